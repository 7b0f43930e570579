//! The product's pixels of a view as samples in the world, without those that other views see through.

use nalgebra::{Point3, Vector3};

use super::{FuseConfig, PlacedView};
use crate::pose::Pose;
use crate::view::DepthView;
use crate::witness::witnesses;

/// A measured point in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub point: [f32; 3],
    pub normal: [f32; 3],
    pub color: [f32; 3],
    pub weight: f32,
    /// Which view saw it.
    pub view: u16,
}

/// The product's pixels of view `i` that the views it is compared with do not see through.
pub(super) fn samples_of(views: &[PlacedView], i: usize, gain: [f32; 3], config: &FuseConfig) -> Vec<Sample> {
    let view = &views[i];
    let others: Vec<(Pose, &DepthView)> = witnesses(i, views.len())
        .map(|j| (views[j].world_from_camera.inverse() * view.world_from_camera, views[j].geometry))
        .collect();
    let world_from_camera = view.world_from_camera.cast::<f32>();
    let geometry = view.geometry;
    let usable =
        geometry.product_pixels().filter(|&s| geometry.incidence_cosine(s) >= config.min_incidence_cosine);
    usable
        .filter(|&s| {
            !is_seen_through(&Point3::from(geometry.points[s]).cast(), &others, config.see_through_metres)
        })
        .map(|s| {
            let cosine = geometry.incidence_cosine(s);
            let distance = geometry.points[s][2] / 0.75;
            let c = view.color.data[s];
            Sample {
                point: (world_from_camera * Point3::from(geometry.points[s])).into(),
                normal: (world_from_camera.rotation * Vector3::from(geometry.normals[s])).into(),
                color: std::array::from_fn(|k| f32::from(c[k]) * gain[k]),
                weight: cosine / (distance * distance).powi(2),
                view: i as u16,
            }
        })
        .collect()
}

/// Whether at least two views, and more than agree, look through the point onto something farther.
fn is_seen_through(point: &Point3<f64>, others: &[(Pose, &DepthView)], see_through_metres: f64) -> bool {
    let (mut through, mut agree) = (0, 0);
    for (other_from_this, other) in others {
        let p = other_from_this * point;
        match other.nearest_gap(&p) {
            Some(gap) if gap > see_through_metres => through += 1,
            Some(gap) if gap.abs() < 0.5 * see_through_metres => agree += 1,
            _ => {}
        }
    }
    through >= 2 && through > agree
}

pub(super) fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
