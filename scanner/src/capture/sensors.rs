//! Which sensors there are, and opening them: the simulated one is always there.

use kinect::probe::{self, Library, Sensor};
use kinect::source::{Ability, Source, SourceError};
use reconstruct::board::KnownBoard;
use reconstruct::recording::{Device, Rig};

use super::replay::{Replay, is_replay};
use super::simulated::{Simulated, is_simulated};
use super::state::{LibraryEntry, SensorEntry};
use crate::unit_calibration::{self, UnitCalibration};

/// What was found.
#[derive(Debug, Clone, Default)]
pub struct Found {
    pub sensors: Vec<SensorEntry>,
    pub libraries: Vec<LibraryEntry>,
}

/// Opens sensors; tests have their own.
pub trait Opener: Send + Sync {
    /// Looks for sensors.
    fn look(&self) -> Found;

    /// Opens the sensor of an address. A simulated one sees `board`.
    fn open(&self, address: &str, board: Option<&KnownBoard>) -> Result<Box<dyn Source>, SourceError>;

    /// The calibration kept for a sensor, as builds use it; one that cannot be read is told by the build.
    fn calibration(&self, device: &Device, rig: &Rig) -> Option<UnitCalibration> {
        unit_calibration::of_sensor(device, rig).unwrap_or_default()
    }
}

/// The sensors of this computer.
#[derive(Debug)]
pub struct ThisComputer;

impl Opener for ThisComputer {
    fn look(&self) -> Found {
        let look = probe::look();
        let plugged_in = look.sensors.iter().map(sensor);
        Found {
            sensors: plugged_in.chain([simulated()]).collect(),
            libraries: look.libraries.iter().map(library).collect(),
        }
    }

    fn open(&self, address: &str, board: Option<&KnownBoard>) -> Result<Box<dyn Source>, SourceError> {
        if is_simulated(address) {
            Ok(Box::new(Simulated::open(address, board)?))
        } else if is_replay(address) {
            Ok(Box::new(Replay::open(address)?))
        } else {
            kinect::open(address)
        }
    }
}

/// What is there before anybody has looked.
pub fn always_there() -> Found {
    Found { sensors: vec![simulated()], libraries: Vec::new() }
}

fn sensor(found: &Sensor) -> SensorEntry {
    let other = found.problems.iter().find(|problem| !problem.blocks);
    SensorEntry {
        // What cannot be opened still needs a name of its own.
        address: found.address.clone().unwrap_or_else(|| format!("usb:{}", found.port)),
        backend: found.backend.to_owned(),
        model: found.model.clone(),
        serial: found.serial.clone(),
        usable: found.is_usable(),
        problem: found.obstacle().map(|problem| problem.text.clone()),
        advice: other.map(|problem| problem.text.clone()),
        abilities: found.abilities.clone(),
    }
}

fn library(found: &Library) -> LibraryEntry {
    LibraryEntry {
        name: found.name.to_owned(),
        found: found.path.is_some(),
        path: found.path.clone(),
        version: found.version.clone(),
        advice: found.advice.clone(),
    }
}

fn simulated() -> SensorEntry {
    SensorEntry {
        address: "simulated".to_owned(),
        backend: "simulated".to_owned(),
        model: "Simulated Kinect".to_owned(),
        serial: String::new(),
        usable: true,
        problem: None,
        advice: None,
        abilities: vec![Ability::Station],
    }
}
