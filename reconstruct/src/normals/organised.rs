//! Normals of an organised depth map: sums along each row first, then of the rows of each column, both only over what does
//! not jump; so a window costs its side, not its area. Where less than half of it is left, it is looked at pixel by pixel.
//! Bands of rows are independent, whole registers of pixels go at once.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::eigen::least_directions;
use super::{DepthJump, Surface};
use crate::simd::{LANES, run};

/// Rows of a parallel task.
const BAND: usize = 60;
/// Columns worked on at once: what is kept of their rows stays in the first-level cache.
const STRIP: usize = 2 * LANES;
/// Values kept a pixel: its place, then count, sums and products of its row relative to it.
const PLANES: usize = 13;

/// Normals and curvatures of all pixels; `points` are whole rows of `width`.
pub(super) fn surface(points: &[[f32; 3]], width: usize, radius: usize, jump: DepthJump) -> Surface {
    let mut surface = Surface { normals: vec![[0.0; 3]; points.len()], curvatures: vec![0.0; points.len()] };
    let pixels = BAND * width;
    let bands = surface.normals.par_chunks_mut(pixels).zip(surface.curvatures.par_chunks_mut(pixels));
    bands.enumerate().for_each(|(band, (normals, curvatures))| {
        run(Band { points, width, radius, jump, first: band * BAND, normals, curvatures });
    });
    surface
}

struct Band<'a> {
    points: &'a [[f32; 3]],
    width: usize,
    radius: usize,
    jump: DepthJump,
    /// The band's first row.
    first: usize,
    normals: &'a mut [[f32; 3]],
    curvatures: &'a mut [f32],
}

/// The rows around the one in work, each with `radius` empty pixels on both sides and whole registers between.
struct Ring {
    rows: usize,
    stride: usize,
    radius: usize,
    data: Vec<f32>,
}

impl Ring {
    fn row(&self, row: usize) -> &[f32] {
        let size = PLANES * self.stride;
        &self.data[row % self.rows * size..][..size]
    }
}

impl WithSimd for Band<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let height = self.points.len() / self.width;
        let radius = self.radius.min(self.width.max(height));
        let (rows, stride) = (2 * radius + 1, 2 * radius + STRIP);
        let mut ring = Ring { rows, stride, radius, data: vec![f32::NAN; rows * PLANES * stride] };
        let last = self.first + self.normals.len() / self.width;
        for left in (0..self.width).step_by(STRIP) {
            let right = (left + STRIP).min(self.width);
            let mut next = self.first.saturating_sub(radius);
            for row in self.first..last {
                while next < (row + radius + 1).min(height) {
                    let points = &self.points[next * self.width..][..self.width];
                    let size = PLANES * stride;
                    let place = next % rows * size;
                    sum_row(simd, points, left, &mut ring.data[place..place + size], radius, self.jump);
                    next += 1;
                }
                let around = row.saturating_sub(radius)..(row + radius + 1).min(height);
                let out = (row - self.first) * self.width;
                let normals = &mut self.normals[out + left..out + right];
                let curvatures = &mut self.curvatures[out + left..out + right];
                finish_row(simd, &ring, row, around, self.jump, normals, curvatures);
            }
        }
    }
}

#[inline(always)]
fn load<S: Simd>(row: &[f32], at: usize) -> S::f32s {
    S::as_simd_f32s(&row[at..at + S::F32_LANES]).0[0]
}

#[inline(always)]
fn limit_of<S: Simd>(simd: S, jump: DepthJump, z: S::f32s) -> S::f32s {
    let square = simd.mul_f32s(z, z);
    simd.add_f32s(simd.splat_f32s(jump.metres), simd.mul_f32s(simd.splat_f32s(jump.per_square_metre), square))
}

/// Places of a row as columns, then the sums over its pixels that do not jump from each.
#[inline(always)]
fn sum_row<S: Simd>(
    simd: S,
    points: &[[f32; 3]],
    left: usize,
    planes: &mut [f32],
    radius: usize,
    jump: DepthJump,
) {
    let stride = 2 * radius + STRIP;
    let (places, sums) = planes.split_at_mut(3 * stride);
    let (xs, rest) = places.split_at_mut(stride);
    let (ys, zs) = rest.split_at_mut(stride);
    places_around(points, left, radius, [&mut *xs, &mut *ys, &mut *zs]);
    let zero = simd.splat_f32s(0.0);
    for u in (0..STRIP).step_by(S::F32_LANES) {
        let [cx, cy, cz] = [load::<S>(xs, u + radius), load::<S>(ys, u + radius), load::<S>(zs, u + radius)];
        let limit = limit_of(simd, jump, cz);
        let mut total = [zero; 10];
        for at in u..=u + 2 * radius {
            let x = simd.sub_f32s(load::<S>(xs, at), cx);
            let y = simd.sub_f32s(load::<S>(ys, at), cy);
            let z = simd.sub_f32s(load::<S>(zs, at), cz);
            total = with_pixel(simd, total, [x, y, z], limit);
        }
        for (plane, value) in sums.chunks_exact_mut(stride).zip(total) {
            S::as_mut_simd_f32s(&mut plane[u + radius..u + radius + S::F32_LANES]).0[0] = value;
        }
    }
}

/// The strip's places and `radius` more on both sides, NaN beyond the picture.
fn places_around(points: &[[f32; 3]], left: usize, radius: usize, [xs, ys, zs]: [&mut [f32]; 3]) {
    let first = left.saturating_sub(radius);
    let end = (left + STRIP + radius).min(points.len());
    let begin = first + radius - left;
    for column in [&mut *xs, &mut *ys, &mut *zs] {
        column[..begin].fill(f32::NAN);
        column[begin + end - first..].fill(f32::NAN);
    }
    let columns = xs[begin..].iter_mut().zip(&mut ys[begin..]).zip(&mut zs[begin..]);
    for (((x, y), z), p) in columns.zip(&points[first..end]) {
        (*x, *y, *z) = (p[0], p[1], p[2]);
    }
}

/// Adds the rows' sums of each column, moved to its own pixel, and takes the direction of least spread.
#[inline(always)]
fn finish_row<S: Simd>(
    simd: S,
    ring: &Ring,
    row: usize,
    around: std::ops::Range<usize>,
    jump: DepthJump,
    normals: &mut [[f32; 3]],
    curvatures: &mut [f32],
) {
    let Ring { stride, radius, .. } = *ring;
    let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
    let half = simd.splat_f32s(0.5 * (2 * radius + 1).pow(2) as f32);
    let needed = simd.splat_f32s((((2 * radius + 1).pow(2) / 3).max(3)) as f32);
    let centre = ring.row(row);
    for u in (0..normals.len()).step_by(S::F32_LANES) {
        let at = u + radius;
        let [cx, cy, cz] =
            [load::<S>(centre, at), load::<S>(centre, stride + at), load::<S>(centre, 2 * stride + at)];
        let limit = limit_of(simd, jump, cz);
        let mut total = [zero; 10];
        for other in around.clone() {
            let planes = ring.row(other);
            let dz = simd.sub_f32s(load::<S>(planes, 2 * stride + at), cz);
            let near = simd.less_than_or_equal_f32s(simd.abs_f32s(dz), limit);
            let dx = simd.select_f32s(near, simd.sub_f32s(load::<S>(planes, at), cx), zero);
            let dy = simd.select_f32s(near, simd.sub_f32s(load::<S>(planes, stride + at), cy), zero);
            let dz = simd.select_f32s(near, dz, zero);
            let mut of = [zero; 10];
            for (k, of) in of.iter_mut().enumerate() {
                *of = simd.select_f32s(near, load::<S>(planes, (3 + k) * stride + at), zero);
            }
            let (n, sx, sy, sz) = (of[0], of[1], of[2], of[3]);
            // The row's sums about its own pixel become sums about the centre: s + n d, P + d s'ᵀ + s dᵀ.
            let tx = simd.mul_add_e_f32s(n, dx, sx);
            let ty = simd.mul_add_e_f32s(n, dy, sy);
            let tz = simd.mul_add_e_f32s(n, dz, sz);
            total = [
                simd.add_f32s(total[0], n),
                simd.add_f32s(total[1], tx),
                simd.add_f32s(total[2], ty),
                simd.add_f32s(total[3], tz),
                simd.add_f32s(total[4], moved(simd, of[4], [dx, tx], [sx, dx])),
                simd.add_f32s(total[5], moved(simd, of[5], [dx, ty], [sx, dy])),
                simd.add_f32s(total[6], moved(simd, of[6], [dx, tz], [sx, dz])),
                simd.add_f32s(total[7], moved(simd, of[7], [dy, ty], [sy, dy])),
                simd.add_f32s(total[8], moved(simd, of[8], [dy, tz], [sy, dz])),
                simd.add_f32s(total[9], moved(simd, of[9], [dz, tz], [sz, dz])),
            ];
        }
        // Without depth there is no limit either.
        let present = simd.greater_than_or_equal_f32s(limit, zero);
        let broken = simd.and_m32s(present, simd.less_than_f32s(total[0], half));
        if simd.first_true_m32s(broken) < S::F32_LANES {
            total = window(simd, ring, around.clone(), at, [cx, cy, cz], limit);
        }
        let enough = simd.greater_than_or_equal_f32s(total[0], needed);
        let per_count = simd.div_f32s(one, simd.select_f32s(enough, total[0], one));
        let mut mean = [zero; 3];
        for (mean, sum) in mean.iter_mut().zip(&total[1..]) {
            *mean = simd.mul_f32s(*sum, per_count);
        }
        let mut covariance = [zero; 6];
        for ((covariance, sum), (a, b)) in
            covariance.iter_mut().zip(&total[4..]).zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)])
        {
            *covariance = simd.sub_f32s(simd.mul_f32s(*sum, per_count), simd.mul_f32s(mean[a], mean[b]));
        }
        let found = least_directions(simd, covariance);
        let valid = simd.and_m32s(found.valid, enough);
        let [nx, ny, nz] = found.normal;
        // The camera is at the origin.
        let away = simd.mul_add_e_f32s(nz, cz, simd.mul_add_e_f32s(ny, cy, simd.mul_f32s(nx, cx)));
        let sign = simd.select_f32s(simd.greater_than_f32s(away, zero), simd.splat_f32s(-1.0), one);
        let sign = simd.select_f32s(valid, sign, zero);
        let share = simd.select_f32s(valid, found.share, zero);
        let columns = [simd.mul_f32s(nx, sign), simd.mul_f32s(ny, sign), simd.mul_f32s(nz, sign), share];
        put::<S>(&columns, &mut normals[u..], &mut curvatures[u..]);
    }
}

/// Sums over the square window itself, where much of it is missing: at jumps and at the picture's border.
#[inline(always)]
fn window<S: Simd>(
    simd: S,
    ring: &Ring,
    around: std::ops::Range<usize>,
    at: usize,
    [cx, cy, cz]: [S::f32s; 3],
    limit: S::f32s,
) -> [S::f32s; 10] {
    let mut total = [simd.splat_f32s(0.0); 10];
    for row in around {
        let planes = ring.row(row);
        let (xs, rest) = planes.split_at(ring.stride);
        let (ys, zs) = (&rest[..ring.stride], &rest[ring.stride..2 * ring.stride]);
        for at in at - ring.radius..=at + ring.radius {
            let x = simd.sub_f32s(load::<S>(xs, at), cx);
            let y = simd.sub_f32s(load::<S>(ys, at), cy);
            let z = simd.sub_f32s(load::<S>(zs, at), cz);
            total = with_pixel(simd, total, [x, y, z], limit);
        }
    }
    total
}

/// Count, sums and products with one more pixel, given relative to the centre, if it does not jump.
#[inline(always)]
fn with_pixel<S: Simd>(
    simd: S,
    total: [S::f32s; 10],
    [x, y, z]: [S::f32s; 3],
    limit: S::f32s,
) -> [S::f32s; 10] {
    let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
    let near = simd.less_than_or_equal_f32s(simd.abs_f32s(z), limit);
    let x = simd.select_f32s(near, x, zero);
    let y = simd.select_f32s(near, y, zero);
    let z = simd.select_f32s(near, z, zero);
    [
        simd.add_f32s(total[0], simd.select_f32s(near, one, zero)),
        simd.add_f32s(total[1], x),
        simd.add_f32s(total[2], y),
        simd.add_f32s(total[3], z),
        simd.mul_add_e_f32s(x, x, total[4]),
        simd.mul_add_e_f32s(x, y, total[5]),
        simd.mul_add_e_f32s(x, z, total[6]),
        simd.mul_add_e_f32s(y, y, total[7]),
        simd.mul_add_e_f32s(y, z, total[8]),
        simd.mul_add_e_f32s(z, z, total[9]),
    ]
}

/// `p + a b + c d`.
#[inline(always)]
fn moved<S: Simd>(simd: S, p: S::f32s, [a, b]: [S::f32s; 2], [c, d]: [S::f32s; 2]) -> S::f32s {
    simd.mul_add_e_f32s(a, b, simd.mul_add_e_f32s(c, d, p))
}

/// Lanes back to pixels.
#[inline(always)]
fn put<S: Simd>(columns: &[S::f32s; 4], normals: &mut [[f32; 3]], curvatures: &mut [f32]) {
    let lanes: &[f32] = pulp::bytemuck::cast_slice(columns);
    let count = S::F32_LANES;
    for (lane, (normal, curvature)) in normals.iter_mut().zip(curvatures).take(count).enumerate() {
        // A pixel without a normal has plus zero everywhere.
        *normal = std::array::from_fn(|k| lanes[k * count + lane] + 0.0);
        *curvature = lanes[3 * count + lane];
    }
}
