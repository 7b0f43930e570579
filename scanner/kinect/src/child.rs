//! The program's side of a driver that runs in a process of its own.
//!
//! C libraries for depth cameras abort, exit, crash and hang in ordinary situations, and print wherever they like. Each
//! therefore runs in a child process of the same program ([`crate::worker`]), and [`ChildSource`] makes events of
//! whatever becomes of it. Starting again starts a new process.

mod ask;
mod digest;
mod launch;
mod queue;
mod reader;
mod running;

use std::time::Duration;

pub use ask::ask;
pub use digest::{Digest, digest};
pub use launch::{Launch, Overflow, Patience, SUBCOMMAND};
use running::Running;

use crate::source::{Ability, Control, Event, SensorInfo, Source, SourceError};

/// A sensor whose driver runs in a process of its own.
#[derive(Debug)]
pub struct ChildSource {
    launch: Launch,
    sensor: SensorInfo,
    /// The driver: open from [`Self::open`] on, gone after [`Source::stop`].
    running: Option<Running>,
}

impl ChildSource {
    /// Starts the driver and waits until it has opened the sensor.
    ///
    /// # Errors
    /// Why the sensor cannot be had, with what to do about it.
    pub fn open(launch: Launch) -> Result<Self, SourceError> {
        let (running, sensor) = Running::start(&launch)?;
        let launch = again(launch, &sensor);
        Ok(Self { launch, sensor, running: Some(running) })
    }
}

/// What finds the same sensor again after it was unplugged: an address of OpenNI2's is a place on the bus, which changes.
fn again(mut launch: Launch, sensor: &SensorInfo) -> Launch {
    let names_one =
        launch.driver == "openni2" && !launch.target.is_empty() && !crate::is_recording(&launch.target);
    if names_one && sensor.serial.chars().any(|c| c != '0') && !sensor.serial.contains(['/', '@', ':']) {
        launch.target.clone_from(&sensor.serial);
    }
    launch
}

impl Source for ChildSource {
    fn sensor(&self) -> &SensorInfo {
        &self.sensor
    }

    fn start(&mut self) -> Result<(), SourceError> {
        // The driver that opened the sensor waits for this; one that streamed already ends first.
        if let Some(running) = self.running.as_mut().filter(|running| !running.has_streamed())
            && running.stream().is_ok()
        {
            return Ok(());
        }
        self.stop();
        let (mut running, sensor) = Running::start(&self.launch)?;
        running.stream()?;
        (self.running, self.sensor) = (Some(running), sensor);
        Ok(())
    }

    fn next_event(&mut self, patience: Duration) -> Event {
        if let Some(running) = &self.running {
            return running.next_event(patience);
        }
        // Who asks in a loop must not turn it as fast as it goes.
        std::thread::sleep(patience.min(Duration::from_millis(100)));
        Event::Nothing
    }

    fn control(&mut self, control: Control) -> Result<(), SourceError> {
        let (ability, refusal) = match control {
            Control::Tilt(_) => (Ability::Tilt, "it has no motor"),
            Control::Led(_) => (Ability::Led, "it has no lamp"),
            Control::LockExposure(_) => (Ability::ExposureLock, "its exposure cannot be held"),
            Control::Station(_) => (Ability::Station, "it stands where it stands"),
            Control::Still => (Ability::Stills, "it takes no sharper pictures"),
        };
        if !self.sensor.abilities.contains(&ability) {
            return Err(SourceError::Unable(refusal));
        }
        match &mut self.running {
            Some(running) => running.control(control),
            None => Err(SourceError::Refused("it has not been started".into())),
        }
    }

    fn stop(&mut self) {
        // Its end waits for the driver's.
        self.running = None;
    }
}
