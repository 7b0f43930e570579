//! Nearest descriptors (source slide 24), by comparing all with all: in 33 dimensions a k-d tree visits nearly every leaf
//! anyway, and this way both directions come out of one pass. Descriptors of any length, so that colour can be added.

use rayon::prelude::*;

use super::ransac::Match;

/// Lanes summed side by side; the compiler turns them into vector registers.
const LANES: usize = 4;
/// Rows a parallel task compares; fixed.
const ROWS: usize = 128;

/// Which pairs are matches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatchConfig {
    /// Only pairs that are each other's nearest; otherwise every source descriptor's nearest, as in the source.
    pub mutual: bool,
    /// Largest ratio of the nearest to the second nearest distance, 0 to 1.
    pub ratio: Option<f32>,
}

impl Default for MatchConfig {
    fn default() -> Self {
        Self { mutual: true, ratio: None }
    }
}

#[derive(Clone, Copy)]
struct Best {
    index: usize,
    distance: f32,
    second: f32,
}

const NOTHING: Best = Best { index: usize::MAX, distance: f32::INFINITY, second: f32::INFINITY };

impl Best {
    fn offer(&mut self, index: usize, distance: f32) {
        if distance < self.distance {
            *self = Self { index, distance, second: self.distance };
        } else if distance < self.second {
            self.second = distance;
        }
    }
}

/// The nearest column of each row of a chunk, and the nearest row of that chunk (with its distance) of each column.
type Part = (Vec<Best>, Vec<(usize, f32)>);

/// Matches `[source, target]` in the order of the source; descriptors that are all zero match nothing.
pub fn match_descriptors<const N: usize>(
    source: &[[f32; N]],
    target: &[[f32; N]],
    config: MatchConfig,
) -> Vec<Match> {
    let (rows, row_ids) = usable(source);
    let (columns, column_ids) = usable(target);
    let parts: Vec<Part> = rows
        .par_chunks(ROWS)
        .enumerate()
        .map(|(chunk, rows)| {
            let mut by_row = vec![NOTHING; rows.len()];
            let mut by_column = vec![(usize::MAX, f32::INFINITY); columns.len()];
            for (j, column) in columns.iter().enumerate() {
                for (i, row) in rows.iter().enumerate() {
                    let distance = sq_distance(row, column);
                    by_row[i].offer(j, distance);
                    if distance < by_column[j].1 {
                        by_column[j] = (chunk * ROWS + i, distance);
                    }
                }
            }
            (by_row, by_column)
        })
        .collect();
    let mut nearest_row = vec![(usize::MAX, f32::INFINITY); columns.len()];
    for (_, by_column) in &parts {
        for (best, new) in nearest_row.iter_mut().zip(by_column) {
            if new.1 < best.1 {
                *best = *new;
            }
        }
    }
    let by_row = parts.iter().flat_map(|(by_row, _)| by_row);
    by_row
        .enumerate()
        .filter(|(_, best)| best.index != usize::MAX)
        .filter(|(i, best)| !config.mutual || nearest_row[best.index].0 == *i)
        .filter(|(_, best)| config.ratio.is_none_or(|r| best.distance <= r * r * best.second))
        .map(|(i, best)| [row_ids[i], column_ids[best.index]])
        .collect()
}

fn usable<const N: usize>(descriptors: &[[f32; N]]) -> (Vec<[f32; N]>, Vec<usize>) {
    descriptors
        .iter()
        .enumerate()
        .filter(|(_, d)| d.iter().any(|v| *v != 0.0) && d.iter().all(|v| v.is_finite()))
        .map(|(i, d)| (*d, i))
        .unzip()
}

fn sq_distance<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for k in (0..N / LANES * LANES).step_by(LANES) {
        for lane in 0..LANES {
            let d = a[k + lane] - b[k + lane];
            sums[lane] += d * d;
        }
    }
    let rest: f32 = (N / LANES * LANES..N).map(|k| (a[k] - b[k]).powi(2)).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::fpfh::{Descriptor, LENGTH};

    fn random(count: usize, seed: u64) -> Vec<Descriptor> {
        let mut rng = fastrand::Rng::with_seed(seed);
        (0..count).map(|_| [(); LENGTH].map(|()| rng.f32())).collect()
    }

    #[test]
    fn a_shuffled_copy_is_matched_back() {
        let source = random(300, 1);
        let mut target = source.clone();
        target.rotate_left(37);
        for mutual in [true, false] {
            let config = MatchConfig { mutual, ratio: Some(0.9) };
            let matches = match_descriptors(&source, &target, config);
            assert_eq!(matches, (0..300).map(|i| [i, (i + 300 - 37) % 300]).collect::<Vec<_>>());
        }
    }

    #[test]
    fn agrees_with_plain_search() {
        let (source, target) = (random(290, 1), random(150, 2));
        let distance =
            |i: usize, j: usize| source[i].iter().zip(&target[j]).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        let nearest: Vec<usize> = (0..290)
            .map(|i| (0..150).min_by(|a, b| distance(i, *a).total_cmp(&distance(i, *b))).unwrap())
            .collect();
        let back: Vec<usize> = (0..150)
            .map(|j| (0..290).min_by(|a, b| distance(*a, j).total_cmp(&distance(*b, j))).unwrap())
            .collect();
        let all = match_descriptors(&source, &target, MatchConfig { mutual: false, ratio: None });
        assert_eq!(all, (0..290).map(|i| [i, nearest[i]]).collect::<Vec<_>>());
        let mutual = match_descriptors(&source, &target, MatchConfig::default());
        assert_eq!(
            mutual,
            (0..290).filter(|i| back[nearest[*i]] == *i).map(|i| [i, nearest[i]]).collect::<Vec<_>>()
        );
    }

    #[test]
    fn what_describes_nothing_matches_nothing() {
        let mut source = random(3, 1);
        source[1] = [0.0; LENGTH];
        source[2][4] = f32::NAN;
        let matches = match_descriptors(&source, &random(5, 2), MatchConfig { mutual: false, ratio: None });
        assert_eq!(matches.len(), 1);
        assert!(match_descriptors::<LENGTH>(&[], &source, MatchConfig::default()).is_empty());
    }
}
