//! What can go wrong with a recording that is being taken, each in a sentence that says what to do.

use std::io;
use std::path::{Path, PathBuf};

use crate::recording::RecordingError;

/// Why the recording cannot be begun, gone on with or added to.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The next view would not fit.
    #[error(
        "the disk with {} is nearly full: {} MB are free and a view needs {} MB; free some space and take the view then",
        folder.display(), free >> 20, needed >> 20
    )]
    DiskFull {
        /// The recording.
        folder: PathBuf,
        /// Free bytes.
        free: u64,
        /// Bytes that must be free.
        needed: u64,
    },
    /// Another capture has it.
    #[error("another scan-product works in {}; close that one first", .0.display())]
    InUse(PathBuf),
    /// A recording lies there already.
    #[error("{} already holds a recording; go on with it by `scan-product resume`, or name another folder", .0.display())]
    NotEmpty(PathBuf),
    /// Not taken by this program.
    #[error("{} was not taken with scan-product, so no views can be added; build it with `scan-product build`", .0.display())]
    NotOurs(PathBuf),
    /// No view of that name.
    #[error("there is no view {0}")]
    NoSuchView(String),
    /// The pictures of a view cannot be compressed.
    #[error("a picture could not be written: {0}")]
    Picture(#[from] png::EncodingError),
    /// The description cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The file system refuses.
    #[error("cannot write {}: {source}; check that the disk is not full and that you may write there", path.display())]
    Io {
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// Names the place of an error.
pub(super) fn at(path: &Path) -> impl FnOnce(io::Error) -> JournalError + '_ {
    move |source| JournalError::Io { path: path.to_owned(), source }
}
