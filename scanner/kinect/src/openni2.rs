//! OpenNI2: sensors of Asus and PrimeSense (and others its installed drivers know), and its recordings, `.oni` files.
//!
//! [`run`] is the driver's whole life, in a process of its own ([`crate::worker`]). Depth comes in millimetres or tenths
//! of them, whichever the stream has; times are the library's microseconds as nanoseconds; pictures are turned where the
//! stream is mirrored.
//!
//! Cameras are ideal ones by the streams' fields of view. Registered depth lies in the colour camera's geometry, so it
//! gets that one's focal length, whatever the depth stream goes on saying. A file does not tell whether its depth was
//! registered: it is taken to be, as programs that scan record it.
//!
//! Debian's OpenNI2 has no driver for the Xbox Kinect; that one is libfreenect's.

mod device;
mod library;
mod stream;
mod tap;

use std::ffi::CString;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::time::{Duration, Instant};

use reconstruct::camera::Intrinsics;
use reconstruct::pose::Pose;
use reconstruct::recording::Rig;

use crate::probe::Listed;
use crate::source::{Ability, Control, SensorInfo};
use crate::wire::{Failure, Message};
use crate::worker::{DriverError, Link, Request};
use device::Device;
use library::Library;
use stream::Pixels;

/// How long to wait for a frame before looking at what else there is to do.
const GLANCE: Duration = Duration::from_millis(50);
/// A file that gives nothing for so long and is not at its end is broken.
const MOST_SILENCE_OF_A_FILE: Duration = Duration::from_secs(2);
/// Where makers put the depth camera, seen from the colour camera: this far to the left, metres.
const DEPTH_CAMERA_LEFT: f64 = 0.025;
/// The driver that Debian installs beside the others and that plays nothing of use.
const DUMMY: &str = "Dummy";
/// Most sensors that are told of.
const MOST_LISTED: usize = 32;

/// Opens what `request.target` names (a file, an address of the library's, or nothing for the first sensor) and streams.
///
/// # Errors
/// Why it cannot be opened or went wrong, with what to do.
pub fn run(request: &Request, link: &mut Link) -> Result<(), DriverError> {
    let library = Library::open()?;
    let mut device = open(&library, &request.target)?;
    link.opened(sensor(&device, &request.target))?;
    device.start()?;
    let end = stream(&library, &device, link);
    // Before anything else: the player of files runs wild at a file's end.
    device.stop();
    link.send(&end?)
}

/// A library that was found: its version, and the sensors it knows of.
///
/// # Errors
/// Where there is none, with how to get it.
pub fn look() -> Result<(String, Vec<Listed>), Failure> {
    let library = Library::open()?;
    // A library that cannot list its sensors is there all the same.
    let mut listed = sensors(&library).unwrap_or_default();
    listed.truncate(MOST_LISTED);
    Ok((library.version(), listed))
}

fn sensors(library: &Library) -> Result<Vec<Listed>, Failure> {
    let mut listed = library.devices()?;
    listed.retain(|sensor| sensor.uri != DUMMY);
    Ok(listed)
}

/// The sensor that an address means: the one that bears it, or the only one of its model on its bus, for every plugging in
/// gives another number.
fn meant<'a>(listed: &'a [Listed], uri: &str) -> Option<&'a Listed> {
    let place =
        |uri: &str| uri.contains('@').then(|| uri.rsplit_once('/').map(|(bus, _)| bus.to_owned())).flatten();
    let same_place = |sensor: &&Listed| place(uri).is_some() && place(&sensor.uri) == place(uri);
    let mut near = listed.iter().filter(same_place);
    let only = near.next().filter(|_| near.next().is_none());
    listed.iter().find(|sensor| sensor.uri == uri).or(only)
}

/// The sensor with a serial number, which only an open one says.
fn with_serial<'a>(library: &'a Library, listed: &[Listed], serial: &str) -> Option<Device<'a>> {
    if serial.contains(['/', '@', ':']) {
        return None;
    }
    let mut open = listed.iter().filter_map(|sensor| {
        // One that somebody else uses is not the one that is to be opened.
        Device::open(library, &device::c_address(&sensor.uri).ok()?).ok()
    });
    open.find(|device| device.serial == serial)
}

fn open<'a>(library: &'a Library, target: &str) -> Result<Device<'a>, Failure> {
    if crate::is_recording(target) {
        return open_file(library, target);
    }
    let sensors = sensors(library)?;
    let sensor = if target.is_empty() { sensors.first() } else { meant(&sensors, target) };
    match sensor.map(|sensor| sensor.uri.as_str()).or((target == DUMMY).then_some(DUMMY)) {
        Some(uri) => Device::open(library, &device::c_address(uri)?),
        None if !target.is_empty() => with_serial(library, &sensors, target).ok_or_else(|| Failure::NotFound(format!(
            "OpenNI2 knows no {target:?}; {}",
            match sensors.as_slice() {
                [] => "no sensor of its drivers is plugged in".to_owned(),
                some => {
                    let names: Vec<&str> = some.iter().map(|sensor| sensor.uri.as_str()).collect();
                    format!("plugged in: {}", names.join(", "))
                }
            }
        ))),
        None => Err(Failure::NotFound(
            "OpenNI2 sees no sensor (Asus Xtion, PrimeSense); check its USB plug. An Xbox Kinect needs libfreenect \
             instead"
                .to_owned(),
        )),
    }
}

fn open_file<'a>(library: &'a Library, path: &str) -> Result<Device<'a>, Failure> {
    let uri = file_address(path)?;
    Device::open(library, &uri).map_err(|failure| match failure {
        Failure::Other(words) => Failure::Refused(format!(
            "{path} cannot be played ({words}); it may be cut off or lack a depth or a colour stream: copy it again or \
             record again"
        )),
        other => other,
    })
}

/// The file's whole path, after a look at its first bytes.
fn file_address(path: &str) -> Result<CString, Failure> {
    let whole = std::path::absolute(path).unwrap_or_else(|_empty| path.into());
    let uri = device::c_address(&whole.to_string_lossy())?;
    let unreadable =
        |error: std::io::Error| Failure::NotFound(format!("{path} cannot be read: {error}; check the path"));
    let mut magic = [0; 4];
    let read = File::open(&whole).and_then(|file| file.take(4).read(&mut magic)).map_err(unreadable)?;
    if read < 4 || !magic.starts_with(b"NI") {
        return Err(Failure::Refused(format!("{path} is no recording of OpenNI; name a .oni file")));
    }
    Ok(uri)
}

fn sensor(device: &Device, target: &str) -> SensorInfo {
    let listed = &device.listed;
    let target = if device.is_file { target } else { listed.uri.as_str() };
    let model = if device.is_file {
        format!("recording {}", Path::new(target).file_name().unwrap_or_default().to_string_lossy())
    } else {
        format!("{} {}", listed.vendor, listed.name).trim().to_owned()
    };
    let abilities = if device.can_lock_exposure() { vec![Ability::ExposureLock] } else { Vec::new() };
    SensorInfo {
        backend: "openni2".to_owned(),
        address: format!("openni2:{target}"),
        model,
        serial: device.serial.clone(),
        rig: rig(device),
        units_per_metre: device.depth().units_per_metre(),
        abilities,
    }
}

fn rig(device: &Device) -> Rig {
    let (color, depth) = (device.color().camera(), device.depth().camera());
    if device.is_registered || device.is_file {
        Rig { color, depth: registered(&color, &depth), color_from_depth: Pose::identity() }
    } else {
        Rig { color, depth, color_from_depth: Pose::translation(-DEPTH_CAMERA_LEFT, 0.0, 0.0) }
    }
}

/// The colour camera at the depth image's size.
fn registered(color: &Intrinsics, depth: &Intrinsics) -> Intrinsics {
    if (color.width, color.height) == (depth.width, depth.height) {
        return *color;
    }
    let scale = f64::from(depth.width) / f64::from(color.width);
    Intrinsics { fx: color.fx * scale, fy: color.fy * scale, ..*depth }
}

/// Sends frames until the file ends or the sensor goes; which of them is the last message.
fn stream(library: &Library, device: &Device, link: &mut Link) -> Result<Message, DriverError> {
    let mut last = Instant::now();
    loop {
        // Asked first: what was ready before the end is still read after it.
        let (at_end, gone) = (library.is_at_end(), library.is_gone());
        while let Some(control) = link.order() {
            let outcome = obey(device, control);
            link.answer(outcome)?;
        }
        match device.read(GLANCE)? {
            Some(Pixels::Depth(depth)) => link.send(&Message::Depth(depth))?,
            Some(Pixels::Color(color)) => link.send(&Message::Color(color))?,
            None if at_end => return Ok(Message::Ended),
            None if gone => return Ok(Message::Unplugged),
            None if device.is_file && last.elapsed() > MOST_SILENCE_OF_A_FILE => {
                let words = "the file stops in its middle; copy it again or record again";
                return Err(DriverError::Failed(Failure::Refused(words.to_owned())));
            }
            None => {
                link.alive()?;
                continue;
            }
        }
        last = Instant::now();
    }
}

fn obey(device: &Device, control: Control) -> Result<(), String> {
    match control {
        Control::LockExposure(lock) if device.can_lock_exposure() => {
            device.lock_exposure(lock).map_err(|_refused| "it does not hold its exposure".to_owned())
        }
        _ => Err("OpenNI2 offers no such thing for this sensor".to_owned()),
    }
}

impl From<Failure> for DriverError {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_that_was_plugged_in_again_is_found() {
        let sensor = |uri: &str| Listed {
            uri: uri.to_owned(),
            vendor: String::new(),
            name: String::new(),
            usb: (0x1d27, 0x0601),
        };
        let listed = ["1d27/0601@2/5", "1d27/0601@2/6", "1d27/0601@3/9", "mock://kinect0"].map(sensor);
        let meant = |uri: &str| meant(&listed, uri).map(|sensor| sensor.uri.as_str());
        assert_eq!(meant("1d27/0601@2/6"), Some("1d27/0601@2/6"));
        assert_eq!(meant("1d27/0601@3/4"), Some("1d27/0601@3/9"));
        assert_eq!(meant("1d27/0601@2/4"), None, "either of two");
        assert_eq!((meant("mock://kinect1"), meant("1d27/0600@3/9"), meant("")), (None, None, None));
    }
}
