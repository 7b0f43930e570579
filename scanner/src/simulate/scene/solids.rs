//! Boxes and turned things: the table, the room, clutter, and what hides part of the sheet.

use std::f32::consts::TAU;

use nalgebra::Vector3;

use super::{Material, Object};
use crate::simulate::board::Sheet;
use crate::simulate::texture::hue;

/// Half the room's width and its floor and ceiling, metres.
const ROOM: f32 = 2.1;
const FLOOR: f32 = -0.75;
const CEILING: f32 = 1.9;

/// A box turned by `yaw` about its own upright axis.
fn cuboid(centre: [f32; 3], half: [f32; 3], yaw: f32, material: Material) -> Object {
    let (sin, cos) = yaw.sin_cos();
    let turn = |x: f32, y: f32| [cos * x - sin * y, sin * x + cos * y];
    let vertices = (0..8)
        .map(|k| {
            let sign = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let [x, y] = turn(sign(0) * half[0], sign(1) * half[1]);
            [centre[0] + x, centre[1] + y, centre[2] + sign(2) * half[2]]
        })
        .collect();
    let faces: [([u32; 4], [f32; 3]); 6] = [
        ([1, 3, 7, 5], [1.0, 0.0, 0.0]),
        ([0, 4, 6, 2], [-1.0, 0.0, 0.0]),
        ([2, 6, 7, 3], [0.0, 1.0, 0.0]),
        ([0, 1, 5, 4], [0.0, -1.0, 0.0]),
        ([4, 5, 7, 6], [0.0, 0.0, 1.0]),
        ([0, 2, 3, 1], [0.0, 0.0, -1.0]),
    ];
    let (mut triangles, mut normals) = (Vec::new(), Vec::new());
    for ([a, b, c, d], n) in faces {
        triangles.extend([[a, b, c], [a, c, d]]);
        let [x, y] = turn(n[0], n[1]);
        normals.extend([[x, y, n[2]]; 2]);
    }
    Object { vertices, triangles, normals, material }
}

/// The same surface seen from inside.
fn inside_out(mut object: Object) -> Object {
    object.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    object.normals.iter_mut().for_each(|n| *n = n.map(|v| -v));
    object
}

/// A profile `[radius, height]` from bottom to top, turned about an upright axis; closed where it starts and ends at radius 0.
fn turned(foot: [f32; 3], profile: &[[f32; 2]], material: Material) -> Object {
    const SIDES: u32 = 28;
    let mut object = Object { vertices: Vec::new(), triangles: Vec::new(), normals: Vec::new(), material };
    for [r, z] in profile {
        for k in 0..SIDES {
            let (sin, cos) = (TAU * k as f32 / SIDES as f32).sin_cos();
            object.vertices.push([foot[0] + r * cos, foot[1] + r * sin, foot[2] + z]);
        }
    }
    for ring in 0..profile.len() as u32 - 1 {
        let [[r0, z0], [r1, z1]] = [profile[ring as usize], profile[ring as usize + 1]];
        for k in 0..SIDES {
            let (sin, cos) = (TAU * (k as f32 + 0.5) / SIDES as f32).sin_cos();
            let normal: [f32; 3] = Vector3::new(cos * (z1 - z0), sin * (z1 - z0), r0 - r1).normalize().into();
            let (a, b) = (ring * SIDES + k, ring * SIDES + (k + 1) % SIDES);
            object.triangles.extend([[a, b, b + SIDES], [a, b + SIDES, a + SIDES]]);
            object.normals.extend([normal; 2]);
        }
    }
    object
}

/// Table, walls, floor and clutter; the table's top lies at `top`.
pub(super) fn room(top: f32, seed: u32) -> Vec<Object> {
    let mut rng = fastrand::Rng::with_seed(u64::from(seed) ^ 0x700);
    let between = |rng: &mut fastrand::Rng, low: f32, high: f32| low + (high - low) * rng.f32();
    let table = [between(&mut rng, 0.5, 0.75), between(&mut rng, 0.42, 0.6)];
    let height = 0.5 * (CEILING - FLOOR);
    let mut objects = vec![
        inside_out(cuboid([0.0, 0.0, FLOOR + height], [ROOM, ROOM, height], 0.1, Material::Room)),
        cuboid([0.0, 0.0, top - 0.015], [table[0], table[1], 0.015], 0.0, Material::Table),
    ];
    let things = rng.usize(4..8);
    let start = rng.f32();
    for k in 0..things {
        let angle = TAU * (start + (k as f32 + 0.6 * rng.f32()) / things as f32);
        // On an ellipse just outside the largest sheet, low enough not to stand before it.
        let reach = between(&mut rng, 1.02, 1.18);
        let (x, y) = (reach * 0.43 * angle.cos(), reach * 0.37 * angle.sin());
        let size =
            [between(&mut rng, 0.02, 0.05), between(&mut rng, 0.02, 0.05), between(&mut rng, 0.015, 0.045)];
        let material = Material::Thing(hue(rng.f32(), 0.65, 0.75), rng.u32(..));
        objects.push(match k % 3 {
            0 | 1 => cuboid([x, y, top + size[2]], size, TAU * rng.f32(), material),
            _ => {
                let (r, h) = (size[0].min(0.04), 2.0 * size[2]);
                turned(
                    [x, y, top],
                    &[
                        [0.0, 0.0],
                        [0.8 * r, 0.0],
                        [r, h],
                        [0.9 * r, h],
                        [0.75 * r, 0.15 * h],
                        [0.0, 0.15 * h],
                    ],
                    material,
                )
            }
        });
    }
    objects
}

/// Cloths and books that hide about `share` of the ring of tags, on the side of the sheet at `angle`.
pub fn cover_boxes(
    sheet: &Sheet,
    inner: &[[f64; 2]],
    share: f64,
    angle: f64,
    rng: &mut fastrand::Rng,
) -> Vec<Object> {
    let bound = |k: usize| inner.iter().map(|p| p[k].abs()).fold(0.0, f64::max);
    let (ix, iy) = (bound(0) + 0.004, bound(1) + 0.004);
    let (ox, oy) = (sheet.high[0].max(-sheet.low[0]) + 0.02, sheet.high[1].max(-sheet.low[1]) + 0.02);
    let (sin, cos) = angle.sin_cos();
    let level = cut_level(sheet, inner, share, [cos, sin]);
    let height = if rng.bool() { 0.0015 } else { 0.012 + 0.018 * rng.f32() };
    let material = Material::Cover(hue(rng.f32(), 0.5, 0.5));
    // Strips along the four sides of the sheet: the axis they run along, its range, and their range across.
    let strips = [
        (0, [-ox, ox], [iy, oy]),
        (0, [-ox, ox], [-oy, -iy]),
        (1, [-iy, iy], [ix, ox]),
        (1, [-iy, iy], [-ox, -ix]),
    ];
    let mut covers = Vec::new();
    for (axis, [from, to], across) in strips {
        let (slope, offset) = if axis == 0 { (cos, sin) } else { (sin, cos) };
        let middle = 0.5 * (across[0] + across[1]);
        let edge = (level - offset * middle) / slope;
        let [from, to] = if slope.abs() < 1e-6 {
            if offset * middle > level { [from, to] } else { continue }
        } else if slope > 0.0 {
            [from.max(edge), to]
        } else {
            [from, to.min(edge)]
        };
        if to - from < 0.01 {
            continue;
        }
        let (along, half) = (0.5 * (from + to), 0.5 * (to - from));
        let (centre, size) = if axis == 0 {
            ([along, middle], [half, 0.5 * (across[1] - across[0])])
        } else {
            ([middle, along], [0.5 * (across[1] - across[0]), half])
        };
        covers.push(cuboid(
            [centre[0] as f32, centre[1] as f32, 0.0003 + 0.5 * height],
            [size[0] as f32, size[1] as f32, 0.5 * height],
            0.0,
            material,
        ));
    }
    covers
}

/// How far along a direction the cut lies beyond which `share` of the ring is.
fn cut_level(sheet: &Sheet, inner: &[[f64; 2]], share: f64, direction: [f64; 2]) -> f64 {
    let bound = |k: usize| inner.iter().map(|p| p[k].abs()).fold(0.0, f64::max);
    let (mx, my) = (0.5 * (bound(0) + sheet.high[0]), 0.5 * (bound(1) + sheet.high[1]));
    // Evenly spread places on the ring's middle line.
    let mut levels: Vec<f64> = (0..400)
        .map(|k| {
            let t = f64::from(k) / 400.0 * 4.0 * (mx + my);
            let (x, y) = if t < 2.0 * mx {
                (t - mx, my)
            } else if t < 4.0 * mx {
                (t - 3.0 * mx, -my)
            } else if t < 4.0 * mx + 2.0 * my {
                (mx, t - 4.0 * mx - my)
            } else {
                (-mx, t - 4.0 * mx - 3.0 * my)
            };
            x * direction[0] + y * direction[1]
        })
        .collect();
    levels.sort_by(f64::total_cmp);
    levels[((1.0 - share.clamp(0.0, 1.0)) * 399.0) as usize]
}
