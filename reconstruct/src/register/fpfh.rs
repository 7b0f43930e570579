//! Fast point feature histograms (Rusu, Blodow and Beetz 2009; source slide 23): 33 numbers that describe the surface around
//! a point whatever its pose. Three angles between oriented points, 11 bins each.
//!
//! The weighted mean of the neighbours' histograms is brought to the same total as the point's own before both are added, so
//! that neither depends on the unit of length. Any frame, metres.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::cloud::PointCloud;
use crate::knn::{Neighbour, Tree};

/// Bins an angle.
const BINS: usize = 11;
/// Length of a descriptor.
pub const LENGTH: usize = 3 * BINS;
/// Total of each of the three histograms.
const TOTAL: f32 = 100.0;
/// Neighbours beyond this many are thinned evenly: dense clouds would cost much and tell nothing new.
const MOST_NEIGHBOURS: usize = 128;

/// A descriptor; all zero where the surface could not be described.
pub type Descriptor = [f32; LENGTH];

/// Descriptors of the points named by `at`, over neighbours within `radius` metres.
///
/// All zero for points without a normal or without neighbours, or where the cloud has no normals at all.
pub fn describe(cloud: &PointCloud, tree: &Tree, radius: f32, at: &[usize]) -> Vec<Descriptor> {
    if !cloud.has_normals() {
        return vec![[0.0; LENGTH]; at.len()];
    }
    let around = |i: usize| neighbours(cloud, tree, radius, i);
    let own: Vec<Vec<Neighbour>> = at.par_iter().with_min_len(64).map(|i| around(*i)).collect();
    let mut wanted = vec![false; cloud.len()];
    for i in own.iter().flatten().map(|n| n.index).chain(at.iter().copied()) {
        wanted[i] = true;
    }
    let mut lists: Vec<Option<&Vec<Neighbour>>> = vec![None; cloud.len()];
    for (i, list) in at.iter().zip(&own) {
        lists[*i] = Some(list);
    }
    let simple: Vec<Option<Descriptor>> = (0..cloud.len())
        .into_par_iter()
        .with_min_len(64)
        .map(|i| {
            wanted[i].then(|| match lists[i] {
                Some(list) => simplified(cloud, i, list),
                None => simplified(cloud, i, &around(i)),
            })
        })
        .collect();
    at.par_iter().zip(&own).with_min_len(64).map(|(i, list)| weighted(*i, list, &simple)).collect()
}

fn neighbours(cloud: &PointCloud, tree: &Tree, radius: f32, i: usize) -> Vec<Neighbour> {
    let mut found = tree.within_radius_unsorted(&cloud.points[i], radius);
    found.retain(|n| n.sq_dist > 0.0 && cloud.normals[n.index] != [0.0; 3]);
    if found.len() > MOST_NEIGHBOURS {
        let all = found.len();
        found = (0..MOST_NEIGHBOURS).map(|k| found[k * all / MOST_NEIGHBOURS]).collect();
    }
    found
}

/// SPFH: the histograms of the pairs with the point itself.
fn simplified(cloud: &PointCloud, i: usize, list: &[Neighbour]) -> Descriptor {
    let mut histogram = [0.0f32; LENGTH];
    if list.is_empty() || cloud.normals[i] == [0.0; 3] {
        return histogram;
    }
    let share = TOTAL / list.len() as f32;
    for other in list {
        let Some(angles) = pair_angles(cloud, i, other.index) else { continue };
        for (k, angle) in angles.iter().enumerate() {
            let bin = (angle * BINS as f32).clamp(0.0, BINS as f32 - 1.0) as usize;
            histogram[k * BINS + bin] += share;
        }
    }
    histogram
}

/// The three angles of Rusu's Darboux frame, each scaled to 0..1: `α = v·n_t`, `φ = u·(p_t - p_s)/d`,
/// `θ = atan2(w·n_t, u·n_t)` (their eq. 1–2).
fn pair_angles(cloud: &PointCloud, i: usize, j: usize) -> Option<[f32; 3]> {
    let (p, q) = (Vector3::from(cloud.points[i]), Vector3::from(cloud.points[j]));
    let (n, m) = (Vector3::from(cloud.normals[i]), Vector3::from(cloud.normals[j]));
    let line = q - p;
    let distance = line.norm();
    // The frame stands where the normal is closer to the connecting line.
    let (u, other, line) =
        if n.dot(&line).abs() >= m.dot(&line).abs() { (n, m, line) } else { (m, n, -line) };
    let direction = line / distance;
    let v = direction.cross(&u).try_normalize(1e-6)?;
    let w = u.cross(&v);
    let alpha = v.dot(&other);
    let phi = u.dot(&direction);
    let theta = w.dot(&other).atan2(u.dot(&other));
    Some([(alpha + 1.0) * 0.5, (phi + 1.0) * 0.5, theta / std::f32::consts::TAU + 0.5])
}

/// FPFH: own histogram plus the mean of the neighbours', weighted by inverse squared distance.
fn weighted(i: usize, list: &[Neighbour], simple: &[Option<Descriptor>]) -> Descriptor {
    let mut sum = [0.0f32; LENGTH];
    for other in list {
        let Some(histogram) = &simple[other.index] else { continue };
        let weight = 1.0 / other.sq_dist;
        for (total, value) in sum.iter_mut().zip(histogram) {
            *total += weight * value;
        }
    }
    let own = simple[i].unwrap_or([0.0; LENGTH]);
    let mut result = [0.0f32; LENGTH];
    for angle in 0..3 {
        let bins = angle * BINS..(angle + 1) * BINS;
        let total: f32 = sum[bins.clone()].iter().sum();
        let scale = if total > 0.0 && total.is_finite() { TOTAL / total } else { 0.0 };
        for k in bins {
            result[k] = own[k] + sum[k] * scale;
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normals::{Neighbourhood, estimate};
    use crate::pose::exp;
    use nalgebra::Vector6;

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
}
