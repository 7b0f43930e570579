//! What the page is told: the whole state of a capture as one JSON object. Metres, radians, seconds, bytes.
//!
//! The names are a contract with the page in `web/capture/`.

use std::path::PathBuf;

use kinect::source::Ability;
use reconstruct::report::Verdict;
use serde::{Deserialize, Serialize};

/// Where the seller is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Step {
    /// Choosing the sensor.
    Sensor,
    /// Choosing the board.
    Board,
    /// Taking views.
    Views,
    /// The model is being built.
    Building,
    /// Looking at the model.
    Result,
    /// The model is being sent.
    Publishing,
    /// The listing is there.
    Published,
}

/// Everything the page shows but the pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct State {
    pub version: u32,
    pub step: Step,
    pub sensors: Vec<SensorEntry>,
    pub libraries: Vec<LibraryEntry>,
    pub sensor: Option<OpenSensor>,
    pub board: Option<BoardState>,
    pub views: Vec<TakenView>,
    pub sectors: Vec<Sector>,
    pub taking: Option<Taking>,
    pub auto: Auto,
    pub preview: Option<PreviewState>,
    pub build: Option<BuildState>,
    pub result: Option<ResultState>,
    pub publish: Option<PublishState>,
    pub folder: Option<PathBuf>,
    pub free_bytes: u64,
    /// Server to propose for publishing.
    pub server: Option<String>,
    pub error: Option<String>,
}

/// A sensor that could be chosen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorEntry {
    pub address: String,
    pub backend: String,
    pub model: String,
    pub serial: String,
    pub usable: bool,
    /// Why it cannot be used.
    pub problem: Option<String>,
    /// What to do about it.
    pub advice: Option<String>,
    pub abilities: Vec<Ability>,
}

/// A driver library.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LibraryEntry {
    pub name: String,
    pub found: bool,
    pub path: Option<String>,
    pub version: Option<String>,
    pub advice: Option<String>,
}

/// The sensor in use.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OpenSensor {
    pub address: String,
    pub model: String,
    pub serial: String,
    /// Whether a calibration of this very unit is used.
    pub calibrated: bool,
    pub running: bool,
    /// What is wrong with it just now, in a sentence.
    pub trouble: Option<String>,
    /// Azimuth at which it stands, radians, where it stands where it is told to.
    pub station: Option<f64>,
}

/// The board in use.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BoardState {
    pub name: String,
    pub tags: usize,
    pub warnings: Vec<String>,
}

/// A view that is on the disk.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TakenView {
    pub name: String,
    /// Where the camera stood, counter-clockwise from the board's x seen from above, 0 to 2 pi.
    pub azimuth: f64,
    /// Above the board's plane.
    pub elevation: f64,
    /// From the board's middle.
    pub distance: f64,
    /// Tags that placed it.
    pub tags: usize,
    pub frames: usize,
    /// Points of the product.
    pub points: usize,
    /// How long it took, from the order to the confirmation; 0 for a view of an earlier session.
    pub seconds: f64,
}

/// A twelfth of the way around the product.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sector {
    pub from: f64,
    pub to: f64,
    pub seen: bool,
}

/// A view being taken.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Taking {
    pub view: String,
    pub frames: usize,
    pub of: usize,
}

/// When views are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AutoMode {
    /// By order only.
    #[default]
    Manual,
    /// Every so many seconds.
    Timer,
    /// When the scene has been still for so many seconds, at a place where no view was taken yet.
    Still,
}

/// The order for taking views by itself, and how long until the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Auto {
    pub mode: AutoMode,
    pub seconds: f64,
    pub next_in: Option<f64>,
}

/// The cloud that grows with every view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct PreviewState {
    pub version: u64,
    pub points: usize,
}

/// How far the build is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct BuildState {
    pub stage: String,
    pub done: usize,
    pub of: usize,
}

/// The built model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResultState {
    pub version: u64,
    pub points: usize,
    pub verdict: Verdict,
    pub dimensions_m: Option<[f64; 3]>,
    pub dimensions_uncertainty_m: Option<[f64; 3]>,
    pub warnings: Vec<String>,
    pub views: Vec<ViewUse>,
    /// Points taken away by hand.
    pub removed: usize,
    pub can_undo: bool,
}

/// What the build did with a view.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ViewUse {
    pub name: String,
    pub used: bool,
    pub reason: Option<String>,
}

/// How far publishing is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PublishPhase {
    Uploading,
    Processing,
    Done,
    Failed,
}

/// Publishing. There is no token in it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PublishState {
    pub phase: PublishPhase,
    pub sent_bytes: u64,
    pub total_bytes: u64,
    pub address: Option<String>,
    pub error: Option<String>,
}
