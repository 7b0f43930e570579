//! What can be wrong with a recording, each in one sentence that says what to do.

use std::io;
use std::path::PathBuf;

use crate::pictures::PictureError;

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The folder cannot be found.
    #[error("cannot open the recording {}: {source}; name the folder that holds recording.json", .path.display())]
    NoFolder {
        /// As given.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file is not there.
    #[error("{path} is missing ({source}); {}", missing_advice(.path))]
    Missing {
        /// Inside the recording.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// A file cannot be read.
    #[error("cannot read {path}: {source}; check that you may read it")]
    Unreadable {
        /// Inside the recording.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// A folder or device where a file is expected.
    #[error("{0} is not a file; name the picture itself in recording.json")]
    NotAFile(String),
    /// Larger than anything a camera makes.
    #[error("{path} has {megabytes} MB, more than is read; save it as an ordinary PNG or JPEG")]
    TooLarge {
        /// Inside the recording.
        path: String,
        /// Its size.
        megabytes: u64,
    },
    /// A path outside of the folder.
    #[error(
        "the path {0:?} leaves the recording's folder; put the images inside it and name them relative to it"
    )]
    LeavesFolder(String),
    /// Not JSON, or other fields than the format has.
    #[error("{file} cannot be understood: {what}; correct it or record again")]
    Format {
        /// `recording.json` or `board.json`.
        file: &'static str,
        /// Where and what.
        what: String,
    },
    /// Nobody waits for the result any more.
    #[error("cancelled")]
    Cancelled,
    /// A newer version.
    #[error("{file} is of version {version}, this program reads version 1; use a newer scan-product")]
    Version {
        /// `recording.json` or `board.json`.
        file: &'static str,
        /// As written.
        version: String,
    },
    /// A needed value is not there.
    #[error("recording.json has no {field}; {advice}")]
    MissingField {
        /// Dotted path.
        field: String,
        /// What to write there.
        advice: &'static str,
    },
    /// A value that describes no camera.
    #[error("recording.json: {field} is {value}; {advice}")]
    BadValue {
        /// Dotted path.
        field: String,
        /// As written.
        value: String,
        /// What to write there.
        advice: &'static str,
    },
    /// `color_from_depth` is no rigid transform.
    #[error(
        "recording.json: color_from_depth is not a rigid transform in metres; write 16 numbers row by row, the \
         identity where depth is registered to colour"
    )]
    NotRigid,
    /// No view at all.
    #[error("recording.json lists no views and no frames; record at least one view")]
    NoViews,
    /// Both ways of listing at once.
    #[error(
        "recording.json lists both views and frames; keep views for a resting scene, frames for one moving stream"
    )]
    ViewsAndFrames,
    /// A view without frames.
    #[error("view {0:?} lists no frames; remove it from recording.json or record it again")]
    EmptyView(String),
    /// Two views of one name.
    #[error("two views are named {0:?} in recording.json; give every view its own name")]
    DuplicateView(String),
    /// More frames than fit into memory.
    #[error("view {view:?} has more frames than fit into memory; keep at most {most} of them")]
    TooManyFrames {
        /// The view.
        view: String,
        /// How many fit.
        most: usize,
    },
    /// An index past the end.
    #[error("the recording has no view number {0}; ask for a smaller one")]
    NoSuchView(usize),
    /// A picture that cannot be used.
    #[error("{path} cannot be used: {source}")]
    Picture {
        /// Inside the recording.
        path: String,
        /// What is wrong with it.
        source: PictureError,
    },
    /// Nothing but zeros.
    #[error(
        "the depth of view {view:?} is zero everywhere: the sensor measured nothing; keep 0.5 to 1.5 m distance, avoid \
         sunlight, and record this view again"
    )]
    NoDepth {
        /// The view.
        view: String,
    },
    /// Depth in another unit than written.
    #[error(
        "with units_per_metre = {units} the scene would be {metres:.3} m away, where no such sensor measures; set \
         units_per_metre in recording.json to {likely} if the values fit that unit (1000 is millimetres)"
    )]
    Unit {
        /// Median distance as written.
        metres: f64,
        /// As written.
        units: f64,
        /// What would fit.
        likely: f64,
    },
    /// Something about the board.
    #[error("board.json: {0}")]
    Board(String),
}

impl RecordingError {
    /// Whether one view is at fault, so that the others may still give a model.
    pub fn concerns_one_view(&self) -> bool {
        matches!(self, Self::NoDepth { .. })
    }
}

fn missing_advice(path: &str) -> &'static str {
    match path {
        "recording.json" => {
            "name the folder of a recording, or bring in other programs' data with `scan-product import`"
        }
        _ => "copy the whole recording again, or remove the frame from recording.json",
    }
}
