//! Nearest neighbours among 3-D points: a tree of boxes over points sorted along a Z-order curve, at most 32 to a leaf.
//!
//! Sorting by the curve's integers builds the tree in linear time (as Lauterbach et al. 2009 for ray tracing); where many
//! points share one of its cells, they are split at medians instead. Answers are exactly those of comparing with every
//! point in single precision, `dx*dx + dy*dy + dz*dz`; of equal distances the lower index is nearer.
//!
//! Points with a coordinate that is not finite are never found; indices stay those of the slice given to [`Tree::new`].

mod block;
mod bound;
mod build;
mod each;

pub(crate) use block::Block;
pub(crate) use bound::{bound, distances, larger_reach};

use std::collections::BinaryHeap;

/// A point found: its index in the slice the tree was made of and its squared distance in square metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Index of the point.
    pub index: usize,
    /// Squared distance, square metres.
    pub sq_dist: f32,
}

/// A box and the points in it.
#[derive(Debug, Clone, Copy)]
struct Node {
    low: [f32; 3],
    high: [f32; 3],
    /// Its points' places in the order of the tree.
    first: u32,
    end: u32,
    /// Its second child; the first one follows it. 0 = a leaf.
    second: u32,
    /// The node after it and all below it.
    after: u32,
}

/// A search structure over fixed points.
pub struct Tree {
    /// Parents before children; empty without points.
    nodes: Vec<Node>,
    /// Coordinates in the order of the tree.
    axes: [Vec<f32>; 3],
    /// Index of each point in the slice given.
    indices: Vec<u32>,
}

/// Deepest way down: 16 bits of each axis, then 32 halvings at medians.
const MAX_DEPTH: usize = 96;
/// Up to so many neighbours a sorted list is quicker than a heap.
const SHORT: usize = 64;

impl std::fmt::Debug for Tree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tree").field("len", &self.len()).finish_non_exhaustive()
    }
}

impl Tree {
    /// Builds the tree; a coordinate that is not finite leaves its point out, and so does an index beyond 2^28.
    pub fn new(points: &[[f32; 3]]) -> Self {
        build::tree(points)
    }

    /// Number of points that can be found.
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether nothing can be found.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The nearest point; `None` for an empty tree or a query that is not finite.
    pub fn nearest(&self, query: &[f32; 3]) -> Option<Neighbour> {
        self.nearest_below(query, f32::INFINITY)
    }

    /// The nearest point not farther than `radius` metres.
    pub fn nearest_within(&self, query: &[f32; 3], radius: f32) -> Option<Neighbour> {
        self.nearest_below(query, radius * radius)
    }

    fn nearest_below(&self, query: &[f32; 3], limit: f32) -> Option<Neighbour> {
        let mut best = packed(limit, u32::MAX);
        self.visit(query, limit, |first, end| {
            let [xs, ys, zs] = self.axes.each_ref().map(|axis| &axis[first..end]);
            for (((x, y), z), &index) in xs.iter().zip(ys).zip(zs).zip(&self.indices[first..end]) {
                best = best.min(packed(sq_dist(&[*x, *y, *z], query), index));
            }
            distance_of(best)
        });
        (best as u32 != u32::MAX).then(|| unpacked(best))
    }

    /// The `count` nearest points, nearest first (fewer where there are fewer).
    pub fn nearest_n(&self, query: &[f32; 3], count: usize) -> Vec<Neighbour> {
        let count = count.min(self.len());
        let found = match count {
            0 => Vec::new(),
            1..=SHORT => self.nearest_few(query, count),
            _ => self.nearest_many(query, count),
        };
        found.into_iter().map(unpacked).collect()
    }

    fn nearest_few(&self, query: &[f32; 3], count: usize) -> Vec<u64> {
        let mut best = [u64::MAX; SHORT];
        let best = &mut best[..count];
        self.visit(query, f32::INFINITY, |first, end| {
            for slot in first..end {
                let new = packed(sq_dist(&self.at(slot), query), self.indices[slot]);
                if new < best[count - 1] {
                    let place = best.partition_point(|old| *old < new);
                    best.copy_within(place..count - 1, place + 1);
                    best[place] = new;
                }
            }
            if best[count - 1] == u64::MAX { f32::INFINITY } else { distance_of(best[count - 1]) }
        });
        best.iter().copied().take_while(|found| *found != u64::MAX).collect()
    }

    fn nearest_many(&self, query: &[f32; 3], count: usize) -> Vec<u64> {
        let mut best = BinaryHeap::with_capacity(count + 1);
        self.visit(query, f32::INFINITY, |first, end| {
            for slot in first..end {
                best.push(packed(sq_dist(&self.at(slot), query), self.indices[slot]));
                if best.len() > count {
                    best.pop();
                }
            }
            best.peek().filter(|_| best.len() == count).map_or(f32::INFINITY, |worst| distance_of(*worst))
        });
        best.into_sorted_vec()
    }

    /// All points not farther than `radius` metres, nearest first; equal distances in the order of their indices.
    pub fn within_radius(&self, query: &[f32; 3], radius: f32) -> Vec<Neighbour> {
        let mut found = self.within_radius_unsorted(query, radius);
        found.sort_unstable_by_key(|n| packed(n.sq_dist, n.index as u32));
        found
    }

    /// All points not farther than `radius` metres, in an order fixed by the tree alone.
    pub fn within_radius_unsorted(&self, query: &[f32; 3], radius: f32) -> Vec<Neighbour> {
        let mut found = Vec::new();
        if radius.is_nan() || radius < 0.0 || !is_finite(query) {
            return found;
        }
        let limit = radius * radius;
        self.visit_in_order(query, limit, |first, end| {
            for slot in first..end {
                let sq_dist = sq_dist(&self.at(slot), query);
                if sq_dist <= limit {
                    found.push(Neighbour { index: self.indices[slot] as usize, sq_dist });
                }
            }
        });
        found
    }

    #[inline]
    fn at(&self, slot: usize) -> [f32; 3] {
        [self.axes[0][slot], self.axes[1][slot], self.axes[2][slot]]
    }

    /// Shows the leaves that may hold a point within a squared distance, the nearer child first; `leaf` returns the
    /// distance that still counts.
    fn visit(&self, query: &[f32; 3], mut limit: f32, mut leaf: impl FnMut(usize, usize) -> f32) {
        if self.nodes.is_empty() || !is_finite(query) {
            return;
        }
        let mut waiting = [(0u32, 0.0f32); MAX_DEPTH];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (mut at, distance) = waiting[count];
            if distance > limit {
                continue;
            }
            while self.nodes[at as usize].second != 0 {
                let (a, b) = (at + 1, self.nodes[at as usize].second);
                let [to_a, to_b] = [a, b].map(|node| self.nodes[node as usize].sq_dist(query));
                let (near, far, to_far) = if to_a <= to_b { (a, b, to_b) } else { (b, a, to_a) };
                if to_far <= limit {
                    waiting[count] = (far, to_far);
                    count += 1;
                }
                at = near;
            }
            let node = &self.nodes[at as usize];
            if node.sq_dist(query) <= limit {
                limit = leaf(node.first as usize, node.end as usize).min(limit);
            }
        }
    }

    /// Shows the leaves that may hold a point within a squared distance, in the order of the tree.
    fn visit_in_order(&self, query: &[f32; 3], limit: f32, mut leaf: impl FnMut(usize, usize)) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if node.sq_dist(query) > limit {
                at = node.after as usize;
            } else {
                if node.second == 0 {
                    leaf(node.first as usize, node.end as usize);
                }
                at += 1;
            }
        }
    }
}

impl Node {
    /// Squared distance to the box; rounded as that to a point is, it is never above that to a point inside.
    #[inline]
    fn sq_dist(&self, query: &[f32; 3]) -> f32 {
        let outside: [f32; 3] =
            std::array::from_fn(|k| (self.low[k] - query[k]).max(query[k] - self.high[k]).max(0.0));
        outside[0] * outside[0] + outside[1] * outside[1] + outside[2] * outside[2]
    }
}

#[inline]
fn sq_dist(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

/// Distance above index: distances are not negative, so their bits are in their order.
#[inline]
fn packed(sq_dist: f32, index: u32) -> u64 {
    (u64::from(sq_dist.to_bits()) << 32) | u64::from(index)
}

#[inline]
fn distance_of(packed: u64) -> f32 {
    f32::from_bits((packed >> 32) as u32)
}

fn unpacked(packed: u64) -> Neighbour {
    Neighbour { index: packed as u32 as usize, sq_dist: distance_of(packed) }
}

fn is_finite(point: &[f32; 3]) -> bool {
    point.iter().all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute(points: &[[f32; 3]], query: &[f32; 3]) -> Vec<f32> {
        let mut all: Vec<f32> = points
            .iter()
            .filter(|p| is_finite(p))
            .map(|p| (0..3).map(|k| (p[k] - query[k]).powi(2)).sum())
            .collect();
        all.sort_by(f32::total_cmp);
        all
    }

    fn close(a: f32, b: f32) -> bool {
        (a - b).abs() <= 1e-5 * (1.0 + a.abs())
    }

    /// Points on a coarse lattice, so that equal coordinates and equal points are common.
    fn lattice() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop::collection::vec(prop::array::uniform3((-6i32..6).prop_map(|v| v as f32 * 0.25)), 0..200)
    }

    proptest! {
        #[test]
        fn agrees_with_brute_force(points in lattice(), query in prop::array::uniform3(-2.0f32..2.0), k in 0usize..40) {
            let tree = Tree::new(&points);
            let all = brute(&points, &query);
            prop_assert_eq!(tree.nearest(&query).is_some(), !points.is_empty());
            if let Some(found) = tree.nearest(&query) {
                prop_assert!(close(found.sq_dist, all[0]));
            }
            let found = tree.nearest_n(&query, k);
            prop_assert_eq!(found.len(), k.min(points.len()));
            for (n, expected) in found.iter().zip(&all) {
                prop_assert!(close(n.sq_dist, *expected));
            }
            let radius = 0.83f32;
            let found = tree.within_radius(&query, radius);
            prop_assert_eq!(found.len(), all.iter().filter(|d| **d <= radius * radius).count());
            prop_assert!(found.windows(2).all(|w| w[0].sq_dist <= w[1].sq_dist));
            let mut indices: Vec<usize> = found.iter().map(|n| n.index).collect();
            indices.sort_unstable();
            indices.dedup();
            prop_assert_eq!(indices.len(), found.len());
        }
    }

    #[test]
    fn what_is_not_finite_is_never_found() {
        let points = [[f32::NAN; 3], [1.0, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let tree = Tree::new(&points);
        assert_eq!(tree.len(), 2);
        assert_eq!(tree.nearest(&[1.9, 0.0, 0.0]).unwrap().index, 3);
        assert!(tree.nearest(&[f32::NAN; 3]).is_none());
        assert!(tree.within_radius(&[0.0; 3], f32::NAN).is_empty());
        assert!(Tree::new(&[[f32::NAN; 3]]).is_empty());
    }

    #[test]
    fn thousands_of_equal_points_are_no_trouble() {
        let tree = Tree::new(&vec![[0.5; 3]; 5000]);
        assert_eq!(tree.within_radius(&[0.5; 3], 0.1).len(), 5000);
        assert_eq!(tree.nearest_n(&[0.0; 3], 30).len(), 30);
    }

    #[test]
    fn neighbours_are_exactly_those_of_plain_search_index_by_index() {
        let mut rng = fastrand::Rng::with_seed(11);
        let mut points: Vec<[f32; 3]> = (0..3000)
            .map(|i| [rng.f32(), rng.f32(), if i % 3 == 0 { 0.25 } else { 0.01 * rng.f32() }])
            .collect();
        points.extend_from_within(..200);
        points.push([4e5, -3e5, 1e4]);
        let tree = Tree::new(&points);
        for query in points.iter().step_by(31).chain(&[[7.0, -3.0, 0.2], [1e30, 0.0, 0.0]]) {
            let mut all: Vec<Neighbour> = (0..points.len())
                .map(|index| Neighbour { index, sq_dist: sq_dist(&points[index], query) })
                .collect();
            all.sort_by(|a, b| a.sq_dist.total_cmp(&b.sq_dist).then(a.index.cmp(&b.index)));
            for count in [1, 7, 64, 65, 300] {
                assert_eq!(tree.nearest_n(query, count), all[..count]);
            }
            assert_eq!(tree.nearest(query), Some(all[0]));
            let within = all.iter().take_while(|n| n.sq_dist <= 0.01).copied().collect::<Vec<_>>();
            assert_eq!(tree.within_radius(query, 0.1), within);
        }
    }
}
