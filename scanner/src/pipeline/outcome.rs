//! Last stage: the result is measured and judged in words.

use reconstruct::measure::{Dimensions, dimensions, unseen_beyond};
use reconstruct::mesh::Mesh;
use reconstruct::pose;
use reconstruct::report::surface::{SurfaceReport, describe, underside_measured_percent};
use reconstruct::report::{CalibrationReport, Report, Verdict, ViewReport, half_contradict};
use reconstruct::surface::{HoleKind, Surface};
use serde_json::{Map, Value};

use super::load::{View, Work};
use crate::config::Config;
use crate::report_words::hole_in_words;

/// Fewer points are no model.
const MIN_POINTS: usize = 500;
/// Smaller unseen places are in the report, but no reason to warn, square metres.
const WORTH_A_WARNING_M2: f64 = 3e-4;
/// Most unseen places that are warned of.
const MOST_HOLE_WARNINGS: usize = 3;
/// Relative uncertainty of the printed board: paper and printer.
const PRINT_SCALE_SD: f64 = 0.0015;

/// Measures the model and writes the report; a scan that cannot be right comes back without points. `seen_from_below`: some views show what
/// the product stands on in the others.
pub fn judge(
    scan: &Work,
    surface: Surface,
    seen_from_below: bool,
    config: &Config,
    timings_ms: Map<String, Value>,
) -> (Mesh, Report) {
    let mut warnings = scan.warnings.clone();
    let failure = scan.failure.clone().or_else(|| no_agreement(scan)).or_else(|| too_little(&surface.mesh));
    let surface = if failure.is_some() { Surface::default() } else { surface };
    let cloud = surface.mesh.measured();
    let scale_sd = scale_sd(scan.calibration.standard_deviations[0]);
    let mut size = dimensions(&surface.mesh, scale_sd, scan.ground.up_is_known());
    warnings.extend(size.as_mut().and_then(|size| allow_for_unseen(size, &surface.mesh, scan)));
    let left_out = scan.views.iter().filter(|v| !v.is_used()).count();
    if failure.is_none() {
        warnings.extend(
            scan.views.iter().filter_map(|v| v.left_out.as_ref().map(|r| format!("view {}: {r}", v.name))),
        );
    }
    warnings.extend(size.as_ref().and_then(implausible_size));
    let (verdict, verdict_reason) = match failure {
        Some(why) => (Verdict::Poor, why),
        None => verdict(scan, left_out),
    };
    let mut report = Report {
        version: 1,
        views: scan.views.iter().map(view_report).collect(),
        recordings: Vec::new(),
        points: cloud.len(),
        dimensions_m: size.map(|s| s.metres.map(|v| round(v, 1e5))),
        dimensions_uncertainty_m: size.map(|s| s.uncertainty_metres.map(|v| round(v, 1e5))),
        surface: (!surface.mesh.triangles.is_empty()).then(|| SurfaceReport {
            underside_measured_percent: underside_measured_percent(&surface).filter(|_| seen_from_below),
            ..describe(&surface)
        }),
        ground: scan.ground,
        joint: scan.joint,
        depth_calibration: calibration_report(scan, config),
        warnings,
        verdict,
        verdict_reason,
        timings_ms,
        software: env!("CARGO_PKG_VERSION").to_owned(),
        source_chain: None,
    };
    let unseen =
        surface.holes.iter().filter(|h| h.kind == HoleKind::Unseen && h.area_m2 > WORTH_A_WARNING_M2);
    let in_words: Vec<String> = unseen.take(MOST_HOLE_WARNINGS).map(|h| hole_in_words(h, &report)).collect();
    report.warnings.extend(in_words);
    (surface.mesh, report)
}

/// The report of a model of which only this is left; holes that were cut by hand are nobody's news.
pub fn measured_again(report: &Report, model: &Mesh) -> Report {
    let cloud = model.measured();
    let surface = |holes| describe(&Surface { mesh: model.clone(), holes });
    // What no view saw stays unseen, whatever is cut off elsewhere.
    let before = report.dimensions_uncertainty_m.unwrap_or_default();
    let unsure_as_before = |now: [f64; 3]| std::array::from_fn(|k| f64::max(now[k], before[k]));
    let size = dimensions(model, scale_sd(report.depth_calibration.scale_sd), report.ground.up_is_known());
    Report {
        points: cloud.len(),
        dimensions_m: size.map(|s| s.metres.map(|v| round(v, 1e5))),
        dimensions_uncertainty_m: size
            .map(|s| s.uncertainty_metres.map(|v| round(v, 1e5)))
            .map(unsure_as_before),
        surface: report.surface.as_ref().map(|s| surface(s.holes.clone())),
        ..report.clone()
    }
}

/// Relative standard deviation of the model's scale, from that of the depth calibration.
fn scale_sd(calibration_sd: f64) -> f64 {
    (calibration_sd.min(0.01).powi(2) + PRINT_SCALE_SD.powi(2)).sqrt()
}

/// Where half of the views contradict the others, nobody can tell which to believe.
fn no_agreement(scan: &Work) -> Option<String> {
    let why = "the views do not fit together: the product or a marker sheet was moved between them; scan again without touching either";
    half_contradict(scan.views.iter().map(|v| v.left_out.as_ref())).then(|| why.to_owned())
}

fn too_little(model: &Mesh) -> Option<String> {
    let why = "hardly any surface was measured: dark, shiny and transparent things give no depth; try more light, a nearer camera (0.6 to 0.9 m) or a dusting of powder";
    (model.vertices.len() < MIN_POINTS).then(|| why.to_owned())
}

/// Where the product may go on unseen, its size may be larger by that much, at least. Where nothing stands around it, views that look past it
/// have no depth to tell so.
fn allow_for_unseen(size: &mut Dimensions, model: &Mesh, scan: &Work) -> Option<String> {
    if !scan.ground.up_is_known() {
        return None;
    }
    let unseen = unseen_beyond(model, size, &scan.placed_views());
    for (uncertainty, beyond) in size.uncertainty_metres.iter_mut().zip(unseen) {
        *uncertainty += beyond;
    }
    let named = ["length", "width", "height"].into_iter().zip(unseen).filter(|(_, beyond)| *beyond > 0.0);
    let larger: Vec<String> =
        named.map(|(name, beyond)| format!("the {name} by {:.0} mm or more", beyond * 1000.0)).collect();
    (!larger.is_empty()).then(|| {
        format!(
            "not every end of the product was seen, so it may be larger than measured: {}; another view from there would show it",
            larger.join(", ")
        )
    })
}

fn implausible_size(size: &Dimensions) -> Option<String> {
    let longest = size.metres[0].max(size.metres[2]);
    (longest > 1.0).then(|| {
        format!("the product seems to be {longest:.1} m long: check units_per_metre of the recording")
    })
}

fn verdict(scan: &Work, left_out: usize) -> (Verdict, String) {
    let used = scan.views.len() - left_out;
    let mut tags: Vec<usize> = scan.views.iter().filter(|v| v.is_used()).map(tags_of).collect();
    tags.sort_unstable();
    let few_tags = scan.board.is_some() && tags.first().is_some_and(|&t| t < 4);
    match (used, left_out, few_tags) {
        (0..=2, _, _) => {
            (Verdict::Acceptable, format!("only {used} views were used, so much of the product is unseen"))
        }
        (_, 0, false) => (Verdict::Good, "all views fit together".to_owned()),
        (_, 0, true) => (
            Verdict::Acceptable,
            "some views show fewer than four markers, so the model may be off by a millimetre or two"
                .to_owned(),
        ),
        _ if left_out * 3 > scan.views.len() => {
            (Verdict::Acceptable, format!("{left_out} of {} views had to be left out", scan.views.len()))
        }
        _ => (Verdict::Good, format!("{used} views fit together; {left_out} left out")),
    }
}

fn tags_of(view: &View) -> usize {
    view.marker_pose.as_ref().map_or(0, |p| p.used.len())
}

fn view_report(view: &View) -> ViewReport {
    ViewReport {
        name: view.name.clone(),
        used: view.is_used() && view.world_from_camera.is_some(),
        world_from_camera: view.world_from_camera.as_ref().map(pose::to_row_major),
        tags: tags_of(view),
        reprojection_px: view.marker_pose.as_ref().map(|p| round(p.reprojection_px, 1e3)),
        pose_sd_mm: view.pose_sd.map(|sd| round(sd.0 * 1000.0, 1e3)),
        pose_sd_degrees: view.pose_sd.map(|sd| round(sd.1.to_degrees(), 1e4)),
        loosest_by_surface_mm: view
            .loosest_by_surface_metres
            .filter(|m| m.is_finite())
            .map(|m| round(m * 1000.0, 1e3)),
        inlier_rmse_mm: view.fit.map(|f| round(f.inlier_rmse_metres * 1000.0, 1e3)),
        conflict_percent: view.fit.and_then(|f| f.conflict).map(|c| round(c * 100.0, 1e2)),
        reason: view.left_out.as_ref().map(ToString::to_string),
    }
}

fn calibration_report(scan: &Work, config: &Config) -> CalibrationReport {
    let c = &scan.calibration;
    CalibrationReport {
        scale: round(c.depth_scale(), 1e5),
        scale_sd: round(c.standard_deviations[0], 1e5),
        board_error_before_mm: round(c.error_metres[0] * 1000.0, 1e3),
        board_error_after_mm: round(c.error_metres[1] * 1000.0, 1e3),
        samples: c.samples,
        of_this_sensor: config.depth_prior.is_some(),
    }
}

fn round(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps
}
