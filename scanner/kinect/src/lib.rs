//! Depth cameras: frames and events of real sensors, whatever their C libraries do.
//!
//! [`source`] has what every sensor offers, real, replayed or simulated: the [`source::Source`] trait. The C libraries run
//! in processes of their own: [`child`] is the program's side of one, [`worker`] the driver's, [`wire`] what they say to
//! each other. [`probe`] says what is plugged in, and what stands in its way.
//!
//! | what | convention |
//! |---|---|
//! | depth | as delivered, in `rig.depth`'s geometry; 0 = nothing measured |
//! | times | nanoseconds on one clock for colour and depth |
//! | gravity | colour camera's frame (x right, y down, z forward), metres per square second |

pub mod advice;
pub mod child;
pub mod clock;
#[cfg(feature = "freenect")]
pub mod freenect;
#[cfg(feature = "openni2")]
pub mod openni2;
pub mod pair;
pub mod probe;
pub mod source;
mod sys;
pub mod usb;
pub mod wire;
pub mod worker;

use std::path::Path;

use child::{ChildSource, Launch, Overflow};
use source::{Source, SourceError};

/// Backends that run in a driver's process.
const DRIVERS: [&str; 2] = ["freenect", "openni2"];

/// Opens a sensor by its address: `freenect`, `freenect:SERIAL`, `openni2`, `openni2:URI`, `openni2:/path/file.oni`.
///
/// # Errors
/// Why it cannot be had, with what to do about it.
pub fn open(address: &str) -> Result<Box<dyn Source>, SourceError> {
    let (driver, target) = address.split_once(':').unwrap_or((address, ""));
    if !DRIVERS.contains(&driver) {
        let words = format!(
            "{address:?} is no address of a sensor: write freenect or freenect:SERIAL, openni2 or openni2:FILE"
        );
        return Err(SourceError::NotFound(words));
    }
    let mut launch = Launch::new(driver, target).map_err(|error| SourceError::Driver(error.to_string()))?;
    if driver == "openni2" && is_recording(target) {
        // Every frame of it is wanted, however long that takes.
        launch.overflow = Overflow::Wait;
    }
    Ok(Box::new(ChildSource::open(launch)?))
}

/// Whether a target of OpenNI2 means a recording; addresses of sensors are no paths that exist.
pub fn is_recording(target: &str) -> bool {
    let has_ending = Path::new(target).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("oni"));
    has_ending || Path::new(target).is_file()
}
