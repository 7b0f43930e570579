//! The moving-least-squares step (Levin 2004) that averages the views' noise.

use super::FuseConfig;
use super::grid::Walk;
use super::samples::dot;
use super::spot::{Smoothed, Spot};

/// Neighbouring pixels of a view share part of their noise: this many of them are worth one.
const PIXELS_WORTH_ONE: f32 = 11.8;
/// What all pixels of a view share where they are a few millimetres apart, as a share of their spread.
const SHARED_IN_A_VIEW: f32 = 0.59;
/// What all views share (their poses, the depth's calibration, the smoothing), metres. These three were fitted to the errors of four
/// simulated recordings with exact truth.
const SHARED_BY_ALL_METRES: f32 = 0.0001;

/// Spread of a spot's samples about its smoothed surface, and from how many views they are.
#[derive(Default)]
struct Spread {
    weight: f32,
    squared_weight: f32,
    squared: f32,
    views: u64,
}

impl Spread {
    /// `share` is how much of its own weight the spot has here.
    fn add(&mut self, off_metres: f32, spot: &Spot, share: f32) {
        self.weight += share * spot.weight;
        self.squared_weight += share * share * spot.squared_weight;
        self.squared += share * spot.weight * (off_metres * off_metres + spot.variance);
        self.views |= spot.views;
    }

    /// Standard deviation of the mean: a part shrinks with the samples, a part only with the views.
    fn deviation(&self) -> f32 {
        let variance = self.squared / self.weight.max(1e-12);
        let samples = self.weight * self.weight / self.squared_weight.max(1e-12) / PIXELS_WORTH_ONE;
        let views = self.views.count_ones().max(1) as f32;
        let of_views = variance * (1.0 / samples.max(1.0) + SHARED_IN_A_VIEW * SHARED_IN_A_VIEW / views);
        (of_views + SHARED_BY_ALL_METRES * SHARED_BY_ALL_METRES).sqrt()
    }
}

/// Moves a spot along its normal onto the surface of its neighbours; `None` where too few support it.
pub(super) fn smooth(
    seed: &Spot,
    spots: &[Spot],
    near: &mut Walk<'_>,
    config: &FuseConfig,
) -> Option<Smoothed> {
    let (mut point, mut normal) = (seed.point, seed.normal);
    let (mut spread, mut color) = (Spread::default(), seed.color);
    let radius2 = config.radius_metres * config.radius_metres;
    let per_radius2 = 4.0 / radius2;
    let per_voxel2 = 1.0 / (config.voxel_metres * config.voxel_metres);
    for pass in 0..2 {
        let (mut patch, mut support, mut colors) =
            (Patch::default(), 0.0, (seed.color.map(|c| 1e-9 * c), 1e-9f32));
        spread = Spread::default();
        near.around(&point, |i| {
            let s = &spots[i];
            let off: [f32; 3] = std::array::from_fn(|k| s.point[k] - point[k]);
            let d2 = dot(&off, &off);
            let cosine = dot(&s.normal, &normal);
            if d2 > radius2 || cosine < config.same_side_cosine {
                return;
            }
            support += s.weight;
            let share = bell(per_radius2 * d2);
            patch.add(&off, &s.normal, &normal, cosine, share * s.weight);
            spread.add(dot(&off, &normal), s, share);
            if pass == 0 {
                let weight = s.squared_weight * bell(per_voxel2 * d2);
                (0..3).for_each(|k| colors.0[k] += weight * s.color[k]);
                colors.1 += weight;
            }
        });
        if support < config.min_support || patch.weight <= 0.0 {
            return None;
        }
        if pass == 0 {
            color = colors.0.map(|c| c / colors.1);
        }
        let (height, turned) = patch.at_its_middle(&normal);
        point = std::array::from_fn(|k| point[k] + height * normal[k]);
        normal = turned;
    }
    Some(Smoothed { point, normal, color, weight: seed.weight, deviation: spread.deviation() })
}

/// Sums over neighbours as a patch of height above the plane through a point, for its height at the point itself. The mean of the heights is
/// not that: it lies below a bulge by half its curvature times the spread of the neighbours. Each neighbour's own slope tells what its
/// height is back at the point: `h - (slope + slope at the point)·t / 2`, exact for a patch of second order.
#[derive(Default)]
struct Patch {
    weight: f32,
    height: f32,
    across: [f32; 3],
    slope: [f32; 3],
    slope_across: f32,
    squared_across: f32,
}

impl Patch {
    fn add(&mut self, off: &[f32; 3], n: &[f32; 3], up: &[f32; 3], cosine: f32, weight: f32) {
        let height = dot(off, up);
        let across: [f32; 3] = std::array::from_fn(|k| off[k] - height * up[k]);
        let slope: [f32; 3] = std::array::from_fn(|k| up[k] - n[k] / cosine);
        self.weight += weight;
        self.height += weight * height;
        for k in 0..3 {
            self.across[k] += weight * across[k];
            self.slope[k] += weight * slope[k];
        }
        self.slope_across += weight * dot(&slope, &across);
        self.squared_across += weight * dot(&across, &across);
    }

    /// Height and unit normal at the point.
    fn at_its_middle(&self, up: &[f32; 3]) -> (f32, [f32; 3]) {
        let per = 1.0 / self.weight;
        let (across, slope) = (self.across.map(|v| v * per), self.slope.map(|v| v * per));
        let spread = self.squared_across * per - dot(&across, &across);
        let together = self.slope_across * per - dot(&slope, &across);
        let curvature = together / spread.max(1e-12);
        let here: [f32; 3] = std::array::from_fn(|k| slope[k] - curvature * across[k]);
        let height = self.height * per - 0.5 * (self.slope_across * per + dot(&here, &across));
        let normal: [f32; 3] = std::array::from_fn(|k| up[k] - here[k]);
        let length = dot(&normal, &normal).sqrt().max(1e-12);
        (height, normal.map(|v| v / length))
    }
}

/// About `exp(-x / 2)` of the squared distance in deviations, without the cost; 0 from four deviations on.
#[inline]
fn bell(squared: f32) -> f32 {
    let x = (1.0 - squared / 16.0).max(0.0);
    let (x2, x4) = (x * x, x * x * x * x);
    x2 * x2 * x4
}

#[cfg(test)]
mod tests {
    use super::super::grid::Grid;
    use super::super::samples::Sample;
    use super::super::spot::spots_of;
    use super::*;

    fn thinned_and_smoothed(samples: &[Sample]) -> Vec<Smoothed> {
        let config = FuseConfig::default();
        let spots = spots_of(samples, config.voxel_metres);
        let points: Vec<[f32; 3]> = spots.iter().map(|s| s.point).collect();
        let grid = Grid::new(&points, config.radius_metres);
        spots.iter().filter_map(|s| smooth(s, &spots, &mut grid.walk(), &config)).collect()
    }

    #[test]
    fn both_sides_of_a_thin_wall_survive_thinning_and_smoothing() {
        let mut rng = fastrand::Rng::with_seed(5);
        let wall = |x: f32, sign: f32, rng: &mut fastrand::Rng| Sample {
            point: [x + 0.0006 * (rng.f32() - 0.5), 0.04 * rng.f32(), 0.01 + 0.04 * rng.f32()],
            normal: [sign, 0.0, 0.0],
            color: [100.0; 3],
            weight: 1.0,
            view: 0,
        };
        let mut samples: Vec<Sample> = (0..6000).map(|_| wall(0.001, 1.0, &mut rng)).collect();
        samples.extend((0..6000).map(|_| wall(-0.001, -1.0, &mut rng)));
        let smoothed = thinned_and_smoothed(&samples);
        assert!(smoothed.len() > 2000);
        let rms = (smoothed.iter().map(|s| (s.point[0].abs() - 0.001).powi(2)).sum::<f32>()
            / smoothed.len() as f32)
            .sqrt();
        assert!(rms < 0.0001, "{rms}");
    }

    #[test]
    fn a_handle_keeps_its_thickness() {
        const RADIUS: f32 = 0.006;
        let mut rng = fastrand::Rng::with_seed(3);
        let samples: Vec<Sample> = (0..20_000)
            .map(|_| {
                let (s, c) = (std::f32::consts::TAU * rng.f32()).sin_cos();
                let r = RADIUS + 0.0005 * (rng.f32() - 0.5);
                Sample {
                    point: [r * c, r * s, 0.05 * rng.f32()],
                    normal: [c, s, 0.0],
                    color: [100.0; 3],
                    weight: 1.0,
                    view: 0,
                }
            })
            .collect();
        let smoothed = thinned_and_smoothed(&samples);
        let off = |s: &Smoothed| s.point[0].hypot(s.point[1]) - RADIUS;
        let mean = smoothed.iter().map(off).sum::<f32>() / smoothed.len() as f32;
        // The plain mean of the neighbours lies 0.4 mm inside.
        assert!(mean.abs() < 0.00005, "{mean}");
        assert!(smoothed.iter().all(|s| off(s).abs() < 0.0002));
    }
}
