//! Nearest descriptors (source slide 24), by comparing all with all: in 33 dimensions a k-d tree visits nearly every leaf
//! anyway, and this way both directions come out of one pass. Descriptors of any length, so that colour can be added.
//!
//! `|a - b|²` is compared as `|b|² - 2ab`, a register of columns against a few rows at once; all are first moved by the
//! targets' mean, so that little cancels. Equal distances go to the lower index.

mod sweep;

use rayon::prelude::*;

use super::ransac::Match;
use crate::simd::run;
use sweep::{Columns, Nearest, Sweep};

/// Rows a parallel task compares; fixed.
const ROWS: usize = 256;

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

/// Matches `[source, target]` in the order of the source; descriptors that are all zero match nothing.
pub fn match_descriptors<const N: usize>(
    source: &[[f32; N]],
    target: &[[f32; N]],
    config: MatchConfig,
) -> Vec<Match> {
    let (mut rows, row_ids) = usable(source);
    let (mut columns, column_ids) = usable(target);
    if columns.is_empty() {
        return Vec::new();
    }
    let mean = mean_of(&columns);
    for descriptor in rows.iter_mut().chain(&mut columns) {
        for (value, mean) in descriptor.iter_mut().zip(&mean) {
            *value -= mean;
        }
    }
    let columns = run(Columns(&columns));
    let parts: Vec<Nearest> = rows
        .par_chunks(ROWS)
        .enumerate()
        .map(|(chunk, rows)| run(Sweep { rows, first: chunk * ROWS, columns: &columns }))
        .collect();
    let nearest_row = nearest_rows(&parts, column_ids.len());
    let by_row = parts.iter().flat_map(|part| &part.by_row);
    by_row
        .enumerate()
        .filter(|(i, best)| !config.mutual || nearest_row[best.index] == *i)
        .filter(|(_, best)| config.ratio.is_none_or(|r| best.distance <= r * r * best.second))
        .map(|(i, best)| [row_ids[i], column_ids[best.index]])
        .collect()
}

/// The nearest row of every column, over all parts.
fn nearest_rows(parts: &[Nearest], columns: usize) -> Vec<usize> {
    let mut nearest = vec![(f32::INFINITY, usize::MAX); columns];
    for part in parts {
        for (best, new) in nearest.iter_mut().zip(&part.by_column) {
            if new.0 < best.0 {
                *best = *new;
            }
        }
    }
    nearest.into_iter().map(|(_, row)| row).collect()
}

fn usable<const N: usize>(descriptors: &[[f32; N]]) -> (Vec<[f32; N]>, Vec<usize>) {
    descriptors
        .iter()
        .enumerate()
        .filter(|(_, d)| d.iter().any(|v| *v != 0.0) && d.iter().all(|v| v.is_finite()))
        .map(|(i, d)| (*d, i))
        .unzip()
}

fn mean_of<const N: usize>(descriptors: &[[f32; N]]) -> [f32; N] {
    let mut sum = [0.0f64; N];
    for descriptor in descriptors {
        for (sum, value) in sum.iter_mut().zip(descriptor) {
            *sum += f64::from(*value);
        }
    }
    sum.map(|v| (v / descriptors.len() as f64) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::fpfh::{Descriptor, LENGTH};
    use crate::simd::on_every_path;

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

    /// A table made and swept on one path.
    struct Swept<'a>(&'a [Descriptor], &'a [Descriptor]);

    impl pulp::WithSimd for Swept<'_> {
        type Output = Nearest;

        #[inline(always)]
        fn with_simd<S: pulp::Simd>(self, simd: S) -> Nearest {
            let columns = Columns(self.1).with_simd(simd);
            Sweep { rows: self.0, first: 5, columns: &columns }.with_simd(simd)
        }
    }

    #[test]
    fn all_paths_agree() {
        let (rows, columns) = (random(131, 3), random(77, 4));
        let paths = on_every_path(|| Swept(&rows, &columns));
        let rows_of = |part: &Nearest| part.by_column.iter().map(|(_, row)| *row).collect::<Vec<_>>();
        for path in &paths[1..] {
            for (a, b) in path.by_row.iter().zip(&paths[0].by_row) {
                assert_eq!(a.index, b.index);
                assert!((a.distance - b.distance).abs() < 1e-4 * b.distance);
                assert!((a.second - b.second).abs() < 1e-4 * b.second);
            }
            assert_eq!(rows_of(path), rows_of(&paths[0]));
        }
    }
}
