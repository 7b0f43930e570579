//! A report in words: size, surface, what is missing and where, views, calibration.
//!
//! Places are told as somebody would who stands where the first used view was taken: its side of the product is the front.

use std::fmt::Write as _;

use reconstruct::report::recordings::RecordingReport;
use reconstruct::report::surface::SurfaceReport;
use reconstruct::report::{Ground, Report, Verdict, ViewReport};
use reconstruct::surface::{Hole, HoleKind};

/// Views that the surfaces leave looser than this are held by something else, millimetres.
const LOOSE_MM: f64 = 1.0;
/// A place faces a view from this cosine between its direction and that to the camera on.
const FACES_VIEW: f64 = 0.3;
/// Most holes that are named.
const MOST_HOLES: usize = 8;

/// The whole report for people.
pub fn in_words(report: &Report) -> String {
    let mut text = format!("{}: {}\n", verdict(report.verdict), report.verdict_reason);
    if let (Some(size), Some(off)) = (report.dimensions_m, report.dimensions_uncertainty_m) {
        text.push_str("\nSize, with what it may be off (95 %)\n");
        for (name, i) in [("length", 0), ("width", 1), ("height", 2)] {
            let _ = writeln!(text, "  {name:<8}{:>8.1} ± {:.1} mm", size[i] * 1000.0, off[i] * 1000.0);
        }
    }
    if let Some(surface) = &report.surface {
        text.push_str(&surface_in_words(surface, report));
    }
    text.push_str(&recordings_in_words(&report.recordings));
    text.push_str(&views_in_words(&report.views));
    text.push_str(&looseness_in_words(&report.views));
    text.push_str(&calibration_in_words(report));
    if !report.warnings.is_empty() {
        text.push_str("\nTo know\n");
        for warning in &report.warnings {
            let _ = writeln!(text, "  {warning}");
        }
    }
    let total: f64 = report.timings_ms.values().filter_map(serde_json::Value::as_f64).sum();
    let _ = write!(text, "\nBuilt in {:.1} s by scan-product {}", total / 1000.0, report.software);
    text
}

fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "Good scan",
        Verdict::Acceptable => "Acceptable scan",
        Verdict::Poor => "Poor scan",
    }
}

fn surface_in_words(surface: &SurfaceReport, report: &Report) -> String {
    let mut text = String::from("\nSurface\n");
    let cm2 = |m2: f64| m2 * 1e4;
    let _ = writeln!(
        text,
        "  measured    {:>8.1} cm², {:.0} points a square centimetre, each ± {:.2} mm (95 % of them within ± {:.2} mm)",
        cm2(surface.measured_m2),
        surface.points_per_cm2,
        2.0 * surface.deviation_mm[0],
        2.0 * surface.deviation_mm[1],
    );
    let _ = writeln!(
        text,
        "  invented    {:>8.1} cm²: {}small gaps, shown striped",
        cm2(surface.invented_m2),
        if surface.underside_measured_percent.is_some() { "" } else { "the underside and " }
    );
    if let Some(percent) = surface.underside_measured_percent {
        let _ = writeln!(text, "  underside   {percent:>8.1} % measured");
    }
    let _ = writeln!(text, "  coverage    {:>8.1} % of what can be seen of it", surface.coverage_percent);
    let closed = if surface.watertight { "closed everywhere" } else { "open where nothing was seen" };
    let _ = writeln!(text, "  {} triangles, {closed}", surface.triangles);
    let open: Vec<&Hole> = surface.holes.iter().filter(|h| h.kind != HoleKind::Base).collect();
    if !open.is_empty() {
        text.push_str("\nNot measured\n");
    }
    for hole in open.iter().take(MOST_HOLES) {
        let _ = writeln!(text, "  {}", hole_in_words(hole, report));
    }
    if open.len() > MOST_HOLES {
        let _ = writeln!(text, "  and {} smaller places", open.len() - MOST_HOLES);
    }
    text
}

/// Says where the surfaces alone would let the views slide, and what holds them then.
fn looseness_in_words(views: &[ViewReport]) -> String {
    let mut loose: Vec<f64> =
        views.iter().filter(|v| v.used).filter_map(|v| v.loosest_by_surface_mm).collect();
    loose.sort_by(f64::total_cmp);
    match loose.get(loose.len() / 2) {
        Some(&middle) if middle > LOOSE_MM => format!(
            "  The product is so round or so flat that its surface alone would let the views slide by {middle:.1} mm: markers and colours hold them.\n"
        ),
        _ => String::new(),
    }
}

/// What and where a hole is, and what to do about it.
pub fn hole_in_words(hole: &Hole, report: &Report) -> String {
    let above = |ground: &str| {
        let height = hole.center_m[2] * 1000.0;
        format!("{}, {height:.0} mm above the {ground}", direction(hole.facing, front_of(report)))
    };
    let where_it_is = match report.ground {
        Ground::Board => above("board"),
        Ground::Table => above("table"),
        Ground::Unknown => beside_view(hole, &report.views),
    };
    let place = format!("{:.1} cm² {where_it_is}", hole.area_m2 * 1e4);
    let turned_over = report.surface.as_ref().is_some_and(|s| s.underside_measured_percent.is_some());
    match hole.kind {
        HoleKind::Closed => format!("{place}: closed by guess"),
        HoleKind::Base => format!("{place}: the side it stands on, closed by guess"),
        HoleKind::Opening => format!("{place}: an opening, or an inside that no view reaches"),
        HoleKind::Unseen if report.ground.up_is_known() && !turned_over && hole.facing[2] < -0.5 => {
            format!("{place}: never seen, with the side it stands on")
        }
        HoleKind::Unseen => format!("{place}: never seen; another view from there would show it"),
    }
}

/// Where nobody knows what is up, a place is told by the view that looks at it most squarely.
fn beside_view(hole: &Hole, views: &[ViewReport]) -> String {
    let squareness = |view: &ViewReport| {
        let camera = view.world_from_camera?;
        let to_camera = [camera[3], camera[7], camera[11]];
        let to_camera: [f64; 3] = std::array::from_fn(|k| to_camera[k] - hole.center_m[k]);
        let dot = |a: &[f64; 3], b: &[f64; 3]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        Some(dot(&to_camera, &hole.facing) / dot(&to_camera, &to_camera).sqrt().max(1e-9))
    };
    let used = views.iter().filter(|v| v.used).filter_map(|v| Some((squareness(v)?, v)));
    match used.max_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((square, view)) if square > FACES_VIEW => format!("on the side of view {}", view.name),
        _ => "on a side that no view faces".to_owned(),
    }
}

/// Direction from the product to the first used view seen from above, radians.
fn front_of(report: &Report) -> f64 {
    let first = report.views.iter().find(|v| v.used).and_then(|v| v.world_from_camera);
    first.map_or(0.0, |m| m[7].atan2(m[3]))
}

/// A direction in words, the front being the side of the first view.
fn direction(facing: [f64; 3], front: f64) -> String {
    let flat = facing[0].hypot(facing[1]);
    let height = facing[2].atan2(flat).to_degrees();
    if height > 60.0 {
        return "on top".to_owned();
    }
    if height < -60.0 {
        return "underneath".to_owned();
    }
    // Seen from above, angles grow against the clock: from the front that is to the right hand.
    let turn = (facing[1].atan2(facing[0]) - front).rem_euclid(std::f64::consts::TAU);
    let sides = [
        "in front",
        "front right",
        "on the right",
        "back right",
        "at the back",
        "back left",
        "on the left",
        "front left",
    ];
    let side = sides[(turn / std::f64::consts::FRAC_PI_4).round() as usize % 8];
    match height {
        h if h > 25.0 => format!("{side}, facing up"),
        h if h < -25.0 => format!("{side}, facing down"),
        _ => side.to_owned(),
    }
}

/// How the recordings belong together, where there are several.
fn recordings_in_words(recordings: &[RecordingReport]) -> String {
    let mut text = String::new();
    for (number, recording) in (1..).zip(recordings) {
        text.push_str(if number == 1 { "\nRecordings\n" } else { "" });
        let _ = write!(text, "  {number}: {} views", recording.views);
        let _ = match (&recording.joined, number) {
            (_, 1) => writeln!(text, ", its board is the ground"),
            (Some(j), _) => writeln!(
                text,
                ", joined by {:.0} % of common surface, {:.2} mm apart, {:.0} % ahead of the next best way",
                j.overlap_percent, j.surface_mm, j.lead_percent
            ),
            (None, _) => writeln!(text, ", not joined"),
        };
    }
    text
}

fn views_in_words(views: &[ViewReport]) -> String {
    let mut text = format!("\nViews: {} of {} used\n", views.iter().filter(|v| v.used).count(), views.len());
    for view in views {
        let _ = write!(text, "  {:<6}", view.name);
        if let Some(reason) = &view.reason {
            let _ = writeln!(text, "left out: {reason}");
            continue;
        }
        let _ = write!(text, "{:>3} markers", view.tags);
        if let Some(pixels) = view.reprojection_px {
            let _ = write!(text, ", corners {pixels:.2} px");
        }
        if let Some(mm) = view.pose_sd_mm {
            let _ = write!(text, ", placed to ± {:.2} mm", 2.0 * mm);
        }
        if let Some(mm) = view.inlier_rmse_mm {
            let _ = write!(text, ", {mm:.2} mm to the other views");
        }
        text.push('\n');
    }
    text
}

fn calibration_in_words(report: &Report) -> String {
    let c = &report.depth_calibration;
    if c.samples == 0 {
        return "\nDepth was not calibrated: no board was seen\n".to_owned();
    }
    format!(
        "\nDepth calibrated on the board: the sensor read {:+.2} % ({:+.1} mm off before, {:+.1} mm after, {} pixels)\n",
        (1.0 / c.scale - 1.0) * 100.0,
        c.board_error_before_mm,
        c.board_error_after_mm,
        c.samples
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(name: &str, camera: [f64; 3]) -> ViewReport {
        let mut pose = [0.0; 16];
        (pose[3], pose[7], pose[11]) = camera.into();
        ViewReport {
            name: name.to_owned(),
            used: true,
            world_from_camera: Some(pose),
            tags: 5,
            reprojection_px: None,
            pose_sd_mm: None,
            pose_sd_degrees: None,
            loosest_by_surface_mm: None,
            inlier_rmse_mm: None,
            conflict_percent: None,
            reason: None,
        }
    }

    #[test]
    fn without_ground_a_hole_is_told_by_the_view_it_faces_and_nothing_is_said_of_its_foot() {
        let down = Hole {
            kind: HoleKind::Unseen,
            center_m: [0.0, 0.0, 0.01],
            facing: [0.0, 0.0, -1.0],
            rim_m: 0.1,
            area_m2: 4e-4,
        };
        let of = |ground: Ground, views: Vec<ViewReport>| {
            hole_in_words(&down, &Report { views, ground, ..empty() })
        };
        for (ground, name) in [(Ground::Board, "board"), (Ground::Table, "table")] {
            let standing = of(ground, vec![view("000", [0.5, 0.0, 0.5])]);
            let expected =
                format!("4.0 cm² underneath, 10 mm above the {name}: never seen, with the side it stands on");
            assert_eq!(standing, expected);
        }
        let below = of(Ground::Unknown, vec![view("000", [0.5, 0.0, 0.5]), view("001", [0.1, 0.0, -0.6])]);
        assert_eq!(
            below,
            "4.0 cm² on the side of view 001: never seen; another view from there would show it"
        );
        let nobody = of(Ground::Unknown, vec![view("000", [0.5, 0.0, 0.5])]);
        assert!(nobody.starts_with("4.0 cm² on a side that no view faces: never seen"), "{nobody}");
    }

    fn empty() -> Report {
        Report {
            version: 1,
            views: Vec::new(),
            points: 0,
            dimensions_m: None,
            dimensions_uncertainty_m: None,
            recordings: Vec::new(),
            surface: None,
            ground: Ground::Unknown,
            joint: None,
            depth_calibration: reconstruct::report::CalibrationReport::default(),
            warnings: Vec::new(),
            verdict: Verdict::Good,
            verdict_reason: String::new(),
            timings_ms: serde_json::Map::new(),
            software: String::new(),
            source_chain: None,
        }
    }

    #[test]
    fn directions_are_told_from_the_first_view() {
        let front = std::f64::consts::FRAC_PI_2;
        assert_eq!(direction([0.0, 1.0, 0.0], front), "in front");
        assert_eq!(direction([0.0, -1.0, 0.0], front), "at the back");
        // Whoever stands at +y and looks towards -y has -x on the right hand.
        assert_eq!(direction([-1.0, 0.0, 0.0], front), "on the right");
        assert_eq!(direction([0.1, 0.1, -0.9], front), "underneath");
        assert_eq!(direction([0.0, 0.7, 0.7], front), "in front, facing up");
    }
}
