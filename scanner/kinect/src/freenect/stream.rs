//! The driver's loop: images out, orders in, until the end.

use std::rc::Rc;
use std::time::{Duration, Instant};

use reconstruct::image::{ColorImage, DepthImage};

use super::depth::{HEIGHT, Mapping, WIDTH};
use super::handle::{Context, Sensor, Unavailable};
use super::inbox::{self, Arrived, Stream};
use super::mode::Format;
use crate::clock::Clock;
use crate::source::{Ability, Control, SensorInfo};
use crate::wire::{Message, Stamped};
use crate::worker::{DriverError, Link};

/// The counter that both streams share, ticks a second.
const TICKS: u32 = 60_000_000;
/// How long the library may work before orders are looked at.
const TURN: Duration = Duration::from_millis(20);
/// Pictures after which the sensor has found exposure and white balance: a second and a half.
const WARM_UP: u32 = 45;
/// Between two looks at the accelerometer, which hold everything else up.
const GRAVITY: Duration = Duration::from_millis(600);
/// How far the head tilts, radians.
const MOST_TILT: f64 = 0.54;
/// How long a still may take.
const STILL: Duration = Duration::from_secs(4);
/// Pictures to let pass after the change of format: the first is often broken.
const STILL_SETTLES: u32 = 2;

/// An open sensor while it streams.
pub(super) struct Streams {
    context: Rc<Context>,
    sensor: Sensor,
    mapping: Mapping,
    info: SensorInfo,
    clock: Clock,
    pictures: u32,
    exposure: Exposure,
    gravity: Instant,
}

/// Who decides on exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Exposure {
    /// Free until the sensor is warm.
    WarmingUp,
    /// As it was asked for, or as it was held at last.
    Set { locked: bool },
}

/// Whether there is more to come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turn {
    More,
    Over,
}

impl Streams {
    pub(super) fn new(context: Rc<Context>, sensor: Sensor, mapping: Mapping, info: SensorInfo) -> Self {
        let exposure = if info.abilities.contains(&Ability::ExposureLock) {
            Exposure::WarmingUp
        } else {
            Exposure::Set { locked: false }
        };
        let clock = Clock::new(TICKS);
        Self { context, sensor, mapping, info, clock, pictures: 0, exposure, gravity: Instant::now() }
    }

    /// Streams until the end; the sensor is stopped and closed when this returns, however it does.
    pub(super) fn run(mut self, link: &mut Link) -> Result<(), DriverError> {
        self.sensor.start(Format::Raw)?;
        self.sensor.start(Format::Color)?;
        while self.turn(link)? == Turn::More {
            if let Some(control) = link.order()
                && self.obey(control, link)? == Turn::Over
            {
                break;
            }
            self.hold_exposure_when_warm();
            self.feel_gravity(link)?;
        }
        let end = if self.context.is_replay() { Message::Ended } else { Message::Unplugged };
        link.send(&end)
    }

    /// Lets the library work once and passes on what came.
    fn turn(&mut self, link: &mut Link) -> Result<Turn, DriverError> {
        let more = self.context.process(TURN);
        for image in inbox::take_images() {
            self.pass_on(&image, link)?;
        }
        link.alive()?;
        Ok(if more { Turn::More } else { Turn::Over })
    }

    fn pass_on(&mut self, image: &Arrived, link: &mut Link) -> Result<(), DriverError> {
        let timestamp_nanos = self.clock.nanos(image.ticks);
        let lost_packets = image.lost_packets;
        let message = match image.stream {
            Stream::Depth => {
                let raw: Vec<u16> =
                    image.bytes.as_chunks().0.iter().map(|&pair| u16::from_le_bytes(pair)).collect();
                let data = self.mapping.registered(&raw);
                let image = DepthImage {
                    width: WIDTH,
                    height: HEIGHT,
                    data,
                    units_per_metre: self.info.units_per_metre,
                };
                Message::Depth(Stamped { image, timestamp_nanos, lost_packets })
            }
            Stream::Video => {
                self.pictures = self.pictures.saturating_add(1);
                let image = picture(&image.bytes, WIDTH, HEIGHT);
                Message::Color(Stamped { image, timestamp_nanos, lost_packets })
            }
        };
        link.send(&message)
    }

    fn obey(&mut self, control: Control, link: &mut Link) -> Result<Turn, DriverError> {
        let outcome = match control {
            Control::Tilt(angle) if angle.is_finite() => {
                self.sensor.tilt(angle.clamp(-MOST_TILT, MOST_TILT).to_degrees())
            }
            Control::Led(led) => self.sensor.led(led),
            Control::LockExposure(locked) => {
                self.exposure = Exposure::Set { locked };
                self.sensor.lock_exposure(locked)
            }
            Control::Still => {
                // It takes longer than an answer may: the picture itself comes as an event.
                link.answer(Ok(()))?;
                return self.take_still(link);
            }
            Control::Tilt(_) | Control::Station(_) => Err(Unavailable("what was asked")),
        };
        link.answer(outcome.map_err(|error| error.to_string()))?;
        Ok(Turn::More)
    }

    fn hold_exposure_when_warm(&mut self) {
        if self.exposure == Exposure::WarmingUp && self.pictures >= WARM_UP {
            // A sensor that does not do it goes on as it is.
            let locked = self.sensor.lock_exposure(true).is_ok();
            self.exposure = Exposure::Set { locked };
        }
    }

    fn feel_gravity(&mut self, link: &mut Link) -> Result<(), DriverError> {
        if self.gravity.elapsed() < GRAVITY || !self.info.abilities.contains(&Ability::Accelerometer) {
            return Ok(());
        }
        self.gravity = Instant::now();
        match self.sensor.accelerometer() {
            Some(felt) => link.send(&Message::Gravity(gravity_of(felt))),
            None => Ok(()),
        }
    }

    /// Rests both streams, takes one large picture, and goes on as before.
    fn take_still(&mut self, link: &mut Link) -> Result<Turn, DriverError> {
        self.sensor.stop(Stream::Depth);
        self.sensor.start(Format::LargeColor)?;
        self.restore_exposure();
        let until = Instant::now() + STILL;
        let mut passed = 0;
        let mut still = None;
        while still.is_none() && Instant::now() < until {
            if !self.context.process(TURN) {
                return Ok(Turn::Over);
            }
            let large = |image: &Arrived| image.bytes.len() == Format::LargeColor.bytes();
            for image in inbox::take_images().into_iter().filter(large) {
                passed += 1;
                if passed > STILL_SETTLES && image.lost_packets == 0 {
                    still = Some(picture(&image.bytes, 1280, 1024));
                }
            }
            link.alive()?;
        }
        if let Some(still) = still {
            link.send(&Message::Still(still))?;
        }
        self.sensor.start(Format::Color)?;
        self.sensor.start(Format::Raw)?;
        self.restore_exposure();
        Ok(Turn::More)
    }

    /// A new start of the colour stream may let exposure go.
    fn restore_exposure(&mut self) {
        if let Exposure::Set { locked: true } = self.exposure {
            // As at warming up: a sensor that does not do it goes on.
            let _ = self.sensor.lock_exposure(true);
        }
    }
}

fn picture(bytes: &[u8], width: usize, height: usize) -> ColorImage {
    ColorImage { width, height, data: bytes.as_chunks().0.to_vec() }
}

/// Gravity in the colour camera's frame (x right, y down, z forward) from what the accelerometer feels when it rests: the
/// push of the table, in its own axes of left, up and forward.
fn gravity_of([left, up, forward]: [f64; 3]) -> [f64; 3] {
    [left, up, -forward]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_points_down() {
        // Level: the table pushes up, and gravity is along +y of the camera.
        assert_eq!(gravity_of([0.0, 9.81, 0.0]), [0.0, 9.81, -0.0]);
        // Looking down by 90 degrees: up is behind, so it is pushed backwards, and gravity is along +z.
        assert_eq!(gravity_of([0.0, 0.0, -9.81]), [0.0, 0.0, 9.81]);
    }
}
