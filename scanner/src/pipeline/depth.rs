//! Third stage: the depth is corrected by the board's own pixels. Also brings unregistered depth into the colour camera.

use rayon::prelude::*;
use reconstruct::average::DisparityMap;
use reconstruct::board::KnownBoard;
use reconstruct::calibrate::{self, BoardSample, CalibrationPrior, DepthCalibration};
use reconstruct::depth_to_color;
use reconstruct::image::GrayImage;
use reconstruct::pose::Pose;
use reconstruct::recording::Rig;
use reconstruct::segment::convex_hull;

use super::load::{View, Work};
use crate::config::Config;

/// White paper around a tag belongs to the board as far as this many times the tag's half side.
const TAG_SURROUNDINGS: f64 = 1.35;
/// No sensor errs by more than this part of the distance.
pub(super) const MOST_OFF: f64 = 0.08;
/// In the second pass, pixels whose disparity is off by less than this are taken for the board.
const SECOND_GATE_PX: f64 = 0.25;

/// The depth in the colour camera's geometry; unchanged where it is registered already.
pub fn in_color_camera(map: DisparityMap, rig: &Rig) -> DisparityMap {
    if !depth_to_color::is_needed(rig) {
        return map;
    }
    let metres: Vec<f32> = (0..map.disparity_px.len()).map(|i| map.metres(i)).collect();
    let moved = depth_to_color::Registration::new(rig).register(&metres);
    let focal_baseline = rig.color.fx * reconstruct::average::BASELINE_METRES;
    let disparity = |z: &f32| if *z > 0.0 { (focal_baseline / f64::from(*z)) as f32 } else { 0.0 };
    DisparityMap {
        width: rig.color.width as usize,
        height: rig.color.height as usize,
        disparity_px: moved.iter().map(disparity).collect(),
        focal_baseline,
        motion_px: map.motion_px,
    }
}

/// Fits the calibration to the board's pixels of all views and corrects every view.
pub fn calibrate(scan: &mut Work, config: &Config) {
    if scan.board.is_none() {
        return;
    }
    let prior = config.depth_prior.unwrap_or_else(CalibrationPrior::of_any_kinect);
    let (width, height) = (scan.rig.color.width as usize, scan.rig.color.height as usize);
    let samples = board_samples(scan, &prior);
    let calibration = calibrate::fit(&samples.concat(), width, height, &prior);
    scan.views.par_iter_mut().zip(samples).for_each(|(view, mut samples)| {
        calibration.apply(&mut view.disparity);
        calibration.apply_to_samples(&mut samples);
        view.board_samples = samples;
    });
    warn_of_scale(scan, &calibration, &prior);
    scan.calibration = calibration;
}

/// White pixels of the board, in the order of the views; none in views that are not placed on it.
pub fn board_samples(scan: &Work, prior: &CalibrationPrior) -> Vec<Vec<BoardSample>> {
    let Some(board) = &scan.board else { return vec![Vec::new(); scan.views.len()] };
    let (width, height) = (scan.rig.color.width as usize, scan.rig.color.height as usize);
    let placed = |v: &View| v.is_used() && v.world_from_camera.is_some();
    let of_views = |of_view: &(dyn Fn(&View) -> Vec<BoardSample> + Sync)| -> Vec<Vec<BoardSample>> {
        scan.views.par_iter().map(|v| if placed(v) { of_view(v) } else { Vec::new() }).collect()
    };
    let near_tags = of_views(&|v| samples_near_tags(v, board, &scan.rig));
    // The table under loose sheets need not be where the sheets are, so only they count.
    if scan.loose_sheets {
        return near_tags;
    }
    let first = calibrate::fit(&near_tags.concat(), width, height, prior);
    if first.samples == 0 {
        return near_tags;
    }
    let more = of_views(&|v| samples_on_board(v, board, &scan.rig, &first));
    near_tags.into_iter().zip(more).map(|(near, more)| [near, more].concat()).collect()
}

/// Without a board, what the sensor's own calibration says is all that is known.
pub fn correct_as_calibrated(scan: &mut Work, config: &Config) {
    let Some(prior) = &config.depth_prior else { return };
    let (width, height) = (scan.rig.color.width as usize, scan.rig.color.height as usize);
    let calibration = DepthCalibration::from_prior(prior, width, height);
    scan.views.par_iter_mut().for_each(|v| calibration.apply(&mut v.disparity));
    scan.calibration = calibration;
}

/// Some Kinects' depth is off by more, but a printer that fits the sheet to its page makes it smaller by three to seven percent, and a look at
/// the ruler costs little.
const USUAL_SCALE: f64 = 0.025;
/// Of a calibrated sensor, so many standard deviations, and at least so much.
const CALIBRATED_SIGMAS: f64 = 3.0;
const CALIBRATED_SCALE: f64 = 0.01;

/// A scale that the sensor does not explain is as likely a board printed at the wrong size.
fn warn_of_scale(scan: &mut Work, calibration: &DepthCalibration, prior: &CalibrationPrior) {
    let off = calibration.depth_scale() * (1.0 + prior.coefficients[0]) - 1.0;
    let sensor = CALIBRATED_SIGMAS * prior.standard_deviations[0];
    if off.abs() > sensor.clamp(CALIBRATED_SCALE, USUAL_SCALE) {
        let percent = 100.0 * off;
        scan.warnings.push(format!(
            "depth and markers disagree by {percent:.1} %: check with a ruler that the line of 100 mm on the board is 100 mm long, \
             and print at 100 % otherwise"
        ));
    }
}

/// White pixels on and around the tags that were read.
fn samples_near_tags(view: &View, board: &KnownBoard, rig: &Rig) -> Vec<BoardSample> {
    let gray = view.color.to_gray();
    let (Some(world_from_camera), Some(marker_pose)) = (view.world_from_camera, view.marker_pose.as_ref())
    else {
        return Vec::new();
    };
    let mut samples = Vec::new();
    for tag in board.tags.iter().filter(|t| marker_pose.used.contains(&t.id)) {
        let centre: [f64; 3] = std::array::from_fn(|k| tag.corners_m.iter().map(|c| c[k]).sum::<f64>() / 4.0);
        let wider =
            tag.corners_m.map(|c| std::array::from_fn(|k| centre[k] + TAG_SURROUNDINGS * (c[k] - centre[k])));
        let Some(quad) = project_quad(&wider, &world_from_camera, rig) else { continue };
        let pixels = pixels_inside(&quad, gray.width, gray.height, 1);
        let white = white_level(&gray, &pixels);
        let clearly_white = pixels.into_iter().filter(|&p| is_white_around(&gray, p, white));
        samples.extend(clearly_white.filter_map(|p| sample(view, &world_from_camera, rig, p)));
    }
    samples
}

/// Pixels anywhere on the board that the first calibration puts near its plane and that are as white as paper.
fn samples_on_board(
    view: &View,
    board: &KnownBoard,
    rig: &Rig,
    first: &DepthCalibration,
) -> Vec<BoardSample> {
    let gray = view.color.to_gray();
    let Some(world_from_camera) = view.world_from_camera else { return Vec::new() };
    let corners: Vec<[f64; 2]> = board.tags.iter().flat_map(|t| t.corners_m).map(|c| [c[0], c[1]]).collect();
    let hull: Vec<[f64; 3]> = convex_hull(&corners).iter().map(|c| [c[0], c[1], 0.0]).collect();
    let Some(outline) = project_quad(&hull, &world_from_camera, rig) else { return Vec::new() };
    let pixels = pixels_inside(&outline, gray.width, gray.height, 2);
    let white = white_level(&gray, &pixels);
    pixels
        .into_iter()
        .filter(|&p| is_white_around(&gray, p, white))
        .filter_map(|p| sample(view, &world_from_camera, rig, p))
        .filter(|s| {
            let corrected =
                first.correct(f64::from(s.pixel[0]), f64::from(s.pixel[1]), f64::from(s.measured_px));
            (corrected - f64::from(s.expected_px)).abs() < SECOND_GATE_PX
        })
        .collect()
}

fn sample(view: &View, world_from_camera: &Pose, rig: &Rig, (u, v): (usize, usize)) -> Option<BoardSample> {
    let measured_px = view.disparity.disparity_px[v * view.disparity.width + u];
    if measured_px <= 0.0 {
        return None;
    }
    let pixel = [u as f64, v as f64];
    let expected =
        calibrate::board_disparity(&rig.color, world_from_camera, pixel, view.disparity.focal_baseline)?;
    // Something stands in front.
    if (f64::from(measured_px) / expected - 1.0).abs() > MOST_OFF {
        return None;
    }
    Some(BoardSample { pixel: [u as f32, v as f32], measured_px, expected_px: expected as f32 })
}

/// A polygon of the board in the picture; `None` where part of it is behind the camera.
fn project_quad(corners: &[[f64; 3]], world_from_camera: &Pose, rig: &Rig) -> Option<Vec<[f64; 2]>> {
    let camera_from_world = world_from_camera.inverse();
    corners
        .iter()
        .map(|c| rig.color.project(&(camera_from_world * nalgebra::Point3::from(*c))).map(|p| [p.x, p.y]))
        .collect()
}

/// Pixels inside a convex polygon of either orientation, every `stride`-th, two pixels off the image's border.
fn pixels_inside(polygon: &[[f64; 2]], width: usize, height: usize, stride: usize) -> Vec<(usize, usize)> {
    let range = |k: usize, limit: usize| {
        let (lo, hi) = polygon.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
        (lo.ceil().max(2.0) as usize)..(hi.floor().min(limit as f64 - 3.0) + 1.0).max(0.0) as usize
    };
    let inside = |x: f64, y: f64| {
        let turns = polygon.iter().zip(polygon.iter().cycle().skip(1));
        let mut signs = turns.map(|(a, b)| (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) > 0.0);
        let Some(first) = signs.next() else { return false };
        signs.all(|s| s == first)
    };
    let rows = range(1, height).step_by(stride);
    let pixels = rows.flat_map(|v| range(0, width).step_by(stride).map(move |u| (u, v)));
    pixels.filter(|&(u, v)| inside(u as f64, v as f64)).collect()
}

/// Grey level from which a pixel is paper: two thirds of the way from the dark to the bright tenth.
fn white_level(gray: &GrayImage, pixels: &[(usize, usize)]) -> u8 {
    let mut values: Vec<u8> = pixels.iter().map(|&(u, v)| gray.data[v * gray.width + u]).collect();
    if values.len() < 20 {
        return u8::MAX;
    }
    values.sort_unstable();
    let (dark, bright) = (f64::from(values[values.len() / 10]), f64::from(values[values.len() * 9 / 10]));
    (dark + (bright - dark) * 2.0 / 3.0) as u8
}

/// Whether the pixel and its surroundings are paper: black ink swallows infrared and smears depth at its edges.
fn is_white_around(gray: &GrayImage, (u, v): (usize, usize), white: u8) -> bool {
    let at =
        |du: isize, dv: isize| gray.data[v.wrapping_add_signed(dv) * gray.width + u.wrapping_add_signed(du)];
    [(0, 0), (2, 0), (-2, 0), (0, 2), (0, -2)].iter().all(|&(du, dv)| at(du, dv) >= white)
}
