//! The marker board as data (`board.json`): world frame, origin at the board's centre, z up, metres.

use serde::{Deserialize, Serialize};

/// Marker families, with the published dictionaries' own codes and ids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Family {
    /// OpenCV's DICT_4X4_50.
    #[serde(rename = "aruco_4x4_50")]
    Aruco4x4_50,
    /// OpenCV's DICT_5X5_100.
    #[serde(rename = "aruco_5x5_100")]
    Aruco5x5_100,
    /// OpenCV's DICT_6X6_250.
    #[serde(rename = "aruco_6x6_250")]
    Aruco6x6_250,
    /// OpenCV's DICT_ARUCO_ORIGINAL.
    #[serde(rename = "aruco_original")]
    ArucoOriginal,
    /// AprilTag's 36h11, upright as OpenCV draws it.
    #[serde(rename = "tag36h11")]
    Tag36h11,
}

impl Family {
    /// All families.
    pub const ALL: [Family; 5] =
        [Self::Aruco4x4_50, Self::Aruco5x5_100, Self::Aruco6x6_250, Self::ArucoOriginal, Self::Tag36h11];

    /// The name used in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Aruco4x4_50 => "aruco_4x4_50",
            Self::Aruco5x5_100 => "aruco_5x5_100",
            Self::Aruco6x6_250 => "aruco_6x6_250",
            Self::ArucoOriginal => "aruco_original",
            Self::Tag36h11 => "tag36h11",
        }
    }
}

/// A board whose tags lie at known places, or loose sheets whose places nobody measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum BoardFile {
    /// `tags` with their corners.
    Known(KnownBoard),
    /// `layout: "unknown"`.
    Loose(LooseSheets),
}

/// Tags at known places.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnownBoard {
    /// Always 1.
    pub version: u32,
    /// Which dictionary the tags are from.
    pub family: Family,
    /// The tags.
    pub tags: Vec<Tag>,
    /// Polygon `[x, y]` in which the product stands, metres.
    pub inner_region_m: Vec<[f64; 2]>,
}

/// One tag of a board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tag {
    /// Id in the family.
    pub id: u32,
    /// Top-left, top-right, bottom-right, bottom-left of the upright tag, metres.
    pub corners_m: [[f64; 3]; 4],
}

/// Sheets of one tag each, lying on one table at unknown places.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LooseSheets {
    /// Always 1.
    pub version: u32,
    /// Which dictionary the tags are from.
    pub family: Family,
    /// Side of the black square, metres.
    pub tag_size_m: f64,
    /// Always `"unknown"`.
    pub layout: String,
    /// Ids that were printed.
    pub ids: Vec<u32>,
}
