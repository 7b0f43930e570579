//! The real libfreenect on a simulated USB bus, and its replay library on dumps.
//!
//! Needs Debian's `libfreenect0.5`: passes with a message where it is missing, fails where `SCAN_REQUIRE_DRIVERS=1`.
#![allow(clippy::unwrap_used)]
#![cfg(feature = "freenect")]

#[path = "freenect/bus.rs"]
mod bus;
#[path = "freenect/ends.rs"]
mod ends;
#[path = "freenect/formats.rs"]
mod formats;
#[path = "freenect/orders.rs"]
mod orders;
#[path = "freenect/replay.rs"]
mod replay;
