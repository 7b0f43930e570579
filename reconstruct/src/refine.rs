//! Joint refinement: one Gauss-Newton over all poses and the depth correction, in the world (board) frame.
//!
//! Residuals: the corners of the board's tags, symmetric point-to-plane distances and differences of brightness between overlapping
//! views, the board's plane in every view's depth, and what is known of the sensor. Everything stands **inside** one cost, so that directions
//! the surfaces do not hold (a bottle turned about its axis) are held by corners and colours and cannot slide, and a depth that reads
//! wrong cannot pass for a pose. Every kind is robust; neighbouring points err alike, so each kind is diluted to what it tells.

mod anchor;
mod board;
mod gather;
mod luminance;
mod pair;
mod system;

use nalgebra::{Matrix3, Matrix6, Point3, Vector3};
use rayon::prelude::*;

use crate::calibrate::{BoardSample, CalibrationPrior, DepthCalibration, TERMS};
use crate::pose::{self, Pose};
use crate::view::DepthView;

pub use anchor::{Anchor, PosePrior};
pub use luminance::Luminance;
use pair::{Linearised, Pair};
use system::{System, ViewBlock};

/// Settings of the refinement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineConfig {
    /// Points of a view that look for partners in each other view.
    pub points_per_pair: usize,
    /// Each view is tied to this many others.
    pub neighbours: usize,
    /// Rounds of finding partners anew, each with one Gauss–Newton step.
    pub rounds: usize,
    /// Partners farther apart than this are none, metres, in the first and the last round.
    pub gate_metres: [f64; 2],
    /// Least cosine between the normals of partners.
    pub min_normal_cosine: f64,
    /// Standard deviation of a point's distance to its partner's plane, metres.
    pub sigma_metres: f64,
    /// Standard deviation of a point's brightness against its partner's, of 1.
    pub sigma_luminance: f64,
    /// Neighbouring points err alike: a pair of views never counts more than this many independent points.
    pub independent_points: f64,
    /// The same of brightness: what the depth errs by shifts a whole picture on the surface, so a pair tells hardly more than a few points.
    pub independent_colors: f64,
    /// Whether brightness takes part.
    pub use_color: bool,
    /// Whether the depth correction and the board's plane take part.
    pub use_depth: bool,
}

impl Default for RefineConfig {
    fn default() -> Self {
        Self {
            points_per_pair: 800,
            neighbours: 6,
            rounds: 6,
            gate_metres: [0.010, 0.004],
            min_normal_cosine: 0.8,
            sigma_metres: 0.001,
            sigma_luminance: 0.05,
            independent_points: 40.0,
            independent_colors: 2.0,
            use_color: true,
            use_depth: true,
        }
    }
}

/// A view as the refinement takes it.
#[derive(Debug, Clone, Copy)]
pub struct RefineView<'a> {
    /// Its points, normals and product mask.
    pub geometry: &'a DepthView,
    /// Its picture's brightness, where colour is to take part.
    pub luminance: Option<&'a Luminance>,
    /// The pose to start from.
    pub start: Pose,
    /// What holds its pose.
    pub anchor: Anchor<'a>,
    /// Pixels on the board, measured as `geometry` is.
    pub board: &'a [BoardSample],
}

/// What is known of the depth before: the correction that the views' points already have, and what was expected of the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthModel {
    /// Focal length times baseline: depth in metres is this by disparity in pixels.
    focal_baseline: f64,
    half: [f64; 2],
    residual_px: f64,
    /// The present coefficients less the expected ones, and how far they may be off.
    off: [f64; TERMS],
    standard_deviations: [f64; TERMS],
}

impl DepthModel {
    /// `applied` is the correction that the points already have.
    pub fn new(applied: &DepthCalibration, expected: &CalibrationPrior, focal_baseline: f64) -> Self {
        Self {
            focal_baseline,
            half: applied.half(),
            residual_px: applied.residual_px.max(0.02),
            off: std::array::from_fn(|k| applied.coefficients[k] - expected.coefficients[k]),
            standard_deviations: expected.standard_deviations,
        }
    }
}

/// Refined poses and how well they are known.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// Poses in the order of the views.
    pub world_from_camera: Vec<Pose>,
    /// Covariances of left steps on them, world frame: translation (metres), rotation (radians).
    pub covariance: Vec<Matrix6<f64>>,
    /// What the depth's coefficients change by, with their standard deviations; `None` where they were not free.
    pub depth: Option<DepthStep>,
    /// Agreement of the pairs that share surface.
    pub pairs: Vec<PairFit>,
    /// Per view, how far the surfaces alone would leave the product's points in the direction they hold least, metres.
    pub loosest_by_surface_metres: Vec<f64>,
    /// Middle of the product's points, world.
    pub centre: Point3<f64>,
    /// Board pixels that were looked at.
    pub board_samples: usize,
    /// Gauss–Newton steps taken.
    pub rounds: usize,
}

/// Change of the depth correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthStep {
    /// Added by [`DepthCalibration::then`].
    pub coefficients: [f64; TERMS],
    /// Of the corrected coefficients.
    pub standard_deviations: [f64; TERMS],
}

/// How two views agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairFit {
    /// The view whose points looked for partners.
    pub source: usize,
    /// The view in which they were looked for.
    pub target: usize,
    /// Points that have a partner.
    pub inliers: usize,
    /// Root mean square distance to the partner's plane, metres.
    pub inlier_rmse_metres: f64,
    /// Those of them whose brightness was compared.
    pub color_inliers: usize,
}

impl Refined {
    /// Standard deviation of where a view puts the product's middle (metres), and of how it is turned (radians).
    pub fn standard_deviation(&self, view: usize) -> (f64, f64) {
        let covariance = &self.covariance[view];
        // A left step (t, w) moves a point x by t + w x x.
        let mut by_step = nalgebra::Matrix3x6::zeros();
        by_step.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
        by_step.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-self.centre.coords.cross_matrix()));
        let place = (by_step * covariance * by_step.transpose()).trace();
        let turn = covariance.fixed_view::<3, 3>(3, 3).trace();
        (place.max(0.0).sqrt(), turn.max(0.0).sqrt())
    }
}

/// The present estimate.
struct Estimate {
    poses: Vec<Pose>,
    depth: [f64; TERMS],
    /// The target's brightness from the source's, in the order of the pairs.
    gains: Vec<Option<f64>>,
}

/// Refines all views together; `depth` is `None` where the depth's correction is not to change.
pub fn refine(views: &[RefineView<'_>], depth: Option<&DepthModel>, config: &RefineConfig) -> Refined {
    let depth = depth.filter(|_| config.use_depth);
    let starts: Vec<Pose> = views.iter().map(|v| v.start).collect();
    let pixels: Vec<Vec<usize>> =
        views.iter().map(|v| spread_samples(v.geometry, config.points_per_pair)).collect();
    let pairs = choose_pairs(&starts, config.neighbours);
    let mut now = Estimate { poses: starts, depth: [0.0; TERMS], gains: vec![None; pairs.len()] };
    let (mut rounds, mut last) = (0, None);
    while rounds < config.rounds {
        let round = linearise(views, &pixels, &pairs, depth, &now, rounds, config);
        rounds += 1;
        let Some(step) = round.system.solve() else { break };
        for (i, pose) in now.poses.iter_mut().enumerate() {
            *pose = pose::exp(&step.fixed_rows::<6>(6 * i).into_owned()) * *pose;
        }
        if depth.is_some() {
            let from = 6 * views.len();
            (0..TERMS).for_each(|k| now.depth[k] += step[from + k]);
        }
        now.gains = round.linearised.iter().map(|l| l.gain).collect();
        let is_still = step.amax() < 1e-6;
        last = Some(round);
        if is_still {
            break;
        }
    }
    outcome(views, &pixels, depth, now, last, rounds)
}

/// One round's equations, and what they were made of.
struct Round {
    system: System,
    linearised: Vec<Linearised>,
    board_samples: usize,
}

fn linearise(
    views: &[RefineView<'_>],
    pixels: &[Vec<usize>],
    pairs: &[(usize, usize)],
    depth: Option<&DepthModel>,
    now: &Estimate,
    round: usize,
    config: &RefineConfig,
) -> Round {
    let t = round as f64 / (config.rounds.max(2) - 1) as f64;
    let gate_metres = config.gate_metres[0] * (1.0 - t) + config.gate_metres[1] * t;
    // Brightness leads to the truth from a pixel or two away only, so the surfaces go first.
    let use_color = config.use_color && (round > 0 && gate_metres < 0.009);
    let model = depth.map(|model| (model, &now.depth));
    let samples: Vec<Vec<pair::Sample>> = (0..views.len())
        .into_par_iter()
        .map(|i| pair::place_samples(&views[i], &pixels[i], &now.poses[i], model))
        .collect();
    let linearised: Vec<Linearised> = (0..pairs.len())
        .into_par_iter()
        .map(|k| {
            let (source, target) = pairs[k];
            let pair = Pair {
                of: pairs[k],
                target: &views[target],
                samples: &samples[source],
                world_from_target: &now.poses[target],
                gain: now.gains[k].filter(|_| use_color),
                gate_metres,
            };
            pair::linearise(&pair, model, config)
        })
        .collect();
    let mut system = System::new(views.len(), depth.is_some());
    let mut board_samples = 0;
    for (&pair, part) in pairs.iter().zip(&linearised) {
        system.add_pair(pair, &part.block);
    }
    for (i, view) in views.iter().enumerate() {
        let (pose, camera) = (&now.poses[i], &view.geometry.camera);
        system.add_anchor(i, &view.anchor.normal_equations(pose, camera));
        if let Some((model, step)) = model {
            let mut block = ViewBlock::zero();
            board_samples += board::add(&mut block, view.board, pose, camera, model, step);
            system.add_view(i, &block);
        }
    }
    if let Some((model, step)) = model {
        let off = std::array::from_fn(|k| model.off[k] + step[k]);
        system.add_depth_prior(&off, &model.standard_deviations);
    }
    Round { system, linearised, board_samples }
}

fn outcome(
    views: &[RefineView<'_>],
    pixels: &[Vec<usize>],
    depth: Option<&DepthModel>,
    now: Estimate,
    last: Option<Round>,
    rounds: usize,
) -> Refined {
    let centre = centre(views, pixels, &now.poses);
    let Estimate { poses, depth: step, .. } = now;
    let (mut pairs, mut board_samples, mut covariance) = (Vec::new(), 0, None);
    let mut by_surface = vec![Matrix6::zeros(); views.len()];
    if let Some(round) = last {
        for part in &round.linearised {
            by_surface[part.fit.source] += part.by_surface[0];
            by_surface[part.fit.target] += part.by_surface[1];
        }
        pairs = round.linearised.iter().map(|l| l.fit).collect();
        board_samples = round.board_samples;
        covariance = round.system.covariance();
    }
    let of_view = |i: usize| {
        covariance.as_ref().map_or_else(Matrix6::zeros, |m| m.fixed_view::<6, 6>(6 * i, 6 * i).into_owned())
    };
    let sd = |k: usize| {
        let at = 6 * views.len() + k;
        covariance.as_ref().map_or(0.0, |m| m[(at, at)].max(0.0).sqrt())
    };
    let loosest = |i: usize| loosest_metres(&by_surface[i], views[i].geometry, &pixels[i], &poses[i]);
    Refined {
        covariance: (0..views.len()).map(of_view).collect(),
        depth: depth.map(|_| DepthStep { coefficients: step, standard_deviations: std::array::from_fn(sd) }),
        pairs,
        loosest_by_surface_metres: (0..views.len()).map(loosest).collect(),
        centre,
        board_samples,
        rounds,
        world_from_camera: poses,
    }
}

/// Middle of all samples, world.
fn centre(views: &[RefineView<'_>], pixels: &[Vec<usize>], poses: &[Pose]) -> Point3<f64> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for ((view, pixels), pose) in views.iter().zip(pixels).zip(poses) {
        for &pixel in pixels {
            sum += (pose * Point3::from(view.geometry.points[pixel]).cast::<f64>()).coords;
            count += 1.0;
        }
    }
    Point3::from(sum / f64::max(count, 1.0))
}

/// Standard deviation in the direction that a view's surfaces hold least, as metres at the view's points: turns about their middle
/// count by the points' distance from it.
fn loosest_metres(information: &Matrix6<f64>, view: &DepthView, pixels: &[usize], pose: &Pose) -> f64 {
    let points: Vec<Vector3<f64>> =
        pixels.iter().map(|&i| (pose * Point3::from(view.points[i]).cast::<f64>()).coords).collect();
    let count = points.len().max(1) as f64;
    let middle = points.iter().sum::<Vector3<f64>>() / count;
    let radius = (points.iter().map(|p| (p - middle).norm_squared()).sum::<f64>() / count).sqrt().max(1e-4);
    // A turn about the middle is a turn about the origin with a shift: t = t' - w x middle.
    let mut change = Matrix6::identity();
    change.fixed_view_mut::<3, 3>(0, 3).copy_from(&(middle.cross_matrix() / radius));
    change.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() / radius));
    let centred = change.transpose() * information * change;
    let least = centred.symmetric_eigenvalues().min();
    if least > 1e-6 { 1.0 / least.sqrt() } else { f64::INFINITY }
}

/// Product pixels of a view, evenly taken.
fn spread_samples(view: &DepthView, count: usize) -> Vec<usize> {
    let all: Vec<usize> = view.product_pixels().filter(|&i| view.incidence_cosine(i) > 0.3).collect();
    let stride = (all.len() / count.max(1)).max(1);
    all.into_iter().step_by(stride).collect()
}

/// Ordered pairs of views that look at the product from the nearest sides.
fn choose_pairs(poses: &[Pose], neighbours: usize) -> Vec<(usize, usize)> {
    let towards = |p: &Pose| p.translation.vector.normalize();
    let mut pairs = Vec::new();
    for (i, a) in poses.iter().enumerate() {
        let mut others: Vec<(f64, usize)> = poses
            .iter()
            .enumerate()
            .filter(|&(j, _)| j != i)
            .map(|(j, b)| (towards(a).dot(&towards(b)), j))
            .filter(|&(cosine, _)| cosine > -0.2)
            .collect();
        others.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        pairs.extend(others.into_iter().take(neighbours).map(|(_, j)| (i, j)));
    }
    pairs
}

#[cfg(test)]
mod tests;
