//! One module a command: its arguments, and `run`, which returns the exit status.

pub mod board;
pub mod build;
pub mod completions;
pub mod demo;
pub mod import;
pub mod simulate;
pub mod upload;
