//! How the smallest rectangle around something lies, from noisy areas of rectangles in many directions.
//!
//! Where a side of the rectangle lies on a flat face the area rises like a roof turned over, with a kink at the smallest; around something
//! round it hardly changes. The smallest of noisy areas would be the one with the most unlucky noise, so a kinked parabola is fitted to
//! many of them, and its smallest place counts.

use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;

/// Directions tried first, degrees apart over a right angle ...
const COARSE_DEGREES: f64 = 3.0;
const COARSE: usize = 30;
/// ... then so many on both sides of the best, so many degrees apart, and once more so.
const FINE_DEGREES: [f64; 2] = [0.6, 0.12];
const FINE: i32 = 10;
/// Kink and smallest place are looked for between the directions that were tried: so many steps from one to the next.
const BETWEEN: i32 = 4;

/// Direction of one side of the smallest rectangle, radians; `area(angle)` is that of the rectangle with a side along it, noisy.
pub(super) fn smallest(area: impl Fn(f64) -> f64 + Sync) -> f64 {
    let coarse = (0..COARSE).into_par_iter().map(|k| (k as f64 * COARSE_DEGREES).to_radians());
    let areas: Vec<(f64, f64)> = coarse.map(|angle| (area(angle), angle)).collect();
    let mut middle = areas.into_iter().fold((f64::MAX, 0.0), |a, b| if b.0 < a.0 { b } else { a }).1;
    for step in FINE_DEGREES {
        let radians = step.to_radians();
        let directions = (-FINE..=FINE).into_par_iter().map(|k| middle + f64::from(k) * radians);
        let areas: Vec<f64> = directions.map(&area).collect();
        middle += smallest_of_fit(&areas) * radians;
    }
    middle
}

/// Place of the smallest value of the kinked parabola that fits the values at `-FINE..=FINE` best.
fn smallest_of_fit(values: &[f64]) -> f64 {
    let mut best = (f64::INFINITY, 0.0);
    for kink in (1 - FINE) * BETWEEN..=(FINE - 1) * BETWEEN {
        let kink = f64::from(kink) / f64::from(BETWEEN);
        let terms = |x: f64| Vector4::new(1.0, x, x * x, (x - kink).abs());
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for (x, &value) in (-FINE..).zip(values) {
            let t = terms(f64::from(x));
            normal += t * t.transpose();
            right += t * value;
        }
        let Some(fit) = normal.cholesky().map(|c| c.solve(&right)) else { continue };
        let at = |x: f64| fit.dot(&terms(x));
        let off: f64 = (-FINE..).zip(values).map(|(x, v)| (v - at(f64::from(x))).powi(2)).sum();
        if off < best.0 {
            let places = (-FINE * BETWEEN..=FINE * BETWEEN).map(|k| f64::from(k) / f64::from(BETWEEN));
            best = (off, places.fold(0.0, |low, x| if at(x) < at(low) { x } else { low }));
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::edge::tests::normal;

    /// The area around something that is `width(angle)` wide, each width a little off: in one direction always by the same.
    fn noisy(sd: f64, seed: u64, width: impl Fn(f64) -> f64) -> impl Fn(f64) -> f64 {
        let off = move |angle: f64| {
            let direction = (angle.to_degrees() * 1000.0).round() as i64 as u64;
            sd * f64::from(normal(&mut fastrand::Rng::with_seed(direction.wrapping_mul(1000) + seed)))
        };
        move |angle| {
            let across = angle + std::f64::consts::FRAC_PI_2;
            (width(angle) + off(angle)) * (width(across) + off(across))
        }
    }

    /// Turns by which a rectangle looks the same are nothing.
    fn degrees_apart(a: f64, b: f64) -> f64 {
        let apart = (a - b).to_degrees().rem_euclid(90.0);
        apart.min(90.0 - apart)
    }

    #[test]
    fn a_box_lies_as_its_faces_do_whatever_the_noise() {
        for seed in 0..20 {
            let turned = 0.07 * seed as f64;
            let width = |angle: f64| {
                let (s, c) = (angle - turned).sin_cos();
                0.16 * c.abs() + 0.06 * s.abs()
            };
            let exact = smallest(noisy(0.0, seed, width));
            assert!(degrees_apart(exact, turned) < 0.016, "{exact} {turned}");
            let found = smallest(noisy(0.0003, seed, width));
            assert!(degrees_apart(found, turned) < 0.25, "{found} {turned}");
        }
    }

    /// What the fit replaces: the direction of the least of all areas that are looked at.
    fn least(area: impl Fn(f64) -> f64) -> f64 {
        let least_of = |angles: &mut dyn Iterator<Item = f64>| {
            angles.map(|a| (area(a), a)).fold((f64::MAX, 0.0), |a, b| if b.0 < a.0 { b } else { a }).1
        };
        let coarse = least_of(&mut (0..COARSE).map(|k| (k as f64 * COARSE_DEGREES).to_radians()));
        FINE_DEGREES.iter().fold(coarse, |middle, step| {
            least_of(&mut (-FINE..=FINE).map(|k| middle + f64::from(k) * step.to_radians()))
        })
    }

    #[test]
    fn of_something_oval_the_long_side_is_found() {
        for seed in 0..20 {
            let turned = 0.3 + 0.05 * seed as f64;
            let width = |angle: f64| {
                let (s, c) = (angle - turned).sin_cos();
                f64::hypot(0.16 * c, 0.1 * s)
            };
            let found = smallest(noisy(0.0003, seed, width));
            assert!(degrees_apart(found, turned) < 8.0, "{found} {turned}");
        }
    }

    #[test]
    fn of_equal_directions_the_luckiest_noise_is_not_the_smallest() {
        let mut missing = [0.0; 2];
        for seed in 0..100 {
            let area = noisy(0.0003, seed, |_| 0.13);
            missing[0] += 0.13 * 0.13 - area(smallest(&area));
            missing[1] += 0.13 * 0.13 - area(least(&area));
        }
        assert!(missing[1] > 0.0 && missing[0].abs() < 0.5 * missing[1], "{missing:?}");
        assert!(smallest(|_| f64::NAN).is_finite());
    }
}
