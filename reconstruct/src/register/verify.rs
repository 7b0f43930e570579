//! Whether two views really fit at a relative pose: what both see must agree in place and colour, and neither may have a
//! surface where the other looked through (free space).

use nalgebra::Point3;
use rayon::prelude::*;

use super::view::{DepthMap, RegisterView};
use crate::knn::Tree;
use crate::pose::Pose;

/// Agreement of two views, both ways. Shares 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Agreement {
    /// Share of the smaller view's points that lie on the other's surface.
    pub overlap: f64,
    /// Of the points that fall where the other view measured, the share that lies in front of what it saw.
    pub in_free_space: f64,
    /// Of the points that lie on the other's surface, the share with its colour.
    pub same_color: f64,
    /// Points on the other's surface with its colour.
    pub points: usize,
    /// Of the points on the other's surface whose surroundings show a pattern, the share that finds its colour there: plain
    /// tables look alike anywhere.
    pub same_pattern: f64,
    /// How many show a pattern.
    pub patterned: usize,
}

impl Agreement {
    /// One number to compare candidates: share of points that agree in place and colour, less what stands in free space.
    pub fn score(&self) -> f64 {
        self.overlap * self.same_color - self.in_free_space
    }
}

/// Largest difference of a channel (0 to 255) between views of one spot.
const COLOR_TOLERANCE: u8 = 38;
/// Cells (at the view's distance) within which two surfaces are one, and beyond which one is in the other's free space.
const ON_SURFACE: f32 = 1.5;
const IN_FRONT: f32 = 4.0;
/// Every how many-th pixel is looked at, along both axes.
const STEP: usize = 3;

#[derive(Default, Clone, Copy)]
struct Counts {
    all: usize,
    seen: usize,
    on_surface: usize,
    same_color: usize,
    in_front: usize,
    patterned: usize,
    same_pattern: usize,
}

/// Difference of a channel (0 to 255) among neighbouring pixels that makes a pattern.
const PATTERN: u8 = 60;

/// Agreement of two views at `target_from_source`.
pub fn agreement(source: &RegisterView, target: &RegisterView, target_from_source: &Pose) -> Agreement {
    let there = one_way(source, target, target_from_source);
    let back = one_way(target, source, &target_from_source.inverse());
    let share = |part: usize, all: usize| part as f64 / all.max(1) as f64;
    let overlap = share(there.on_surface, there.all).max(share(back.on_surface, back.all));
    Agreement {
        overlap,
        in_free_space: share(there.in_front + back.in_front, there.seen + back.seen),
        same_color: share(there.same_color + back.same_color, there.on_surface + back.on_surface),
        points: there.same_color + back.same_color,
        same_pattern: share(there.same_pattern + back.same_pattern, there.patterned + back.patterned),
        patterned: there.patterned + back.patterned,
    }
}

fn one_way(source: &RegisterView, target: &RegisterView, pose: &Pose) -> Counts {
    match (&source.depth, &target.depth) {
        (Some(from), Some(to)) => by_projection(from, to, source, pose),
        _ => by_neighbours(source, target, pose),
    }
}

fn by_projection(from: &DepthMap, to: &DepthMap, view: &RegisterView, pose: &Pose) -> Counts {
    let rows: Vec<Counts> = (0..from.height.div_ceil(STEP))
        .into_par_iter()
        .map(|row| {
            let mut counts = Counts::default();
            for u in (0..from.width).step_by(STEP) {
                let i = row * STEP * from.width + u;
                let p = from.points[i];
                if !(p[2] > 0.0 && p[2] < 2.0 * view.distance) {
                    continue;
                }
                counts.all += 1;
                let p = pose * Point3::from(p.map(f64::from));
                let Some(pixel) = to.pixel_of(&p) else { continue };
                let measured = to.points[pixel][2];
                if !measured.is_finite() {
                    continue;
                }
                counts.seen += 1;
                let z = p.z as f32;
                // Noise and steps of the sensor grow with z².
                let unit = view.cell * (measured / view.distance).powi(2).max(1.0);
                if (z - measured).abs() <= ON_SURFACE * unit {
                    counts.on_surface += 1;
                    counts.same_color += usize::from(alike(from.colors[i], to.colors[pixel]));
                    if has_pattern(from, i) {
                        counts.patterned += 1;
                        counts.same_pattern += usize::from(near_alike(to, pixel, from.colors[i]));
                    }
                } else if z < measured - IN_FRONT * unit && surrounded(to, pixel, z + IN_FRONT * unit) {
                    counts.in_front += 1;
                }
            }
            counts
        })
        .collect();
    rows.iter().fold(Counts::default(), |a, b| Counts {
        all: a.all + b.all,
        seen: a.seen + b.seen,
        on_surface: a.on_surface + b.on_surface,
        same_color: a.same_color + b.same_color,
        in_front: a.in_front + b.in_front,
        patterned: a.patterned + b.patterned,
        same_pattern: a.same_pattern + b.same_pattern,
    })
}

/// Whether all measured pixels around are farther than `z`: at edges a pixel of offset is no contradiction.
fn surrounded(map: &DepthMap, pixel: usize, z: f32) -> bool {
    let (u, v) = (pixel % map.width, pixel / map.width);
    (v.saturating_sub(2)..(v + 3).min(map.height)).all(|y| {
        (u.saturating_sub(2)..(u + 3).min(map.width)).all(|x| {
            let other = map.points[y * map.width + x][2];
            other.is_nan() || other > z
        })
    })
}

/// A pixel and those around it, as far as they were measured.
fn around(map: &DepthMap, pixel: usize) -> impl Iterator<Item = usize> + '_ {
    let (u, v) = (pixel % map.width, pixel / map.width);
    let rows = v.saturating_sub(1)..(v + 2).min(map.height);
    let columns = u.saturating_sub(1)..(u + 2).min(map.width);
    let all = rows.flat_map(move |y| columns.clone().map(move |x| y * map.width + x));
    all.filter(|&i| map.points[i][2].is_finite())
}

fn has_pattern(map: &DepthMap, pixel: usize) -> bool {
    let here = map.colors[pixel];
    around(map, pixel).any(|i| map.colors[i].iter().zip(&here).any(|(a, b)| a.abs_diff(*b) > PATTERN))
}

/// At a pattern a pixel of offset is no contradiction.
fn near_alike(map: &DepthMap, pixel: usize, color: [u8; 3]) -> bool {
    around(map, pixel).any(|i| alike(map.colors[i], color))
}

fn alike(a: [u8; 3], b: [u8; 3]) -> bool {
    a.iter().zip(&b).all(|(x, y)| x.abs_diff(*y) <= COLOR_TOLERANCE)
}

/// Without a depth map free space is unknown; nearness and colour are left.
fn by_neighbours(source: &RegisterView, target: &RegisterView, pose: &Pose) -> Counts {
    let moved = source.coarse.transformed(pose);
    let tree = Tree::new(&target.fine.points);
    let colors = moved.has_colors() && target.fine.has_colors();
    let mut counts = Counts { all: moved.len(), seen: moved.len(), ..Counts::default() };
    for (i, p) in moved.points.iter().enumerate() {
        let Some(found) = tree.nearest_within(p, ON_SURFACE * source.cell) else { continue };
        counts.on_surface += 1;
        let same = !colors || alike(moved.colors[i], target.fine.colors[found.index]);
        counts.same_color += usize::from(same);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::super::link::Acceptance;
    use super::*;
    use crate::camera::Intrinsics;

    /// A white wall with dark squares, far apart, straight ahead.
    fn wall() -> RegisterView {
        let camera = Intrinsics::pinhole(320, 240, 262.0, 262.0, 159.5, 119.5);
        let points: Vec<[f32; 3]> =
            camera.ray_table().iter().map(|r| [0.7 * r[0], 0.7 * r[1], 0.7]).collect();
        let dark = |i: usize| (i % 320) % 40 < 12 && (i / 320) % 40 < 12;
        let colors: Vec<[u8; 3]> =
            (0..points.len()).map(|i| if dark(i) { [30; 3] } else { [230; 3] }).collect();
        let cell = RegisterView::cell_for(&camera, &points).unwrap();
        RegisterView::organised(camera, &points, &colors, cell).unwrap()
    }

    #[test]
    fn white_on_white_is_no_proof_where_the_pattern_is_not_found() {
        let wall = wall();
        let pixel = 0.7 / 262.0;
        let slid = |pixels: f64| agreement(&wall, &wall, &Pose::translation(pixels * pixel, 0.0, 0.0));
        let (right, wrong) = (slid(0.0), slid(20.0));
        assert!(right.patterned > 100 && right.same_pattern > 0.98, "{right:?}");
        assert_eq!(Acceptance::default().judge(&right), Ok(()));
        // Most of both is white, and that agrees.
        assert!(wrong.same_color > 0.7 && wrong.overlap > 0.8 && wrong.in_free_space < 0.01, "{wrong:?}");
        assert!(wrong.same_pattern < 0.7, "{wrong:?}");
        assert!(Acceptance::default().judge(&wrong).is_err());
    }
}
