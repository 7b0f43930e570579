//! Fusion: the product's pixels of all used views become one clean cloud.
//!
//! World frame, metres. Points that other views see through are carved away; the rest is thinned to a voxel grid that
//! keeps the two sides of a thin wall apart, and every remaining point is moved along its normal onto the weighted mean
//! of its neighbours facing the same way (a moving-least-squares step, Levin 2004), which averages the views' noise.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::cloud::PointCloud;
use crate::image::ColorImage;
use crate::pose::Pose;
use crate::view::DepthView;

/// Settings of the fusion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FuseConfig {
    /// Spacing of the final points, metres.
    pub voxel_metres: f32,
    /// Neighbours within this distance smooth a point, metres.
    pub radius_metres: f32,
    /// Least cosine between normals of the same side of a wall.
    pub same_side_cosine: f32,
    /// A view that sees this much farther than a point sees through it, metres.
    pub see_through_metres: f64,
    /// Pixels seen flatter than this cosine are not used.
    pub min_incidence_cosine: f32,
    /// Least weight of neighbours for a point to stay (1 = one pixel seen straight on).
    pub min_support: f32,
    /// Points are kept above this height only, metres.
    pub floor_metres: f32,
}

impl Default for FuseConfig {
    fn default() -> Self {
        Self {
            voxel_metres: 0.001,
            radius_metres: 0.004,
            same_side_cosine: 0.6,
            see_through_metres: 0.010,
            min_incidence_cosine: 0.25,
            min_support: 2.0,
            floor_metres: 0.0018,
        }
    }
}

/// A view ready to be fused.
#[derive(Debug, Clone, Copy)]
pub struct PlacedView<'a> {
    /// Its geometry.
    pub geometry: &'a DepthView,
    /// Its colours, same pixels.
    pub color: &'a ColorImage,
    /// Its pose.
    pub world_from_camera: Pose,
}

/// A measured point in the world.
#[derive(Debug, Clone, Copy)]
struct Sample {
    point: [f32; 3],
    normal: [f32; 3],
    color: [f32; 3],
    weight: f32,
}

/// Fuses the views.
pub fn fuse(views: &[PlacedView], config: &FuseConfig) -> PointCloud {
    let gains = color_gains(views);
    let samples: Vec<Sample> = (0..views.len())
        .into_par_iter()
        .map(|i| samples_of(views, i, gains[i], config))
        .collect::<Vec<_>>()
        .concat();
    let grid = Grid::new(&samples, config.radius_metres);
    let seeds = thin(&samples, config.voxel_metres);
    let smoothed: Vec<Sample> = seeds.par_iter().filter_map(|s| smooth(s, &samples, &grid, config)).collect();
    let thinned = thin(&smoothed, config.voxel_metres);
    let kept = drop_board_remains(thinned, config);
    to_cloud(&drop_small_clusters(kept))
}

/// The product's pixels of view `i` that no two other views see through.
fn samples_of(views: &[PlacedView], i: usize, gain: [f32; 3], config: &FuseConfig) -> Vec<Sample> {
    let view = &views[i];
    let others: Vec<(Pose, &DepthView)> = (0..views.len())
        .filter(|&j| j != i)
        .map(|j| (views[j].world_from_camera.inverse() * view.world_from_camera, views[j].geometry))
        .collect();
    let world_from_camera = view.world_from_camera.cast::<f32>();
    let geometry = view.geometry;
    let usable =
        geometry.product_pixels().filter(|&s| geometry.incidence_cosine(s) >= config.min_incidence_cosine);
    usable
        .filter(|&s| {
            !is_seen_through(&Point3::from(geometry.points[s]).cast(), &others, config.see_through_metres)
        })
        .map(|s| {
            let cosine = geometry.incidence_cosine(s);
            let distance = geometry.points[s][2] / 0.75;
            let c = view.color.data[s];
            Sample {
                point: (world_from_camera * Point3::from(geometry.points[s])).into(),
                normal: (world_from_camera.rotation * Vector3::from(geometry.normals[s])).into(),
                color: std::array::from_fn(|k| f32::from(c[k]) * gain[k]),
                weight: cosine / (distance * distance).powi(2),
            }
        })
        .collect()
}

/// Whether at least two views, and more than agree, look through the point onto something farther.
fn is_seen_through(point: &Point3<f64>, others: &[(Pose, &DepthView)], see_through_metres: f64) -> bool {
    let (mut through, mut agree) = (0, 0);
    for (other_from_this, other) in others {
        let p = other_from_this * point;
        match other.nearest_gap(&p) {
            Some(gap) if gap > see_through_metres => through += 1,
            Some(gap) if gap.abs() < 0.5 * see_through_metres => agree += 1,
            _ => {}
        }
    }
    through >= 2 && through > agree
}

/// Factors that bring every view's colours to a common brightness, channel by channel: least squares of log colours over
/// spots seen by two views, with a pull to 1.
fn color_gains(views: &[PlacedView]) -> Vec<[f32; 3]> {
    let n = views.len();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect();
    let ratios: Vec<Option<([f64; 3], f64)>> =
        pairs.par_iter().map(|&(i, j)| log_ratio(&views[i], &views[j])).collect();
    let mut gains = vec![[1.0f32; 3]; n];
    for channel in 0..3 {
        let mut normal = nalgebra::DMatrix::<f64>::identity(n, n) * 0.05;
        let mut right = nalgebra::DVector::<f64>::zeros(n);
        for (&(i, j), ratio) in pairs.iter().zip(&ratios) {
            let Some((log_ratio, weight)) = ratio else { continue };
            let w = weight.min(1.0);
            normal[(i, i)] += w;
            normal[(j, j)] += w;
            normal[(i, j)] -= w;
            normal[(j, i)] -= w;
            right[i] -= w * log_ratio[channel];
            right[j] += w * log_ratio[channel];
        }
        if let Some(solution) = normal.cholesky().map(|c| c.solve(&right)) {
            for (gain, log) in gains.iter_mut().zip(solution.iter()) {
                gain[channel] = log.clamp(-0.5, 0.5).exp() as f32;
            }
        }
    }
    gains
}

/// Middle of `log(color in a) - log(color in b)` over common spots, and how much it is worth (1 = a thousand spots).
fn log_ratio(a: &PlacedView, b: &PlacedView) -> Option<([f64; 3], f64)> {
    let b_from_a = b.world_from_camera.inverse() * a.world_from_camera;
    let mut logs: [Vec<f64>; 3] = Default::default();
    for s in a.geometry.product_pixels().step_by(7) {
        let p = b_from_a * Point3::from(a.geometry.points[s]).cast::<f64>();
        let Some(t) = b.geometry.pixel_of(&p) else { continue };
        let same = b.geometry.mask[t] && (f64::from(b.geometry.points[t][2]) - p.z).abs() < 0.004;
        if !same || a.geometry.incidence_cosine(s) < 0.5 || b.geometry.incidence_cosine(t) < 0.5 {
            continue;
        }
        for (k, logs) in logs.iter_mut().enumerate() {
            let (ca, cb) = (a.color.data[s][k], b.color.data[t][k]);
            if (12..250).contains(&ca) && (12..250).contains(&cb) {
                logs.push((f64::from(ca) / f64::from(cb)).ln());
            }
        }
    }
    let weight = logs.iter().map(Vec::len).min()? as f64 / 1000.0;
    if weight < 0.05 {
        return None;
    }
    Some((
        logs.map(|mut l| {
            let m = l.len() / 2;
            *l.select_nth_unstable_by(m, f64::total_cmp).1
        }),
        weight,
    ))
}

/// Points sorted by cell, so that a row of cells along x is one run.
struct Grid {
    cell: f32,
    low: [f32; 3],
    keys: Vec<u64>,
    order: Vec<u32>,
}

impl Grid {
    fn new(samples: &[Sample], cell: f32) -> Self {
        let low = samples.iter().fold([f32::MAX; 3], |lo, s| std::array::from_fn(|k| lo[k].min(s.point[k])));
        let mut keyed: Vec<(u64, u32)> = samples
            .par_iter()
            .enumerate()
            .map(|(i, s)| (key(cell_of(&s.point, &low, cell)), i as u32))
            .collect();
        keyed.par_sort_unstable();
        let (keys, order) = keyed.into_iter().unzip();
        Self { cell, low, keys, order }
    }

    /// Calls `visit` with the index of every sample in the 27 cells around a point.
    fn around(&self, point: &[f32; 3], mut visit: impl FnMut(usize)) {
        let [x, y, z] = cell_of(point, &self.low, self.cell);
        for cz in z.saturating_sub(1)..=z + 1 {
            for cy in y.saturating_sub(1)..=y + 1 {
                let (from, to) = (key([x.saturating_sub(1), cy, cz]), key([x + 1, cy, cz]));
                let start = self.keys.partition_point(|&k| k < from);
                for (k, &i) in self.keys[start..].iter().zip(&self.order[start..]) {
                    if *k > to {
                        break;
                    }
                    visit(i as usize);
                }
            }
        }
    }
}

/// Cell of a point; far outliers are clamped to 21 bits an axis.
fn cell_of(point: &[f32; 3], low: &[f32; 3], cell: f32) -> [u64; 3] {
    std::array::from_fn(|k| (((point[k] - low[k]) / cell).max(0.0) as u64).min((1 << 21) - 2))
}

fn key([x, y, z]: [u64; 3]) -> u64 {
    (z << 42) | (y << 21) | x
}

/// Which of six directions a normal points to most: keeps the sides of a thin wall in different voxels.
fn side(n: &[f32; 3]) -> u64 {
    let axis = (0..3).fold(0, |best, k| if n[k].abs() > n[best].abs() { k } else { best });
    (2 * axis + usize::from(n[axis] < 0.0)) as u64
}

/// One weighted mean sample a voxel and side, in the order of the voxels.
fn thin(samples: &[Sample], voxel: f32) -> Vec<Sample> {
    let low = samples.iter().fold([f32::MAX; 3], |lo, s| std::array::from_fn(|k| lo[k].min(s.point[k])));
    let mut keyed: Vec<(u64, u64, u32)> = samples
        .iter()
        .enumerate()
        .map(|(i, s)| (key(cell_of(&s.point, &low, voxel)), side(&s.normal), i as u32))
        .collect();
    keyed.par_sort_unstable();
    keyed
        .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
        .map(|run| {
            let mut mean = Mean::default();
            for &(_, _, i) in run {
                let s = &samples[i as usize];
                mean.add(s, s.weight, s.weight);
            }
            mean.sample()
        })
        .collect()
}

/// A weighted mean of samples.
#[derive(Default)]
struct Mean {
    point: [f32; 3],
    normal: [f32; 3],
    color: [f32; 3],
    weight: f32,
    color_weight: f32,
}

impl Mean {
    fn add(&mut self, s: &Sample, weight: f32, color_weight: f32) {
        for k in 0..3 {
            self.point[k] += weight * s.point[k];
            self.normal[k] += weight * s.normal[k];
            self.color[k] += color_weight * s.color[k];
        }
        self.weight += weight;
        self.color_weight += color_weight;
    }

    fn sample(&self) -> Sample {
        let length = dot(&self.normal, &self.normal).sqrt().max(1e-12);
        Sample {
            point: self.point.map(|v| v / self.weight.max(1e-12)),
            normal: self.normal.map(|v| v / length),
            color: self.color.map(|v| v / self.color_weight.max(1e-12)),
            weight: self.weight,
        }
    }
}

/// Moves a seed along its normal onto the mean of its neighbours; `None` where too few support it.
fn smooth(seed: &Sample, samples: &[Sample], grid: &Grid, config: &FuseConfig) -> Option<Sample> {
    let mut current = *seed;
    let narrow = -0.5 / (0.25 * config.radius_metres * config.radius_metres);
    let color_narrow = -0.5 / (config.voxel_metres * config.voxel_metres);
    for _ in 0..2 {
        let mut mean = Mean::default();
        let mut support = 0.0;
        grid.around(&current.point, |i| {
            let s = &samples[i];
            let off: [f32; 3] = std::array::from_fn(|k| s.point[k] - current.point[k]);
            let d2 = dot(&off, &off);
            if d2 > config.radius_metres * config.radius_metres
                || dot(&s.normal, &current.normal) < config.same_side_cosine
            {
                return;
            }
            support += s.weight;
            mean.add(
                s,
                s.weight * (narrow * d2).exp(),
                s.weight * s.weight * (color_narrow * d2).exp() + 1e-9,
            );
        });
        if support < config.min_support || mean.weight <= 0.0 {
            return None;
        }
        let mean = mean.sample();
        let off: [f32; 3] = std::array::from_fn(|k| mean.point[k] - current.point[k]);
        let along = dot(&off, &mean.normal);
        current = Sample {
            point: std::array::from_fn(|k| current.point[k] + along * mean.normal[k]),
            normal: mean.normal,
            color: mean.color,
            weight: seed.weight,
        };
    }
    Some(current)
}

fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Drops low points that are the board's noise: they stay only under or inside the product's outline.
fn drop_board_remains(samples: Vec<Sample>, config: &FuseConfig) -> Vec<Sample> {
    const CELL: f32 = 0.002;
    const SURELY_PRODUCT_METRES: f32 = 0.006;
    let Some(first) = samples.first() else { return samples };
    let bounds = samples.iter().fold((first.point, first.point), |(lo, hi), s| {
        (
            std::array::from_fn(|k| f32::min(lo[k], s.point[k])),
            std::array::from_fn(|k| f32::max(hi[k], s.point[k])),
        )
    });
    let (low, high): ([f32; 3], [f32; 3]) = bounds;
    let margin = 3usize;
    let size: [usize; 2] =
        std::array::from_fn(|k| (((high[k] - low[k]) / CELL) as usize).min(4000) + 1 + 2 * margin);
    let cell = |p: &[f32; 3]| {
        let c: [usize; 2] =
            std::array::from_fn(|k| ((((p[k] - low[k]) / CELL) as usize) + margin).min(size[k] - 1));
        c[1] * size[0] + c[0]
    };
    let mut high_up = vec![false; size[0] * size[1]];
    samples
        .iter()
        .filter(|s| s.point[2] > SURELY_PRODUCT_METRES)
        .for_each(|s| high_up[cell(&s.point)] = true);
    let inside = filled(&dilated(&high_up, size, 1), size);
    samples
        .into_iter()
        .filter(|s| {
            s.point[2] > SURELY_PRODUCT_METRES || (s.point[2] > config.floor_metres && inside[cell(&s.point)])
        })
        .collect()
}

fn dilated(cells: &[bool], size: [usize; 2], by: usize) -> Vec<bool> {
    let mut out = cells.to_vec();
    for y in by..size[1] - by {
        for x in by..size[0] - by {
            if cells[y * size[0] + x] {
                for v in y - by..=y + by {
                    out[v * size[0] + x - by..=v * size[0] + x + by].fill(true);
                }
            }
        }
    }
    out
}

/// The cells and all that they enclose: what cannot be reached from the border.
fn filled(cells: &[bool], size: [usize; 2]) -> Vec<bool> {
    let mut outside = vec![false; cells.len()];
    let mut queue: Vec<usize> = (0..cells.len())
        .filter(|i| {
            let (x, y) = (i % size[0], i / size[0]);
            x == 0 || y == 0 || x + 1 == size[0] || y + 1 == size[1]
        })
        .collect();
    while let Some(i) = queue.pop() {
        if outside[i] || cells[i] {
            continue;
        }
        outside[i] = true;
        let (x, y) = (i % size[0], i / size[0]);
        if x > 0 {
            queue.push(i - 1);
        }
        if x + 1 < size[0] {
            queue.push(i + 1);
        }
        if y > 0 {
            queue.push(i - size[0]);
        }
        if y + 1 < size[1] {
            queue.push(i + size[0]);
        }
    }
    outside.into_iter().map(|o| !o).collect()
}

/// Drops clusters smaller than one percent of the largest (Euclidean clustering, 5 mm: the source's own future work).
fn drop_small_clusters(samples: Vec<Sample>) -> Vec<Sample> {
    const LINK: f32 = 0.005;
    let grid = Grid::new(&samples, LINK);
    let mut cluster = vec![u32::MAX; samples.len()];
    let mut sizes = Vec::new();
    let mut queue = Vec::new();
    for start in 0..samples.len() {
        if cluster[start] != u32::MAX {
            continue;
        }
        let label = sizes.len() as u32;
        cluster[start] = label;
        queue.push(start);
        let mut size = 0usize;
        while let Some(i) = queue.pop() {
            size += 1;
            let here = samples[i].point;
            grid.around(&here, |j| {
                let off: [f32; 3] = std::array::from_fn(|k| samples[j].point[k] - here[k]);
                if cluster[j] == u32::MAX && dot(&off, &off) < LINK * LINK {
                    cluster[j] = label;
                    queue.push(j);
                }
            });
        }
        sizes.push(size);
    }
    let least = sizes.iter().copied().max().unwrap_or(0) / 100;
    samples.into_iter().zip(cluster).filter(|(_, c)| sizes[*c as usize] >= least).map(|(s, _)| s).collect()
}

fn to_cloud(samples: &[Sample]) -> PointCloud {
    PointCloud {
        points: samples.iter().map(|s| s.point).collect(),
        colors: samples.iter().map(|s| s.color.map(|c| c.round().clamp(0.0, 255.0) as u8)).collect(),
        normals: samples.iter().map(|s| s.normal).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_encloses_its_inside() {
        let size = [7, 7];
        let ring: Vec<bool> = (0..49i32)
            .map(|i| {
                let (x, y) = (i % 7 - 3, i / 7 - 3);
                x.abs().max(y.abs()) == 2
            })
            .collect();
        let inside = filled(&ring, size);
        assert!(inside[24] && !inside[0]);
        assert_eq!(inside.iter().filter(|&&i| i).count(), 25);
    }

    #[test]
    fn both_sides_of_a_thin_wall_survive_thinning_and_smoothing() {
        let mut rng = fastrand::Rng::with_seed(5);
        let wall = |x: f32, sign: f32, rng: &mut fastrand::Rng| Sample {
            point: [x + 0.0006 * (rng.f32() - 0.5), 0.04 * rng.f32(), 0.01 + 0.04 * rng.f32()],
            normal: [sign, 0.0, 0.0],
            color: [100.0; 3],
            weight: 1.0,
        };
        let mut samples: Vec<Sample> = (0..6000).map(|_| wall(0.001, 1.0, &mut rng)).collect();
        samples.extend((0..6000).map(|_| wall(-0.001, -1.0, &mut rng)));
        let config = FuseConfig::default();
        let grid = Grid::new(&samples, config.radius_metres);
        let smoothed: Vec<Sample> =
            thin(&samples, 0.001).iter().filter_map(|s| smooth(s, &samples, &grid, &config)).collect();
        assert!(smoothed.len() > 2000);
        let rms = (smoothed.iter().map(|s| (s.point[0].abs() - 0.001).powi(2)).sum::<f32>()
            / smoothed.len() as f32)
            .sqrt();
        assert!(rms < 0.0001, "{rms}");
    }
}
