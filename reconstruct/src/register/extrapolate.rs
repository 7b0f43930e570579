//! Besl and McKay's acceleration of ICP (1992, section IV-C): while the registration moves steadily in one direction,
//! the step is extrapolated along it by a line and a parabola through the last errors.

use nalgebra::Vector6;

/// Largest angle between successive steps that still counts as one direction, radians.
const SAME_DIRECTION: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Longest step allowed, in last steps (their v_max).
const LONGEST: f64 = 25.0;

/// The last registration states and errors.
#[derive(Debug, Default)]
pub(crate) struct Extrapolation {
    /// Step and mean square error before it, newest last; at most three.
    history: Vec<(Vector6<f64>, f64)>,
}

impl Extrapolation {
    /// Notes a step (rotation scaled to metres by the caller) and the mean square error after it. Gives the factor by
    /// which to lengthen the step, at least 1.
    pub(crate) fn factor(&mut self, step: &Vector6<f64>, error: f64) -> f64 {
        self.history.push((*step, error));
        if self.history.len() > 3 {
            self.history.remove(0);
        }
        let [(s2, d2), (s1, d1), (s0, d0)] = self.history[..] else { return 1.0 };
        let straight = |a: &Vector6<f64>, b: &Vector6<f64>| {
            let scale = a.norm() * b.norm();
            scale > 0.0 && (a.dot(b) / scale).clamp(-1.0, 1.0).acos() < SAME_DIRECTION
        };
        if !(straight(&s0, &s1) && straight(&s1, &s2)) {
            return 1.0;
        }
        let length = s0.norm();
        let longest = LONGEST * length;
        // Arc lengths of the last three states, the newest at zero.
        let (v1, v2) = (-length, -length - s1.norm());
        let Some(step) = best_step([(v2, d2), (v1, d1), (0.0, d0)], longest) else { return 1.0 };
        self.history.clear();
        1.0 + step / length
    }
}

/// How far beyond zero the line's zero and the parabola's minimum send us; `None` where neither helps.
fn best_step(samples: [(f64, f64); 3], longest: f64) -> Option<f64> {
    let line = line_zero(&samples);
    let parabola = parabola_minimum(&samples);
    let inside = |v: f64| v > 0.0 && v < longest;
    match (line, parabola) {
        (Some(l), Some(p)) if inside(p) && (p < l || l <= 0.0) => Some(p),
        (Some(l), _) if inside(l) => Some(l),
        (_, Some(p)) if inside(p) => Some(p),
        (Some(l), Some(p)) if l >= longest && p >= longest => Some(longest),
        _ => None,
    }
}

/// Zero of the least-squares line through the samples.
fn line_zero(samples: &[(f64, f64); 3]) -> Option<f64> {
    let mean_v = samples.iter().map(|s| s.0).sum::<f64>() / 3.0;
    let mean_d = samples.iter().map(|s| s.1).sum::<f64>() / 3.0;
    let slope = samples.iter().map(|(v, d)| (v - mean_v) * (d - mean_d)).sum::<f64>()
        / samples.iter().map(|(v, _)| (v - mean_v).powi(2)).sum::<f64>();
    (slope < 0.0 && slope.is_finite()).then(|| mean_v - mean_d / slope)
}

/// Lowest point of the parabola through the samples.
fn parabola_minimum(samples: &[(f64, f64); 3]) -> Option<f64> {
    let [(v2, d2), (v1, d1), (v0, d0)] = *samples;
    let (s1, s2) = ((d1 - d0) / (v1 - v0), (d2 - d1) / (v2 - v1));
    let curvature = (s2 - s1) / (v2 - v0);
    let slope = s1 - curvature * (v1 + v0);
    (curvature > 0.0 && curvature.is_finite()).then(|| -slope / (2.0 * curvature))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_met_at_its_lowest_point() {
        let error = |v: f64| 2.0 + (v - 3.0).powi(2);
        let samples = [-2.0, -1.0, 0.0].map(|v| (v, error(v)));
        assert!((parabola_minimum(&samples).unwrap() - 3.0).abs() < 1e-9);
        assert!((best_step(samples, 25.0).unwrap() - 3.0).abs() < 2.0);
    }

    #[test]
    fn a_turn_or_a_first_step_is_not_lengthened() {
        let mut extrapolation = Extrapolation::default();
        let x = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let y = Vector6::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0);
        assert_eq!(extrapolation.factor(&x, 9.0), 1.0);
        assert_eq!(extrapolation.factor(&x, 7.0), 1.0);
        assert_eq!(extrapolation.factor(&y, 6.0), 1.0);
        let mut steady = Extrapolation::default();
        let factors: Vec<f64> = [9.0, 7.0, 5.2].map(|error| steady.factor(&x, error)).to_vec();
        assert!(factors[2] > 2.0 && factors[2] <= 26.0, "{factors:?}");
    }
}
