//! What two views say about each other: distances between their surfaces, and differences of brightness.
//!
//! Partners are found by projection. Surfaces: symmetric point-to-plane (Rusinkiewicz 2019, eq. 9). Colour: the target's
//! picture where the source's point falls on it, less the source's own brightness times the pair's gain; it holds what the
//! surfaces leave open, such as the turn of a bottle.

use nalgebra::{Matrix3, Matrix6, Point3, RowVector3, Vector3};
use pulp::{Simd, WithSimd};

use super::gather::Gather;
use super::system::PairBlock;
use super::{DepthModel, PairFit, RefineConfig, RefineView};
use crate::calibrate::{TERMS, basis};
use crate::marker::projection::with_derivative;
use crate::pose::Pose;
use crate::simd;
use crate::view::DepthView;

/// Residuals of this many standard deviations count half (Geman-McClure).
const SCALE_SIGMAS: f64 = 2.5;
/// Darker pixels tell no gain.
const MIN_LUMINANCE: f64 = 0.02;

/// A point of a view in the world, as the present poses and depth coefficients put it.
pub(super) struct Sample {
    point: Vector3<f64>,
    normal: Vector3<f64>,
    by_depth: DepthMove,
    luminance: Option<f64>,
}

/// How a point moves with the depth coefficients: along one direction, by so much a coefficient.
#[derive(Clone, Copy)]
struct DepthMove {
    along: Vector3<f64>,
    terms: [f64; TERMS],
}

/// Pair of views with what both know.
pub(super) struct Pair<'a> {
    pub(super) of: (usize, usize),
    pub(super) target: &'a RefineView<'a>,
    pub(super) samples: &'a [Sample],
    pub(super) world_from_target: &'a Pose,
    /// The target's brightness from the source's; `None` while it is not known.
    pub(super) gain: Option<f64>,
    pub(super) gate_metres: f64,
}

/// A pair's part of the normal equations.
pub(super) struct Linearised {
    pub(super) block: PairBlock,
    pub(super) fit: PairFit,
    /// Information of the surfaces alone on the source's and the target's pose.
    pub(super) by_surface: [Matrix6<f64>; 2],
    /// The target's brightness from the source's.
    pub(super) gain: Option<f64>,
}

/// The samples of a view at the present estimate.
pub(super) fn place_samples(
    view: &RefineView<'_>,
    pixels: &[usize],
    world_from_camera: &Pose,
    depth: Option<(&DepthModel, &[f64; TERMS])>,
) -> Vec<Sample> {
    let rotation = *world_from_camera.rotation.to_rotation_matrix().matrix();
    pixels
        .iter()
        .map(|&pixel| {
            let (point, by_depth) = placed(view.geometry, pixel, world_from_camera, &rotation, depth);
            let normal = rotation * Vector3::from(view.geometry.normals[pixel]).cast::<f64>();
            Sample { point, normal, by_depth, luminance: view.luminance.map(|l| l.at(pixel)) }
        })
        .collect()
}

/// A pixel's point in the world, corrected, and how it moves with the depth coefficients.
#[inline(always)]
fn placed(
    view: &DepthView,
    pixel: usize,
    world_from_camera: &Pose,
    rotation: &Matrix3<f64>,
    depth: Option<(&DepthModel, &[f64; TERMS])>,
) -> (Vector3<f64>, DepthMove) {
    let p = Vector3::from(view.points[pixel]).cast::<f64>();
    let t = world_from_camera.translation.vector;
    let Some((model, step)) = depth else {
        return (rotation * p + t, DepthMove { along: Vector3::zeros(), terms: [0.0; TERMS] });
    };
    let width = view.camera.width as usize;
    let disparity = model.focal_baseline / p.z;
    let terms = basis((pixel % width) as f64, (pixel / width) as f64, disparity, model.half);
    let mut corrected = disparity;
    for k in 0..TERMS {
        corrected += terms[k] * step[k];
    }
    // p = ray fb / d, so dp/dd = -p / d
    let in_world = rotation * (p * (disparity / corrected));
    (in_world + t, DepthMove { along: -in_world / corrected, terms })
}

/// Finds partners of the source's samples in the target and linearises their residuals.
pub(super) fn linearise(
    pair: &Pair<'_>,
    depth: Option<(&DepthModel, &[f64; TERMS])>,
    config: &RefineConfig,
) -> Linearised {
    simd::run(Residuals { pair, depth, config })
}

struct Residuals<'a> {
    pair: &'a Pair<'a>,
    depth: Option<(&'a DepthModel, &'a [f64; TERMS])>,
    config: &'a RefineConfig,
}

impl WithSimd for Residuals<'_> {
    type Output = Linearised;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Linearised {
        let Self { pair, depth, config } = self;
        let (mut block, mut fit, met) = surfaces(simd, pair, depth, config);
        let by_surface = [block.square(0), block.square(6)];
        let gain = gain(&met);
        if let Some(gain) = pair.gain {
            block.join(&colors(simd, pair, &met, gain, config, &mut fit));
        }
        Linearised { block, fit, by_surface, gain }
    }
}

/// A sample that has a partner, and what the target's picture shows there.
struct Met<'a> {
    sample: &'a Sample,
    in_target: Point3<f64>,
    seen: Option<(f64, [f64; 2])>,
}

#[inline(always)]
fn surfaces<'a, S: Simd>(
    simd: S,
    pair: &Pair<'a>,
    depth: Option<(&DepthModel, &[f64; TERMS])>,
    config: &RefineConfig,
) -> (PairBlock, PairFit, Vec<Met<'a>>) {
    let target = pair.target.geometry;
    let target_from_world = pair.world_from_target.inverse();
    let rotation = *pair.world_from_target.rotation.to_rotation_matrix().matrix();
    let (mut gather, mut met, mut squares) = (Gather::new(simd), Vec::new(), 0.0f64);
    for sample in pair.samples {
        let in_target = target_from_world * Point3::from(sample.point);
        let Some(pixel) = target.camera.project(&in_target) else { continue };
        let Some(t) = target.index_of(&pixel) else { continue };
        if !target.mask[t] || target.normals[t] == [0.0; 3] {
            continue;
        }
        let (q, q_by_depth) = placed(target, t, pair.world_from_target, &rotation, depth);
        let p = sample.point;
        let n_q = rotation * Vector3::from(target.normals[t]).cast::<f64>();
        let apart = p - q;
        if sample.normal.dot(&n_q) < config.min_normal_cosine
            || apart.norm_squared() > 4.0 * pair.gate_metres.powi(2)
        {
            continue;
        }
        // Rusinkiewicz 2019, eq. 9: distance along the sum of both normals
        let n = (sample.normal + n_q).normalize();
        let residual = n.dot(&apart);
        if residual.abs() > pair.gate_metres {
            continue;
        }
        squares += residual * residual;
        let row = row(&n, &p, &q, &sample.by_depth, Some(&q_by_depth));
        gather.add(row, residual, robust(residual, config.sigma_metres));
        let seen = pair.target.luminance.and_then(|l| l.between(pixel.x, pixel.y));
        met.push(Met { sample, in_target, seen });
    }
    let inliers = met.len();
    let dilution = (config.independent_points / inliers.max(1) as f64).min(1.0);
    let mut block = gather.finish();
    block.scale(dilution / config.sigma_metres.powi(2));
    let inlier_rmse_metres = (squares / inliers.max(1) as f64).sqrt();
    let (source, target) = pair.of;
    (block, PairFit { source, target, inliers, inlier_rmse_metres, color_inliers: 0 }, met)
}

/// The differences of brightness of samples that have a partner.
#[inline(always)]
fn colors<S: Simd>(
    simd: S,
    pair: &Pair<'_>,
    met: &[Met<'_>],
    gain: f64,
    config: &RefineConfig,
    fit: &mut PairFit,
) -> PairBlock {
    let camera = &pair.target.geometry.camera;
    let rotation: Matrix3<f64> = *pair.world_from_target.rotation.to_rotation_matrix().matrix();
    let mut gather = Gather::new(simd);
    for m in met {
        let (Some((there, slope)), Some(here)) = (m.seen, m.sample.luminance) else { continue };
        let residual = there - gain * here;
        if residual.abs() > SCALE_SIGMAS * 2.0 * config.sigma_luminance {
            continue;
        }
        let Some((_, by_point)) = with_derivative(camera, &m.in_target) else { continue };
        let by_point: RowVector3<f64> = slope[0] * by_point.row(0) + slope[1] * by_point.row(1);
        let along = rotation * by_point.transpose();
        let row = row(&along, &m.sample.point, &m.sample.point, &m.sample.by_depth, None);
        gather.add(row, residual, robust(residual, config.sigma_luminance));
        fit.color_inliers += 1;
    }
    let dilution = (config.independent_colors / fit.color_inliers.max(1) as f64).min(1.0);
    let mut block = gather.finish();
    block.scale(dilution / config.sigma_luminance.powi(2));
    block
}

/// Derivative of `g . (p - q)` by the source's step, the target's step and the depth coefficients, where p moves with the source
/// and q with the target: `d(exp(step) p) = t + w x p`, so `g . (t + w x p) = g . t + (p x g) . w`.
#[inline(always)]
fn row(
    g: &Vector3<f64>,
    p: &Vector3<f64>,
    q: &Vector3<f64>,
    p_by_depth: &DepthMove,
    q_by_depth: Option<&DepthMove>,
) -> [f64; 24] {
    let (a, b) = (p.cross(g), q.cross(g));
    let mut row = [0.0; 24];
    row[..12].copy_from_slice(&[g.x, g.y, g.z, a.x, a.y, a.z, -g.x, -g.y, -g.z, -b.x, -b.y, -b.z]);
    let of_p = g.dot(&p_by_depth.along);
    for (out, term) in row[12..].iter_mut().zip(&p_by_depth.terms) {
        *out = of_p * term;
    }
    if let Some(q_by_depth) = q_by_depth {
        let of_q = g.dot(&q_by_depth.along);
        for (out, term) in row[12..].iter_mut().zip(&q_by_depth.terms) {
            *out -= of_q * term;
        }
    }
    row
}

/// Geman-McClure weight.
#[inline(always)]
fn robust(residual: f64, sigma: f64) -> f64 {
    let ratio = residual / (SCALE_SIGMAS * sigma);
    let bend = 1.0 / (1.0 + ratio * ratio);
    bend * bend
}

/// The target's brightness from the source's, of all points that have a partner.
fn gain(met: &[Met<'_>]) -> Option<f64> {
    let (mut here, mut there, mut count) = (0.0, 0.0, 0usize);
    for m in met {
        let (Some((t, _)), Some(h)) = (m.seen, m.sample.luminance) else { continue };
        if t > MIN_LUMINANCE && h > MIN_LUMINANCE {
            here += h;
            there += t;
            count += 1;
        }
    }
    (count >= 30).then(|| there / here)
}
