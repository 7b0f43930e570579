//! Where noisy points end in one direction, from how they thin out below their end.
//!
//! Seen along one direction, a flat face puts all its points at the end, a ridge or a rim puts the share `x^(-1/2)` of them at depth x below it, a
//! round or slanted surface the same share at every depth. Real ends are mixtures of the three, blurred by noise. So for every
//! place where the end may be the best mixture is found (expectation maximisation over a histogram, Dempster, Laird and Rubin 1977), and
//! the end is the mean over the places, each by its likelihood.

use super::edge::outermost;

/// Where points end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct End {
    /// Farthest place of the surface, metres.
    pub(super) at: f64,
    /// Standard deviation of the points there, metres.
    pub(super) deviation: f64,
    /// Standard deviation of the place, as far as the points' number tells, metres.
    pub(super) spread: f64,
}

/// Width of the histogram's bins, metres.
const BIN_METRES: f64 = 0.00005;
/// The histogram goes from so many bins beyond the outermost point to so many below it.
const BINS_BEYOND: usize = 10;
const BINS_BELOW: usize = 80;
/// Places of the end that are tried: from so many bins beyond the outermost point to so many below it.
const TRIED_BEYOND: usize = 6;
const TRIED_BELOW: usize = 72;
/// Only a part of a stated deviation blurs the end; the rest is shared by all its points and moves it as a whole. Of a small end more is
/// shared than of a large one: the parts of both. Chosen on 300 simulated scans.
const BLURRING_PART: [f64; 2] = [0.55, 0.9];
/// Points of a small and of a large end that lie less than [`SIZED_BINS`] below the outermost.
const END_POINTS: [f64; 2] = [200.0, 1000.0];
/// One millimetre.
const SIZED_BINS: usize = 20;
/// Larger deviations blur all that is looked at alike; also keeps what files may state within bounds, metres.
const MOST_BLUR_METRES: f64 = 0.002;
/// Noise is smoothed over some millimetres before points are a millimetre apart: so many neighbours share theirs and count as one.
const POINTS_WORTH_ONE: f64 = 50.0;
/// Rounds of expectation maximisation.
const ROUNDS: usize = 30;
/// A little of anything anywhere: stray points are nothing to explain.
const STRAY_SHARE: f64 = 1e-7;
/// Points nearer to the outermost than this tell how large the deviations are, metres.
const NEAR_METRES: f32 = 0.002;

const BINS: usize = BINS_BEYOND + BINS_BELOW;
const SHAPES: usize = 3;
/// Bins of a blurred shape: it must reach from the farthest place below to the nearest bin and the other way round.
const SHAPE_BEYOND: usize = BINS_BEYOND + TRIED_BELOW;
const SHAPE_BINS: usize = SHAPE_BEYOND + BINS_BELOW + TRIED_BEYOND;

/// The end of points at `along` with their deviations; `None` where there are too few.
pub(super) fn end(along: &[f32], deviations: &[f32]) -> Option<End> {
    let outermost = outermost(along)?;
    let histogram = histogram(along, outermost);
    let noise = rms_near(along, deviations, outermost);
    let shapes = blurred_shapes((blurring_part(&histogram) * noise).min(MOST_BLUR_METRES));
    let tried = TRIED_BEYOND + 1 + TRIED_BELOW;
    let fits: Vec<f64> = (0..tried).map(|place| log_likelihood(&histogram, &shapes, place)).collect();
    let best = fits.iter().copied().fold(f64::MIN, f64::max);
    let (mut weight, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for (place, fit) in fits.iter().enumerate() {
        let below = (place as f64 - TRIED_BEYOND as f64) * BIN_METRES;
        let w = ((fit - best) / POINTS_WORTH_ONE).exp();
        weight += w;
        sum += w * below;
        squares += w * below * below;
    }
    let below = sum / weight;
    let spread = (squares / weight - below * below).max(0.0);
    Some(End { at: f64::from(outermost) - below, deviation: noise, spread: spread.sqrt() })
}

/// Points at every distance below the outermost.
fn histogram(along: &[f32], outermost: f32) -> [f64; BINS] {
    let mut bins = [0.0; BINS];
    for &at in along {
        let bin = f64::from(outermost - at) / BIN_METRES + BINS_BEYOND as f64;
        if (0.0..BINS as f64).contains(&bin) {
            bins[bin as usize] += 1.0;
        }
    }
    bins
}

/// Part of the deviation that blurs this end, by its size.
fn blurring_part(histogram: &[f64; BINS]) -> f64 {
    let points: f64 = histogram[BINS_BEYOND..BINS_BEYOND + SIZED_BINS].iter().sum();
    let ([few, many], [least, most]) = (END_POINTS, BLURRING_PART);
    let share = (points.max(1.0) / few).ln() / (many / few).ln();
    least + (most - least) * share.clamp(0.0, 1.0)
}

fn rms_near(along: &[f32], deviations: &[f32], outermost: f32) -> f64 {
    let near = along.iter().zip(deviations).filter(|(at, _)| **at > outermost - NEAR_METRES);
    let (squares, count) = near.fold((0.0f64, 0usize), |(squares, count), (_, &deviation)| {
        (squares + f64::from(deviation).powi(2), count + 1)
    });
    (squares / count.max(1) as f64).sqrt()
}

/// Face, ridge and slope with their end at bin `SHAPE_BEYOND`, blurred.
fn blurred_shapes(sd_metres: f64) -> [Vec<f64>; SHAPES] {
    let below = |bin: usize| (bin + 1).saturating_sub(SHAPE_BEYOND) as f64;
    let face = |bin: usize| if bin == SHAPE_BEYOND || bin + 1 == SHAPE_BEYOND { 0.5 } else { 0.0 };
    let ridge = |bin: usize| below(bin).sqrt() - (below(bin) - 1.0).max(0.0).sqrt();
    let slope = |bin: usize| f64::from(u8::from(below(bin) > 0.0));
    // Blurred beyond the far end too, which must not look like an end.
    let reach = (4.0 * sd_metres / BIN_METRES).ceil() as usize;
    let bell: Vec<f64> = (0..=2 * reach)
        .map(|k| {
            let off = (k as f64 - reach as f64) * BIN_METRES / sd_metres.max(0.2 * BIN_METRES);
            (-0.5 * off * off).exp()
        })
        .collect();
    let total: f64 = bell.iter().sum();
    let blurred = |shape: &dyn Fn(usize) -> f64| {
        let sharp: Vec<f64> = (0..SHAPE_BINS + reach).map(shape).collect();
        let at = |bin: usize| {
            let overlap =
                (0..bell.len()).filter_map(|k| Some(bell[k] * sharp.get((bin + k).checked_sub(reach)?)?));
            overlap.sum::<f64>() / total
        };
        (0..SHAPE_BINS).map(at).collect()
    };
    [blurred(&face), blurred(&ridge), blurred(&slope)]
}

/// Of the best mixture with its end at `place`, counted from the first one that is tried.
fn log_likelihood(histogram: &[f64; BINS], shapes: &[Vec<f64>; SHAPES], place: usize) -> f64 {
    let from = SHAPE_BEYOND + TRIED_BEYOND - BINS_BEYOND - place;
    let parts: [[f64; BINS]; SHAPES] = std::array::from_fn(|s| {
        let part = &shapes[s][from..from + BINS];
        let sum = part.iter().sum::<f64>().max(1e-300);
        std::array::from_fn(|bin| part[bin] / sum)
    });
    let points = histogram.iter().sum::<f64>().max(1.0);
    let mut shares = [1.0 / SHAPES as f64; SHAPES];
    let density = |shares: &[f64; SHAPES], bin: usize| {
        STRAY_SHARE + (0..SHAPES).map(|s| shares[s] * parts[s][bin]).sum::<f64>()
    };
    for _ in 0..ROUNDS {
        let mut explained = [0.0; SHAPES];
        for (bin, count) in histogram.iter().enumerate() {
            let ratio = count / density(&shares, bin);
            (0..SHAPES).for_each(|s| explained[s] += ratio * parts[s][bin]);
        }
        (0..SHAPES).for_each(|s| shares[s] *= explained[s] / points);
    }
    histogram.iter().enumerate().map(|(bin, count)| count * density(&shares, bin).ln()).sum()
}

#[cfg(test)]
mod tests {
    use super::super::edge::tests::normal;
    use super::*;

    /// The error of the end in deviations, for points whose true places below it come from `below` and of whose stated deviation only a part
    /// is their own.
    fn error(count: usize, own: f64, below: impl Fn(&mut fastrand::Rng) -> f32) -> f64 {
        let (mut rng, sd) = (fastrand::Rng::with_seed(7), 0.0005f32);
        let noise = own as f32 * sd;
        let along: Vec<f32> = (0..count).map(|_| 0.1 - below(&mut rng) + noise * normal(&mut rng)).collect();
        let found = end(&along, &vec![sd; count]).unwrap();
        assert!((found.deviation - f64::from(sd)).abs() < 1e-6);
        assert!((found.at - 0.1).abs() < 3.0 * found.spread + 1e-4, "{found:?}");
        (found.at - 0.1) / f64::from(sd)
    }

    #[test]
    fn a_face_a_ridge_and_a_round_end_are_found_whatever_the_number_of_points() {
        let [small, large] = BLURRING_PART;
        for (count, of_round) in [(5_000, small), (200_000, large)] {
            let face = error(count, large, |_| 0.0);
            let ridge = error(count, large, |rng| 0.01 * rng.f32().powi(2));
            let round = error(count, of_round, |rng| 0.05 * rng.f32());
            // A box: most points on a face across, few on the sides along.
            let lid = error(count, large, |rng| if rng.f32() < 0.7 { 0.0 } else { 0.05 * rng.f32() });
            for (what, off) in [("face", face), ("ridge", ridge), ("round", round), ("lid", lid)] {
                assert!(off.abs() < 0.4, "{what} of {count}: {off}");
            }
        }
    }

    #[test]
    fn whatever_deviations_are_stated_the_end_is_near_the_points() {
        let along: Vec<f32> = (0..2000u16).map(|i| 0.05 + 1e-6 * f32::from(i)).collect();
        for deviation in [0.1, 1e6, f32::MAX, f32::INFINITY, f32::NAN] {
            let found = end(&along, &vec![deviation; along.len()]).unwrap();
            assert!((found.at - 0.05).abs() < 0.006, "{deviation}: {found:?}");
        }
    }

    #[test]
    fn exact_points_end_exactly_and_few_have_no_end() {
        let mut along = vec![0.05f32; 1000];
        along.extend([0.3; 7]);
        assert!((end(&along, &[0.0; 1007]).unwrap().at - 0.05).abs() < 1e-4);
        assert_eq!(end(&[0.1; 7], &[0.0; 7]), None);
    }
}
