//! Fifth stage: all views and the depth's correction are refined together, and views that do not fit are left out.

use rayon::prelude::*;
use reconstruct::calibrate::CalibrationPrior;
use reconstruct::consistency::agreement;
use reconstruct::refine::{Anchor, DepthModel, Luminance, RefineView, Refined, refine};
use reconstruct::report::{JointReport, LeftOut};
use reconstruct::view::DepthView;

use super::load::{View, Work};
use crate::config::Config;

/// Refines, looks for the views that fit worst, leaves them out, and starts again until all fit.
pub fn refine_together(scan: &mut Work, config: &Config) {
    let pictures: Vec<Option<Luminance>> = scan
        .views
        .par_iter()
        .map(|v| (config.refine.use_color && v.geometry.is_some()).then(|| Luminance::of(&v.color)))
        .collect();
    let expected = config.depth_prior.unwrap_or_else(CalibrationPrior::of_any_kinect);
    loop {
        let used: Vec<usize> =
            (0..scan.views.len()).filter(|&i| as_refined(&scan.views[i], None).is_some()).collect();
        let Some(&first) = used.first() else { return };
        let views: Vec<RefineView<'_>> =
            used.iter().filter_map(|&i| as_refined(&scan.views[i], pictures[i].as_ref())).collect();
        let calibrated = scan.board.is_some() && scan.calibration.samples > 0;
        let focal_baseline = scan.views[first].disparity.focal_baseline;
        let depth = calibrated.then(|| DepthModel::new(&scan.calibration, &expected, focal_baseline));
        let refined = refine(&views, depth.as_ref(), &config.refine);
        let geometry: Vec<&DepthView> = views.iter().map(|v| v.geometry).collect();
        let agreement = agreement(&geometry, &refined.world_from_camera, &config.consistency);
        let outsiders = agreement.outsiders(&config.consistency);
        for (&i, &fit) in used.iter().zip(&agreement.views) {
            scan.views[i].fit = Some(fit);
        }
        if outsiders.is_empty() {
            return take_over(scan, &used, &refined);
        }
        for outsider in outsiders {
            scan.views[used[outsider.view]].leave_out(LeftOut::DoesNotFit { conflict: outsider.conflict });
        }
    }
}

/// A view as the refinement takes it; `None` where it takes no part.
fn as_refined<'a>(view: &'a View, luminance: Option<&'a Luminance>) -> Option<RefineView<'a>> {
    if !view.is_used() {
        return None;
    }
    let anchor = match (&view.prior, &view.marker_pose) {
        (Some(prior), _) => Anchor::Prior(prior),
        (None, Some(pose)) => Anchor::Corners(&pose.corners),
        (None, None) => return None,
    };
    Some(RefineView {
        geometry: view.geometry.as_ref()?,
        luminance,
        start: view.world_from_camera?,
        anchor,
        board: &view.board_samples,
    })
}

/// Poses, depth correction and what is known of both go into the scan.
fn take_over(scan: &mut Work, used: &[usize], refined: &Refined) {
    take_poses(scan, used, refined, refined.board_samples);
    let Some(step) = &refined.depth else { return };
    let focal_baseline = scan.views[used[0]].disparity.focal_baseline;
    scan.calibration = scan.calibration.then(&step.coefficients);
    scan.calibration.standard_deviations = step.standard_deviations;
    let step = scan.calibration.only(&step.coefficients);
    scan.views.par_iter_mut().filter(|v| v.is_used()).for_each(|view| {
        if let Some(geometry) = view.geometry.as_mut() {
            geometry.correct(focal_baseline, |u, v, disparity| step.correct(u, v, disparity));
        }
    });
}

/// Poses and what is known of them; `board_samples`: board pixels that held them.
pub(super) fn take_poses(scan: &mut Work, used: &[usize], refined: &Refined, board_samples: usize) {
    for (k, &i) in used.iter().enumerate() {
        scan.views[i].world_from_camera = Some(refined.world_from_camera[k]);
        scan.views[i].pose_sd = Some(refined.standard_deviation(k));
        scan.views[i].loosest_by_surface_metres = Some(refined.loosest_by_surface_metres[k]);
    }
    scan.joint = Some(JointReport {
        rounds: refined.rounds,
        surface_pairs: refined.pairs.iter().filter(|p| p.inliers > 0).count(),
        color_pairs: refined.pairs.iter().filter(|p| p.color_inliers > 0).count(),
        board_samples,
        corners: used
            .iter()
            .filter_map(|&i| scan.views[i].marker_pose.as_ref())
            .map(|p| p.corners.len())
            .sum(),
    });
}
