//! `scan-product` as its users meet it: the built binary, its files, its words and its exit status.
//!
//! The binary is the one that `cargo build --release --bins` (or without `--release`, as the tests were built) left beside these
//! tests; build it first, cargo does not do so for the tests of another package. After a wanted change of a help text or an error,
//! `INSTA_UPDATE=always cargo test --release -p tests cli::` writes the new snapshots.

mod alone;
mod bad_board;
mod bad_input;
mod bad_scans;
mod calibrate;
mod devices;
mod disk;
mod doctor;
mod imports;
mod interrupt;
mod method_source;
mod mutations;
mod poses;
mod repeatable;
mod report;
mod secrets;
mod sensors;
pub(crate) mod support;
mod usage;
