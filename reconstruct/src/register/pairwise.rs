//! Global registration of two views from feature matches, with an honest verdict.
//!
//! Matches that keep the distance and the angles of their normals to one another form a graph (second-order compatibility after
//! Chen 2022); its strongest edges give hypotheses. Every hypothesis is judged on the surfaces as both sensors saw them: what
//! lies on the other's surface speaks for it, what stands in the other's free space against it. The best are refined and the
//! best of those is taken; it counts as good only where evidence and the distance to the next best say so. Nothing is random.
//! `target_from_source`, metres.

mod hypotheses;
mod range_map;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use rayon::prelude::*;

use self::hypotheses::hypotheses;
use self::range_map::{Counts, RangeMap};
use super::fine::{Acceleration, Cost, FineConfig, Prepared, Round};
use super::kernel::Kernel;
use super::ransac::Match;
use super::surfel::Surfels;
use crate::pose::Pose;

/// What it means that a sensor measured nothing in a direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beside {
    /// Nothing is known there, as where a surface was too dark to measure or the cloud was cut.
    Unknown,
    /// Nothing is there: the cloud is all of the object that the sensor saw.
    Empty,
}

/// A view: points of the same spacing with normals, and where the sensor stood, all in the view's own frame.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// Points, metres.
    pub points: &'a [[f32; 3]],
    /// Unit normals to the sensor's side, one a point.
    pub normals: &'a [[f32; 3]],
    /// Place of the sensor.
    pub sensor: [f32; 3],
}

/// How to place.
#[derive(Debug, Clone, PartialEq)]
pub struct PairwiseConfig {
    /// Spacing of the points, metres.
    pub cell: f32,
    /// What directions without points mean.
    pub beside: Beside,
    /// Hypotheses that are judged.
    pub hypotheses: usize,
    /// How many of these are refined at first, and how many more each time nothing good was among them.
    pub refined: [usize; 3],
    /// What a placement must reach to be called good.
    pub acceptance: Acceptance,
}

/// What a placement must reach to be called good.
#[derive(Debug, Clone, PartialEq)]
pub struct Acceptance {
    /// Least share of the points on the other's surface.
    pub overlap: f64,
    /// Most points in the other's free space, as a share.
    pub contradiction: f64,
    /// Least lead of the score over that of the best other placement, as a share of the score.
    pub margin: f64,
    /// Largest root mean square distance of the paired surfaces, cells: noise is far below, wrong shapes are not.
    pub rmse_cells: f64,
}

impl Default for PairwiseConfig {
    fn default() -> Self {
        Self {
            cell: 0.005,
            beside: Beside::Unknown,
            hypotheses: 200,
            refined: [8, 16, 40],
            acceptance: Acceptance { overlap: 0.2, contradiction: 0.03, margin: 0.15, rmse_cells: 0.2 },
        }
    }
}

/// Why to believe a placement, or not. Shares 0 to 1, of the points of both views.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Evidence {
    /// Share that lies on the other's surface and faces as it does.
    pub overlap: f64,
    /// Share that stands where the other's sensor looked through, or where it saw nothing at all.
    pub contradiction: f64,
    /// Overlap, each point weighed by how well it lies on the other's surface, less twice the contradiction.
    pub score: f64,
    /// Lead of the score over the best placement elsewhere, as a share of the score.
    pub margin: f64,
    /// Matches that agree, as a share of all.
    pub matches: f64,
    /// Root mean square distance of the paired surfaces, metres.
    pub rmse_metres: f64,
}

/// A placement.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Carries source points to target points.
    pub target_from_source: Pose,
    /// Why to believe it.
    pub evidence: Evidence,
    /// Whether it may be believed.
    pub good: bool,
    /// Other placements with their scores, best first.
    pub others: Vec<(Pose, f64)>,
}

/// Turned or moved by less than this (radians, cells at the middle), two placements are one.
const SAME: (f64, f64) = (0.12, 3.0);
/// Places that a placement must be away from another to be a rival (radians, cells).
const RIVAL: (f64, f64) = (0.2, 4.0);
/// Cells within which a point lies on the surface: before anything is refined, after some steps, in the end.
const WIDE: f32 = 1.6;
const MIDDLE: f32 = 0.9;
const NARROW: f32 = 0.6;
/// Placements that are refined to the end.
const FINALISTS: usize = 3;
/// Points of a view that the first judgement looks at.
const GLANCE: usize = 250;

/// Places `source` against `target`; `None` where the matches give no hypothesis at all.
pub fn place(
    source: &Seen<'_>,
    target: &Seen<'_>,
    matches: &[Match],
    config: &PairwiseConfig,
) -> Option<Placed> {
    if !(config.cell.is_finite() && config.cell > 0.0) {
        return None;
    }
    let starts = hypotheses(source, target, matches, config);
    choose(source, target, matches, &starts, config)
}

/// Placements that several matches agree on, strongest first, not judged by anything else.
pub(super) fn starts_of_matches(
    source: &Seen<'_>,
    target: &Seen<'_>,
    matches: &[Match],
    config: &PairwiseConfig,
) -> Vec<Pose> {
    hypotheses(source, target, matches, config)
}

/// Whether a placement that was found good still is beside others at `starts`: not where one of them, refined, lies elsewhere and fits as well.
pub(super) fn outdoes(
    source: &Seen<'_>,
    target: &Seen<'_>,
    placed: &Placed,
    starts: &[Pose],
    config: &PairwiseConfig,
) -> bool {
    let pair = Pair::new(source, target, config);
    let ranked: Vec<(f64, Pose)> = starts.iter().map(|pose| (0.0, *pose)).collect();
    let mut all = pair.refined(&ranked, 2, 8);
    all.extend(starts);
    let rivals = pair.ranked(all, 1, NARROW);
    let best = &placed.target_from_source;
    let elsewhere = rivals.into_iter().find(|(_, pose)| pair.apart(best, pose, RIVAL));
    let score = placed.evidence.score;
    elsewhere.is_none_or(|(rival, _)| score - rival.max(0.0) >= config.acceptance.margin * score)
}

/// Evidence for a given placement, without rivals.
pub fn judge_at(source: &Seen<'_>, target: &Seen<'_>, pose: &Pose, config: &PairwiseConfig) -> Evidence {
    Pair::new(source, target, config).evidence(pose)
}

/// The best verified of the given starts.
fn choose(
    source: &Seen<'_>,
    target: &Seen<'_>,
    matches: &[Match],
    starts: &[Pose],
    config: &PairwiseConfig,
) -> Option<Placed> {
    let pair = Pair::new(source, target, config);
    let glance = source.points.len().max(target.points.len()).div_ceil(GLANCE);
    let ranked = pair.ranked(starts.to_vec(), glance, WIDE);
    let mut rest = ranked.as_slice();
    let mut pool: Vec<Pose> = Vec::new();
    let mut best = None;
    for size in config.refined {
        let (now, later) = rest.split_at(size.min(rest.len()));
        if now.is_empty() {
            break;
        }
        rest = later;
        pool.extend(pair.refined(now, 3, 6));
        let coarse = pair.ranked(pool, glance.div_ceil(3), MIDDLE);
        let mut kept = distinct(coarse, &pair, SAME);
        let fine = pair.refined(&kept[..kept.len().min(FINALISTS)], 2, 8);
        for (kept, fine) in kept.iter_mut().zip(fine) {
            kept.1 = fine;
        }
        pool = kept.into_iter().map(|(_, pose)| pose).collect();
        let placed = pair.verdict(pair.ranked(pool.clone(), 1, NARROW), config);
        let good = placed.as_ref().is_some_and(|placed| placed.good);
        best = placed.or(best);
        if good {
            break;
        }
    }
    best.map(|mut placed| {
        placed.evidence.matches = agreeing(source, target, matches, &placed.target_from_source, config.cell);
        placed
    })
}

/// Share of the matches within two cells of one another.
fn agreeing(source: &Seen<'_>, target: &Seen<'_>, matches: &[Match], pose: &Pose, cell: f32) -> f64 {
    let reach = 2.0 * f64::from(cell);
    let near = matches
        .iter()
        .filter(|[s, t]| match (source.points.get(*s), target.points.get(*t)) {
            (Some(p), Some(q)) => {
                let p = pose * nalgebra::Point3::from(p.map(f64::from));
                (p.coords - Vector3::from(q.map(f64::from))).norm() < reach
            }
            _ => false,
        })
        .count();
    near as f64 / matches.len().max(1) as f64
}

/// Both views, ready to be judged and refined.
struct Pair {
    source: Surfels,
    target: Prepared,
    maps: [RangeMap; 2],
    cell: f32,
    beside: Beside,
}

impl Pair {
    fn new(source: &Seen<'_>, target: &Seen<'_>, config: &PairwiseConfig) -> Self {
        let radius = 2.4 * config.cell;
        let surfels = [source, target].map(|view| Surfels::new(view.points, &view.sensor, radius));
        let maps = [(&surfels[0], source), (&surfels[1], target)]
            .map(|(surfels, view)| RangeMap::new(surfels, view.points, &view.sensor, config.cell));
        let [source, target] = surfels;
        let reach = 4.0 * config.cell;
        Self {
            source,
            target: Prepared::new(target, 1, 1.25 * config.cell, reach),
            maps,
            cell: config.cell,
            beside: config.beside,
        }
    }

    /// Whether two placements differ, by the turn or by where the source's middle goes.
    fn apart(&self, a: &Pose, b: &Pose, (turn, cells): (f64, f64)) -> bool {
        let middle = self.source.centre;
        a.rotation.angle_to(&b.rotation) > turn
            || (a * middle - b * middle).norm() > cells * f64::from(self.cell)
    }

    fn counts(&self, pose: &Pose, step: usize, tolerance: f32) -> Counts {
        let target = self.target.surfels();
        let width = tolerance * self.cell;
        let there = self.maps[1].counts(&self.source, target, pose, step, width);
        let back = self.maps[0].counts(target, &self.source, &pose.inverse(), step, width);
        let mut counts = there.plus(&back);
        if self.beside == Beside::Unknown {
            counts.beside = 0;
        }
        counts
    }

    fn evidence(&self, pose: &Pose) -> Evidence {
        let counts = self.counts(pose, 1, NARROW);
        let rmse = self.target.rmse(&self.source, pose, &round(self.cell, 1, 1), &cost());
        Evidence {
            overlap: counts.share(counts.on_surface),
            contradiction: counts.share(counts.in_front + counts.beside),
            score: counts.score(),
            rmse_metres: rmse.unwrap_or(f64::INFINITY),
            ..Evidence::default()
        }
    }

    /// The best of ranked placements, with its evidence and its rivals.
    fn verdict(&self, ranked: Vec<(f64, Pose)>, config: &PairwiseConfig) -> Option<Placed> {
        let (score, best) = ranked.first().copied()?;
        let others: Vec<(Pose, f64)> = ranked
            .into_iter()
            .skip(1)
            .filter(|(_, pose)| self.apart(&best, pose, RIVAL))
            .map(|(score, pose)| (pose, score))
            .collect();
        let lead = others.first().map_or(score, |other| score - other.1.max(0.0));
        let evidence = Evidence { margin: lead / score.max(1e-9), ..self.evidence(&best) };
        let wanted = &config.acceptance;
        let good = evidence.overlap >= wanted.overlap
            && evidence.contradiction <= wanted.contradiction
            && evidence.margin >= wanted.margin
            && evidence.rmse_metres <= wanted.rmse_cells * f64::from(config.cell);
        Some(Placed { target_from_source: best, evidence, good, others })
    }

    /// Placements by their score, best first.
    fn ranked(&self, poses: Vec<Pose>, step: usize, tolerance: f32) -> Vec<(f64, Pose)> {
        let mut ranked: Vec<(f64, Pose)> =
            poses.into_par_iter().map(|pose| (self.counts(&pose, step, tolerance).score(), pose)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked
    }

    fn refined(&self, ranked: &[(f64, Pose)], stride: usize, iterations: usize) -> Vec<Pose> {
        let (round, cost) = (round(self.cell, stride, iterations), cost());
        ranked
            .par_iter()
            .map(|(_, pose)| self.target.refine(&self.source, pose, &round, &cost).unwrap_or(*pose))
            .collect()
    }
}

fn round(cell: f32, stride: usize, iterations: usize) -> Round {
    let metres = f64::from(cell);
    // Coarse passes reach farther, the last ones trust what is near.
    let (reach, scale) = if stride > 1 { (4.0 * cell, 1.6 * metres) } else { (2.0 * cell, 0.6 * metres) };
    Round {
        reach,
        cell: 1.25 * cell,
        stride,
        thin_target: 1,
        kernel: Kernel::GemanMcClure(scale),
        iterations,
        tolerance: 0.01 * metres,
    }
}

/// How a placement is refined round by round: rounds are given one at a time.
pub(super) fn cost() -> FineConfig {
    FineConfig {
        cost: Cost::Symmetric,
        acceleration: Acceleration::None,
        rounds: Vec::new(),
        min_normal_cosine: 0.6,
    }
}

/// Drops what is the same as something earlier.
fn distinct(ranked: Vec<(f64, Pose)>, pair: &Pair, same: (f64, f64)) -> Vec<(f64, Pose)> {
    let mut kept: Vec<(f64, Pose)> = Vec::new();
    for (score, pose) in ranked {
        if kept.iter().all(|(_, other)| pair.apart(other, &pose, same)) {
            kept.push((score, pose));
        }
    }
    kept
}
