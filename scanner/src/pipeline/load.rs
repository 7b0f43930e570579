//! First stage: pictures from the source, frames averaged, depth brought into the colour camera's geometry.

use rayon::prelude::*;
use reconstruct::average::{DisparityMap, average};
use reconstruct::calibrate::{BoardSample, DepthCalibration};
use reconstruct::consistency::ViewFit;
use reconstruct::fuse::PlacedView;
use reconstruct::image::ColorImage;
use reconstruct::marker::{BoardPose, Detection};
use reconstruct::pose::Pose;
use reconstruct::recording::Rig;
use reconstruct::refine::PosePrior;
use reconstruct::report::{Ground, JointReport, LeftOut};
use reconstruct::segment::Region;
use reconstruct::view::DepthView;

use super::ViewSource;
use crate::config::Config;
use crate::recording::RecordingError;
use crate::ui::Stage;

/// Everything known of the scan, filled in stage by stage.
#[derive(Debug)]
pub struct Work {
    /// The cameras.
    pub rig: Rig,
    /// The views, in the recording's order.
    pub views: Vec<View>,
    /// Whether neighbouring views are neighbours in time.
    pub is_stream: bool,
    /// Rays of the colour camera's pixels on z = 1.
    pub rays: Vec<[f32; 2]>,
    /// The board with its tags, once known.
    pub board: Option<reconstruct::board::KnownBoard>,
    /// Whether a board was to be used.
    pub board_expected: bool,
    /// Whether the board's places were worked out from the views.
    pub loose_sheets: bool,
    /// Where the product may be, once the board is known.
    pub region: Option<Region>,
    /// Correction of the depth.
    pub calibration: DepthCalibration,
    /// What the joint refinement was made of, once it ran.
    pub joint: Option<JointReport>,
    /// What the seller should know.
    pub warnings: Vec<String>,
    /// What the product stands on.
    pub ground: Ground,
    /// Why there is no scan at all, where a stage found out.
    pub failure: Option<String>,
}

/// One view.
#[derive(Debug)]
pub struct View {
    /// Its name.
    pub name: String,
    /// The colour picture.
    pub color: ColorImage,
    /// Averaged disparity, colour camera's geometry.
    pub disparity: DisparityMap,
    /// Markers in the picture.
    pub detections: Vec<Detection>,
    /// Pose by its markers.
    pub marker_pose: Option<BoardPose>,
    /// What is known of the pose before the surfaces are compared, where no board tells.
    pub prior: Option<PosePrior>,
    /// White pixels of the board, corrected as `disparity` is.
    pub board_samples: Vec<BoardSample>,
    /// Points, normals and product mask.
    pub geometry: Option<DepthView>,
    /// The pose, as well as it is known so far.
    pub world_from_camera: Option<Pose>,
    /// Standard deviations of where it puts the product's middle (metres) and of how it is turned (radians).
    pub pose_sd: Option<(f64, f64)>,
    /// How far the surfaces alone would leave it loose, metres.
    pub loosest_by_surface_metres: Option<f64>,
    /// How it agrees with the other views.
    pub fit: Option<ViewFit>,
    /// Why it is not used.
    pub left_out: Option<LeftOut>,
}

impl View {
    /// Leaves the view out, unless it already is.
    pub fn leave_out(&mut self, reason: LeftOut) {
        self.left_out.get_or_insert(reason);
    }

    /// Whether the view is still part of the scan.
    pub fn is_used(&self) -> bool {
        self.left_out.is_none()
    }
}

impl Work {
    /// Whether the views are placed by a board, well or not.
    pub fn has_board(&self) -> bool {
        self.board_expected
    }

    /// The used views that have geometry and a pose.
    pub fn placed_views(&self) -> Vec<PlacedView<'_>> {
        let placed = |v: &'_ View| v.is_used() && v.geometry.is_some() && v.world_from_camera.is_some();
        let views = self.views.iter().filter(|v| placed(v));
        views
            .filter_map(|v| {
                Some(PlacedView {
                    geometry: v.geometry.as_ref()?,
                    color: &v.color,
                    world_from_camera: v.world_from_camera?,
                })
            })
            .collect()
    }
}

/// Loads every view and averages its frames.
pub fn load_and_average(
    source: &dyn ViewSource,
    config: &Config,
    stage: &Stage,
) -> Result<Work, RecordingError> {
    let rig = source.rig();
    let names = source.view_names();
    let views = (0..names.len())
        .into_par_iter()
        .map(|i| {
            let view = load_view(source, i, &names[i], &rig, config);
            stage.step();
            view
        })
        .collect::<Result<Vec<View>, RecordingError>>()?;
    Ok(Work {
        calibration: DepthCalibration::identity(rig.color.width as usize, rig.color.height as usize),
        rays: rig.color.ray_table(),
        rig,
        views,
        is_stream: source.is_stream(),
        board: None,
        board_expected: false,
        loose_sheets: false,
        region: None,
        joint: None,
        warnings: Vec::new(),
        ground: Ground::Unknown,
        failure: None,
    })
}

fn load_view(
    source: &dyn ViewSource,
    index: usize,
    name: &str,
    rig: &Rig,
    config: &Config,
) -> Result<View, RecordingError> {
    let mut view = View {
        name: name.to_owned(),
        color: ColorImage::default(),
        disparity: average(&[], rig.depth.fx, &config.average),
        detections: Vec::new(),
        marker_pose: None,
        prior: None,
        board_samples: Vec::new(),
        geometry: None,
        world_from_camera: None,
        pose_sd: None,
        loosest_by_surface_metres: None,
        fit: None,
        left_out: None,
    };
    let images = match source.load_view(index) {
        Ok(images) => images,
        Err(error) if error.concerns_one_view() => {
            view.leave_out(LeftOut::NoDepth);
            return Ok(view);
        }
        Err(error) => return Err(error),
    };
    view.color = images.color;
    let averaged = average(&images.depths, rig.depth.fx, &config.average);
    if averaged.motion_px > config.average.motion_steps * reconstruct::average::STEP_PX {
        view.leave_out(LeftOut::Moved { motion_px: averaged.motion_px });
    }
    view.disparity = super::depth::in_color_camera(averaged, rig);
    Ok(view)
}
