//! The nearest of many places at once: places that lie near each other share one block of candidates.

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::{Block, Neighbour, Tree, bound, distances, larger_reach, packed, unpacked};
use crate::simd::run;

/// Leaves of queries a parallel task takes.
const LEAVES: usize = 32;

impl Tree {
    /// The nearest of every query, row by row: `count` each (fewer where there are fewer points), nearest first; of equal
    /// distances the lower index is nearer.
    ///
    /// A query that is not finite has neighbours at infinity with the index `usize::MAX`.
    pub fn nearest_n_each(&self, queries: &[[f32; 3]], count: usize) -> Vec<Neighbour> {
        let count = count.min(self.len());
        let nobody = Neighbour { index: usize::MAX, sq_dist: f32::INFINITY };
        let mut out = vec![nobody; queries.len() * count];
        if count == 0 {
            return out;
        }
        let queries = Self::new(queries);
        let leaves = queries.leaves();
        let chunks: Vec<Vec<u64>> = leaves
            .par_chunks(LEAVES)
            .map(|leaves| run(Chunk { tree: self, queries: &queries, leaves, count }))
            .collect();
        let rows = chunks.iter().flat_map(|chunk| chunk.chunks_exact(count));
        for (&query, row) in queries.indices.iter().zip(rows) {
            let out = &mut out[query as usize * count..][..count];
            for (out, &found) in out.iter_mut().zip(row) {
                *out = unpacked(found);
            }
        }
        out
    }
}

/// Some leaves of queries.
struct Chunk<'a> {
    tree: &'a Tree,
    queries: &'a Tree,
    leaves: &'a [Range<usize>],
    count: usize,
}

impl WithSimd for Chunk<'_> {
    /// Rows of neighbours in the order of the queries' tree.
    type Output = Vec<u64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let queries = self.leaves.iter().map(ExactSizeIterator::len).sum::<usize>();
        let mut rows = Vec::with_capacity(queries * self.count);
        let (mut block, mut sq_dists, mut pending) = (Block::default(), Vec::new(), Vec::new());
        let mut near: Vec<u64> = Vec::new();
        let mut reach = None;
        for leaf in self.leaves {
            let first = rows.len();
            rows.resize(first + leaf.len() * self.count, 0);
            pending.clear();
            pending.extend(leaf.clone());
            let mut here: f32 = reach.unwrap_or_else(|| self.queries.likely_reach(leaf, self.count));
            let (mut farthest, mut likely) = (0.0f32, 0.5 * here * here);
            while !pending.is_empty() {
                let places = pending.iter().map(|&slot| self.queries.point(slot));
                self.tree.gather_around(places, here, &mut block);
                let limit = (here * here).min(f32::MAX);
                let (mut kept, mut fewest) = (0, usize::MAX);
                for i in 0..pending.len() {
                    let slot = pending[i];
                    distances(simd, &block, &self.queries.point(slot), &mut sq_dists);
                    let index = |at: usize| self.tree.index_in(&block, at);
                    match bound(simd, &mut sq_dists, self.count, likely, limit, index) {
                        Ok(bound) => {
                            near.resize(sq_dists.len(), 0);
                            let mut found = 0;
                            for (&d, &slot) in sq_dists.iter().zip(&block.slots) {
                                near[found] = packed(d, slot);
                                found += usize::from(d <= bound);
                            }
                            let near = &mut near[..found];
                            for found in &mut *near {
                                let index = self.tree.indices[*found as u32 as usize];
                                *found = (*found >> 32 << 32) | u64::from(index);
                            }
                            near.sort_unstable();
                            let row = first + (slot - leaf.start) * self.count;
                            rows[row..row + self.count].copy_from_slice(near);
                            (farthest, likely) = (farthest.max(bound), bound);
                        }
                        Err(found) => {
                            pending[kept] = slot;
                            (kept, fewest) = (kept + 1, fewest.min(found));
                        }
                    }
                }
                pending.truncate(kept);
                if kept > 0 && here >= f32::MAX {
                    // So far apart that no square is finite: one by one.
                    for &slot in &pending {
                        let row = first + (slot - leaf.start) * self.count;
                        let near = self.tree.nearest_n(&self.queries.point(slot), self.count);
                        for (out, near) in rows[row..row + self.count].iter_mut().zip(near) {
                            *out = packed(near.sq_dist, near.index as u32);
                        }
                    }
                    break;
                }
                here = if kept > 0 { larger_reach(here, self.count, fewest) } else { here };
            }
            reach = Some(farthest.sqrt() * 1.1);
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_are_those_of_single_queries(seed in any::<u64>(), count in 1usize..40, lattice in any::<bool>()) {
            let mut rng = fastrand::Rng::with_seed(seed);
            let mut place = |scale: f32| -> [f32; 3] {
                std::array::from_fn(|_| if lattice { f32::from(rng.u8(..6)) } else { scale * rng.f32() })
            };
            let points: Vec<[f32; 3]> = (0..400).map(|_| place(1.0)).collect();
            let mut queries: Vec<[f32; 3]> = (0..150).map(|i| place(if i % 50 == 0 { 1e4 } else { 1.2 })).collect();
            queries[7][1] = f32::NAN;
            let tree = Tree::new(&points);
            let rows = tree.nearest_n_each(&queries, count);
            for (i, (query, row)) in queries.iter().zip(rows.chunks_exact(count)).enumerate() {
                if i == 7 {
                    prop_assert!(row.iter().all(|n| n.index == usize::MAX));
                } else {
                    prop_assert_eq!(row, tree.nearest_n(query, count));
                }
            }
        }
    }

    #[test]
    fn what_is_farther_than_single_precision_squares_still_ends() {
        let tree = Tree::new(&[[0.0; 3], [3e38, 0.0, 0.0]]);
        assert_eq!(tree.nearest_n_each(&[[-3e38; 3]], 2).len(), 2);
    }
}
