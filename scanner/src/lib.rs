//! `scan-product`: recordings in, 3D listings out. `pipeline` is the page to read first.

pub mod board_sheet;
pub mod capture;
pub mod cli;
pub mod commands;
pub mod config;
pub mod doctor;
pub mod import;
pub mod output;
pub mod pictures;
pub mod pipeline;
pub mod record;
pub mod recording;
pub mod report_words;
pub mod result;
pub mod simulate;
pub mod ui;
pub mod unit_calibration;
pub mod upload;
