//! Nearest neighbours among 3-D points: the only file that names `kiddo`.
//!
//! Points with a coordinate that is not finite are never found; indices stay those of the slice given to [`Tree::new`].

use std::cmp::Ordering;
use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// A point found: its index in the slice the tree was made of and its squared distance in square metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Index of the point.
    pub index: usize,
    /// Squared distance, square metres.
    pub sq_dist: f32,
}

/// A search structure over fixed points.
pub struct Tree {
    inner: Option<ImmutableKdTree<f32, 3>>,
    /// Original indices where points had to be left out, else empty.
    original: Vec<u32>,
    len: usize,
}

impl std::fmt::Debug for Tree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tree").field("len", &self.len).finish_non_exhaustive()
    }
}

impl Tree {
    /// Builds the tree; a coordinate that is not finite leaves its point out.
    pub fn new(points: &[[f32; 3]]) -> Self {
        if points.iter().all(is_finite) {
            return Self::of_finite(points, Vec::new());
        }
        let original: Vec<u32> =
            (0u32..).zip(points).filter(|(_, p)| is_finite(p)).map(|(index, _)| index).collect();
        let finite: Vec<[f32; 3]> = points.iter().copied().filter(is_finite).collect();
        Self::of_finite(&finite, original)
    }

    fn of_finite(points: &[[f32; 3]], original: Vec<u32>) -> Self {
        let inner = if points.is_empty() { None } else { ImmutableKdTree::new_from_slice(points).ok() };
        Self { len: inner.as_ref().map_or(0, ImmutableKdTree::size), inner, original }
    }

    /// Number of points that can be found.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether nothing can be found.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    fn neighbour(&self, item: usize, sq_dist: f32) -> Neighbour {
        let index = if self.original.is_empty() { item } else { self.original[item] as usize };
        Neighbour { index, sq_dist }
    }

    /// The nearest point; `None` for an empty tree or a query that is not finite.
    pub fn nearest(&self, query: &[f32; 3]) -> Option<Neighbour> {
        let tree = self.inner.as_ref().filter(|_| is_finite(query))?;
        let found = tree.query(query).nearest_one::<SquaredEuclidean<f32>>().execute();
        Some(self.neighbour(found.item as usize, found.distance))
    }

    /// The nearest point not farther than `radius` metres.
    pub fn nearest_within(&self, query: &[f32; 3], radius: f32) -> Option<Neighbour> {
        self.nearest(query).filter(|found| found.sq_dist <= radius * radius)
    }

    /// The `count` nearest points, nearest first (fewer where there are fewer).
    pub fn nearest_n(&self, query: &[f32; 3], count: usize) -> Vec<Neighbour> {
        let (Some(tree), Some(count)) = (&self.inner, NonZero::new(count.min(self.len))) else {
            return Vec::new();
        };
        if !is_finite(query) {
            return Vec::new();
        }
        let found = tree.query(query).nearest_n::<SquaredEuclidean<f32>>(count).execute();
        found.into_iter().map(|n| self.neighbour(n.item as usize, n.distance)).collect()
    }

    /// All points not farther than `radius` metres, nearest first; equal distances in the order of their indices.
    pub fn within_radius(&self, query: &[f32; 3], radius: f32) -> Vec<Neighbour> {
        let mut found = self.within_radius_unsorted(query, radius);
        found.sort_unstable_by(|a, b| {
            a.sq_dist.partial_cmp(&b.sq_dist).unwrap_or(Ordering::Equal).then(a.index.cmp(&b.index))
        });
        found
    }

    /// All points not farther than `radius` metres, in an order fixed by the tree alone.
    pub fn within_radius_unsorted(&self, query: &[f32; 3], radius: f32) -> Vec<Neighbour> {
        let Some(tree) = self.inner.as_ref().filter(|_| is_finite(query) && radius >= 0.0) else {
            return Vec::new();
        };
        let found = tree.query(query).within::<SquaredEuclidean<f32>>(radius * radius).unsorted().execute();
        found.into_iter().map(|n| self.neighbour(n.item as usize, n.distance)).collect()
    }
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
}
