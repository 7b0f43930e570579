//! Whether the libraries are there: asked of a process of its own, for opening one runs its code.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::Library;
#[cfg(feature = "openni2")]
use crate::advice;
use crate::child::{self, Launch};
use crate::wire::{Failure, Message};
use crate::worker::{Driver, DriverError, Link, Request};

/// How long a library may take to open and say its version.
const PATIENCE: Duration = Duration::from_secs(5);

/// A library's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Name {
    /// libfreenect.
    Freenect,
    /// OpenNI2.
    OpenNi2,
}

/// What a library says of itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LibraryFacts {
    /// The file it came from.
    pub path: Option<String>,
    /// Its version, as far as it says.
    pub version: Option<String>,
    /// The sensors it knows of, where it says without opening them.
    pub sensors: Vec<Listed>,
}

/// A sensor that a library knows of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listed {
    /// What opens it, in the library's words: `1d27/0601@2/5` is a model, a bus and a number on it.
    pub uri: String,
    /// Who made it.
    pub vendor: String,
    /// What it is called.
    pub name: String,
    /// Who made it and what it is, as numbers on the USB.
    pub usb: (u16, u16),
}

/// Asks for both libraries, and for the sensors they know of.
pub(super) fn look() -> (Vec<Library>, Vec<Listed>) {
    let (libraries, listed): (Vec<_>, Vec<_>) =
        [Name::Freenect, Name::OpenNi2].map(look_for).into_iter().unzip();
    (libraries, listed.concat())
}

fn look_for(name: Name) -> (Library, Vec<Listed>) {
    let (words, serves) = match name {
        Name::Freenect => ("libfreenect", "Kinect for Xbox 360, Kinect for Windows"),
        Name::OpenNi2 => ("OpenNI2", "Asus Xtion, PrimeSense, .oni files"),
    };
    let missing = |advice| {
        (Library { name: words, serves, path: None, version: None, advice: Some(advice) }, Vec::new())
    };
    let launch = match Launch::new(driver_name(name), "") {
        Ok(launch) => launch,
        Err(error) => return missing(format!("this program cannot start itself: {error}")),
    };
    match child::ask(&launch, PATIENCE) {
        Ok(Message::Found(LibraryFacts { path, version, sensors })) => {
            (Library { name: words, serves, path, version, advice: None }, sensors)
        }
        Ok(Message::Failed(Failure::LibraryMissing(advice))) => missing(advice),
        Ok(Message::Failed(Failure::Other(why) | Failure::Refused(why) | Failure::NotFound(why))) => {
            missing(format!("it is there but does not work: {why}"))
        }
        Ok(_) => missing("it is there but does not work".into()),
        Err(why) => missing(format!("it is there but does not work: {why}")),
    }
}

fn driver_name(name: Name) -> &'static str {
    match name {
        Name::Freenect => "look-for-freenect",
        Name::OpenNi2 => "look-for-openni2",
    }
}

/// The driver that only opens a library and says what it is.
pub(crate) fn driver_of(name: &str) -> Option<Driver> {
    match name {
        "look-for-freenect" => Some(freenect),
        "look-for-openni2" => Some(openni2),
        _ => None,
    }
}

#[cfg(feature = "freenect")]
fn freenect(_request: &Request, link: &mut Link) -> Result<(), DriverError> {
    let library = crate::sys::freenect::Library::open();
    let _open = library.map_err(|advice| DriverError::Failed(Failure::LibraryMissing(advice)))?;
    let path = loaded_as("freenect.so").or_else(|| loaded_as("libfakenect.so"));
    // The library does not say its version, but its file's name does.
    let version = path.as_deref().and_then(version_in);
    say(link, path, version, Vec::new())
}

#[cfg(not(feature = "freenect"))]
fn freenect(_request: &Request, _link: &mut Link) -> Result<(), DriverError> {
    Err(DriverError::Failed(Failure::LibraryMissing("this program was built without it".into())))
}

#[cfg(feature = "openni2")]
fn openni2(_request: &Request, link: &mut Link) -> Result<(), DriverError> {
    let found = crate::openni2::look().map_err(|failure| match failure {
        Failure::LibraryMissing(_) => Failure::LibraryMissing(advice::INSTALL_OPENNI2.into()),
        other => other,
    });
    let (version, sensors) = found.map_err(DriverError::Failed)?;
    say(link, loaded_as("OpenNI2.so"), Some(version), sensors)
}

#[cfg(not(feature = "openni2"))]
fn openni2(_request: &Request, _link: &mut Link) -> Result<(), DriverError> {
    Err(DriverError::Failed(Failure::LibraryMissing("this program was built without it".into())))
}

#[cfg(any(feature = "freenect", feature = "openni2"))]
fn say(
    link: &mut Link,
    path: Option<String>,
    version: Option<String>,
    sensors: Vec<Listed>,
) -> Result<(), DriverError> {
    link.send(&Message::Found(LibraryFacts { path, version, sensors }))
}

/// The file of a library that is open in this process.
#[cfg(any(feature = "freenect", feature = "openni2"))]
fn loaded_as(part: &str) -> Option<String> {
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    let mut paths = maps.lines().filter_map(|line| line.split_once('/').map(|(_, path)| format!("/{path}")));
    paths.find(|path| path.contains(part))
}

/// `libfreenect.so.0.5.3` is version 0.5.3.
#[cfg(feature = "freenect")]
fn version_in(path: &str) -> Option<String> {
    let version = path.rsplit_once(".so.")?.1;
    let is_number =
        version.split('.').all(|part| !part.is_empty() && part.chars().all(|c| c.is_ascii_digit()));
    is_number.then(|| version.to_owned())
}

#[cfg(all(test, feature = "freenect"))]
mod tests {
    use super::*;

    #[test]
    fn versions_by_name() {
        assert_eq!(version_in("/usr/lib/libfreenect.so.0.5.3").as_deref(), Some("0.5.3"));
        assert_eq!(version_in("/usr/lib/libfreenect.so"), None);
        assert_eq!(version_in("/usr/lib/libfreenect.so.old"), None);
    }
}
