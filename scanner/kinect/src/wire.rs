//! What a driver's process and the program say to each other.
//!
//! From the driver come messages: a head of kind (one byte) and length (four bytes, little-endian), then the body. Images
//! are raw pixels behind a short head of their own, everything else is JSON. To the driver go orders, one JSON object a
//! line. The driver's process may be in any state of disarray, so every length is checked before memory is taken.

mod image;

use std::io::{self, Read, Write};

use reconstruct::camera::Intrinsics;
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::pose;
use reconstruct::recording::Rig;
use serde::{Deserialize, Serialize};

use crate::probe::LibraryFacts;
use crate::source::{Ability, Control, SensorInfo};

/// Longest body that is not an image, bytes.
const MOST_WORDS: u32 = 64 * 1024;
/// Most pixels a side of an image.
const MOST_PIXELS: u32 = 4096;
/// Longest body of an image, bytes: colour of the largest sensor (1280 x 1024) and much more.
const MOST_IMAGE: u32 = 32 * 1024 * 1024;

/// What a driver says.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// The sensor is open and waits for [`Order::Start`].
    Opened(Box<SensorInfo>),
    /// A colour picture.
    Color(Stamped<ColorImage>),
    /// A depth image in the geometry of `rig.depth`.
    Depth(Stamped<DepthImage>),
    /// A sharper colour picture, as ordered by [`Control::Still`].
    Still(ColorImage),
    /// Gravity in the colour camera's frame, metres per square second.
    Gravity([f64; 3]),
    /// How a [`Control`] went: nothing, or why it did not.
    Answer(Option<String>),
    /// A library that was asked for is there; the process ends.
    Found(LibraryFacts),
    /// The driver is at work, though it has nothing to deliver.
    Alive,
    /// The sensor is gone; the driver ends.
    Unplugged,
    /// A recording is at its end; the driver ends.
    Ended,
    /// The driver ends for this reason.
    Failed(Failure),
}

/// An image with its time.
#[derive(Debug, Clone, PartialEq)]
pub struct Stamped<I> {
    /// The pixels.
    pub image: I,
    /// When it was taken, nanoseconds on the clock that both streams share.
    pub timestamp_nanos: u64,
    /// Packets lost in it.
    pub lost_packets: u32,
}

/// Why a driver gives up; [`crate::source::SourceError`] has the words for people.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", content = "text")]
pub enum Failure {
    /// The C library is not on this computer; how to get it.
    LibraryMissing(String),
    /// No such sensor.
    NotFound(String),
    /// It is there, but may not be used.
    Refused(String),
    /// Anything else.
    Other(String),
}

/// What a driver is told.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Begin to stream.
    Start,
    /// Do this and answer.
    Control(Control),
}

/// Messages without pixels, as JSON.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Words {
    Opened(Box<Opened>),
    Gravity([f64; 3]),
    Answer(Option<String>),
    Found(LibraryFacts),
    Alive,
    Unplugged,
    Ended,
    Failed(Failure),
}

/// [`SensorInfo`] as it is written down.
#[derive(Debug, Serialize, Deserialize)]
struct Opened {
    backend: String,
    address: String,
    model: String,
    serial: String,
    color: Intrinsics,
    depth: Intrinsics,
    color_from_depth: [f64; 16],
    units_per_metre: f64,
    abilities: Vec<Ability>,
}

/// What a message's first byte says.
mod kind {
    pub(super) const WORDS: u8 = 1;
    pub(super) const COLOR: u8 = 2;
    pub(super) const DEPTH: u8 = 3;
    pub(super) const STILL: u8 = 4;
}

/// Writes a message.
///
/// # Errors
/// Where the other side is gone, or the message is longer than any reader takes.
pub fn write(out: &mut impl Write, message: &Message) -> io::Result<()> {
    let words = match message {
        Message::Color(color) => return image::write_color(out, kind::COLOR, color),
        Message::Depth(depth) => return image::write_depth(out, kind::DEPTH, depth),
        Message::Still(still) => return image::write_still(out, kind::STILL, still),
        Message::Opened(info) => Words::Opened(Box::new(Opened::of(info))),
        Message::Gravity(gravity) => Words::Gravity(*gravity),
        Message::Answer(refusal) => Words::Answer(refusal.clone()),
        Message::Found(facts) => Words::Found(facts.clone()),
        Message::Alive => Words::Alive,
        Message::Unplugged => Words::Unplugged,
        Message::Ended => Words::Ended,
        Message::Failed(failure) => Words::Failed(failure.clone()),
    };
    let body = serde_json::to_vec(&words).map_err(io::Error::other)?;
    write_head(out, kind::WORDS, body.len(), MOST_WORDS)?;
    out.write_all(&body)
}

fn write_head(out: &mut impl Write, kind: u8, length: usize, most: u32) -> io::Result<()> {
    let length = u32::try_from(length).ok().filter(|length| *length <= most);
    let Some(length) = length else { return Err(nonsense("a message is too long")) };
    let [a, b, c, d] = length.to_le_bytes();
    out.write_all(&[kind, a, b, c, d])
}

/// Reads the next message; `None` where the driver closed its end between two messages.
///
/// # Errors
/// `InvalidData` for what no driver says, `UnexpectedEof` where it ended within a message, and what `input` fails with.
pub fn read(input: &mut impl Read) -> io::Result<Option<Message>> {
    let mut first = [0u8; 1];
    if input.read(&mut first)? == 0 {
        return Ok(None);
    }
    let mut length = [0u8; 4];
    input.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length);
    match first[0] {
        kind::WORDS => read_words(input, length).map(Some),
        kind::COLOR => image::read_color(input, length).map(|color| Some(Message::Color(color))),
        kind::DEPTH => image::read_depth(input, length).map(|depth| Some(Message::Depth(depth))),
        kind::STILL => image::read_color(input, length).map(|still| Some(Message::Still(still.image))),
        other => Err(nonsense(format!("a message of unknown kind {other}"))),
    }
}

fn read_words(input: &mut impl Read, length: u32) -> io::Result<Message> {
    if length > MOST_WORDS {
        return Err(nonsense("a message is too long"));
    }
    let mut body = vec![0u8; length as usize];
    input.read_exact(&mut body)?;
    let words: Words = serde_json::from_slice(&body).map_err(nonsense)?;
    Ok(match words {
        Words::Opened(opened) => Message::Opened(Box::new(opened.info()?)),
        Words::Gravity(gravity) => Message::Gravity(gravity),
        Words::Answer(refusal) => Message::Answer(refusal),
        Words::Found(facts) => Message::Found(facts),
        Words::Alive => Message::Alive,
        Words::Unplugged => Message::Unplugged,
        Words::Ended => Message::Ended,
        Words::Failed(failure) => Message::Failed(failure),
    })
}

fn nonsense(what: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}

impl Opened {
    fn of(info: &SensorInfo) -> Self {
        Self {
            backend: info.backend.clone(),
            address: info.address.clone(),
            model: info.model.clone(),
            serial: info.serial.clone(),
            color: info.rig.color,
            depth: info.rig.depth,
            color_from_depth: pose::to_row_major(&info.rig.color_from_depth),
            units_per_metre: info.units_per_metre,
            abilities: info.abilities.clone(),
        }
    }

    fn info(self) -> io::Result<SensorInfo> {
        let color_from_depth = pose::from_row_major(&self.color_from_depth);
        let Some(color_from_depth) = color_from_depth else {
            return Err(nonsense("the cameras stand nowhere"));
        };
        let sane = |camera: &Intrinsics| camera.is_valid() && camera.width.max(camera.height) <= MOST_PIXELS;
        if !sane(&self.color) || !sane(&self.depth) || !(1.0..=1e6).contains(&self.units_per_metre) {
            return Err(nonsense("the cameras cannot be"));
        }
        Ok(SensorInfo {
            backend: self.backend,
            address: self.address,
            model: self.model,
            serial: self.serial,
            rig: Rig { color: self.color, depth: self.depth, color_from_depth },
            units_per_metre: self.units_per_metre,
            abilities: self.abilities,
        })
    }
}

#[cfg(test)]
mod tests;
