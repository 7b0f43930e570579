//! Whether the product may go on beyond where its points end: space that no view saw to be free may hold more of it.

use nalgebra::{Point3, Vector3};

use super::{Dimensions, Measured};
use crate::fuse::PlacedView;
use crate::mesh::Mesh;

/// Points within this depth below an end are its slice, metres.
const SLICE_METRES: f64 = 0.004;
/// Points of a slice that are looked at, evenly taken.
const MOST_PROBES: usize = 60;
/// Space beyond a point is looked at from here on, in steps, up to there, metres.
const FIRST_METRES: f64 = 0.004;
const STEP_METRES: f64 = 0.002;
const LAST_METRES: f64 = 0.2;
/// A view sees through a place if it sees so much farther, metres.
const THROUGH_METRES: f64 = 0.004;

/// How much longer, wider and higher than measured the product may be at least, metres: beyond a quarter of an end lies space that no view
/// saw. Parts that nothing measured borders on may reach farther still.
pub fn unseen_beyond(mesh: &Mesh, size: &Dimensions, views: &[PlacedView]) -> [f64; 3] {
    let points = Measured::of(mesh);
    std::array::from_fn(|k| {
        let ends = [1.0, -1.0].map(|sign| Vector3::from(size.directions[k]) * sign);
        // What it stands on is known.
        let ends = ends.iter().filter(|d| k < 2 || !size.stands_on_floor || d.z > 0.0);
        ends.map(|direction| beyond(&points, direction, views)).sum()
    })
}

fn beyond(points: &Measured, direction: &Vector3<f64>, views: &[PlacedView]) -> f64 {
    let along = points.along((*direction).into());
    let Some(at) = super::edge::outermost(&along) else { return 0.0 };
    let in_slice: Vec<usize> =
        (0..along.len()).filter(|&i| f64::from(at - along[i]) < SLICE_METRES).collect();
    let stride = in_slice.len().div_ceil(MOST_PROBES).max(1);
    let mut unseen: Vec<f64> = in_slice
        .iter()
        .step_by(stride)
        .map(|&i| {
            let place = Vector3::from(points.places[i]).cast::<f64>();
            let to_end = f64::from(at - along[i]);
            unseen_from(&(place + direction * to_end), direction, views)
        })
        .collect();
    unseen.sort_unstable_by(f64::total_cmp);
    unseen.get(unseen.len() * 3 / 4).copied().unwrap_or(0.0)
}

/// From a place outwards, how far it is to the first place that a view sees to be free; 0 where that is the first one looked at.
fn unseen_from(place: &Vector3<f64>, direction: &Vector3<f64>, views: &[PlacedView]) -> f64 {
    let is_free = |at: &Point3<f64>| {
        views.iter().any(|view| {
            let in_camera = view.world_from_camera.inverse_transform_point(at);
            view.geometry.nearest_gap(&in_camera).is_some_and(|gap| gap > THROUGH_METRES)
        })
    };
    let mut metres = FIRST_METRES;
    while metres < LAST_METRES && !is_free(&Point3::from(place + direction * metres)) {
        metres += STEP_METRES;
    }
    if metres > FIRST_METRES { metres } else { 0.0 }
}
