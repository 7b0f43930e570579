//! The normal equations of a pair's residuals, gathered by the batch: the blocks of four rows stay in registers while a batch goes by.

use pulp::Simd;

use super::system::{OF_PAIR, PairBlock};

/// Residuals a batch: both tables of it stay in the nearest cache.
const BATCH: usize = 32;
/// Rows of the sums that stay in registers.
const ROWS: usize = 4;
/// The last of a row is the negative residual, so that the right side comes with the sums.
const RIGHT: usize = OF_PAIR - 1;

/// Sums of `J^T W J` and `-J^T W r` in the making.
pub(super) struct Gather<S: Simd> {
    simd: S,
    rows: [[f64; OF_PAIR]; BATCH],
    weighted: [[f64; OF_PAIR]; BATCH],
    filled: usize,
    sums: [[f64; OF_PAIR]; OF_PAIR],
}

impl<S: Simd> Gather<S> {
    #[inline(always)]
    pub(super) fn new(simd: S) -> Self {
        let empty = [[0.0; OF_PAIR]; BATCH];
        Self { simd, rows: empty, weighted: empty, filled: 0, sums: [[0.0; OF_PAIR]; OF_PAIR] }
    }

    /// Adds one residual with its derivative; the last place of `row` is free.
    #[inline(always)]
    pub(super) fn add(&mut self, mut row: [f64; OF_PAIR], residual: f64, weight: f64) {
        row[RIGHT] = -residual;
        for (weighted, value) in self.weighted[self.filled].iter_mut().zip(&row) {
            *weighted = weight * value;
        }
        self.rows[self.filled] = row;
        self.filled += 1;
        if self.filled == BATCH {
            self.add_batch();
        }
    }

    /// The sums of all that was added.
    #[inline(always)]
    pub(super) fn finish(mut self) -> PairBlock {
        self.add_batch();
        let mut right = [0.0; OF_PAIR];
        let mut rows = self.sums;
        for i in 0..RIGHT {
            right[i] = rows[i][RIGHT];
            rows[i][RIGHT] = 0.0;
            for j in 0..i {
                rows[i][j] = rows[j][i];
            }
        }
        rows[RIGHT] = [0.0; OF_PAIR];
        PairBlock { rows, right }
    }

    /// Upper half of the products, by blocks of four rows and a register's columns.
    #[inline(always)]
    fn add_batch(&mut self) {
        let simd = self.simd;
        for first in (0..OF_PAIR).step_by(ROWS) {
            for column in first / S::F64_LANES..OF_PAIR / S::F64_LANES {
                let mut sums = [simd.splat_f64s(0.0); ROWS];
                for (row, weighted) in self.rows[..self.filled].iter().zip(&self.weighted) {
                    let columns = S::as_simd_f64s(row).0[column];
                    for (k, sum) in sums.iter_mut().enumerate() {
                        *sum = simd.mul_add_e_f64s(simd.splat_f64s(weighted[first + k]), columns, *sum);
                    }
                }
                for (k, sum) in sums.iter().enumerate() {
                    let out = &mut S::as_mut_simd_f64s(&mut self.sums[first + k]).0[column];
                    *out = simd.add_f64s(*out, *sum);
                }
            }
        }
        self.filled = 0;
    }
}

#[cfg(test)]
mod tests {
    use pulp::WithSimd;

    use super::*;
    use crate::simd::on_every_path;

    struct Sums<'a>(&'a [([f64; OF_PAIR], f64, f64)]);

    impl WithSimd for Sums<'_> {
        type Output = PairBlock;

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> PairBlock {
            let mut gather = Gather::new(simd);
            self.0.iter().for_each(|(row, residual, weight)| gather.add(*row, *residual, *weight));
            gather.finish()
        }
    }

    #[test]
    fn every_path_agrees_with_adding_one_by_one() {
        let mut rng = fastrand::Rng::with_seed(8);
        let mut residual = || {
            let mut row: [f64; OF_PAIR] = std::array::from_fn(|_| rng.f64() - 0.5);
            row[RIGHT] = 0.0;
            (row, rng.f64() - 0.5, rng.f64())
        };
        for count in [0, 1, BATCH - 1, BATCH, 3 * BATCH + 5] {
            let residuals: Vec<_> = (0..count).map(|_| residual()).collect();
            let mut simple = PairBlock::zero();
            for (row, residual, weight) in &residuals {
                simple.add(row, *residual, *weight);
            }
            for gathered in on_every_path(|| Sums(&residuals)) {
                let off =
                    |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
                assert!(off(gathered.rows.as_flattened(), simple.rows.as_flattened()) < 1e-12);
                assert!(off(&gathered.right, &simple.right) < 1e-12);
            }
        }
    }
}
