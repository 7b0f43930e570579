//! OpenNI's recordings, `.oni` files, played by the real OpenNI2: every pair of frames, without loss, as one moving stream.
//!
//! Pictures that the file says are mirrored come out turned. The file has the cameras' fields of view; depth is taken to
//! be registered to colour, unless the command line says where the depth camera is.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use kinect::source::SourceError;
use reconstruct::camera::Intrinsics;
use reconstruct::recording::{Device, Rig};

use super::{ImportError, Options, Pinhole, Written};
use crate::record::{self, Plan};
use crate::recording::{check_camera, check_units};

/// Whether a file is one, by its ending or its first bytes.
pub fn is_one(path: &Path) -> bool {
    let begins = || -> std::io::Result<bool> {
        let mut magic = [0; 4];
        std::io::Read::read_exact(&mut std::fs::File::open(path)?, &mut magic)?;
        Ok(&magic == b"NI10")
    };
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("oni")) || begins().unwrap_or(false)
}

/// Plays the file into a recording; `step` is called after every frame.
///
/// # Errors
/// Where OpenNI2 is not installed or cannot play the file; nothing is left then.
pub fn import(path: &Path, options: &Options, out: &Path, step: impl Fn()) -> Result<Written, ImportError> {
    let text = path.to_str().ok_or_else(|| ImportError::NotAFile(path.to_owned()))?;
    let failed = |error: SourceError| ImportError::Sensor { path: path.to_owned(), source: error };
    let mut source = kinect::open(&format!("openni2:{text}")).map_err(failed)?;
    let mut plan = Plan::of(source.as_ref(), out);
    plan.device = Device { backend: "import".to_owned(), serial: plan.device.serial.clone() };
    plan.rig = rig(options, &plan.rig)?;
    plan.units_per_metre = options.units_per_metre.unwrap_or(plan.units_per_metre);
    check_units(plan.units_per_metre)?;
    plan.every = options.every.max(1);
    (plan.may_drop, plan.keeps_part, plan.is_mirrored) = (false, false, options.mirrored);
    let recorded = record::record(source.as_mut(), &plan, &AtomicBool::new(false), |_| step())
        .map_err(|source| ImportError::Record { path: path.to_owned(), source: Box::new(source) })?;
    Ok(Written { frames: recorded.frames, poses: 0 })
}

/// The cameras by command line, else by the file. A colour camera that is given is depth's too, as long as depth counts
/// as registered.
fn rig(options: &Options, known: &Rig) -> Result<Rig, ImportError> {
    let is_registered = options.depth_camera.is_none() && options.color_from_depth.is_none();
    let same_size = (known.color.width, known.color.height) == (known.depth.width, known.depth.height);
    let color = given(known.color, options.color_camera, options.color_distortion);
    let depth = if is_registered && same_size && options.depth_distortion.is_none() {
        color
    } else {
        given(known.depth, options.depth_camera, options.depth_distortion)
    };
    check_camera("color", &color)?;
    check_camera("depth", &depth)?;
    Ok(Rig { color, depth, color_from_depth: options.color_from_depth.unwrap_or(known.color_from_depth) })
}

fn given(known: Intrinsics, camera: Option<Pinhole>, distortion: Option<[f64; 5]>) -> Intrinsics {
    let [fx, fy, cx, cy] = camera.unwrap_or([known.fx, known.fy, known.cx, known.cy]);
    Intrinsics { fx, fy, cx, cy, distortion: distortion.unwrap_or(known.distortion), ..known }
}
