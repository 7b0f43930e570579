//! Do the views agree? A product that was knocked in one view stands elsewhere there, and so does its surface.
//!
//! For every pair of views (of many views, each with an even choice of the others), each point of one is held against the
//! depth that the other sees in its direction (metres): it agrees, it is hidden, or it contradicts, standing where the other
//! view sees through. Views that agree make a group (`groups`); those that contradict a larger group do not fit.

mod groups;

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::pose::Pose;
use crate::view::DepthView;
use crate::witness::are_compared;
use groups::Shared;

/// Never more contradicting points are taken for noise.
const MOST_CONFLICT: f64 = 0.15;

/// Settings of the check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConsistencyConfig {
    /// Gaps up to this are noise, metres.
    pub noise_metres: f64,
    /// A pair needs this many common points to be judged.
    pub min_common: usize,
    /// Views with a larger share of contradicting points do not belong together ...
    pub max_conflict: f64,
    /// ... if that is also this many times what a quarter of the pairs stays below; 15 % are never taken for noise.
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

/// How the views agree.
#[derive(Debug, Clone)]
pub struct Agreement {
    /// In the order of the views.
    pub views: Vec<ViewFit>,
    /// Of views i and j at `i * n + j`, both ways.
    shared: Vec<Shared>,
}

/// A view that contradicts the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outsider {
    /// Its index.
    pub view: usize,
    /// Share of the points in common with the group it contradicts that do not agree; its own group's where it has none itself.
    pub conflict: f64,
}

/// Agreement of every view with the others.
pub fn agreement(views: &[&DepthView], world_from_camera: &[Pose], config: &ConsistencyConfig) -> Agreement {
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
    let both_ways = |k: usize| {
        let (a, b) = (&one_way[k], &one_way[k % n * n + k / n]);
        let shared = Shared { common: a.common() + b.common(), conflicts: a.conflicts + b.conflicts };
        if shared.common < config.min_common { Shared::default() } else { shared }
    };
    let shared: Vec<Shared> = (0..n * n).map(both_ways).collect();
    Agreement { views: (0..n).map(|i| fit_of(i, n, &one_way, &shared)).collect(), shared }
}

impl Agreement {
    /// The group of views that contradicts a larger one most; empty where none does. Views that share nothing do not contradict each other.
    pub fn outsiders(&self, config: &ConsistencyConfig) -> Vec<Outsider> {
        let n = self.views.len();
        let bound = config.max_conflict.max(config.max_ratio * self.usual_conflict()).min(MOST_CONFLICT);
        let groups = groups::groups(n, |i, j| self.shared[i * n + j], bound);
        let pairs = (0..groups.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let conflict = |(i, j): (usize, usize)| self.conflict(&groups[j], &groups[i]).unwrap_or(0.0);
        let worst = pairs.max_by(|&a, &b| conflict(a).total_cmp(&conflict(b)).then(b.cmp(&a)));
        let Some((kept, out)) = worst.filter(|&pair| conflict(pair) > bound) else { return Vec::new() };
        // A view in the middle of the group may share nothing with the others itself.
        let of_view =
            |view: usize| self.conflict(&[view], &groups[kept]).unwrap_or_else(|| conflict((kept, out)));
        groups[out].iter().map(|&view| Outsider { view, conflict: of_view(view) }).collect()
    }

    /// Share of what views have in common with others that contradicts them; `None` where that is nothing.
    fn conflict(&self, views: &[usize], others: &[usize]) -> Option<f64> {
        let n = self.views.len();
        let pairs = views.iter().flat_map(|&i| others.iter().map(move |&j| self.shared[i * n + j]));
        let (common, conflicts) = pairs.fold((0, 0), |(a, b), s| (a + s.common, b + s.conflicts));
        (common > 0).then(|| conflicts as f64 / common as f64)
    }

    /// The share that a quarter of the pairs stays below: a product that was moved makes up to half of them contradict.
    fn usual_conflict(&self) -> f64 {
        let share = |s: &Shared| (s.common > 0).then(|| s.conflicts as f64 / s.common as f64);
        let mut shares: Vec<f64> = self.shared.iter().filter_map(share).collect();
        shares.sort_unstable_by(f64::total_cmp);
        shares.get(shares.len() / 4).copied().unwrap_or(0.0)
    }
}

/// Gathers what view `i` met in the others and the others in it.
fn fit_of(i: usize, n: usize, one_way: &[Meeting], shared: &[Shared]) -> ViewFit {
    let neighbours: Vec<usize> = (0..n).filter(|&j| shared[i * n + j].common > 0).collect();
    let mut shares: Vec<f64> = neighbours
        .iter()
        .map(|&j| shared[i * n + j].conflicts as f64 / shared[i * n + j].common as f64)
        .collect();
    let squares: f64 =
        neighbours.iter().map(|&j| one_way[i * n + j].squares + one_way[j * n + i].squares).sum();
    let agree: usize =
        neighbours.iter().map(|&j| shared[i * n + j].common - shared[i * n + j].conflicts).sum();
    ViewFit {
        conflict: middle(&mut shares),
        inlier_rmse_metres: (squares / agree.max(1) as f64).sqrt(),
        neighbours: shares.len(),
    }
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

    /// Views of which neighbours have a thousand points in common; `conflicts` are those of views i < j.
    fn of_views(n: usize, conflicts: impl Fn(usize, usize) -> usize) -> Agreement {
        let shared: Vec<Shared> = (0..n * n)
            .map(|k| match (k / n, k % n) {
                (i, j) if i == j => Shared::default(),
                (i, j) => Shared { common: 1000, conflicts: conflicts(i.min(j), i.max(j)) },
            })
            .collect();
        Agreement {
            views: (0..n).map(|i| fit_of(i, n, &vec![Meeting::default(); n * n], &shared)).collect(),
            shared,
        }
    }

    fn outsiders(agreement: &Agreement) -> Vec<usize> {
        agreement.outsiders(&ConsistencyConfig::default()).iter().map(|o| o.view).collect()
    }

    #[test]
    fn only_a_view_that_is_off_is_named() {
        assert_eq!(outsiders(&of_views(5, |_, j| if j == 4 { 200 } else { 10 })), [4]);
        assert!(outsiders(&of_views(5, |_, j| if j == 4 { 30 } else { 10 })).is_empty());
    }

    #[test]
    fn views_after_the_product_was_moved_are_named_together() {
        let moved = of_views(8, |i, j| if i < 5 && j >= 5 { 400 } else { 3 });
        assert_eq!(outsiders(&moved), [5, 6, 7]);
        assert!(
            moved.outsiders(&ConsistencyConfig::default()).iter().all(|o| (o.conflict - 0.4).abs() < 1e-9)
        );
    }

    #[test]
    fn of_two_views_that_contradict_one_is_off() {
        assert_eq!(outsiders(&of_views(2, |_, _| 500)), [1]);
    }
}
