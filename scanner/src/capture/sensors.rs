//! Which sensors there are, and opening them: the simulated one is always there.

use kinect::source::{Ability, Source, SourceError};
use reconstruct::board::KnownBoard;

use super::replay::{Replay, is_replay};
use super::simulated::{Simulated, is_simulated};
use super::state::{LibraryEntry, SensorEntry};

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
}

/// The sensors of this computer.
#[derive(Debug)]
pub struct ThisComputer;

impl Opener for ThisComputer {
    fn look(&self) -> Found {
        Found { sensors: vec![simulated("simulated")], libraries: Vec::new() }
    }

    fn open(&self, address: &str, board: Option<&KnownBoard>) -> Result<Box<dyn Source>, SourceError> {
        if is_simulated(address) {
            return Ok(Box::new(Simulated::open(address, board)?));
        }
        if is_replay(address) {
            return Ok(Box::new(Replay::open(address)?));
        }
        kinect::open(address)
    }
}

fn simulated(address: &str) -> SensorEntry {
    SensorEntry {
        address: address.to_owned(),
        backend: "simulated".to_owned(),
        model: "Simulated Kinect".to_owned(),
        serial: String::new(),
        usable: true,
        problem: None,
        advice: None,
        abilities: vec![Ability::Station],
    }
}
