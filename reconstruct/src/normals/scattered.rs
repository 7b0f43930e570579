//! Normals of scattered points, a leaf of the tree at a time: its points share one block of candidates, distances are
//! compared in whole registers, and of the nearest only the bounding distance is sought, never a list.

use pulp::bytemuck::cast_slice;
use pulp::{Simd, WithSimd};

use super::{Moments, Neighbourhood};
use crate::knn::{Block, Tree};

/// Leaves a parallel task takes; fixed, since each begins with the reach of the one before.
pub(super) const LEAVES: usize = 32;
/// Steps of the search for a bounding distance before the candidates left are sorted.
const STEPS: usize = 10;

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
                    let first = reach.unwrap_or_else(|| self.likely_reach(leaf, count));
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
                match bound(simd, &mut work.sq_dists, count, likely, limit, |i| self.index(&work.block, i)) {
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
            if kept > 0 {
                // On a surface the number grows with the square of the reach.
                let growth = (count as f32 / fewest.max(1) as f32).sqrt() * 1.1;
                reach = (reach * growth.clamp(1.3, 4.0)).max(f32::MIN_POSITIVE).min(f32::MAX);
            }
        }
        farthest.sqrt() * 1.1
    }

    fn index(&self, block: &Block, at: usize) -> u32 {
        block.slots.get(at).map_or(u32::MAX, |&slot| self.tree.indices()[slot as usize])
    }

    /// Radius of the disc that holds `count` points where they lie as dense as in the leaf.
    fn likely_reach(&self, leaf: &std::ops::Range<usize>, count: usize) -> f32 {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for slot in leaf.clone() {
            let p = self.tree.point(slot);
            for k in 0..3 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        let mut sides: [f32; 3] = std::array::from_fn(|k| high[k] - low[k]);
        sides.sort_by(f32::total_cmp);
        let area = sides[2] * sides[1].max(0.1 * sides[2]);
        let reach = (area / leaf.len() as f32 * count as f32 / std::f32::consts::PI).sqrt() * 1.3;
        if reach.is_finite() { reach.max(f32::MIN_POSITIVE) } else { f32::MAX }
    }
}

/// Squared distances of a block's points.
#[inline(always)]
fn distances<S: Simd>(simd: S, block: &Block, p: &[f32; 3], out: &mut Vec<f32>) {
    let [xs, ys, zs] = block.axes.each_ref().map(|axis| S::as_simd_f32s(axis).0);
    out.resize(block.axes[0].len(), 0.0);
    let [px, py, pz] = p.map(|v| simd.splat_f32s(v));
    let out = S::as_mut_simd_f32s(out).0;
    for (((&x, &y), &z), out) in xs.iter().zip(ys).zip(zs).zip(out) {
        let (x, y, z) = (simd.sub_f32s(x, px), simd.sub_f32s(y, py), simd.sub_f32s(z, pz));
        // Not fused: equal to what everyone else computes.
        let xy = simd.add_f32s(simd.mul_f32s(x, x), simd.mul_f32s(y, y));
        *out = simd.add_f32s(xy, simd.mul_f32s(z, z));
    }
}

/// How many are not above a limit.
#[inline(always)]
fn count_within<S: Simd>(simd: S, sq_dists: &[f32], limit: f32) -> usize {
    let (limit, one, zero) = (simd.splat_f32s(limit), simd.splat_u32s(1), simd.splat_u32s(0));
    let mut counts = zero;
    for &d in S::as_simd_f32s(sq_dists).0 {
        let within = simd.less_than_or_equal_f32s(d, limit);
        counts = simd.add_u32s(counts, simd.select_u32s(within, one, zero));
    }
    let lanes: &[u32] = cast_slice(std::slice::from_ref(&counts));
    lanes.iter().sum::<u32>() as usize
}

/// A distance within which exactly `count` points lie; how many lie within `limit` where those are too few. Of points as far
/// as the last one, those with the highest index are moved away.
#[inline(always)]
fn bound<S: Simd>(
    simd: S,
    sq_dists: &mut [f32],
    count: usize,
    likely: f32,
    limit: f32,
    index: impl Fn(usize) -> u32,
) -> Result<f32, usize> {
    let (mut low, mut below) = (0.0f32, 0);
    let (mut high, mut above) = (limit, count_within(simd, sq_dists, limit));
    if above <= count {
        return if above == count { Ok(limit) } else { Err(above) };
    }
    let mut middle = likely;
    for step in 0..STEPS {
        if !(middle > low && middle < high) {
            middle = 0.5 * (low + high);
        }
        let found = count_within(simd, sq_dists, middle);
        match found.cmp(&count) {
            std::cmp::Ordering::Equal => return Ok(middle),
            std::cmp::Ordering::Less => (low, below) = (middle, found),
            std::cmp::Ordering::Greater => (high, above) = (middle, found),
        }
        // The number grows about evenly with the square of the distance; now and then a halving against slow progress.
        let share = (count - below) as f32 / (above - below) as f32;
        middle = low + (high - low) * if step % 4 == 3 { 0.5 } else { share };
    }
    Ok(sorted_bound(sq_dists, count, high, index))
}

#[cold]
fn sorted_bound(sq_dists: &mut [f32], count: usize, high: f32, index: impl Fn(usize) -> u32) -> f32 {
    let mut near: Vec<(f32, u32, usize)> =
        sq_dists.iter().enumerate().filter(|(_, d)| **d <= high).map(|(at, &d)| (d, index(at), at)).collect();
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let bound = near[count - 1].0;
    for (_, _, at) in near[count..].iter().take_while(|(d, ..)| *d == bound) {
        sq_dists[*at] = f32::INFINITY;
    }
    bound
}

/// Sums over the points within a squared distance.
#[inline(always)]
fn moments<S: Simd>(simd: S, block: &Block, sq_dists: &[f32], p: &[f32; 3], limit: f32) -> Moments {
    let [xs, ys, zs] = block.axes.each_ref().map(|axis| S::as_simd_f32s(axis).0);
    let [px, py, pz] = p.map(|v| simd.splat_f32s(v));
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
    Moments::of_sums(simd.reduce_sum_f32s(counts) as usize, sums.map(|sum| simd.reduce_sum_f32s(sum)))
}
