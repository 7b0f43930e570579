//! The Kinect of the first generation through libfreenect: the driver that runs in a process of its own.
//!
//! Frames as delivered: colour of 640 x 480 pixels; depth in millimetres in the colour camera's geometry, worked out from
//! the raw values by the device's own constants ([`depth`]). Times are the sensor's 60 MHz counter, unwrapped. Exposure and
//! white balance are held once the sensor has had time to find them, so that a product has one colour from all sides.
//!
//! With the replay library (`SCAN_FREENECT_LIB` names it, `FAKENECT_PATH` the dump) the same driver plays a dump.

pub mod depth;
mod dump;
pub mod handle;
pub mod inbox;
pub mod mode;
mod open;
mod stream;

use std::rc::Rc;

use reconstruct::camera::Intrinsics;
use reconstruct::pose::Pose;
use reconstruct::recording::Rig;

use crate::sys::freenect::Library;
use crate::wire::Failure;
use crate::worker::{DriverError, Link, Request};
use depth::Constants;
use handle::{Context, Unavailable};
use open::Opened;

/// Drives one sensor until the end is asked for or the sensor is gone.
///
/// # Errors
/// Why it cannot be had, or what went wrong.
pub fn run(request: &Request, link: &mut Link) -> Result<(), DriverError> {
    let context = context()?;
    let Opened { sensor, info, mapping } = open::open(&context, &request.target)?;
    link.opened(info.clone())?;
    stream::Streams::new(Rc::clone(&context), sensor, mapping, info).run(link)
}

/// The library, started; with the replay library only once the dump is known to be whole.
///
/// # Errors
/// Where the library is missing, refuses, or has no dump to play.
pub fn context() -> Result<Rc<Context>, DriverError> {
    let library = Library::open().map_err(|advice| DriverError::Failed(Failure::LibraryMissing(advice)))?;
    if library.is_replay {
        // Before anything is called: the replay library ends the process where something is missing.
        dump::check()?;
    }
    Ok(Context::new(library)?)
}

impl From<Unavailable> for DriverError {
    fn from(error: Unavailable) -> Self {
        Self::other(error.to_string())
    }
}

/// Both images in the colour camera's geometry.
fn rig(constants: &Constants) -> Rig {
    let color = constants.color_camera().unwrap_or_else(usual_camera);
    Rig { color, depth: color, color_from_depth: Pose::identity() }
}

/// The colour camera where nothing is known of it.
fn usual_camera() -> Intrinsics {
    Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5)
}
