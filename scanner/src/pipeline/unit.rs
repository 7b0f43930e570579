//! Depth in another unit than written shows at the markers: their distance is known twice, by their size and by depth.

use nalgebra::Point3;
use reconstruct::board::KnownBoard;

use super::load::{View, Work};

/// No sensor errs by more than this part of the distance; the calibration does not look farther either.
const MAX_RELATIVE_ERROR: f64 = super::depth::MOST_OFF;
/// Fewer markers with depth say nothing.
const MIN_MARKERS: usize = 6;

/// Where depth and markers contradict each other in the middle of all sightings, there can be no scan.
pub fn compare_with_markers(scan: &mut Work, board: &KnownBoard) {
    let mut ratios: Vec<f64> = scan
        .views
        .iter()
        .filter(|v| v.is_used())
        .flat_map(|v| depth_to_marker_ratios(v, board, scan))
        .collect();
    if ratios.len() < MIN_MARKERS {
        return;
    }
    let middle = ratios.len() / 2;
    let ratio = *ratios.select_nth_unstable_by(middle, f64::total_cmp).1;
    if (ratio - 1.0).abs() <= MAX_RELATIVE_ERROR {
        return;
    }
    scan.failure.get_or_insert_with(|| {
        format!(
            "the depth images put the board {ratio:.2} times as far away as its markers do: if depth is in another unit, correct \
             units_per_metre in recording.json (multiply it by {ratio:.2}; 1000 is millimetres); otherwise check that the board \
             was printed at 100 %"
        )
    });
}

/// Measured over expected distance along the optical axis, just outside a corner of every marker that places a view.
fn depth_to_marker_ratios(view: &View, board: &KnownBoard, scan: &Work) -> Vec<f64> {
    let (Some(world_from_camera), Some(marker_pose)) = (view.world_from_camera, view.marker_pose.as_ref())
    else {
        return Vec::new();
    };
    let camera_from_world = world_from_camera.inverse();
    let ratio = |corners: &[[f64; 3]; 4]| {
        let centre: [f64; 3] = std::array::from_fn(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 4.0);
        // Beside the tag, where the paper is white: black ink swallows infrared.
        let white = Point3::from(std::array::from_fn(|k| centre[k] + 1.15 * (corners[0][k] - centre[k])));
        let in_camera = camera_from_world * white;
        let pixel = scan.rig.color.project(&in_camera)?;
        let (u, v) = (pixel.x.round(), pixel.y.round());
        let map = &view.disparity;
        if u < 0.0 || v < 0.0 || u >= map.width as f64 || v >= map.height as f64 {
            return None;
        }
        let metres = map.metres(v as usize * map.width + u as usize);
        (metres > 0.0).then(|| f64::from(metres) / in_camera.z)
    };
    let used = board.tags.iter().filter(|tag| marker_pose.used.contains(&tag.id));
    used.filter_map(|tag| ratio(&tag.corners_m)).collect()
}
