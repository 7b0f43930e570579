//! What can be wrong with a model file: each says where, and what to do.

use std::io;

use super::MAX_COORDINATE_METRES;

/// Why a model was refused or could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The reader or writer failed.
    #[error("reading or writing the model failed: {0}")]
    Io(io::Error),
    /// The bytes end before what was announced.
    #[error("the file ends too early, while {reading}; send or copy it again in full")]
    Truncated {
        /// What was being read.
        reading: &'static str,
    },
    /// A line of text that is no point.
    #[error(
        "line {line}: {what}; write one point a line as X Y Z or X Y Z R G B, millimetres and colours 0 to 255"
    )]
    Line {
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// A line or value without end.
    #[error("line or value {line} is longer than {most} bytes; write one point a line")]
    LineTooLong {
        /// Counted from 1.
        line: usize,
        /// The limit.
        most: usize,
    },
    /// A header or description that breaks the format.
    #[error("the {format} header cannot be understood: {what}; export the model again")]
    Header {
        /// `PLY`, `PCD` or `GLB`.
        format: &'static str,
        /// What is wrong.
        what: String,
    },
    /// Values that break the format.
    #[error("the {format} data cannot be understood: {what}; export the model again")]
    Data {
        /// `PLY`, `PCD` or `GLB`.
        format: &'static str,
        /// What is wrong.
        what: String,
    },
    /// More than the limits allow.
    #[error("the model has {found} {what}, at most {most} are taken; reduce it before sending it")]
    TooMany {
        /// Points, triangles, bytes.
        what: &'static str,
        /// How many were announced or read.
        found: u64,
        /// The limit.
        most: usize,
    },
    /// NaN, infinite or absurdly far.
    #[error(
        "point {number} lies at {point:?} m, which is not a place within {MAX_COORDINATE_METRES} m; remove such points \
         or correct the unit"
    )]
    BadCoordinate {
        /// Counted from 1.
        number: usize,
        /// As read, metres.
        point: [f32; 3],
    },
    /// A triangle names a vertex that does not exist.
    #[error("a face names vertex {index}, but there are {vertices} (counted from 0); export the model again")]
    BadIndex {
        /// As read.
        index: u64,
        /// How many there are.
        vertices: usize,
    },
    /// A valid file with a feature that is not read.
    #[error("{what} is not supported; {advice}")]
    Unsupported {
        /// The feature.
        what: String,
        /// What to do instead.
        advice: &'static str,
    },
    /// No point at all.
    #[error("there is no point in the model; send a model with at least one point")]
    Empty,
}

impl ModelError {
    /// An error of the reader; an early end becomes [`Self::Truncated`].
    pub(super) fn reading(error: io::Error, reading: &'static str) -> Self {
        if error.kind() == io::ErrorKind::UnexpectedEof {
            Self::Truncated { reading }
        } else {
            Self::Io(error)
        }
    }

    /// Refuses more than `most`, announced or read.
    pub(super) fn refuse_more(what: &'static str, found: u64, most: usize) -> Result<(), Self> {
        if found > most as u64 { Err(Self::TooMany { what, found, most }) } else { Ok(()) }
    }
}
