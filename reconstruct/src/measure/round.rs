//! Products that are round from above: the smallest of many equally wide rectangles would only be the one with the most unlucky noise,
//! so their length and width are both the mean diameter.

/// Directions in which the width of something round is looked at, over half a turn.
const DIRECTIONS: usize = 24;
/// Of those, the diameter is the mean of every second one.
const AVERAGED: usize = DIRECTIONS / 2;
/// Widths of something round differ from their mean by no more than what noise makes (root mean square), metres ...
const MOST_RMS_METRES: f64 = 0.000_85;
/// ... and it is hardly longer in one direction than across: half of the difference, metres.
const MOST_OVAL_METRES: f64 = 0.001;

/// Whether something is equally wide in all directions; `end(x, y)` is how far it reaches in the direction (x, y).
pub(super) fn is_round(end: impl Fn(f64, f64) -> Option<f64>) -> bool {
    let width = |x: f64, y: f64| Some(end(x, y)? + end(-x, -y)?);
    let Some(widths) = widths(DIRECTIONS, width) else { return false };
    let mean = widths.iter().sum::<f64>() / DIRECTIONS as f64;
    let rms = (widths.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / DIRECTIONS as f64).sqrt();
    // The widths' second harmonic: half of what an ellipse is longer than wide.
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (k, width) in widths.iter().enumerate() {
        let (s, c) = (2.0 * angle(k, DIRECTIONS)).sin_cos();
        cosine += c * (width - mean);
        sine += s * (width - mean);
    }
    let oval = f64::hypot(cosine, sine) * 2.0 / DIRECTIONS as f64;
    rms < MOST_RMS_METRES && oval < MOST_OVAL_METRES
}

/// Mean width; `width(x, y)` is the one in the direction (x, y).
pub(super) fn diameter(width: impl Fn(f64, f64) -> Option<f64>) -> Option<f64> {
    Some(widths(AVERAGED, width)?.iter().sum::<f64>() / AVERAGED as f64)
}

fn angle(k: usize, count: usize) -> f64 {
    std::f64::consts::PI * k as f64 / count as f64
}

fn widths(count: usize, width: impl Fn(f64, f64) -> Option<f64>) -> Option<Vec<f64>> {
    (0..count)
        .map(|k| {
            let (s, c) = angle(k, count).sin_cos();
            width(c, s)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How far an ellipse reaches, with a ripple as noise makes it.
    fn ellipse(half: [f64; 2], ripple: f64) -> impl Fn(f64, f64) -> Option<f64> {
        move |x, y| Some(f64::hypot(half[0] * x, half[1] * y) + ripple * (9.0 * y.atan2(x)).sin().powi(2))
    }

    #[test]
    fn a_disc_is_round_and_an_ellipse_is_not() {
        assert!(is_round(ellipse([0.07, 0.07], 0.0)) && is_round(ellipse([0.07, 0.07], 0.001)));
        assert!(!is_round(ellipse([0.07, 0.0685], 0.0)), "3 mm longer than wide");
        assert!(!is_round(ellipse([0.07, 0.07], 0.002)), "the widths differ too much for noise");
        assert!(!is_round(|_, _| None));
    }

    #[test]
    fn a_square_is_not_round() {
        assert!(!is_round(|x, y| Some(0.01 * (x.abs() + y.abs()))));
    }

    #[test]
    fn the_diameter_is_the_mean_width() {
        let width = |x: f64, y: f64| Some(0.1 + 0.001 * (4.0 * y.atan2(x)).cos());
        assert!((diameter(width).unwrap() - 0.1).abs() < 1e-9);
    }
}
