//! A leaf of the tree at a time: its points share one block of candidates.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::angles::{Oriented, SPARE_BIN, bins};
use super::{BINS, Context, LENGTH, TOTAL};
use crate::knn::{Block, distances};
use crate::simd::LANES;

/// A descriptor padded to whole registers.
pub(super) type Histogram = [f32; PADDED];
/// Length with the padding; what stands there is never read.
pub(super) const PADDED: usize = LENGTH.next_multiple_of(LANES);

/// What is done for every point.
pub(super) trait Task: Copy + Send + Sync {
    fn row<S: Simd>(self, simd: S, around: &mut Around, slot: usize) -> Histogram;
}

/// SPFH: the histograms of the pairs with the point itself.
#[derive(Clone, Copy)]
pub(super) struct Simple;

/// FPFH: own histogram plus the mean of the neighbours', weighted by inverse squared distance.
#[derive(Clone, Copy)]
pub(super) struct Weighted<'a>(pub(super) &'a [Histogram]);

/// The points of some leaves.
pub(super) struct Chunk<'a, T> {
    pub(super) context: Context<'a>,
    pub(super) leaves: &'a [Range<usize>],
    pub(super) wanted: &'a [bool],
    pub(super) task: T,
}

impl<T: Task> WithSimd for Chunk<'_, T> {
    type Output = Vec<Histogram>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let mut rows = Vec::with_capacity(self.leaves.iter().map(ExactSizeIterator::len).sum());
        let mut around = Around::default();
        let Context { tree, normals, radius } = self.context;
        for leaf in self.leaves {
            let slots: Vec<u32> =
                leaf.clone().filter(|&slot| self.wanted[slot]).map(|slot| slot as u32).collect();
            if !slots.is_empty() {
                tree.gather(&slots, radius, &mut around.block);
                around.take_normals(normals);
            }
            for slot in leaf.clone() {
                let mut row = [0.0; PADDED];
                if self.wanted[slot] {
                    around.point = Oriented {
                        place: tree.point(slot),
                        normal: [normals[0][slot], normals[1][slot], normals[2][slot]],
                    };
                    around.find(simd, (radius * radius).min(f32::MAX));
                    row = self.task.row(simd, &mut around, slot);
                }
                rows.push(row);
            }
        }
        rows
    }
}

/// A point and the candidates around it.
#[derive(Default)]
pub(super) struct Around {
    pub(super) block: Block,
    pub(super) normals: [Vec<f32>; 3],
    pub(super) point: Oriented,
    /// Squared distances of the candidates.
    sq_dists: Vec<f32>,
    /// Candidates that are neighbours: the first `found`.
    near: Vec<u32>,
    found: usize,
    /// Places and normals of the neighbours, padded to whole registers.
    pub(super) oriented: [Vec<f32>; 6],
    /// Bins of the three angles of every neighbour.
    pub(super) bins: [Vec<u32>; 3],
}

impl Around {
    /// The candidates' normals; a candidate without one is moved out of reach.
    #[inline(always)]
    fn take_normals(&mut self, normals: &[Vec<f32>; 3]) {
        let count = self.block.axes[0].len();
        for (taken, all) in self.normals.iter_mut().zip(normals) {
            taken.clear();
            taken.extend(self.block.slots.iter().map(|&slot| all[slot as usize]));
            taken.resize(count, 0.0);
        }
        let [nx, ny, nz] = &self.normals;
        for (((place, x), y), z) in self.block.axes[0].iter_mut().zip(nx).zip(ny).zip(nz) {
            if [*x, *y, *z] == [0.0; 3] {
                *place = f32::INFINITY;
            }
        }
    }

    /// Finds the neighbours: other places within the radius that have a normal.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "a branch would be guessed wrong every other time")]
    fn find<S: Simd>(&mut self, simd: S, limit: f32) {
        distances(simd, &self.block, &self.point.place, &mut self.sq_dists);
        self.near.resize(self.sq_dists.len(), 0);
        let near: &mut [u32] = &mut self.near;
        let mut found = 0;
        for (i, &d) in (0u32..).zip(&self.sq_dists) {
            near[found] = i;
            found += usize::from((d > 0.0) & (d <= limit));
        }
        self.found = found;
    }

    /// Brings the neighbours' places and normals together.
    #[inline(always)]
    fn take_oriented(&mut self) {
        let padded = self.found.next_multiple_of(LANES);
        let near = &self.near[..self.found];
        let columns = self.block.axes.iter().chain(&self.normals);
        for (taken, all) in self.oriented.iter_mut().zip(columns) {
            taken.clear();
            taken.extend(near.iter().map(|&i| all[i as usize]));
            taken.resize(padded, 0.0);
        }
    }

    fn near(&self) -> &[u32] {
        &self.near[..self.found]
    }
}

impl Task for Simple {
    #[inline(always)]
    fn row<S: Simd>(self, simd: S, around: &mut Around, _: usize) -> Histogram {
        let mut row = [0.0; PADDED];
        if around.found == 0 || around.point.normal == [0.0; 3] {
            return row;
        }
        around.take_oriented();
        bins(simd, around);
        // Two sets of counters: the same bin twice in a row would wait for itself.
        let mut counts = [[0u32; 64]; 2];
        let [alphas, phis, thetas] = &around.bins;
        for (i, ((alpha, phi), theta)) in alphas.iter().zip(phis).zip(thetas).take(around.found).enumerate() {
            for bin in [alpha, phi, theta] {
                counts[i % 2][*bin as usize % 64] += 1;
            }
        }
        let share = TOTAL / around.found as f32;
        for bin in 0..SPARE_BIN as usize {
            row[bin] = (counts[0][bin] + counts[1][bin]) as f32 * share;
        }
        row
    }
}

impl Task for Weighted<'_> {
    #[inline(always)]
    fn row<S: Simd>(self, simd: S, around: &mut Around, slot: usize) -> Histogram {
        let mut sums = [[0.0f32; PADDED]; 2];
        for (i, &near) in around.near().iter().enumerate() {
            let weight = simd.splat_f32s(1.0 / around.sq_dists[near as usize]);
            let histogram = &self.0[around.block.slots[near as usize] as usize];
            let sum = S::as_mut_simd_f32s(&mut sums[i % 2]).0;
            for (sum, &value) in sum.iter_mut().zip(S::as_simd_f32s(histogram).0) {
                *sum = simd.add_f32s(*sum, simd.mul_f32s(weight, value));
            }
        }
        let mut sum = sums[0];
        for (sum, other) in sum.iter_mut().zip(&sums[1]) {
            *sum += other;
        }
        let own = &self.0[slot];
        let mut row = [0.0; PADDED];
        for bins in (0..LENGTH).step_by(BINS).map(|first| first..first + BINS) {
            let total: f32 = sum[bins.clone()].iter().sum();
            let scale = if total > 0.0 && total.is_finite() { TOTAL / total } else { 0.0 };
            for k in bins {
                row[k] = own[k] + sum[k] * scale;
            }
        }
        row
    }
}
