//! The direction of least spread of many covariances at once, in single precision.

use pulp::Simd;

/// The smallest root `t` of `4 t³ - 3 t = r` over `s = √((1 - r) / 2)`, which is smooth where the two smaller roots meet; to 0.000 02, highest
/// power first.
const LEAST_ROOT: [f32; 5] = [0.008_749_26, -0.038_333_59, 0.106_354_77, -0.576_736_88, -0.500_019_1];
/// Newton steps that polish it: the first leaves the square of that error, the second what rounding leaves.
const STEPS: usize = 2;
/// Least length of an adjugate's column (of a covariance with trace 1): shorter ones are rounding.
const LEAST: f32 = 1e-5;

/// Unit normals and their share of the trace, where there is a direction at all.
pub(super) struct Directions<S: Simd> {
    pub(super) normal: [S::f32s; 3],
    pub(super) share: S::f32s,
    pub(super) valid: S::m32s,
}

/// Of covariances `[xx, xy, xz, yy, yz, zz]`, one a lane.
///
/// The smallest root of the characteristic cubic, then the longest column of the adjugate of `C - λI`, all of which are
/// multiples of the eigenvector.
#[inline(always)]
pub(super) fn least_directions<S: Simd>(simd: S, covariance: [S::f32s; 6]) -> Directions<S> {
    let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
    let trace = simd.add_f32s(covariance[0], simd.add_f32s(covariance[3], covariance[5]));
    let some = simd.greater_than_f32s(trace, simd.splat_f32s(1e-18));
    let per_trace = simd.div_f32s(one, simd.select_f32s(some, trace, one));
    let mut scaled = covariance;
    for v in &mut scaled {
        *v = simd.mul_f32s(*v, per_trace);
    }
    let [xx, xy, xz, yy, yz, zz] = scaled;
    // λ³ - λ² + c1 λ - c0, trace 1.
    let c1 = simd
        .add_f32s(minor(simd, xx, yy, xy), simd.add_f32s(minor(simd, xx, zz, xz), minor(simd, yy, zz, yz)));
    let det = determinant(simd, [xx, xy, xz, yy, yz, zz]);
    let c0 = simd.max_f32s(det, zero);
    let mut least = least_guess(simd, c0, c1);
    for _ in 0..STEPS {
        // p = ((λ - 1) λ + c1) λ - c0, p' = (3 λ - 2) λ + c1
        let inner = simd.mul_add_e_f32s(simd.sub_f32s(least, one), least, c1);
        let value = simd.sub_f32s(simd.mul_f32s(inner, least), c0);
        let slope = simd.mul_add_e_f32s(
            simd.mul_add_e_f32s(simd.splat_f32s(3.0), least, simd.splat_f32s(-2.0)),
            least,
            c1,
        );
        let steep = simd.greater_than_f32s(slope, simd.splat_f32s(1e-9));
        let step = simd.div_f32s(value, simd.select_f32s(steep, slope, one));
        least = simd.sub_f32s(least, simd.select_f32s(steep, step, zero));
    }
    let (xx, yy, zz) = (simd.sub_f32s(xx, least), simd.sub_f32s(yy, least), simd.sub_f32s(zz, least));
    let a = minor(simd, yy, zz, yz);
    let b = minor(simd, xx, zz, xz);
    let c = minor(simd, xx, yy, xy);
    let ab = simd.sub_f32s(simd.mul_f32s(xz, yz), simd.mul_f32s(xy, zz));
    let ac = simd.sub_f32s(simd.mul_f32s(xy, yz), simd.mul_f32s(yy, xz));
    let bc = simd.sub_f32s(simd.mul_f32s(xy, xz), simd.mul_f32s(xx, yz));
    // The longest column is that of the largest entry on the diagonal.
    let second = simd.greater_than_f32s(b, a);
    let column = choose(simd, second, [ab, b, bc], [a, ab, ac]);
    let largest = simd.max_f32s(a, b);
    let column = choose(simd, simd.greater_than_f32s(c, largest), [ac, bc, c], column);
    let square = simd.mul_add_e_f32s(
        column[2],
        column[2],
        simd.mul_add_e_f32s(column[1], column[1], simd.mul_f32s(column[0], column[0])),
    );
    let length = simd.sqrt_f32s(square);
    let long = simd.greater_than_f32s(length, simd.splat_f32s(LEAST));
    let per_length = simd.div_f32s(one, simd.select_f32s(long, length, one));
    let normal = [
        simd.mul_f32s(column[0], per_length),
        simd.mul_f32s(column[1], per_length),
        simd.mul_f32s(column[2], per_length),
    ];
    Directions { normal, share: simd.max_f32s(least, zero), valid: simd.and_m32s(some, long) }
}

/// The smallest root of `λ³ - λ² + c1 λ - c0` nearly: with `λ = 1/3 + 2 √q t` it is that of `4 t³ - 3 t = r` (Smith 1961).
#[inline(always)]
fn least_guess<S: Simd>(simd: S, c0: S::f32s, c1: S::f32s) -> S::f32s {
    let (zero, one, third) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0), simd.splat_f32s(1.0 / 3.0));
    let per_three = simd.mul_f32s(c1, third);
    let q = simd.max_f32s(simd.sub_f32s(simd.splat_f32s(1.0 / 9.0), per_three), simd.splat_f32s(1e-9));
    let root = simd.sqrt_f32s(q);
    let determinant = simd.add_f32s(simd.sub_f32s(c0, per_three), simd.splat_f32s(2.0 / 27.0));
    let half_r = simd.div_f32s(simd.mul_f32s(determinant, simd.splat_f32s(0.25)), simd.mul_f32s(q, root));
    let square = simd.min_f32s(simd.max_f32s(simd.sub_f32s(simd.splat_f32s(0.5), half_r), zero), one);
    let s = simd.sqrt_f32s(square);
    let mut t = simd.splat_f32s(LEAST_ROOT[0]);
    for c in &LEAST_ROOT[1..] {
        t = simd.mul_add_e_f32s(t, s, simd.splat_f32s(*c));
    }
    simd.max_f32s(simd.mul_add_e_f32s(simd.add_f32s(root, root), t, third), zero)
}

/// `a b - c²`.
#[inline(always)]
fn minor<S: Simd>(simd: S, a: S::f32s, b: S::f32s, c: S::f32s) -> S::f32s {
    simd.sub_f32s(simd.mul_f32s(a, b), simd.mul_f32s(c, c))
}

#[inline(always)]
fn determinant<S: Simd>(simd: S, [xx, xy, xz, yy, yz, zz]: [S::f32s; 6]) -> S::f32s {
    let first = simd.mul_f32s(xx, minor(simd, yy, zz, yz));
    let second = simd.mul_f32s(xy, simd.sub_f32s(simd.mul_f32s(xy, zz), simd.mul_f32s(yz, xz)));
    let third = simd.mul_f32s(xz, simd.sub_f32s(simd.mul_f32s(xy, yz), simd.mul_f32s(yy, xz)));
    simd.add_f32s(simd.sub_f32s(first, second), third)
}

#[inline(always)]
fn choose<S: Simd>(simd: S, mask: S::m32s, a: [S::f32s; 3], b: [S::f32s; 3]) -> [S::f32s; 3] {
    [
        simd.select_f32s(mask, a[0], b[0]),
        simd.select_f32s(mask, a[1], b[1]),
        simd.select_f32s(mask, a[2], b[2]),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::least_direction;
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_double_precision(v in prop::array::uniform9(-1.0f64..1.0), scale in -6i32..3) {
            let a = Matrix3::from_row_slice(&v);
            let c = a * a.transpose() * 10f64.powi(scale);
            let eigen = c.symmetric_eigenvalues();
            let mut sorted: Vec<f64> = eigen.iter().map(|v| v / c.trace()).collect();
            sorted.sort_by(f64::total_cmp);
            prop_assume!(sorted[1] - sorted[0] > 0.02);
            let six = [c[(0, 0)], c[(0, 1)], c[(0, 2)], c[(1, 1)], c[(1, 2)], c[(2, 2)]];
            let (expected, share) = least_direction(&six).unwrap();
            let found = least_directions(pulp::Scalar, six.map(|v| v as f32));
            prop_assert!(found.valid);
            let normal = Vector3::from(found.normal.map(f64::from));
            prop_assert!(normal.dot(&expected).abs() > 1.0 - 1e-6, "{} {}", normal, expected);
            prop_assert!((f64::from(found.share) - share).abs() < 1e-4);
        }
    }

    #[test]
    fn points_on_a_line_or_in_one_place_have_no_direction() {
        assert!(!least_directions(pulp::Scalar, [0.0; 6]).valid);
        assert!(!least_directions(pulp::Scalar, [1.0, 2.0, 3.0, 4.0, 6.0, 9.0]).valid);
    }
}
