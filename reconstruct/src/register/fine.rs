//! Fine registration of two views from a start some degrees and centimetres off.
//!
//! Surfels are paired by looking their place up in a grid, so a pass over all of them costs as much as reading them. Costs and
//! accelerations can be chosen and compared: point-to-point (Besl and McKay 1992), point-to-plane (Chen and Medioni 1992),
//! symmetric (Rusinkiewicz 2019), plane-to-plane (Segal 2009); Besl and McKay's extrapolation, Anderson's mixing (Zhang 2021).
//! `target_from_source`, metres; sums run in chunks of fixed size, so threads don't change the result.

mod anderson;
mod normal_equations;
#[cfg(test)]
pub(super) mod tests;

use nalgebra::{Vector3, Vector6};

use self::anderson::Anderson;
use self::normal_equations::{Sums, sums};
use super::extrapolate::Extrapolation;
use super::kernel::Kernel;
use super::near_field::NearField;
use super::surfel::Surfels;
use crate::pose::{Pose, exp, log};

/// What is made small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cost {
    /// Distance between the places.
    PointToPoint,
    /// Distance from the target's plane.
    PointToPlane,
    /// Distance along the mean of both normals.
    Symmetric,
    /// Distance whitened by how far each place may be off along its plane and across it.
    PlaneToPlane,
}

/// How steps are made longer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Acceleration {
    /// Not at all.
    None,
    /// Along the line or parabola through the last errors.
    BeslMcKay,
    /// Mixing of the last five steps, taken back where the error grew.
    Anderson,
}

/// A stage of [`FineConfig`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// Pairs farther apart are none, metres.
    pub reach: f32,
    /// Edge of a cell of the look-up grid, metres.
    pub cell: f32,
    /// Every how many-th surfel of the source is used.
    pub stride: usize,
    /// Every how many-th surfel of the target is in the grid.
    pub thin_target: usize,
    /// Robust kernel on the residual, metres.
    pub kernel: Kernel,
    /// Iterations at most.
    pub iterations: usize,
    /// Converged when a step moves the source by less, metres.
    pub tolerance: f64,
}

/// How to register.
#[derive(Debug, Clone, PartialEq)]
pub struct FineConfig {
    /// What is made small.
    pub cost: Cost,
    /// How steps are made longer.
    pub acceleration: Acceleration,
    /// Coarse to fine.
    pub rounds: Vec<Round>,
    /// Pairs whose normals' cosine is lower are none.
    pub min_normal_cosine: f32,
}

impl Default for FineConfig {
    /// For views 0.5 to 1 m away, up to 8 degrees and 15 mm off.
    fn default() -> Self {
        let round = |reach, cell, [stride, thin_target]: [usize; 2], scale, iterations, tolerance| Round {
            reach,
            cell,
            stride,
            thin_target,
            kernel: Kernel::GemanMcClure(scale),
            iterations,
            tolerance,
        };
        Self {
            cost: Cost::Symmetric,
            acceleration: Acceleration::None,
            rounds: vec![
                round(0.02, 0.005, [8, 8], 0.008, 10, 3e-4),
                round(0.006, 0.003, [3, 2], 0.003, 12, 3e-5),
                round(0.004, 0.003, [2, 1], 0.0015, 8, 1e-5),
            ],
            min_normal_cosine: 0.75,
        }
    }
}

/// What became of a registration.
#[derive(Debug, Clone, PartialEq)]
pub struct Fine {
    /// Carries source points to target points.
    pub target_from_source: Pose,
    /// Iterations done, all rounds together.
    pub iterations: usize,
    /// Whether the last round converged.
    pub converged: bool,
    /// Share of the source's surfels that have a pair, 0 to 1.
    pub fitness: f64,
    /// Root mean square residual of the pairs by weight, metres.
    pub rmse_metres: f64,
}

/// Moves `source` onto `target` from `start`; `None` where the pairs don't determine a motion or the start is not finite.
pub fn register_fine(source: &Surfels, target: &Surfels, start: &Pose, config: &FineConfig) -> Option<Fine> {
    if !log(start).iter().all(|v| v.is_finite()) {
        return None;
    }
    let mut state = State::new(between_centres(source, target, start));
    for round in &config.rounds {
        let field = NearField::new(&target.points, round.thin_target.max(1), round.cell, round.reach);
        state.run(source, target, &field, round, config)?;
    }
    let paired = state.sums.count as f64 * config.rounds.last().map_or(1, |r| r.stride.max(1)) as f64;
    Some(Fine {
        target_from_source: from_centres(source, target, &state.pose),
        iterations: state.iterations,
        converged: state.converged,
        fitness: (paired / source.len().max(1) as f64).min(1.0),
        rmse_metres: (state.sums.square / state.sums.weight.max(1e-12)).sqrt(),
    })
}

/// A target with its grid, for many starts.
pub(crate) struct Prepared {
    surfels: Surfels,
    field: NearField,
}

impl Prepared {
    pub(crate) fn new(surfels: Surfels, thin: usize, cell: f32, reach: f32) -> Self {
        let field = NearField::new(&surfels.points, thin, cell, reach);
        Self { surfels, field }
    }

    pub(crate) fn surfels(&self) -> &Surfels {
        &self.surfels
    }

    /// One round of [`register_fine`] from `start`.
    pub(crate) fn refine(
        &self,
        source: &Surfels,
        start: &Pose,
        round: &Round,
        config: &FineConfig,
    ) -> Option<Pose> {
        let mut state = State::new(between_centres(source, &self.surfels, start));
        state.run(source, &self.surfels, &self.field, round, config)?;
        Some(from_centres(source, &self.surfels, &state.pose))
    }

    /// Root mean square residual at a pose, metres.
    pub(crate) fn rmse(
        &self,
        source: &Surfels,
        pose: &Pose,
        round: &Round,
        config: &FineConfig,
    ) -> Option<f64> {
        let pose = between_centres(source, &self.surfels, pose);
        let sums = sums(source, &self.surfels, &self.field, &pose, round, config);
        (sums.count > 0).then(|| (sums.square / sums.weight.max(1e-12)).sqrt())
    }
}

/// The pose between coordinates that are relative to the centres.
fn between_centres(source: &Surfels, target: &Surfels, pose: &Pose) -> Pose {
    let translation = pose * source.centre - target.centre;
    Pose::from_parts(translation.into(), pose.rotation)
}

fn from_centres(source: &Surfels, target: &Surfels, pose: &Pose) -> Pose {
    let translation = target.centre.coords + pose.translation.vector - pose.rotation * source.centre.coords;
    let mut rotation = pose.rotation;
    rotation.renormalize();
    Pose::from_parts(translation.into(), rotation)
}

struct State {
    pose: Pose,
    iterations: usize,
    converged: bool,
    sums: Sums,
}

impl State {
    fn new(pose: Pose) -> Self {
        Self { pose, iterations: 0, converged: false, sums: Sums::new() }
    }

    fn run(
        &mut self,
        source: &Surfels,
        target: &Surfels,
        field: &NearField,
        round: &Round,
        config: &FineConfig,
    ) -> Option<()> {
        let radius = radius_of(source);
        let base = self.pose;
        let mut anderson = Anderson::new();
        let mut extrapolation = Extrapolation::default();
        self.converged = false;
        for _ in 0..round.iterations {
            self.sums = sums(source, target, field, &self.pose, round, config);
            if config.acceleration == Acceleration::Anderson
                && let Some(plain) = anderson.take_back(self.sums.mean_cost())
            {
                self.pose = exp(&plain) * base;
                self.sums = sums(source, target, field, &self.pose, round, config);
            }
            let step = self.sums.step(radius)?;
            self.iterations += 1;
            let moved = scaled(&step, radius);
            let mut next = exp(&step) * self.pose;
            self.converged = moved.norm() < round.tolerance;
            match config.acceleration {
                Acceleration::None => {}
                Acceleration::BeslMcKay => {
                    let factor = extrapolation.factor(&moved, self.sums.mean_cost());
                    if factor > 1.0 && !self.converged {
                        next = exp(&(step * (factor - 1.0))) * next;
                    }
                }
                Acceleration::Anderson => {
                    let (before, after) = (log(&(self.pose * base.inverse())), log(&(next * base.inverse())));
                    let mixed = anderson.mix(
                        &scaled(&before, radius),
                        &scaled(&after, radius),
                        self.sums.mean_cost(),
                    );
                    if !self.converged {
                        next = exp(&scaled(&mixed, 1.0 / radius)) * base;
                    }
                    anderson.plain = Some(after);
                }
            }
            self.pose = next;
            if self.converged {
                break;
            }
        }
        Some(())
    }
}

/// A twist with its rotation measured in metres at `radius`.
fn scaled(twist: &Vector6<f64>, radius: f64) -> Vector6<f64> {
    let mut scaled = *twist;
    scaled.fixed_rows_mut::<3>(3).scale_mut(radius);
    scaled
}

fn radius_of(surfels: &Surfels) -> f64 {
    let sum: f64 = surfels.points.iter().map(|p| Vector3::from(p.map(f64::from)).norm_squared()).sum();
    (sum / surfels.len().max(1) as f64).sqrt().max(1e-6)
}
