//! Where the product of one recording lies in another: standing in the first, laid over in the second, nobody knows how.
//!
//! Each recording is a fused cloud with its placed views, in the frame of its own board (z up, metres). Turns of all kinds
//! (evenly over all rotations, the 24 of the principal axes, and feature matches that agree) are refined by the surfaces. Every
//! placement is judged in both directions: what lies on the other's surface speaks for it, what stands where the other's cameras
//! looked through, or under the other's board, against it; and the paint must agree, since a can or a box looks the same from
//! many sides by its shape alone. One is believed only with enough common surface, hardly a contradiction, and a clear lead over
//! the best placement elsewhere. Nothing is random.

mod color;
mod judge;
mod settle;
mod side;
mod slide;
mod starts;
#[cfg(test)]
mod tests;

use nalgebra::Point3;
use rayon::prelude::*;

use self::judge::Judge;
use self::side::Prepared;
use super::fine::Round;
use super::kernel::Kernel;
use super::pairwise::cost;
use crate::cloud::PointCloud;
use crate::fuse::PlacedView;
use crate::pose::Pose;

/// One recording of the product, in the frame of its own board.
#[derive(Debug, Clone, Copy)]
pub struct Side<'a> {
    /// The product's points with normals and colours.
    pub cloud: &'a PointCloud,
    /// The views it was made of.
    pub views: &'a [PlacedView<'a>],
}

/// What a placement must reach, and how finely it is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlipConfig {
    /// Spacing of the points that are compared, metres.
    pub cell_metres: f32,
    /// Least share of both clouds that lies on the other's surface.
    pub min_overlap: f64,
    /// Largest share of both clouds that the other recording's cameras look through, or that lies under its board.
    pub max_conflict: f64,
    /// Largest middle distance of the common surfaces, root mean square, metres.
    pub max_rmse_metres: f64,
    /// Least agreement of the paint (1 = the same, 0 = any), where there is paint to compare.
    pub min_color: f64,
    /// Least lead over the best placement elsewhere, as a share of the score.
    pub min_margin: f64,
}

impl Default for FlipConfig {
    fn default() -> Self {
        Self {
            cell_metres: 0.004,
            min_overlap: 0.30,
            max_conflict: 0.04,
            max_rmse_metres: 0.0011,
            min_color: 0.35,
            min_margin: 0.15,
        }
    }
}

/// Why to believe a placement, or not. Shares 0 to 1, of the points of both recordings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Evidence {
    /// Share that lies on the other's surface and faces as it does.
    pub overlap: f64,
    /// Share that stands where the other's cameras looked through, or under its board.
    pub conflict: f64,
    /// Root mean square distance of the common surfaces, metres.
    pub rmse_metres: f64,
    /// How alike the paint is on the common surface: 1 the same, 0 as any two places.
    pub color: f64,
    /// How much there is of paint to compare: 0 one colour all over, 1 enough.
    pub texture: f64,
    /// Overlap weighed by fit and paint, less twice the conflict.
    pub score: f64,
    /// The score without the paint.
    pub shape_score: f64,
    /// Lead of the score over the best placement elsewhere, as a share of the score.
    pub margin: f64,
}

/// A placement that may be believed.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Carries points of the second recording into the frame of the first.
    pub a_from_b: Pose,
    /// Why to believe it.
    pub evidence: Evidence,
    /// Directions (unit, of left steps about the middle of the product, turns in metres at its radius) that the surfaces do not
    /// hold and the paint must.
    pub weak: slide::Weak,
}

/// Why no placement can be believed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Apart {
    /// One of the recordings has hardly any surface.
    #[error("there is hardly any surface to compare")]
    Nothing,
    /// Too little common surface.
    #[error("the two scans share too little surface")]
    TooLittle(Evidence),
    /// They contradict each other however they are laid together.
    #[error("the two scans do not show the same thing")]
    Contradiction(Evidence),
    /// Shape and paint fit several ways.
    #[error("the two scans fit together in more than one way")]
    Ambiguous(Evidence),
}

/// Turned or moved by less than this (radians, metres at the middle), two placements are one.
const SAME: (f64, f64) = (0.10, 0.006);
/// Places that a placement must be away from another to be a rival.
const RIVAL: (f64, f64) = (0.30, 0.020);
/// What a lead in paint is worth against one in score.
const PAINT_LEAD: f64 = 0.75;
/// Starts that are refined, and refined ones that are judged with all views.
const COARSE: usize = 400;
const FINE: usize = 60;

/// Finds where the second recording's product lies in the first one's frame.
///
/// # Errors
/// Where no placement can be believed, with the evidence for the best.
pub fn place(a: &Side<'_>, b: &Side<'_>, config: &FlipConfig) -> Result<Found, Apart> {
    let pair = Pair::new(a, b, config).ok_or(Apart::Nothing)?;
    let starts = starts::starts(&pair.a, &pair.b);
    let glanced = ranked(starts, |pose| pair.judge.glance(pose));
    let coarse: Vec<Pose> = glanced[..COARSE.min(glanced.len())]
        .par_iter()
        .map(|(_, pose)| pair.refined(pose, &[coarse_round(&pair)]))
        .collect();
    let near = pair.distinct(ranked(coarse, |pose| pair.judge.nearness(pose)));
    let fine: Vec<Pose> = near[..FINE.min(near.len())]
        .par_iter()
        .map(|(_, pose)| pair.refined(pose, &fine_rounds(&pair)))
        .collect();
    let fine = pair.distinct(ranked(fine, |pose| pair.judge.evidence(pose).score));
    pair.verdict(fine, config)
}

/// Evidence for a given placement, without rivals; `None` where there is nothing to compare.
pub fn judge_at(a: &Side<'_>, b: &Side<'_>, a_from_b: &Pose, config: &FlipConfig) -> Option<Evidence> {
    Some(Pair::new(a, b, config)?.judge.evidence(a_from_b))
}

/// Both recordings, ready to be compared.
struct Pair<'a> {
    a: Prepared,
    b: Prepared,
    judge: Judge<'a>,
    target: super::fine::Prepared,
}

impl<'a> Pair<'a> {
    fn new(a: &Side<'a>, b: &Side<'a>, config: &FlipConfig) -> Option<Self> {
        let cell = config.cell_metres;
        let (pa, pb) = (Prepared::new(a.cloud, cell)?, Prepared::new(b.cloud, cell)?);
        let target = super::fine::Prepared::new(pa.surfels.clone(), 1, 1.25 * cell, 6.0 * cell);
        let judge = Judge::new(&pa, &pb, a.views, b.views, cell);
        Some(Self { a: pa, b: pb, judge, target })
    }

    fn refined(&self, start: &Pose, rounds: &[Round]) -> Pose {
        rounds.iter().fold(*start, |pose, round| {
            self.target.refine(&self.b.surfels, &pose, round, &cost()).unwrap_or(pose)
        })
    }

    fn apart(&self, p: &Pose, q: &Pose, (turn, metres): (f64, f64)) -> bool {
        let middle: Point3<f64> = self.b.surfels.centre;
        p.rotation.angle_to(&q.rotation) > turn || (p * middle - q * middle).norm() > metres
    }

    /// Drops what is the same as something better.
    fn distinct(&self, ranked: Vec<(f64, Pose)>) -> Vec<(f64, Pose)> {
        let mut kept: Vec<(f64, Pose)> = Vec::new();
        for (score, pose) in ranked {
            if kept.iter().all(|(_, other)| self.apart(other, &pose, SAME)) {
                kept.push((score, pose));
            }
        }
        kept
    }

    /// The best placement, if it may be believed.
    fn verdict(&self, ranked: Vec<(f64, Pose)>, config: &FlipConfig) -> Result<Found, Apart> {
        let Some(&(_, first)) = ranked.first() else { return Err(Apart::Nothing) };
        let weak = slide::weak_directions(self, &first);
        let slid = slide::along_weak(self, &weak, ranked.into_iter().map(|(_, pose)| pose).collect());
        let ranked = self.distinct(ranked_by_evidence(self, slid));
        let Some(&(_, best)) = ranked.first() else { return Err(Apart::Nothing) };
        let weak = slide::weak_directions(self, &best);
        let best = slide::finely(self, &weak, settle::settled(self, &weak, &best));
        let best = settle::settled(self, &weak, &best);
        let mut evidence = self.judge.evidence(&best);
        let rivals = ranked[1..].iter().filter(|(_, pose)| self.apart(&best, pose, RIVAL));
        evidence.margin =
            rivals.map(|(_, pose)| lead(&evidence, &self.judge.evidence(pose))).fold(1.0, f64::min);
        if evidence.overlap < config.min_overlap {
            return Err(Apart::TooLittle(evidence));
        }
        if evidence.conflict > config.max_conflict
            || evidence.rmse_metres > config.max_rmse_metres
            || (evidence.texture > 0.5 && evidence.color < config.min_color)
        {
            return Err(Apart::Contradiction(evidence));
        }
        if evidence.margin < config.min_margin {
            return Err(Apart::Ambiguous(evidence));
        }
        Ok(Found { a_from_b: best, evidence, weak })
    }
}

/// How clearly a placement is better than another: by its score, or, where most paint is alike whatever the turn (a can's rims and
/// bands), by what is left of it unlike.
fn lead(best: &Evidence, other: &Evidence) -> f64 {
    let by_score = (best.score - other.score.max(0.0)) / best.score.abs().max(1e-9);
    let unlike = |e: &Evidence| (1.0 - e.color).clamp(1e-3, 1.0);
    let by_paint = best.texture.min(other.texture) * (1.0 - unlike(best) / unlike(other));
    by_score.max(PAINT_LEAD * by_paint)
}

fn ranked_by_evidence(pair: &Pair<'_>, poses: Vec<Pose>) -> Vec<(f64, Pose)> {
    ranked(poses, |pose| pair.judge.evidence(pose).score)
}

/// Placements by a score, best first.
fn ranked(poses: Vec<Pose>, score: impl Fn(&Pose) -> f64 + Sync) -> Vec<(f64, Pose)> {
    let mut ranked: Vec<(f64, Pose)> = poses.into_par_iter().map(|pose| (score(&pose), pose)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked
}

fn round(pair: &Pair<'_>, reach: f32, scale: f64, wanted: usize, iterations: usize) -> Round {
    Round {
        reach,
        cell: 0.005,
        stride: (pair.b.surfels.len() / wanted.max(1)).max(1),
        thin_target: 1,
        kernel: Kernel::GemanMcClure(scale),
        iterations,
        tolerance: 3e-5,
    }
}

fn coarse_round(pair: &Pair<'_>) -> Round {
    round(pair, 0.024, 0.010, 400, 12)
}

fn fine_rounds(pair: &Pair<'_>) -> [Round; 2] {
    [round(pair, 0.012, 0.005, 1500, 12), round(pair, 0.006, 0.002, 100_000, 12)]
}
