//! Which points belong to the product where there is no marker region: what rises above the support plane in the middle of the
//! first view, and in all views what touches it.
//!
//! Lengths in metres; each function names its frame.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Point3;
use thiserror::Error;

use crate::pose::Pose;
use crate::register::plane::Plane;

/// How to tell the product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProductConfig {
    /// What is lower above the plane belongs to the plane, metres.
    pub floor_metres: f64,
    /// Points this near to one another belong together, metres.
    pub link_metres: f32,
    /// Fewer pixels than this are no product.
    pub min_pixels: usize,
}

impl Default for ProductConfig {
    fn default() -> Self {
        Self { floor_metres: 0.004, link_metres: 0.01, min_pixels: 100 }
    }
}

impl ProductConfig {
    /// Settings for views thinned to `cell` metres: coarse enough for one noisy frame at that distance.
    pub fn for_cell(cell: f32) -> Self {
        Self { floor_metres: 1.5 * f64::from(cell), link_metres: 2.0 * cell, min_pixels: 100 }
    }
}

/// The product's pixels in one organised view: the piece above the plane that comes nearest to the middle of the picture.
///
/// `points` are in the frame of `plane`, row-major, NaN or z = 0 where nothing was measured. `None` where nothing large enough
/// rises above the plane.
pub fn product_of_view(
    points: &[[f32; 3]],
    width: usize,
    height: usize,
    plane: &Plane,
    config: &ProductConfig,
) -> Option<Vec<bool>> {
    if width == 0 || points.len() != width * height {
        return None;
    }
    let above: Vec<bool> = points.iter().map(|p| is_above(p, plane, config)).collect();
    let mut piece_of = vec![usize::MAX; points.len()];
    let mut best: Option<(usize, usize)> = None;
    let mut pieces = 0;
    for start in 0..points.len() {
        if !above[start] || piece_of[start] != usize::MAX {
            continue;
        }
        let members = grow(start, pieces, &mut piece_of, points, &above, width, height, config.link_metres);
        let from_middle = members
            .iter()
            .map(|i| (2 * (i % width)).abs_diff(width).pow(2) + (2 * (i / width)).abs_diff(height).pow(2))
            .min()
            .unwrap_or(usize::MAX);
        if members.len() >= config.min_pixels && best.is_none_or(|b| from_middle < b.0) {
            best = Some((from_middle, pieces));
        }
        pieces += 1;
    }
    let (_, product) = best?;
    Some(piece_of.iter().map(|piece| *piece == product).collect())
}

fn is_above(p: &[f32; 3], plane: &Plane, config: &ProductConfig) -> bool {
    p[2].is_finite() && p[2] != 0.0 && plane.height(&Point3::from(p.map(f64::from))) > config.floor_metres
}

/// Flood fill through neighbouring pixels that are near in space; gives the piece's pixels.
fn grow(
    start: usize,
    piece: usize,
    piece_of: &mut [usize],
    points: &[[f32; 3]],
    above: &[bool],
    width: usize,
    height: usize,
    link: f32,
) -> Vec<usize> {
    piece_of[start] = piece;
    let mut members = vec![start];
    let mut next = 0;
    while next < members.len() {
        let i = members[next];
        next += 1;
        let (u, v) = (i % width, i / width);
        for y in v.saturating_sub(1)..(v + 2).min(height) {
            for x in u.saturating_sub(1)..(u + 2).min(width) {
                let j = y * width + x;
                let sq: f32 = (0..3).map(|k| (points[i][k] - points[j][k]).powi(2)).sum();
                if above[j] && piece_of[j] == usize::MAX && sq <= link * link {
                    piece_of[j] = piece;
                    members.push(j);
                }
            }
        }
    }
    members
}

/// Points of a placed view, as [`product_in_world`] takes them.
#[derive(Debug, Clone, Copy)]
pub struct PlacedPoints<'a> {
    /// Camera frame; NaN or z = 0 where nothing was measured.
    pub points: &'a [[f32; 3]],
    /// Where the view stands.
    pub world_from_view: Pose,
}

/// Why no product could be told.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ProductError {
    /// The mask of the first view doesn't fit it, or is empty.
    #[error("the product was not found in the first view")]
    NoSeed,
}

/// The product's points in every view, as masks: what is above the plane and connected, over all views together, with the
/// product of the first view (`seed_mask`).
pub fn product_in_world(
    views: &[PlacedPoints<'_>],
    seed_mask: &[bool],
    plane_in_world: &Plane,
    config: &ProductConfig,
) -> Result<Vec<Vec<bool>>, ProductError> {
    let first = views.first().filter(|v| v.points.len() == seed_mask.len()).ok_or(ProductError::NoSeed)?;
    let size = f64::from(config.link_metres);
    let cell_of = |view: &PlacedPoints<'_>, p: &[f32; 3]| -> Option<[i32; 3]> {
        if !p[2].is_finite() || p[2] == 0.0 {
            return None;
        }
        let world = view.world_from_view * Point3::from(p.map(f64::from));
        let above = plane_in_world.height(&world) > config.floor_metres;
        above.then(|| std::array::from_fn(|k| (world[k] / size).floor() as i32))
    };
    let mut reached: BTreeMap<[i32; 3], bool> = views
        .iter()
        .flat_map(|v| v.points.iter().filter_map(|p| cell_of(v, p)))
        .map(|c| (c, false))
        .collect();
    let mut queue: VecDeque<[i32; 3]> = VecDeque::new();
    for (p, _) in first.points.iter().zip(seed_mask).filter(|(_, seed)| **seed) {
        let Some(cell) = cell_of(first, p) else { continue };
        if reached.insert(cell, true) == Some(false) {
            queue.push_back(cell);
        }
    }
    if queue.is_empty() {
        return Err(ProductError::NoSeed);
    }
    while let Some(cell) = queue.pop_front() {
        for d in 0..27 {
            let step = [d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1];
            let near = std::array::from_fn(|k| cell[k].saturating_add(step[k]));
            if let Some(seen @ false) = reached.get_mut(&near) {
                *seen = true;
                queue.push_back(near);
            }
        }
    }
    let belongs = |view: &PlacedPoints<'_>, p: &[f32; 3]| {
        cell_of(view, p).is_some_and(|cell| reached.get(&cell).copied().unwrap_or(false))
    };
    Ok(views.iter().map(|v| v.points.iter().map(|p| belongs(v, p)).collect()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 60;
    const HEIGHT: usize = 40;

    /// A table seen from above with a box in the middle and a larger one in the corner; z down, so heights are `0.8 - z`.
    fn scene(shift: f32) -> (Vec<[f32; 3]>, Plane) {
        let points = (0..WIDTH * HEIGHT)
            .map(|i| {
                let (u, v) = (i % WIDTH, i / WIDTH);
                let middle = (25..35).contains(&u) && (15..25).contains(&v);
                let corner = u < 18 && v < 12;
                let z = if middle {
                    0.72
                } else if corner {
                    0.6
                } else {
                    0.8
                };
                if u == 59 { [f32::NAN; 3] } else { [u as f32 * 0.004 + shift, v as f32 * 0.004, z] }
            })
            .collect();
        (points, Plane { normal: [0.0, 0.0, -1.0], offset: -0.8, support: 0.7 })
    }

    #[test]
    fn the_piece_in_the_middle_is_the_product() {
        let (points, plane) = scene(0.0);
        let mask = product_of_view(&points, WIDTH, HEIGHT, &plane, &ProductConfig::default()).unwrap();
        assert_eq!(mask.iter().filter(|m| **m).count(), 100);
        assert!(mask[20 * WIDTH + 30] && !mask[5 * WIDTH + 5] && !mask[30 * WIDTH + 30]);
        let strict = ProductConfig { min_pixels: 150, ..ProductConfig::default() };
        let corner = product_of_view(&points, WIDTH, HEIGHT, &plane, &strict).unwrap();
        assert!(corner[5 * WIDTH + 5] && !corner[20 * WIDTH + 30]);
        let none = ProductConfig { min_pixels: 9999, ..strict };
        assert!(product_of_view(&points, WIDTH, HEIGHT, &plane, &none).is_none());
        assert!(product_of_view(&points, 7, HEIGHT, &plane, &strict).is_none());
    }

    #[test]
    fn other_views_add_what_is_connected() {
        let (points, plane) = scene(0.0);
        let config = ProductConfig::default();
        let seed = product_of_view(&points, WIDTH, HEIGHT, &plane, &config).unwrap();
        // The second view is moved by 5 mm and sees a handle beside the box.
        let (mut other, _) = scene(0.005);
        for u in 35..45 {
            other[20 * WIDTH + u][2] = 0.725 + 0.004 * (u % 2) as f32;
        }
        let views = [
            PlacedPoints { points: &points, world_from_view: Pose::identity() },
            PlacedPoints { points: &other, world_from_view: Pose::translation(-0.005, 0.0, 0.0) },
        ];
        let masks = product_in_world(&views, &seed, &plane, &config).unwrap();
        assert_eq!(masks[0], seed);
        assert!((35..45).all(|u| masks[1][20 * WIDTH + u]) && !masks[1][5 * WIDTH + 5]);
        assert_eq!(masks[1].iter().filter(|m| **m).count(), 110);
        let nothing = vec![false; seed.len()];
        assert_eq!(product_in_world(&views, &nothing, &plane, &config), Err(ProductError::NoSeed));
        assert_eq!(product_in_world(&[], &seed, &plane, &config), Err(ProductError::NoSeed));
    }
}
