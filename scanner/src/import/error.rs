//! What can be wrong with a folder that is brought in.

use std::io;
use std::path::PathBuf;

use kinect::source::SourceError;
use reconstruct::model_file::ModelError;
use reconstruct::surface::poisson::PoissonError;

use crate::output::OutputError;
use crate::pictures::PictureError;
use crate::record::RecordError;
use crate::recording::RecordingError;

/// Why a source cannot be brought in; each says what to do.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// None of the known kinds.
    #[error(
        "{} is no folder or model that is understood; name a TUM, BOP or 7-Scenes folder, a folder with NAME_rgb.png and \
         NAME_depth.png (or color/ and depth/), a dump of fakenect-record, or a file .oni, .asc, .ply, .pcd, .glb",
        .0.display()
    )]
    NotRecognised(PathBuf),
    /// A file cannot be read.
    #[error("cannot read {}: {source}; check that it exists and that you may read it", .path.display())]
    Unreadable {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A folder, a device, or far too large.
    #[error("{} is not a file of less than 64 MB; name ordinary files", .0.display())]
    NotAFile(PathBuf),
    /// A text that breaks its format.
    #[error("{file}, line {line}: {what}; correct the line or download the data again")]
    Text {
        /// Which.
        file: &'static str,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// A JSON file that breaks its format.
    #[error("{file}: {what}; correct it or download the data again")]
    Json {
        /// Which.
        file: &'static str,
        /// What is wrong.
        what: String,
    },
    /// Points of which no surface can be made.
    #[error("no surface can be made of the points: {0}")]
    Surface(#[from] PoissonError),
    /// Nothing to bring in.
    #[error(
        "no pair of colour and depth pictures was found; check that both lie in the folder and belong together"
    )]
    NoFrames,
    /// One list is longer.
    #[error(
        "there are {colors} colour and {depths} depth pictures whose names do not pair; every colour picture needs its depth \
         picture: remove what has no partner"
    )]
    DifferentLengths {
        /// Colour pictures.
        colors: usize,
        /// Depth pictures.
        depths: usize,
    },
    /// Intrinsics that nobody gave.
    #[error(
        "the cameras of this folder are not known; give them with --color-camera fx,fy,cx,cy (pixels), and with \
         --depth-camera and --color-from-depth where depth is not registered to colour"
    )]
    NoCamera,
    /// Intrinsics that differ from picture to picture.
    #[error(
        "the camera of image {0} differs from the first one's; a recording has one camera: bring in the images of one \
         camera alone"
    )]
    CameraChanges(String),
    /// A picture that cannot be used.
    #[error("{} cannot be used: {source}", .path.display())]
    Picture {
        /// Which.
        path: PathBuf,
        /// What is wrong with it.
        source: PictureError,
    },
    /// A picture that cannot be written again.
    #[error("a depth picture cannot be written: {0}; check the free space and run the command again")]
    Encode(png::EncodingError),
    /// Values that describe no camera.
    #[error(transparent)]
    Recording(Box<RecordingError>),
    /// A model that cannot be read.
    #[error("{} cannot be used: {source}", .path.display())]
    Model {
        /// Which.
        path: PathBuf,
        /// What is wrong with it.
        source: ModelError,
    },
    /// A recording that cannot be opened.
    #[error("{} cannot be played: {source}", .path.display())]
    Sensor {
        /// Which.
        path: PathBuf,
        /// What is wrong, with what to do.
        source: SourceError,
    },
    /// A recording that cannot be played to its end or written.
    #[error("{} cannot be brought in: {source}", .path.display())]
    Record {
        /// Which.
        path: PathBuf,
        /// What is wrong, with what to do.
        source: Box<RecordError>,
    },
    /// The result cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl ImportError {
    /// A complaint about a line.
    pub(super) fn text(file: &'static str, line: usize, what: impl Into<String>) -> Self {
        Self::Text { file, line, what: what.into() }
    }
}
