//! Normals of scattered points, a leaf of the tree at a time: its points share one block of candidates, distances are
//! compared in whole registers, and of the nearest only the bounding distance is sought, never a list.

use pulp::{Simd, WithSimd};

use super::{Moments, Neighbourhood};
use crate::knn::{Block, Tree, bound, distances, larger_reach};

/// Leaves a parallel task takes; fixed, since each begins with the reach of the one before.
pub(super) const LEAVES: usize = 32;

/// The points of some leaves.
pub(super) struct Chunk<'a> {
    pub(super) tree: &'a Tree,
    pub(super) leaves: &'a [std::ops::Range<usize>],
    pub(super) neighbourhood: Neighbourhood,
    pub(super) viewpoint: [f32; 3],
}

impl WithSimd for Chunk<'_> {
    /// Normal and curvature of every point, in the order of the tree.
    type Output = Vec<([f32; 3], f32)>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let count = self.leaves.iter().map(ExactSizeIterator::len).sum();
        let mut work = Work { rows: Vec::with_capacity(count), ..Work::default() };
        let mut reach = None;
        for leaf in self.leaves {
            work.rows.resize(work.rows.len() + leaf.len(), ([0.0; 3], 0.0));
            match self.neighbourhood {
                Neighbourhood::Radius(radius) => self.within(simd, leaf, radius, &mut work),
                Neighbourhood::Nearest(count) => {
                    let count = count.min(self.tree.len());
                    let first = reach.unwrap_or_else(|| self.tree.likely_reach(leaf, count));
                    reach = Some(self.nearest(simd, leaf, count, first, &mut work));
                }
            }
        }
        work.rows
    }
}

/// Buffers that are used again for every leaf.
#[derive(Default)]
struct Work {
    block: Block,
    sq_dists: Vec<f32>,
    /// Places whose nearest are still sought.
    pending: Vec<u32>,
    rows: Vec<([f32; 3], f32)>,
}

impl Chunk<'_> {
    #[inline(always)]
    fn within<S: Simd>(&self, simd: S, leaf: &std::ops::Range<usize>, radius: f32, work: &mut Work) {
        if radius.is_nan() || radius < 0.0 {
            return;
        }
        let slots: Vec<u32> = (leaf.start as u32..leaf.end as u32).collect();
        self.tree.gather(&slots, radius, &mut work.block);
        let limit = (radius * radius).min(f32::MAX);
        let first = work.rows.len() - leaf.len();
        for (row, slot) in leaf.clone().enumerate() {
            let p = self.tree.point(slot);
            distances(simd, &work.block, &p, &mut work.sq_dists);
            let moments = moments(simd, &work.block, &work.sq_dists, &p, limit);
            work.rows[first + row] = moments.surface(&p, &self.viewpoint);
        }
    }

    /// Looks as far as `reach`, then farther for those that have not found enough; returns the reach to begin with beside.
    #[inline(always)]
    fn nearest<S: Simd>(
        &self,
        simd: S,
        leaf: &std::ops::Range<usize>,
        count: usize,
        mut reach: f32,
        work: &mut Work,
    ) -> f32 {
        work.pending.clear();
        work.pending.extend(leaf.start as u32..leaf.end as u32);
        let first = work.rows.len() - leaf.len();
        let (mut farthest, mut likely) = (0.0f32, 0.5 * reach * reach);
        while !work.pending.is_empty() && count > 0 {
            self.tree.gather(&work.pending, reach, &mut work.block);
            let limit = (reach * reach).min(f32::MAX);
            let (mut kept, mut fewest) = (0, usize::MAX);
            for i in 0..work.pending.len() {
                let slot = work.pending[i] as usize;
                let p = self.tree.point(slot);
                distances(simd, &work.block, &p, &mut work.sq_dists);
                match bound(simd, &mut work.sq_dists, count, likely, limit, |i| {
                    self.tree.index_in(&work.block, i)
                }) {
                    Ok(bound) => {
                        let moments = moments(simd, &work.block, &work.sq_dists, &p, bound);
                        work.rows[first + slot - leaf.start] = moments.surface(&p, &self.viewpoint);
                        (farthest, likely) = (farthest.max(bound), bound);
                    }
                    Err(found) => {
                        work.pending[kept] = slot as u32;
                        (kept, fewest) = (kept + 1, fewest.min(found));
                    }
                }
            }
            work.pending.truncate(kept);
            if kept > 0 && reach >= f32::MAX {
                // So far apart that no square is finite.
                break;
            }
            reach = if kept > 0 { larger_reach(reach, count, fewest) } else { reach };
        }
        farthest.sqrt() * 1.1
    }
}

/// Sums over the points within a squared distance.
#[inline(always)]
fn moments<S: Simd>(simd: S, block: &Block, sq_dists: &[f32], p: &[f32; 3], limit: f32) -> Moments {
    let [xs, ys, zs] = &block.axes;
    let (xs, ys, zs) = (S::as_simd_f32s(xs).0, S::as_simd_f32s(ys).0, S::as_simd_f32s(zs).0);
    let (px, py, pz) = (simd.splat_f32s(p[0]), simd.splat_f32s(p[1]), simd.splat_f32s(p[2]));
    let (limit, zero) = (simd.splat_f32s(limit), simd.splat_f32s(0.0));
    let (one, mut counts) = (simd.splat_f32s(1.0), zero);
    let mut sums = [zero; 9];
    for (((&x, &y), &z), &d) in xs.iter().zip(ys).zip(zs).zip(S::as_simd_f32s(sq_dists).0) {
        let within = simd.less_than_or_equal_f32s(d, limit);
        let x = simd.select_f32s(within, simd.sub_f32s(x, px), zero);
        let y = simd.select_f32s(within, simd.sub_f32s(y, py), zero);
        let z = simd.select_f32s(within, simd.sub_f32s(z, pz), zero);
        counts = simd.add_f32s(counts, simd.select_f32s(within, one, zero));
        sums = [
            simd.add_f32s(sums[0], x),
            simd.add_f32s(sums[1], y),
            simd.add_f32s(sums[2], z),
            simd.mul_add_e_f32s(x, x, sums[3]),
            simd.mul_add_e_f32s(x, y, sums[4]),
            simd.mul_add_e_f32s(x, z, sums[5]),
            simd.mul_add_e_f32s(y, y, sums[6]),
            simd.mul_add_e_f32s(y, z, sums[7]),
            simd.mul_add_e_f32s(z, z, sums[8]),
        ];
    }
    let mut totals = [0.0; 9];
    for (total, sum) in totals.iter_mut().zip(sums) {
        *total = simd.reduce_sum_f32s(sum);
    }
    Moments::of_sums(simd.reduce_sum_f32s(counts) as usize, totals)
}
