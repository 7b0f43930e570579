//! Marker corners of a recording against the truth beside it: the board's corners projected with the true poses.

use std::path::Path;
use std::time::Instant;

use nalgebra::{Point2, Point3, Vector2};
use reconstruct::board::{BoardFile, KnownBoard};
use reconstruct::camera::Intrinsics;
use reconstruct::image::GrayImage;
use reconstruct::marker::{DetectConfig, Detection, Dictionary, detect};
use reconstruct::pose::{self, Pose};
use scanner::recording::Recording;

/// What detection gives on one picture.
#[derive(Debug, Clone)]
pub struct PictureCorners {
    /// View's name.
    pub name: String,
    /// What was found.
    pub detections: Vec<Detection>,
    /// Ids that are not on the board or do not lie where they should (farther than 3 px).
    pub wrong_ids: Vec<u32>,
    /// Found minus true, of the corners of right ids, pixels.
    pub errors: Vec<Vector2<f64>>,
    /// Tags whose corners all project into the picture, hidden ones included.
    pub in_picture: usize,
    /// Time of the detection, milliseconds.
    pub milliseconds: f64,
}

/// A recording on a known board with its true poses.
#[derive(Debug)]
pub struct KnownTruth {
    /// The recording.
    pub recording: Recording,
    /// Its board.
    pub board: KnownBoard,
    /// The views' true poses.
    pub world_from_camera: Vec<Pose>,
}

impl KnownTruth {
    /// Opens a recording with `truth/poses.json`; `None` where it has no known board.
    pub fn open(folder: &Path) -> Option<Self> {
        let recording = Recording::open(folder).expect("a readable recording");
        let Some(BoardFile::Known(board)) = recording.board().cloned() else { return None };
        let text = std::fs::read_to_string(folder.join("truth/poses.json")).ok()?;
        let truth: serde_json::Value = serde_json::from_str(&text).ok()?;
        let pose = |view: &serde_json::Value| {
            let numbers: Vec<f64> =
                view["world_from_camera"].as_array()?.iter().filter_map(serde_json::Value::as_f64).collect();
            pose::from_row_major(&numbers.try_into().ok()?)
        };
        let world_from_camera = truth["views"].as_array()?.iter().map(pose).collect::<Option<Vec<_>>>()?;
        Some(Self { recording, board, world_from_camera })
    }

    /// The colour camera.
    pub fn camera(&self) -> Intrinsics {
        self.recording.rig().color
    }

    /// A view's grey picture.
    pub fn picture(&self, view: usize) -> GrayImage {
        self.recording.load_view(view).expect("a readable view").color.to_gray()
    }

    /// Detects in one view and compares with the truth.
    pub fn measure(&self, view: usize) -> PictureCorners {
        let (image, camera) = (self.picture(view), self.camera());
        let start = Instant::now();
        let detections =
            detect(&image, Dictionary::of(self.board.family), Some(&camera), &DetectConfig::default());
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        let camera_from_world = self.world_from_camera[view].inverse();
        let project = |c: [f64; 3]| camera.project(&(camera_from_world * Point3::from(c)));
        let inside = |p: Point2<f64>| {
            p.x > 0.0 && p.y > 0.0 && p.x < image.width as f64 - 1.0 && p.y < image.height as f64 - 1.0
        };
        let in_picture =
            self.board.tags.iter().filter(|t| t.corners_m.iter().all(|&c| project(c).is_some_and(inside)));
        let in_picture = in_picture.count();
        let (mut errors, mut wrong_ids) = (Vec::new(), Vec::new());
        for d in &detections {
            let tag = self.board.tags.iter().find(|t| t.id == d.id);
            let truth = tag.and_then(|t| t.corners_m.map(project).into_iter().collect::<Option<Vec<_>>>());
            let offs: Vec<Vector2<f64>> =
                truth.iter().flatten().zip(&d.corners).map(|(t, found)| found - t).collect();
            if offs.is_empty() || offs.iter().any(|e| e.norm() > 3.0) {
                wrong_ids.push(d.id);
            } else {
                errors.extend(offs);
            }
        }
        let name = self.recording.view_names()[view].clone();
        PictureCorners { name, detections, wrong_ids, errors, in_picture, milliseconds }
    }
}

/// Median of some numbers; NaN for none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Root mean square of some vectors' lengths.
pub fn rms(errors: &[Vector2<f64>]) -> f64 {
    (errors.iter().map(Vector2::norm_squared).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Median length of some vectors.
pub fn median_length(errors: &[Vector2<f64>]) -> f64 {
    median(errors.iter().map(Vector2::norm).collect())
}
