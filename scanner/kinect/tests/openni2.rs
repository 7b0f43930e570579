//! The real OpenNI2 in a driver's process: recordings that these tests write, and a driver of their own that plays a
//! sensor which is plugged in and unplugged.
#![cfg(all(feature = "openni2", target_os = "linux"))]
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

#[path = "openni2/broken.rs"]
mod broken;
#[path = "openni2/files.rs"]
mod files;
#[path = "openni2/live.rs"]
mod live;
#[path = "openni2/support.rs"]
mod support;
