//! What moves between the views: the camera, or the product before a camera at rest.

use rayon::prelude::*;

use super::super::link::{Anchor, follow};
use super::super::plane::{PlaneConfig, support_plane};
use super::super::verify::agreement;
use super::super::view::RegisterView;
use crate::pose::Pose;
use crate::segment_free::{ProductConfig, product_of_view};

/// What moved between the views.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moving {
    /// The camera went round a scene at rest: the whole scene places the views.
    Camera,
    /// The product turned before a camera at rest: only the product places the views.
    Product,
}

/// Neighbouring pairs that are tried both ways.
const TRIALS: usize = 5;
/// By how much the product alone must agree better before the scene is given up.
const MARGIN: f64 = 0.05;
/// A camera that moves less than this between neighbours is at rest: share of the distance, and radians.
const AT_REST: f64 = 0.004;

/// Decides by trying both on some neighbouring pairs. The cut views come along where only the product is to be followed.
pub(super) fn decide(views: &[RegisterView]) -> (Moving, Option<Vec<RegisterView>>) {
    let cut: Vec<Option<RegisterView>> = views.par_iter().map(product_only).collect();
    let last = views.len().saturating_sub(1);
    let mut trials: Vec<usize> =
        (0..TRIALS).map(|k| k * last / TRIALS).filter(|i| i + 1 < views.len()).collect();
    trials.dedup();
    let mut scores = Vec::new();
    for i in trials {
        let (Some(a), Some(b)) = (&cut[i], &cut[i + 1]) else { continue };
        let Some(scene) = follow(&views[i + 1], &Anchor::new(&views[i]), &[Pose::identity()]) else {
            continue;
        };
        let Some(alone) = follow(b, &Anchor::new(a), &[Pose::identity()]) else { continue };
        // Judged on the product both times: a background at rest says nothing about it.
        let by_scene = agreement(b, a, &scene.target_from_source).score();
        let by_product = alone.agreement.score();
        let moved = scene.target_from_source;
        let at_rest = moved.translation.vector.norm() < AT_REST * f64::from(views[i].distance)
            && moved.rotation.angle() < AT_REST;
        scores.push((by_product - by_scene, at_rest));
    }
    let gain = scores.iter().map(|s| s.0).sum::<f64>() / scores.len().max(1) as f64;
    let rests = scores.iter().filter(|s| s.1).count();
    let product_moves = !scores.is_empty() && gain > MARGIN && rests * 2 > scores.len();
    if product_moves && cut.iter().all(Option::is_some) {
        return (Moving::Product, Some(cut.into_iter().flatten().collect()));
    }
    (Moving::Camera, None)
}

/// The view with everything but the product in the middle taken out; `None` where none stands out.
fn product_only(view: &RegisterView) -> Option<RegisterView> {
    let map = view.depth.as_ref()?;
    let config = PlaneConfig { tolerance_metres: 1.5 * f64::from(view.cell), ..PlaneConfig::default() };
    let plane = support_plane(&view.coarse, &config)?;
    let config = ProductConfig::for_cell(view.cell);
    let mask = product_of_view(&map.points, map.width, map.height, &plane, &config)?;
    let mut map = map.clone();
    for (i, keep) in mask.iter().enumerate() {
        if !keep {
            (map.points[i], map.normals[i]) = ([f32::NAN; 3], [0.0; 3]);
        }
    }
    RegisterView::of_map(map, view.cell, view.distance)
}
