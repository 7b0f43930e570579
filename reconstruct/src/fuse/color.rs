//! Colour of a smoothed point: the mean of the pixels beside it, of which those that show something else (a reflection, a hand) count
//! little.

use super::grid::Walk;
use super::samples::{Sample, dot};
use super::spot::Smoothed;

/// Pixels within this distance of a point colour it, metres.
pub(super) const REACH_METRES: f32 = 0.0025;
/// How far a colour may be from the others of its spot before it counts little, 8-bit steps.
const SPREAD: f32 = 25.0;

/// The colour of a point from the pixels around it; its own where there are none.
pub(super) fn color_at(
    at: &Smoothed,
    samples: &[Sample],
    near: &mut Walk<'_>,
    same_side_cosine: f32,
) -> [f32; 3] {
    let (mut sum, mut weights) = (at.color.map(|c| 1e-9 * c), 1e-9f32);
    near.around(&at.point, |i| {
        let s = &samples[i];
        let off: [f32; 3] = std::array::from_fn(|k| s.point[k] - at.point[k]);
        let closeness = 1.0 - dot(&off, &off) / (REACH_METRES * REACH_METRES);
        if closeness <= 0.0 || dot(&s.normal, &at.normal) < same_side_cosine {
            return;
        }
        let weight = trust(&s.color, &at.color) * s.weight * s.weight * closeness * closeness * closeness;
        for k in 0..3 {
            sum[k] += weight * s.color[k];
        }
        weights += weight;
    });
    sum.map(|c| c / weights)
}

/// Little for colours far from their spot's.
fn trust(color: &[f32; 3], of_spot: &[f32; 3]) -> f32 {
    let off: [f32; 3] = std::array::from_fn(|k| (color[k] - of_spot[k]) / SPREAD);
    1.0 / (1.0 + dot(&off, &off)).powi(2)
}
