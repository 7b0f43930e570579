//! What a report says about the recordings of a model that was made of several.

use serde::{Deserialize, Serialize};

use crate::pose;
use crate::register::flip::Found;

/// One recording of the product; the first one's board is the world.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RecordingReport {
    /// What its views' names begin with; nothing for the first.
    pub prefix: String,
    /// Its views.
    pub views: usize,
    /// Row-major 4x4 that carries its own board's frame into the world; `None` where it could not be joined.
    pub world_from_board: Option<[f64; 16]>,
    /// Factor from measured to true depth in this recording.
    pub depth_scale: f64,
    /// How surely it was joined; absent for the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joined: Option<JoinReport>,
}

/// How surely a recording was joined.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct JoinReport {
    /// Share of the points that both recordings have, percent.
    pub overlap_percent: f64,
    /// Share that contradicts the other recording, percent.
    pub conflict_percent: f64,
    /// Root mean square distance of the common surfaces, millimetres.
    pub surface_mm: f64,
    /// How alike the colours are there, 100 for the same, 0 for any two places; absent where the product is of one colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color_percent: Option<f64>,
    /// Lead over the next best way to join them, percent.
    pub lead_percent: f64,
}

impl JoinReport {
    /// Of what was found.
    pub fn of(found: &Found) -> Self {
        let e = &found.evidence;
        Self {
            overlap_percent: rounded(100.0 * e.overlap, 10.0),
            conflict_percent: rounded(100.0 * e.conflict, 100.0),
            surface_mm: rounded(1000.0 * e.rmse_metres, 1000.0),
            color_percent: (e.texture > 0.0).then(|| rounded(100.0 * e.color, 10.0)),
            lead_percent: rounded(100.0 * e.margin, 10.0),
        }
    }
}

impl RecordingReport {
    /// Carried into the world by `world_from_board`.
    #[must_use]
    pub fn joined(mut self, found: &Found, world_from_board: &pose::Pose) -> Self {
        self.world_from_board = Some(pose::to_row_major(world_from_board));
        self.joined = Some(JoinReport::of(found));
        self
    }
}

fn rounded(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps
}
