//! The recording as data: what `recording.json` holds, and a view's images in memory. Reading files is the scanner's work.

use serde::{Deserialize, Serialize};

use crate::camera::Intrinsics;
use crate::image::{ColorImage, DepthImage};
use crate::pose::Pose;

/// Cameras of a recording and how they stand to each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rig {
    /// The colour camera, in which markers are seen and whose pose every view carries.
    pub color: Intrinsics,
    /// The depth camera.
    pub depth: Intrinsics,
    /// Colour-camera frame from depth-camera frame; identity where depth is registered to colour.
    pub color_from_depth: Pose,
}

/// What was taken while nothing moved.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewImages {
    /// The view's name: `"000"`.
    pub name: String,
    /// The colour picture (of the middle frame, where several were taken).
    pub color: ColorImage,
    /// One depth image a frame, never empty.
    pub depths: Vec<DepthImage>,
}

/// `recording.json`, as written down in the formats contract.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingFile {
    /// Always 1.
    pub version: u32,
    /// What took the pictures.
    pub device: Device,
    /// Colour camera.
    pub color: Intrinsics,
    /// Depth camera.
    pub depth: DepthCamera,
    /// Row-major 4x4; identity where depth is registered to colour.
    pub color_from_depth: [f64; 16],
    /// Images are stored flipped left-right; intrinsics are the unflipped camera's.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mirrored: bool,
    /// Views, each of frames taken while nothing moved.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub views: Vec<ViewEntry>,
    /// Instead of views: one moving stream; its views are named by index.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<FrameEntry>,
}

/// The device that took a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Device {
    /// `openni2`, `freenect`, `simulated` or `import`.
    pub backend: String,
    /// Serial number, where there is one.
    #[serde(default)]
    pub serial: String,
}

/// The depth camera and its unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthCamera {
    /// Geometry.
    #[serde(flatten)]
    pub intrinsics: Intrinsics,
    /// Depth units in a metre.
    pub units_per_metre: f64,
}

/// One view: frames taken while nothing moved.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ViewEntry {
    /// Name used in reports.
    pub name: String,
    /// Its frames, which may share one colour image.
    pub frames: Vec<FrameEntry>,
    /// Path of a sharper colour picture taken right after them, where the sensor takes such; builds do without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub still: Option<String>,
}

/// One pair of images.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameEntry {
    /// Path of the colour image inside the recording's folder.
    pub color: String,
    /// Path of the depth image inside the recording's folder.
    pub depth: String,
    /// When it was taken.
    #[serde(default)]
    pub timestamp_nanos: u64,
}

impl RecordingFile {
    /// The views in order: a stream's frames are views of one frame each, named by index.
    pub fn view_entries(&self) -> Vec<ViewEntry> {
        if !self.views.is_empty() {
            return self.views.clone();
        }
        let name = |(i, frame): (usize, &FrameEntry)| ViewEntry {
            name: format!("{i:03}"),
            frames: vec![frame.clone()],
            still: None,
        };
        self.frames.iter().enumerate().map(name).collect()
    }
}
