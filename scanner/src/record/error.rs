//! Why nothing was recorded.

use std::io;

use kinect::source::SourceError;

use crate::output::OutputError;

/// Why nothing was recorded; each says what to do.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The sensor.
    #[error(transparent)]
    Sensor(#[from] SourceError),
    /// Nothing came.
    #[error("nothing was recorded: {0}; check the sensor and record again")]
    NoFrames(String),
    /// Only a part came, and a part is of no use.
    #[error("it ended early: {0}; nothing was kept")]
    Part(String),
    /// Too little space to begin with.
    #[error(
        "only {free_megabytes} MB are free there, and {need_megabytes} MB are needed; free some space or name another folder"
    )]
    NoSpace {
        /// What there is.
        free_megabytes: u64,
        /// What should be.
        need_megabytes: u64,
    },
    /// The system does not say how much space there is.
    #[error("cannot find out how much space is free: {0}; name a folder on an ordinary disk")]
    Space(io::Error),
    /// A picture that cannot be written as PNG.
    #[error("a picture cannot be written: {0}; record again")]
    Encode(png::EncodingError),
    /// The disk.
    #[error(transparent)]
    Output(OutputError),
}
