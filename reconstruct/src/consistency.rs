//! Do the views agree? A product that was knocked in one view stands elsewhere there, and so does its surface.
//!
//! For every pair of views (of many views, each with an even choice of the others), each point of one is held against the depth that the other sees in its direction (metres): it
//! agrees, it is hidden, or it contradicts, standing where the other view sees through. A view that contradicts most of
//! its neighbours in many points does not fit.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::pose::Pose;
use crate::view::DepthView;
use crate::witness::are_compared;

/// Settings of the check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConsistencyConfig {
    /// Gaps up to this are noise, metres.
    pub noise_metres: f64,
    /// A pair needs this many common points to be judged.
    pub min_common: usize,
    /// A view with a larger share of contradicting points does not fit ...
    pub max_conflict: f64,
    /// ... if that is also this many times the middle of all views.
    pub max_ratio: f64,
    /// Points looked at a view.
    pub samples: usize,
}

impl Default for ConsistencyConfig {
    fn default() -> Self {
        Self { noise_metres: 0.005, min_common: 150, max_conflict: 0.06, max_ratio: 3.0, samples: 2500 }
    }
}

/// How one view agrees with the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewFit {
    /// Middle share of points that contradict a neighbour; `None` where no neighbour shares enough surface.
    pub conflict: Option<f64>,
    /// Root mean square distance to the neighbours' surfaces where they agree, metres.
    pub inlier_rmse_metres: f64,
    /// Neighbours compared with.
    pub neighbours: usize,
}

/// What the points of one view meet in another.
#[derive(Debug, Clone, Default)]
struct Meeting {
    agree: usize,
    squares: f64,
    conflicts: usize,
}

impl Meeting {
    fn common(&self) -> usize {
        self.agree + self.conflicts
    }
}

/// Agreement of every view with the others, in the order of the views.
pub fn agreement(
    views: &[&DepthView],
    world_from_camera: &[Pose],
    config: &ConsistencyConfig,
) -> Vec<ViewFit> {
    let n = views.len();
    let samples: Vec<Vec<Sample>> = views.par_iter().map(|v| samples_of(v, config.samples)).collect();
    let one_way: Vec<Meeting> = (0..n * n)
        .into_par_iter()
        .map(|k| {
            let (i, j) = (k / n, k % n);
            if are_compared(i, j, n) {
                let target_from_source = world_from_camera[j].inverse() * world_from_camera[i];
                meet(&samples[i], views[j], &target_from_source, config)
            } else {
                Meeting::default()
            }
        })
        .collect();
    (0..n).map(|i| fit_of(i, n, &one_way, config)).collect()
}

/// Gathers what view `i` met in the others and the others in it.
fn fit_of(i: usize, n: usize, one_way: &[Meeting], config: &ConsistencyConfig) -> ViewFit {
    let mut shares = Vec::new();
    let (mut squares, mut agree) = (0.0, 0usize);
    for j in (0..n).filter(|&j| j != i) {
        let both = [&one_way[i * n + j], &one_way[j * n + i]];
        let common: usize = both.iter().map(|m| m.common()).sum();
        if common < config.min_common {
            continue;
        }
        let conflicts: usize = both.iter().map(|m| m.conflicts).sum();
        shares.push(conflicts as f64 / common as f64);
        squares += both.iter().map(|m| m.squares).sum::<f64>();
        agree += common - conflicts;
    }
    ViewFit {
        conflict: middle(&mut shares),
        inlier_rmse_metres: (squares / agree.max(1) as f64).sqrt(),
        neighbours: shares.len(),
    }
}

/// The view that fits worst, if it does not fit at all.
pub fn misfit(fits: &[ViewFit], config: &ConsistencyConfig) -> Option<usize> {
    let mut shares: Vec<f64> = fits.iter().filter_map(|f| f.conflict).collect();
    if shares.len() < 3 {
        return None;
    }
    let usual = middle(&mut shares)?;
    let bound = config.max_conflict.max(config.max_ratio * usual);
    let (worst, share) = fits
        .iter()
        .enumerate()
        .filter_map(|(i, f)| f.conflict.map(|share| (i, share)))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    (share > bound).then_some(worst)
}

/// A point and its normal in its camera's frame.
type Sample = (Point3<f64>, Vector3<f64>);

/// Points of the product that are seen well enough to be compared, evenly taken.
fn samples_of(view: &DepthView, most: usize) -> Vec<Sample> {
    let pixels: Vec<usize> = view.product_pixels().filter(|&s| view.incidence_cosine(s) > 0.4).collect();
    let stride = (pixels.len() / most).max(1);
    let sample = |&s: &usize| (Point3::from(view.points[s]).cast(), Vector3::from(view.normals[s]).cast());
    pixels.iter().step_by(stride).map(sample).collect()
}

/// Compares the points of a view with what another view sees in their directions.
fn meet(
    samples: &[Sample],
    target: &DepthView,
    target_from_source: &Pose,
    config: &ConsistencyConfig,
) -> Meeting {
    let mut meeting = Meeting::default();
    for (point, normal) in samples {
        let p = target_from_source * point;
        // Surfaces that the other view sees from the side or from behind are compared by views in between.
        let n = target_from_source.rotation * normal;
        if n.dot(&p.coords) > -0.4 * p.coords.norm() {
            continue;
        }
        let Some(gap) = target.nearest_gap(&p) else { continue };
        if gap.abs() <= config.noise_metres {
            meeting.agree += 1;
            meeting.squares += gap * gap;
        } else if gap > 0.0 {
            // Only seeing through is a contradiction: what lies behind the seen surface may be hidden by another part.
            meeting.conflicts += 1;
        }
    }
    meeting
}

fn middle(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fits(shares: &[f64]) -> Vec<ViewFit> {
        let fit = |&share| ViewFit { conflict: Some(share), inlier_rmse_metres: 0.001, neighbours: 4 };
        shares.iter().map(fit).collect()
    }

    #[test]
    fn only_a_view_that_is_off_is_named() {
        let config = ConsistencyConfig::default();
        assert_eq!(misfit(&fits(&[0.01, 0.02, 0.01, 0.2, 0.02]), &config), Some(3));
        assert_eq!(misfit(&fits(&[0.01, 0.02, 0.01, 0.03, 0.02]), &config), None);
        assert_eq!(misfit(&fits(&[0.01, 0.5]), &config), None, "two views cannot outvote each other");
    }
}
