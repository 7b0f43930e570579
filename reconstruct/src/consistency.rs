//! Do the views agree? A product that was knocked in one view stands elsewhere there, and so does its surface.
//!
//! For every pair of views, the distance between their surfaces is taken where both see the same spot (world frame,
//! metres). A view whose surface is off against most of its neighbours does not fit.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::pose::Pose;
use crate::view::DepthView;

/// Settings of the check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConsistencyConfig {
    /// Surfaces farther apart are not compared, metres.
    pub reach_metres: f64,
    /// A pair needs this many common points to be judged.
    pub min_common: usize,
    /// A view off by more than this does not fit, metres ...
    pub max_offset_metres: f64,
    /// ... and by more than this many times the middle of all views.
    pub max_ratio: f64,
    /// Points looked at a view.
    pub samples: usize,
}

impl Default for ConsistencyConfig {
    fn default() -> Self {
        Self { reach_metres: 0.03, min_common: 150, max_offset_metres: 0.002, max_ratio: 2.2, samples: 2500 }
    }
}

/// How one view agrees with the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewFit {
    /// Middle root-mean-square distance to the neighbours' surfaces, metres; `None` where it shares no surface.
    pub offset_metres: Option<f64>,
    /// Neighbours compared with.
    pub neighbours: usize,
}

/// Agreement of every view with the others, in the order of the views.
pub fn agreement(
    views: &[&DepthView],
    world_from_camera: &[Pose],
    config: &ConsistencyConfig,
) -> Vec<ViewFit> {
    let n = views.len();
    let one_way: Vec<Option<(f64, usize)>> = (0..n * n)
        .into_par_iter()
        .map(|k| (k / n != k % n).then(|| distance(views, world_from_camera, k / n, k % n, config)).flatten())
        .collect();
    let of_view = |i: usize| {
        let mut offsets: Vec<f64> = (0..n)
            .filter_map(|j| match (one_way[i * n + j], one_way[j * n + i]) {
                (Some(a), Some(b)) => Some((a, b)),
                _ => None,
            })
            .map(|((a, na), (b, nb))| (a * na as f64 + b * nb as f64) / (na + nb) as f64)
            .map(f64::sqrt)
            .collect();
        ViewFit { offset_metres: middle(&mut offsets), neighbours: offsets.len() }
    };
    (0..n).map(of_view).collect()
}

/// The view that fits worst, if it does not fit at all.
pub fn misfit(fits: &[ViewFit], config: &ConsistencyConfig) -> Option<usize> {
    let mut offsets: Vec<f64> = fits.iter().filter_map(|f| f.offset_metres).collect();
    if offsets.len() < 3 {
        return None;
    }
    let usual = middle(&mut offsets)?;
    let bound = config.max_offset_metres.max(config.max_ratio * usual);
    let (worst, offset) = fits
        .iter()
        .enumerate()
        .filter_map(|(i, f)| f.offset_metres.map(|o| (i, o)))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    (offset > bound).then_some(worst)
}

/// Mean square distance along the normals from view i to view j where both see the same spot, and the number of spots.
fn distance(
    views: &[&DepthView],
    poses: &[Pose],
    i: usize,
    j: usize,
    config: &ConsistencyConfig,
) -> Option<(f64, usize)> {
    let (source, target) = (views[i], views[j]);
    let target_from_source = poses[j].inverse() * poses[i];
    let pixels: Vec<usize> = source.product_pixels().filter(|&s| source.incidence_cosine(s) > 0.4).collect();
    let stride = (pixels.len() / config.samples).max(1);
    let (mut squares, mut count) = (0.0, 0usize);
    for &s in pixels.iter().step_by(stride) {
        let p = target_from_source * Point3::from(source.points[s]).cast::<f64>();
        let Some(t) = target.pixel_of(&p) else { continue };
        if !target.mask[t] || target.incidence_cosine(t) < 0.4 {
            continue;
        }
        let n_p = target_from_source.rotation * Vector3::from(source.normals[s]).cast::<f64>();
        let n_q = Vector3::from(target.normals[t]).cast::<f64>();
        let gap = p - Point3::from(target.points[t]).cast::<f64>();
        if n_p.dot(&n_q) < 0.6 || gap.norm() > config.reach_metres {
            continue;
        }
        let r = (n_p + n_q).normalize().dot(&gap);
        squares += r * r;
        count += 1;
    }
    (count >= config.min_common).then(|| (squares / count as f64, count))
}

fn middle(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fits(offsets_mm: &[f64]) -> Vec<ViewFit> {
        offsets_mm.iter().map(|o| ViewFit { offset_metres: Some(o / 1000.0), neighbours: 4 }).collect()
    }

    #[test]
    fn only_a_view_that_is_off_is_named() {
        let config = ConsistencyConfig::default();
        assert_eq!(misfit(&fits(&[0.8, 0.9, 0.7, 5.0, 1.0]), &config), Some(3));
        assert_eq!(misfit(&fits(&[0.8, 0.9, 0.7, 1.5, 1.0]), &config), None);
        assert_eq!(misfit(&fits(&[0.8, 9.0]), &config), None, "two views cannot outvote each other");
    }
}
