//! What is said about a scan: `report.json`, and the reasons why a view was left out, in words a seller understands.

pub mod recordings;
pub mod surface;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::register::source_chain::SourceReport;
use recordings::RecordingReport;
use surface::SurfaceReport;

/// `report.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Always 1.
    pub version: u32,
    /// One entry a view of the recording, in its order.
    pub views: Vec<ViewReport>,
    /// Measured points of the model.
    pub points: usize,
    /// Length, width, height, metres; absent where nothing was built.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dimensions_m: Option<[f64; 3]>,
    /// Half widths of their 95 % intervals, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dimensions_uncertainty_m: Option<[f64; 3]>,
    /// The recordings and how they were joined; absent where there is only one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<RecordingReport>,
    /// How much of the surface was measured, how well, and what is missing; absent where no surface was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<SurfaceReport>,
    /// What heights are measured from.
    #[serde(default)]
    pub ground: Ground,
    /// What the joint refinement of all views was made of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointReport>,
    /// How the depth was corrected.
    pub depth_calibration: CalibrationReport,
    /// What the seller should know.
    pub warnings: Vec<String>,
    /// The scan in one word.
    pub verdict: Verdict,
    /// Why, in one sentence.
    pub verdict_reason: String,
    /// Wall time of the stages, milliseconds, by the stage's name.
    pub timings_ms: serde_json::Map<String, Value>,
    /// The program's version.
    pub software: String,
    /// What every stage of the source's own chain did; only with `--method source`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source_chain: Option<SourceReport>,
}

/// The scan in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// All views fit and the board was seen well.
    Good,
    /// Usable, with something to know.
    Acceptable,
    /// Not fit to be shown.
    Poor,
}

/// What the product stands on: z = 0 of the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ground {
    /// The marker board.
    Board,
    /// A table, found as the plane below the product.
    Table,
    /// Nothing was seen: which way is up is not known.
    #[default]
    Unknown,
}

impl Ground {
    /// Whether the world's z is up.
    pub fn up_is_known(self) -> bool {
        self != Self::Unknown
    }
}

/// One view in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewReport {
    /// The view's name.
    pub name: String,
    /// Whether it is part of the model.
    pub used: bool,
    /// Row-major 4x4 of the colour camera; `None` where it could not be placed.
    pub world_from_camera: Option<[f64; 16]>,
    /// Tags that took part in its pose.
    pub tags: usize,
    /// Root mean square corner error, pixels.
    pub reprojection_px: Option<f64>,
    /// Standard deviation of where this view puts the product's middle, by the covariance of the joint refinement, millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_sd_mm: Option<f64>,
    /// The same of how it is turned, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_sd_degrees: Option<f64>,
    /// How far the surfaces alone would leave it loose, millimetres: what is more is held by markers and colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loosest_by_surface_mm: Option<f64>,
    /// Root mean square distance to the other views' surfaces where they agree, millimetres.
    pub inlier_rmse_mm: Option<f64>,
    /// Share of its points that contradict a neighbouring view, percent.
    pub conflict_percent: Option<f64>,
    /// Why it was left out.
    pub reason: Option<String>,
}

/// What the joint refinement was made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct JointReport {
    /// Gauss-Newton steps.
    pub rounds: usize,
    /// Corners of the board's tags, in all views.
    pub corners: usize,
    /// Ordered pairs of views whose surfaces were compared.
    pub surface_pairs: usize,
    /// Those of them whose colours were compared too.
    pub color_pairs: usize,
    /// Board pixels whose depth was compared with the board's plane.
    pub board_samples: usize,
}

/// The depth calibration in the report.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct CalibrationReport {
    /// Factor from measured to true depth.
    pub scale: f64,
    /// Its standard deviation.
    pub scale_sd: f64,
    /// Median depth error on the board before correction, millimetres; positive: the sensor reads too far.
    pub board_error_before_mm: f64,
    /// The same after correction.
    pub board_error_after_mm: f64,
    /// Board pixels that took part.
    pub samples: usize,
    /// Whether the sensor's own kept calibration was the starting point.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_this_sensor: bool,
}

/// Why a view is not part of the model.
#[derive(Debug, Clone, PartialEq)]
pub enum LeftOut {
    /// No depth at all.
    NoDepth,
    /// The scene moved while the view was taken.
    Moved {
        /// Change of disparity, pixels.
        motion_px: f32,
    },
    /// No marker was recognised.
    NoTags {
        /// Whether the picture has too little sharp detail.
        blurred: bool,
    },
    /// Markers of another family were seen.
    OtherFamily {
        /// The family seen.
        found: String,
        /// The family of `board.json`.
        expected: String,
    },
    /// Only one marker of the board was recognised.
    OneTag {
        /// Its id.
        id: u32,
    },
    /// The markers contradict each other or the board.
    Markers(String),
    /// Nothing stands above the board.
    NoProduct,
    /// Something stands on the board, but not in its middle.
    OutsideRegion,
    /// The surface does not match the other views'.
    DoesNotFit {
        /// Share of the points it has in common with the views that agree, which contradict them.
        conflict: f64,
    },
    /// No other view shares enough surface to place this one.
    NoOverlap,
    /// Placed without a board, but not surely.
    Unsure(String),
}

impl std::fmt::Display for LeftOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoDepth => write!(
                f,
                "the sensor measured no depth: keep 0.5 to 1.5 m distance, avoid sunlight, and take this view again"
            ),
            Self::Moved { .. } => {
                write!(
                    f,
                    "something moved while this view was taken: let everything stand still and take it again"
                )
            }
            Self::NoTags { blurred: true } => {
                write!(
                    f,
                    "the picture is blurred and no marker could be read: hold the camera still and take it again"
                )
            }
            Self::NoTags { blurred: false } => {
                write!(
                    f,
                    "no marker of the board can be seen: show more of the board and take this view again"
                )
            }
            Self::OtherFamily { found, expected } => write!(
                f,
                "the markers in the picture are of the family {found}, but board.json says {expected}: use the board.json \
                 that was made with the printed sheet"
            ),
            Self::OneTag { id } => write!(
                f,
                "only one marker (id {id}) can be seen: at least two are needed, so show more of the board and take this view again"
            ),
            Self::NoProduct => {
                write!(
                    f,
                    "nothing stands in the middle of the board, or the sensor cannot see it (dark, shiny or transparent things give no depth)"
                )
            }
            Self::OutsideRegion => {
                write!(
                    f,
                    "the product does not stand in the middle of the board: put it inside the marked region"
                )
            }
            Self::DoesNotFit { conflict } => write!(
                f,
                "the product stands differently here than in the other views ({:.0} % of the surface contradicts them): it was \
                 probably knocked or turned before this view; put it back as it stood and take this view again",
                conflict * 100.0
            ),
            Self::NoOverlap => {
                write!(f, "this view shares too little surface with the others: take another one in between")
            }
            Self::Markers(what) | Self::Unsure(what) => write!(f, "{what}"),
        }
    }
}

/// Whether at least as many of these views contradict the others as are used: nobody can tell which to believe then.
pub fn half_contradict<'a>(left_out: impl Iterator<Item = Option<&'a LeftOut>>) -> bool {
    let (mut used, mut off) = (0, 0);
    for reason in left_out {
        used += usize::from(reason.is_none());
        off += usize::from(matches!(reason, Some(LeftOut::DoesNotFit { .. })));
    }
    off > 0 && off >= used
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_say_what_to_do() {
        let knocked = LeftOut::DoesNotFit { conflict: 0.162 }.to_string();
        assert!(knocked.contains("knocked") && knocked.contains("16 %"), "{knocked}");
        assert!(LeftOut::OneTag { id: 7 }.to_string().contains("id 7"));
    }

    #[test]
    fn only_contradicting_views_count_against_those_used() {
        let off = LeftOut::DoesNotFit { conflict: 0.2 };
        let of = |used: usize, contradicting: usize, without_depth: usize| {
            let reasons =
                [(used, None), (contradicting, Some(&off)), (without_depth, Some(&LeftOut::NoDepth))];
            half_contradict(reasons.into_iter().flat_map(|(n, reason)| std::iter::repeat_n(reason, n)))
        };
        assert!(of(4, 4, 0) && of(1, 1, 6) && of(0, 1, 0));
        assert!(!of(4, 3, 9) && !of(0, 0, 8) && !of(8, 0, 0));
    }
}
