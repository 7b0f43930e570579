//! Fast point feature histograms (Rusu, Blodow and Beetz 2009; source slide 23): 33 numbers that describe the surface around
//! a point whatever its pose. Three angles between oriented points, 11 bins each.
//!
//! The weighted mean of the neighbours' histograms is brought to the same total as the point's own before both are added, so
//! that neither depends on the unit of length. Any frame, metres.

mod angles;
mod leaf;

use rayon::prelude::*;

use crate::cloud::PointCloud;
use crate::knn::Tree;
use crate::simd::run;
use leaf::{Chunk, Histogram, Simple, Task, Weighted};

/// Bins an angle.
const BINS: usize = 11;
/// Length of a descriptor.
pub const LENGTH: usize = 3 * BINS;
/// Total of each of the three histograms.
const TOTAL: f32 = 100.0;
/// Leaves a parallel task takes.
const LEAVES: usize = 16;
/// Where at least one point in so many is described, all points are looked at.
const MOST: usize = 4;

/// A descriptor; all zero where the surface could not be described.
pub type Descriptor = [f32; LENGTH];

/// Descriptors of the points named by `at`, over neighbours within `radius` metres; `tree` is that of the cloud.
///
/// All zero for points without a normal or without neighbours, or where the cloud has no normals at all.
pub fn describe(cloud: &PointCloud, tree: &Tree, radius: f32, at: &[usize]) -> Vec<Descriptor> {
    if !cloud.has_normals() || radius.is_nan() || radius <= 0.0 {
        return vec![[0.0; LENGTH]; at.len()];
    }
    let mut slot_of = vec![None; cloud.len()];
    for (slot, &index) in tree.indices().iter().enumerate() {
        slot_of[index as usize] = Some(slot);
    }
    let mut described = vec![false; tree.len()];
    for slot in at.iter().filter_map(|&i| slot_of[i]) {
        described[slot] = true;
    }
    let normals = std::array::from_fn(|k| {
        tree.indices().iter().map(|&index| cloud.normals[index as usize][k]).collect()
    });
    let leaves = tree.leaves();
    let context = Context { tree, normals: &normals, radius };
    let wanted = context.wanted(&leaves, &described, at.len());
    let simple: Vec<Histogram> = context.each(&leaves, &wanted, Simple);
    let weighted = context.each(&leaves, &described, Weighted(&simple));
    at.iter().map(|&i| slot_of[i].map_or([0.0; LENGTH], |slot| descriptor(&weighted[slot]))).collect()
}

/// Without the padding.
fn descriptor(row: &Histogram) -> Descriptor {
    std::array::from_fn(|k| row[k])
}

/// What all tasks look at.
#[derive(Clone, Copy)]
struct Context<'a> {
    tree: &'a Tree,
    /// Normals in the order of the tree.
    normals: &'a [Vec<f32>; 3],
    radius: f32,
}

impl Context<'_> {
    /// Those to be described and all their neighbours.
    fn wanted(&self, leaves: &[std::ops::Range<usize>], described: &[bool], count: usize) -> Vec<bool> {
        if count * MOST >= described.len() {
            return vec![true; described.len()];
        }
        let mut wanted = described.to_vec();
        let neighbours: Vec<Vec<u32>> = leaves
            .par_chunks(LEAVES)
            .map(|leaves| {
                let mut found = Vec::new();
                let slots = leaves.iter().cloned().flatten().filter(|&slot| described[slot]);
                for slot in slots {
                    let near = self.tree.within_radius_unsorted(&self.tree.point(slot), self.radius);
                    found.extend(near.iter().map(|n| n.index as u32));
                }
                found
            })
            .collect();
        let mut near = vec![false; described.len()];
        for index in neighbours.into_iter().flatten() {
            near[index as usize] = true;
        }
        for (wanted, &index) in wanted.iter_mut().zip(self.tree.indices()) {
            *wanted |= near.get(index as usize).copied().unwrap_or(true);
        }
        wanted
    }

    /// A row for every point in the order of the tree; zero where none is wanted.
    fn each<T: Task>(self, leaves: &[std::ops::Range<usize>], wanted: &[bool], task: T) -> Vec<Histogram> {
        let chunks: Vec<Vec<Histogram>> = leaves
            .par_chunks(LEAVES)
            .map(|leaves| run(Chunk { context: self, leaves, wanted, task }))
            .collect();
        chunks.into_iter().flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normals::{Neighbourhood, estimate};
    use crate::pose::exp;
    use crate::simd::on_every_path;
    use nalgebra::{Vector3, Vector6};

    fn bumpy() -> PointCloud {
        let mut rng = fastrand::Rng::with_seed(5);
        let points: Vec<[f32; 3]> = (0..3000)
            .map(|_| {
                let (x, y) = (rng.f32() * 0.2 - 0.1, rng.f32() * 0.2 - 0.1);
                [x, y, 0.5 + 0.01 * (60.0 * x).sin() * (45.0 * y).cos() + 0.4 * x * y]
            })
            .collect();
        let surface = estimate(&points, &Tree::new(&points), Neighbourhood::Radius(0.01), &[0.0; 3]);
        PointCloud { points, normals: surface.normals, ..PointCloud::default() }
    }

    #[test]
    fn a_descriptor_does_not_depend_on_the_pose() {
        let cloud = bumpy();
        let moved = cloud.transformed(&exp(&Vector6::new(0.4, -0.2, 0.9, 1.0, -2.0, 0.5)));
        let at: Vec<usize> = (0..cloud.len()).step_by(17).collect();
        let a = describe(&cloud, &Tree::new(&cloud.points), 0.025, &at);
        let b = describe(&moved, &Tree::new(&moved.points), 0.025, &at);
        for (a, b) in a.iter().zip(&b) {
            // Rounding moves a few angles to the next bin and swaps the ends of a few pairs.
            let difference: f32 = a.iter().zip(b).map(|(x, y)| (x - y).abs()).sum();
            assert!(difference < 0.1 * 6.0 * TOTAL, "{difference}");
            let totals: Vec<f32> = a.chunks(BINS).map(|c| c.iter().sum()).collect();
            assert!(totals.iter().all(|t| (t - 2.0 * TOTAL).abs() < 0.05 * TOTAL), "{totals:?}");
        }
    }

    #[test]
    fn other_samples_of_one_place_are_nearest() {
        let cloud = bumpy();
        let tree = Tree::new(&cloud.points);
        let (even, odd): (Vec<usize>, Vec<usize>) = (0..cloud.len()).partition(|i| i % 2 == 0);
        let halves = [even, odd].map(|indices| cloud.select(&indices));
        let described = halves.each_ref().map(|half| {
            let all: Vec<usize> = (0..half.len()).collect();
            describe(half, &Tree::new(&half.points), 0.025, &all)
        });
        let inside = |p: &[f32; 3]| p[..2].iter().all(|v| v.abs() < 0.07);
        let (mut asked, mut near) = (0, 0);
        for (i, a) in described[0].iter().enumerate().filter(|(i, _)| inside(&halves[0].points[*i])) {
            let distance = |b: &Descriptor| a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f32>();
            let best = (0..described[1].len())
                .min_by(|x, y| distance(&described[1][*x]).total_cmp(&distance(&described[1][*y])))
                .unwrap();
            let offset = Vector3::from(halves[1].points[best]) - Vector3::from(halves[0].points[i]);
            asked += 1;
            near += usize::from(offset.norm() < 0.015);
        }
        // On this smooth surface many places look alike; by chance it would be one in fifty.
        assert!(asked > 300 && near * 8 > asked, "{near} of {asked}");
        // Describing only some points changes nothing.
        let some = describe(&cloud, &tree, 0.025, &[4, 99]);
        let all: Vec<usize> = (0..cloud.len()).collect();
        let every = describe(&cloud, &tree, 0.025, &all);
        assert_eq!(some, vec![every[4], every[99]]);
    }

    #[test]
    fn without_normals_or_neighbours_all_is_zero() {
        let cloud = PointCloud { points: vec![[0.0; 3], [1.0; 3]], ..PointCloud::default() };
        assert_eq!(describe(&cloud, &Tree::new(&cloud.points), 0.1, &[0, 1]), vec![[0.0; LENGTH]; 2]);
        let cloud = PointCloud { normals: vec![[0.0, 0.0, 1.0]; 2], ..cloud };
        assert_eq!(describe(&cloud, &Tree::new(&cloud.points), 0.1, &[0]), vec![[0.0; LENGTH]]);
    }

    #[test]
    fn all_paths_agree_and_so_does_any_number_of_threads() {
        let cloud = bumpy();
        let tree = Tree::new(&cloud.points);
        let normals = std::array::from_fn(|k| {
            tree.indices().iter().map(|&index| cloud.normals[index as usize][k]).collect()
        });
        let (leaves, wanted) = (tree.leaves(), vec![true; tree.len()]);
        let context = Context { tree: &tree, normals: &normals, radius: 0.025 };
        let chunk = || Chunk { context, leaves: &leaves, wanted: &wanted, task: Simple };
        let paths = on_every_path(chunk);
        for path in &paths[1..] {
            // Rounding moves a few angles to the next bin.
            let pairs = path.iter().flatten().zip(paths[0].iter().flatten());
            let differences: f32 = pairs.map(|(a, b)| (a - b).abs()).sum();
            assert!(differences < 1e-3 * 3.0 * TOTAL * path.len() as f32);
        }
        let all: Vec<usize> = (0..cloud.len()).collect();
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| describe(&cloud, &tree, 0.025, &all))
        };
        assert!(on(1) == on(3));
    }
}
