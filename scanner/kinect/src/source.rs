//! What every sensor offers, be it real, replayed or simulated: pairs of colour and depth, and events, never a crash.
//!
//! Units: depth as the sensor counts it (`Rig` and `units_per_metre` say what that means), times in nanoseconds since the
//! sensor's own start. Frames: colour camera x right, y down, z forward.

use std::sync::Arc;
use std::time::Duration;

use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::recording::Rig;
use serde::{Deserialize, Serialize};

/// A sensor that delivers frames.
pub trait Source: Send {
    /// What it is; known from the moment it is opened.
    fn sensor(&self) -> &SensorInfo;

    /// Starts the streams. Starting again after an unplugging tries to find the sensor again.
    fn start(&mut self) -> Result<(), SourceError>;

    /// The next thing that happens, or [`Event::Nothing`] after `patience`.
    fn next_event(&mut self, patience: Duration) -> Event;

    /// Asks the sensor for something it can do.
    fn control(&mut self, control: Control) -> Result<(), SourceError>;

    /// Stops the streams and switches the projector off. Stopping twice is no error.
    fn stop(&mut self);

    /// Azimuth around the product, radians, of one that stands where it is told to ([`Control::Station`]).
    fn station(&self) -> Option<f64> {
        None
    }
}

/// What a sensor is.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorInfo {
    /// `freenect`, `openni2`, `replay` or `simulated`.
    pub backend: String,
    /// Address that opens it again: `freenect:A00363…`, `openni2:/path/file.oni`, `simulated`, `replay:/path`.
    pub address: String,
    /// In words: "Xbox 360 Kinect (model 1414)".
    pub model: String,
    /// Serial number, where it has one.
    pub serial: String,
    /// Cameras and how they stand to each other, for the frames as delivered.
    pub rig: Rig,
    /// Depth units in a metre.
    pub units_per_metre: f64,
    /// What it can do beyond frames.
    pub abilities: Vec<Ability>,
}

/// What a sensor may be able to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ability {
    /// Its motor tilts it.
    Tilt,
    /// It has a lamp.
    Led,
    /// It knows which way is down.
    Accelerometer,
    /// Exposure and white balance can be held.
    ExposureLock,
    /// It gives sharper colour pictures while depth rests.
    Stills,
    /// It stands where it is told to: the simulated sensor.
    Station,
}

/// What a sensor may be asked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "what", content = "value")]
pub enum Control {
    /// Tilt to this angle above the horizon, radians.
    Tilt(f64),
    /// Show the lamp in this state.
    Led(Led),
    /// Hold exposure and white balance as they are, or let them go.
    LockExposure(bool),
    /// Stand at this azimuth around the product, radians: the simulated sensor.
    Station(f64),
    /// Take a sharper colour picture; it comes as [`Event::Still`], and frames rest meanwhile.
    Still,
}

/// The lamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Led {
    /// Dark.
    Off,
    /// Ready.
    Green,
    /// Taking a view.
    BlinkGreen,
    /// A view can be taken, but something could be better.
    Yellow,
    /// Something must be changed.
    Red,
}

/// What happens at a sensor.
#[derive(Debug, Clone)]
pub enum Event {
    /// A pair of images.
    Frame(Arc<Frame>),
    /// The colour picture that [`Control::Still`] asked for, larger than those of the frames.
    Still(Arc<ColorImage>),
    /// The sensor is gone; [`Source::start`] tries to find it again.
    Unplugged,
    /// The driver ended, hung or said something that makes no sense, in words; [`Source::start`] begins anew.
    Failed(String),
    /// A recording is at its end.
    Ended,
    /// Nothing within the time given.
    Nothing,
}

/// A colour picture and a depth image taken at nearly the same time.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Counts delivered pairs from 0 after every start.
    pub index: u64,
    /// Colour, not mirrored.
    pub color: Arc<ColorImage>,
    /// Depth in the geometry of `rig.depth`.
    pub depth: Arc<DepthImage>,
    /// When the colour picture was taken.
    pub color_timestamp_nanos: u64,
    /// When the depth image was taken.
    pub depth_timestamp_nanos: u64,
    /// Packets lost in it: more than none means that parts of the images are older than they should be.
    pub lost_packets: u32,
    /// Frames that the sensor sent but that were not delivered since the last one, because the reader was slow.
    pub skipped: u32,
    /// Gravity in the colour camera's frame, metres per square second, where the sensor measures it.
    pub gravity: Option<[f64; 3]>,
}

/// Why a sensor does not start or does not do what it was asked; says what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SourceError {
    /// The C library is not on this computer.
    #[error("{library} is not installed: {advice}")]
    LibraryMissing {
        /// Its name.
        library: &'static str,
        /// How to get it.
        advice: String,
    },
    /// No such sensor.
    #[error("the sensor is not there: {0}")]
    NotFound(String),
    /// It is there, but may not be used.
    #[error("the sensor cannot be used: {0}")]
    Refused(String),
    /// Asked for something it cannot do.
    #[error("this sensor cannot do that: {0}")]
    Unable(&'static str),
    /// The driver failed.
    #[error("the sensor's driver failed: {0}")]
    Driver(String),
}
