//! A driver for OpenNI2 that plays a Kinect which is plugged in, sends pictures, and is unplugged: for tests of live
//! sensors without one.
//!
//! OpenNI2 opens every `lib*.so.0` in the folder `OpenNI2/Drivers` beside its core library, and needs all the functions
//! of `driver.rs`. The environment says how the sensor behaves:
//!
//! | variable | meaning |
//! |---|---|
//! | `MOCK_KINECT_PRESENT` | a path: the sensor is plugged in as long as something is there (always, where not set) |
//! | `MOCK_KINECT_PERIOD_MICROS` | time between frames, 33333 by itself |
//! | `MOCK_KINECT_PICTURES` | a file of depth and colour images in turn, raw, to be played round and round |
//! | `MOCK_KINECT_SECOND` | set: there are two of them |
//! | `MOCK_KINECT_NO_FRAMES` | set: the streams start, but nothing comes |
//!
//! It begins mirrored, unregistered and with automatic exposure, as real ones do, and its pictures show these states.

mod c_types;
mod driver;
pub mod picture;
mod stream;

/// The address that opens it.
pub const URI: &str = "mock://kinect0";
/// The address that opens the second one.
pub const SECOND_URI: &str = "mock://kinect1";
/// Serial numbers of both.
pub const SERIALS: [&str; 2] = ["MOCK0001", "MOCK0002"];
