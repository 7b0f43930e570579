//! One module a command: its arguments, and `run`, which returns the exit status.

pub mod board;
pub mod build;
pub mod calibrate;
pub mod capture;
pub mod completions;
pub mod demo;
pub mod devices;
pub mod doctor;
pub mod import;
pub mod rebuild;
pub mod record;
pub mod report;
pub mod resume;
pub mod simulate;
pub mod upload;
