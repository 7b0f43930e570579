//! Cross-crate and black-box tests: one binary, one module a subject.
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

mod capture;
mod cli;
mod files;
mod markers;
mod registration;
mod simulate;
mod story;
