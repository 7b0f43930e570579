//! The three angles of Rusu's Darboux frame between a point and its neighbours, a register of neighbours at once, as bins.

use pulp::Simd;

use super::leaf::Around;
use super::{BINS, LENGTH};

/// Bin of pairs that have no frame.
pub(super) const SPARE_BIN: u32 = LENGTH as u32;
/// Adding it rounds to integers, which then stand in the lowest bits.
const ROUNDER: f32 = 8_388_608.0;
/// Shortest vector that has a direction.
const LEAST: f32 = 1e-6;

/// A place with a normal.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Oriented {
    pub(super) place: [f32; 3],
    pub(super) normal: [f32; 3],
}

type Vector<S> = [<S as Simd>::f32s; 3];

/// `α = v·n_t`, `φ = u·(p_t - p_s)/d`, `θ = atan2(w·n_t, u·n_t)` (their eq. 1–2), each scaled to 0..1 and put into bins.
#[inline(always)]
pub(super) fn bins<S: Simd>(simd: S, around: &mut Around) {
    let count = around.oriented[0].len();
    for bins in &mut around.bins {
        bins.resize(count, 0);
    }
    let Around { oriented, bins, point, .. } = around;
    let ([xs, ys, zs, nx, ny, nz], [alphas, phis, thetas]) = (oriented, bins);
    let (xs, ys, zs) = (S::as_simd_f32s(xs).0, S::as_simd_f32s(ys).0, S::as_simd_f32s(zs).0);
    let (nx, ny, nz) = (S::as_simd_f32s(nx).0, S::as_simd_f32s(ny).0, S::as_simd_f32s(nz).0);
    let alphas = S::as_mut_simd_u32s(alphas).0;
    let phis = S::as_mut_simd_u32s(phis).0;
    let thetas = S::as_mut_simd_u32s(thetas).0;
    let p = splat(simd, point.place);
    let n = splat(simd, point.normal);
    let half = simd.splat_f32s(0.5);
    for i in 0..xs.len() {
        let line = [simd.sub_f32s(xs[i], p[0]), simd.sub_f32s(ys[i], p[1]), simd.sub_f32s(zs[i], p[2])];
        let m = [nx[i], ny[i], nz[i]];
        let (along_n, along_m) = (dot(simd, &n, &line), dot(simd, &m, &line));
        // The frame stands where the normal is closer to the connecting line.
        let own = simd.greater_than_or_equal_f32s(simd.abs_f32s(along_n), simd.abs_f32s(along_m));
        let u = choose(simd, own, &n, &m);
        let other = choose(simd, own, &m, &n);
        let distance = simd.sqrt_f32s(dot(simd, &line, &line));
        let per_distance = simd.div_f32s(simd.splat_f32s(1.0), distance);
        let per_distance = simd.select_f32s(own, per_distance, simd.neg_f32s(per_distance));
        let direction = scaled(simd, &line, per_distance);
        let across = cross(simd, &direction, &u);
        let length = simd.sqrt_f32s(dot(simd, &across, &across));
        let valid = simd.greater_than_f32s(length, simd.splat_f32s(LEAST));
        let v = scaled(simd, &across, simd.div_f32s(simd.splat_f32s(1.0), length));
        let w = cross(simd, &u, &v);
        let alpha = dot(simd, &v, &other);
        let phi = dot(simd, &u, &direction);
        let turn = simd.splat_f32s(1.0 / std::f32::consts::TAU);
        let theta = atan2(simd, dot(simd, &w, &other), dot(simd, &u, &other));
        let shares = [
            simd.mul_add_e_f32s(alpha, half, half),
            simd.mul_add_e_f32s(phi, half, half),
            simd.mul_add_e_f32s(theta, turn, half),
        ];
        let spare = simd.splat_u32s(SPARE_BIN);
        alphas[i] = simd.select_u32s(valid, bin(simd, shares[0], 0), spare);
        phis[i] = simd.select_u32s(valid, bin(simd, shares[1], BINS), spare);
        thetas[i] = simd.select_u32s(valid, bin(simd, shares[2], 2 * BINS), spare);
    }
}

/// Bin of a share 0..1 of the histogram that begins at `first`.
#[inline(always)]
fn bin<S: Simd>(simd: S, share: S::f32s, first: usize) -> S::u32s {
    let place = simd.mul_add_e_f32s(share, simd.splat_f32s(BINS as f32), simd.splat_f32s(-0.5));
    let last = simd.splat_f32s((BINS - 1) as f32);
    let clamped = simd.min_f32s(simd.max_f32s(place, simd.splat_f32s(0.0)), last);
    let rounded = simd.transmute_u32s_f32s(simd.add_f32s(clamped, simd.splat_f32s(ROUNDER)));
    let number = simd.and_u32s(rounded, simd.splat_u32s(0xff));
    simd.add_u32s(number, simd.splat_u32s(first as u32))
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: &Vector<S>, b: &Vector<S>) -> S::f32s {
    simd.mul_add_e_f32s(a[2], b[2], simd.mul_add_e_f32s(a[1], b[1], simd.mul_f32s(a[0], b[0])))
}

#[inline(always)]
fn scaled<S: Simd>(simd: S, a: &Vector<S>, factor: S::f32s) -> Vector<S> {
    [simd.mul_f32s(a[0], factor), simd.mul_f32s(a[1], factor), simd.mul_f32s(a[2], factor)]
}

#[inline(always)]
fn cross<S: Simd>(simd: S, a: &Vector<S>, b: &Vector<S>) -> Vector<S> {
    [minor(simd, a, b, 1, 2), minor(simd, a, b, 2, 0), minor(simd, a, b, 0, 1)]
}

#[inline(always)]
fn minor<S: Simd>(simd: S, a: &Vector<S>, b: &Vector<S>, i: usize, j: usize) -> S::f32s {
    simd.sub_f32s(simd.mul_f32s(a[i], b[j]), simd.mul_f32s(a[j], b[i]))
}

#[inline(always)]
fn splat<S: Simd>(simd: S, a: [f32; 3]) -> Vector<S> {
    [simd.splat_f32s(a[0]), simd.splat_f32s(a[1]), simd.splat_f32s(a[2])]
}

#[inline(always)]
fn choose<S: Simd>(simd: S, mask: S::m32s, a: &Vector<S>, b: &Vector<S>) -> Vector<S> {
    [
        simd.select_f32s(mask, a[0], b[0]),
        simd.select_f32s(mask, a[1], b[1]),
        simd.select_f32s(mask, a[2], b[2]),
    ]
}

/// Coefficients of the arc tangent's odd polynomial on 0..1 (minimax, to single precision), highest power first.
const ARC_TANGENT: [f32; 8] = [
    0.002_823_639,
    -0.015_956_903,
    0.042_504_99,
    -0.074_890_09,
    0.106_347_93,
    -0.142_027_36,
    0.199_926_96,
    -0.333_331_02,
];

#[inline(always)]
fn atan2<S: Simd>(simd: S, y: S::f32s, x: S::f32s) -> S::f32s {
    let zero = simd.splat_f32s(0.0);
    let (ax, ay) = (simd.abs_f32s(x), simd.abs_f32s(y));
    let (low, high) = (simd.min_f32s(ax, ay), simd.max_f32s(ax, ay));
    let ratio = simd.div_f32s(low, simd.max_f32s(high, simd.splat_f32s(f32::MIN_POSITIVE)));
    let square = simd.mul_f32s(ratio, ratio);
    let mut series = simd.splat_f32s(ARC_TANGENT[0]);
    for c in &ARC_TANGENT[1..] {
        series = simd.mul_add_e_f32s(series, square, simd.splat_f32s(*c));
    }
    let angle = simd.mul_add_e_f32s(simd.mul_f32s(series, square), ratio, ratio);
    let steep = simd.greater_than_f32s(ay, ax);
    let angle =
        simd.select_f32s(steep, simd.sub_f32s(simd.splat_f32s(std::f32::consts::FRAC_PI_2), angle), angle);
    let behind = simd.less_than_f32s(x, zero);
    let angle = simd.select_f32s(behind, simd.sub_f32s(simd.splat_f32s(std::f32::consts::PI), angle), angle);
    simd.select_f32s(simd.less_than_f32s(y, zero), simd.neg_f32s(angle), angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arc_tangent_is_that_of_the_standard_library() {
        for i in 0..720 {
            let angle = (i as f32 - 359.5) * std::f32::consts::PI / 360.0;
            let found = atan2(pulp::Scalar, 0.3 * angle.sin(), 0.3 * angle.cos());
            assert!((found - angle).abs() < 1e-6, "{found} {angle}");
        }
    }
}
