//! Roughly where noisy points end in one direction, quickly: to compare many directions. [`end`](super::end) says it well.
//!
//! The outermost of n noisy points lies farther out the more there are: by three deviations where a whole face ends there. But
//! the points beyond the true edge exceed it by what their noise alone makes: half of them by less than 0.67 deviations where a
//! flat face ends (half a normal distribution), by less than 0.50 where a round one does (points spread evenly below the edge, as on a
//! sphere). So the edge is about where the middle excess is that, whatever the number of points.

/// Middle excess of points beyond the edge, in deviations. Less than theory's 0.5, since part of a stated deviation is shared by all points of an edge and
/// pushes none of them beyond it, and rims come out a little short: chosen on simulated scans of eight products.
const MIDDLE_EXCESS: f32 = 0.35;
/// The excess must stay that large for so many deviations farther in: few points exceed by chance.
const LOOK_FARTHER: f32 = 0.5;
/// Fewer points are no edge: stray points stand alone.
const MIN_BEYOND: usize = 8;
/// Points farther below the outermost than this are never beyond the edge, metres.
const SHELL_METRES: f32 = 0.006;
/// Resolution of the search, metres.
const BIN_METRES: f32 = 0.00002;

/// The edge of points at `along` with their deviations; `None` where there are too few.
pub(super) fn edge(along: &[f32], deviations: &[f32]) -> Option<f64> {
    let outermost = outermost(along)?;
    let bins = (SHELL_METRES / BIN_METRES) as usize + 1;
    // (how many, sum of squared deviations) at every distance below the outermost
    let mut shell = vec![(0u32, 0.0f32); bins];
    for (&at, &deviation) in along.iter().zip(deviations) {
        let below = (outermost - at).max(0.0) / BIN_METRES;
        if below < bins as f32 {
            let bin = &mut shell[below as usize];
            *bin = (bin.0 + 1, bin.1 + deviation * deviation);
        }
    }
    let (mut beyond, mut squares, mut first) = (0usize, 0.0f32, None);
    // The middle one of those beyond moves in with the edge.
    let (mut middle, mut before_middle) = (0usize, 0usize);
    for (bin, &(count, square)) in shell.iter().enumerate() {
        beyond += count as usize;
        squares += square;
        while before_middle + (shell[middle].0 as usize) < beyond.div_ceil(2) {
            before_middle += shell[middle].0 as usize;
            middle += 1;
        }
        let excess = (bin - middle) as f32 * BIN_METRES;
        let deviation = (squares / beyond.max(1) as f32).sqrt();
        if beyond < MIN_BEYOND || excess < MIDDLE_EXCESS * deviation {
            first = None;
            continue;
        }
        let first = *first.get_or_insert(bin);
        if (bin - first) as f32 * BIN_METRES >= LOOK_FARTHER * deviation {
            return Some(f64::from(outermost - (first as f32 + 0.5) * BIN_METRES));
        }
    }
    // All of the shell is one flat face with hardly any noise, or there are few points: the outermost are the edge.
    Some(f64::from(outermost))
}

/// The outermost value that is not a stray one: [`MIN_BEYOND`] stand at least as far out.
pub(super) fn outermost(along: &[f32]) -> Option<f32> {
    if along.len() < MIN_BEYOND {
        return None;
    }
    let mut best = [f32::NEG_INFINITY; MIN_BEYOND];
    for &value in along {
        if value > best[MIN_BEYOND - 1] {
            let mut place = MIN_BEYOND - 1;
            while place > 0 && best[place - 1] < value {
                best[place] = best[place - 1];
                place -= 1;
            }
            best[place] = value;
        }
    }
    Some(best[MIN_BEYOND - 1])
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Normally distributed noise of deviation 1.
    pub(in crate::measure) fn normal(rng: &mut fastrand::Rng) -> f32 {
        let (a, b) = (rng.f32().max(1e-7), rng.f32());
        (-2.0 * a.ln()).sqrt() * (std::f32::consts::TAU * b).cos()
    }

    /// The error of the edge in deviations, for points whose true places below the edge come from `below`.
    fn error(count: usize, below: impl Fn(&mut fastrand::Rng) -> f32) -> f64 {
        let (mut rng, sd) = (fastrand::Rng::with_seed(7), 0.0005f32);
        let along: Vec<f32> = (0..count).map(|_| 0.1 - below(&mut rng) + sd * normal(&mut rng)).collect();
        (edge(&along, &vec![sd; count]).unwrap() - 0.1) / f64::from(sd)
    }

    #[test]
    fn a_face_a_sphere_and_a_ridge_end_where_they_end_whatever_the_number_of_points() {
        for count in [20_000, 200_000] {
            let face = error(count, |_| 0.0);
            let sphere = error(count, |rng| 0.1 * rng.f32());
            // Around a ridge the depth below it goes with the square of the distance.
            let ridge = error(count, |rng| 0.01 * rng.f32().powi(2));
            for (what, off) in [("face", face), ("sphere", sphere), ("ridge", ridge)] {
                assert!(off.abs() < 1.4, "{what} of {count}: {off}");
            }
        }
    }

    #[test]
    fn a_few_stray_points_move_nothing_and_exact_points_end_exactly() {
        let mut along = vec![0.05f32; 1000];
        along.extend([0.3; 7]);
        assert!((edge(&along, &[0.0004; 1007]).unwrap() - 0.05).abs() < 3e-4);
        assert_eq!(edge(&[0.1; 7], &[0.0; 7]), None);
    }
}
