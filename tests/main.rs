//! Cross-crate and black-box tests: one binary, one module a subject.

mod files;
mod markers;
mod simulate;
mod story;
