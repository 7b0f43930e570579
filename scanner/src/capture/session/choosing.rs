//! Choosing the sensor: one that cannot be used leaves the present one at work.

use std::sync::Arc;

use kinect::source::{SensorInfo, Source, SourceError};
use reconstruct::board::KnownBoard;
use reconstruct::recording::Device;

use super::{Done, Session, lock};
use crate::capture::camera::{Camera, Health};
use crate::capture::state::{OpenSensor, Step};

impl Session {
    /// Opens and starts a sensor. Where it cannot be used, the present one stays.
    pub fn choose_sensor(self: &Arc<Self>, address: &str) -> Done {
        let board = {
            let inner = self.lock();
            inner.check_rests()?;
            inner.board.as_ref().map(|board| board.known.clone())
        };
        self.open(address, board.as_ref())?;
        self.change(|inner| {
            inner.error = None;
            inner.step = if inner.board.is_some() { Step::Views } else { Step::Board };
        });
        Ok(())
    }

    /// Puts the sensor of an address in the place of the present one, which may be the same.
    pub(super) fn open(self: &Arc<Self>, address: &str, board: Option<&KnownBoard>) -> Done {
        let present = self.lock().sensor.as_ref().map(|sensor| sensor.address.clone());
        let is_another = present.is_some_and(|present| present != address);
        if !is_another {
            // Nobody can open a sensor twice.
            self.put_away();
        }
        let opened = self.opener.open(address, board).and_then(|source| self.fitting(source));
        let opened = match opened {
            Err(error) if is_another => return Err(error.into()),
            opened => opened,
        };
        let number = self.put_away();
        let started = opened.and_then(|source| self.started(source, number));
        self.change(|inner| match started {
            Ok(camera) => {
                let info = camera.info();
                let device = Device { backend: info.backend.clone(), serial: info.serial.clone() };
                let kept = self.opener.calibration(&device, &info.rig);
                inner.depth_prior = kept.map(|calibration| calibration.prior());
                inner.sensor = Some(OpenSensor {
                    address: info.address.clone(),
                    model: info.model.clone(),
                    serial: info.serial.clone(),
                    calibrated: inner.depth_prior.is_some(),
                    running: true,
                    trouble: None,
                    station: camera.station(),
                });
                (inner.camera, inner.no_stills) = (Some(camera), false);
                Ok(())
            }
            Err(error) => {
                (inner.sensor, inner.depth_prior) = (None, None);
                inner.step = Step::Sensor;
                Err(error.into())
            }
        })
    }

    /// Stops the present sensor; the number of the one that comes after it.
    fn put_away(&self) -> u64 {
        let (camera, number) = self.change(|inner| {
            inner.camera_number += 1;
            inner.lamp.forget();
            (inner.camera.take(), inner.camera_number)
        });
        // It stops here, and its thread reports while it does.
        drop(camera);
        number
    }

    fn started(self: &Arc<Self>, source: Box<dyn Source>, number: u64) -> Result<Camera, SourceError> {
        let session = Arc::downgrade(self);
        Camera::start(source, Arc::clone(&self.frames), move |health| {
            if let Some(session) = session.upgrade() {
                session.heard_of_sensor(number, &health);
            }
        })
    }

    /// Views of two different sensors do not go into one recording.
    fn fitting(&self, source: Box<dyn Source>) -> Result<Box<dyn Source>, SourceError> {
        if self.fits(source.sensor()) {
            return Ok(source);
        }
        let text = "the views so far were taken with another sensor; begin a new product with this one";
        Err(SourceError::Refused(text.to_owned()))
    }

    fn fits(&self, sensor: &SensorInfo) -> bool {
        let journal = self.lock().journal.clone();
        journal.is_none_or(|journal| lock(&journal).fits(sensor))
    }

    fn heard_of_sensor(&self, number: u64, health: &Health) {
        self.change(|inner| {
            if inner.camera_number == number
                && let Some(sensor) = inner.sensor.as_mut()
            {
                (sensor.running, sensor.trouble) = (health.running, health.trouble.clone());
                sensor.station = health.station;
            }
        });
    }
}
