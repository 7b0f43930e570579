//! The last refinement: all common surface, and the boards. What a product stands on in one recording is measured in the other, and
//! it touches the board.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::Pair;
use super::slide::{Weak, stacked};
use crate::pose::Pose;

const ROUNDS: usize = 10;
/// Standard deviation of a common point's distance, and of a foot's height above its board, metres.
const SURFACE_SD: f64 = 0.0005;
const FOOT_SD: f64 = 0.0003;
/// Standard deviation of where the paint puts it, metres.
const PAINT_SD: f64 = 0.00015;
/// Neighbouring points err alike: the common surface counts as this many independent points.
const INDEPENDENT: f64 = 150.0;
/// Feet farther off than this are none: what the product stands on was not measured, metres.
const FOOT_REACH: f64 = 0.0025;
/// Steps smaller than this are none, metres.
const SETTLED: f64 = 2e-6;

/// One measured distance that should be none.
pub(super) struct Row {
    /// A place that moves with the second recording, first recording's frame.
    pub place: Vector3<f64>,
    /// Direction in which the distance grows as the second recording moves.
    pub along: Vector3<f64>,
    /// The distance, metres.
    pub distance: f64,
}

/// Moves a placement to where surfaces and boards fit best; directions that the surfaces do not hold are held where the paint, if
/// there is any, put them.
pub(super) fn settled(pair: &Pair<'_>, weak: &Weak, start: &Pose) -> Pose {
    let painted = pair.judge.evidence(start).texture / PAINT_SD.powi(2);
    let mut moved = Vector6::<f64>::zeros();
    let mut pose = *start;
    for _ in 0..ROUNDS {
        let (mut normal, mut right) = (Matrix6::<f64>::identity() * 1e-3, Vector6::<f64>::zeros());
        let mut add = |row: &Row, weight: f64| {
            let j = stacked(&row.along, &((row.place - weak.middle.coords).cross(&row.along) / weak.radius));
            normal += weight * j * j.transpose();
            right -= weight * row.distance * j;
        };
        let surface = pair.judge.pairs(&pose);
        let worth = (INDEPENDENT / surface.len().max(1) as f64).min(1.0) / SURFACE_SD.powi(2);
        for row in &surface {
            add(row, worth * robust(row.distance, 2.0 * SURFACE_SD));
        }
        for row in pair.judge.feet(&pose).iter().filter(|row| row.distance.abs() < FOOT_REACH) {
            add(row, robust(row.distance, FOOT_REACH) / FOOT_SD.powi(2));
        }
        for direction in &weak.directions {
            normal += direction * direction.transpose() * painted;
            right -= direction * (direction.dot(&moved) * painted);
        }
        let Some(step) = normal.cholesky().map(|c| c.solve(&right)) else { break };
        pose = weak.moved(&pose, &step);
        moved += step;
        if step.amax() < SETTLED {
            break;
        }
    }
    pose
}

/// Geman–McClure.
fn robust(distance: f64, scale: f64) -> f64 {
    (1.0 / (1.0 + (distance / scale).powi(2))).powi(2)
}
