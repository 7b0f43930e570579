//! Placement of views without a board: of a stream whose neighbours are at most 10 to 15 degrees apart, or of stills.
//!
//! Each view is followed from the one before it by coloured ICP; where that can't be verified, it is found by features among
//! the views placed so far. Further links between views that look from nearby sides, the last and the first among them, close
//! loops; a pose graph makes all agree, and links are measured anew from its poses. A view is only placed with verified links.
//!
//! What moved is found out by trying: either the camera (then the whole scene is followed, table and clutter are wonderful
//! features) or the product on its turntable (then only the product is).

mod motion;

use nalgebra::Point3;
use rayon::prelude::*;

pub use self::motion::Moving;
use super::graph::{Edge, error, optimise};
use super::link::{Acceptance, Anchor, Features, Link, features, find, follow, polish};
use super::verify::Agreement;
use super::view::RegisterView;
use crate::pose::Pose;

/// How to place.
#[derive(Debug, Clone, PartialEq)]
pub struct GlobalConfig {
    /// What a link must reach that was followed from a guess.
    pub acceptance: Acceptance,
    /// What a link must reach that was found from nothing, where look-alikes are many.
    pub acceptance_of_found: Acceptance,
    /// Links of a view beside the one it was placed by.
    pub extra_links: usize,
    /// Views farther apart in direction than this are not linked, radians.
    pub max_link_angle: f64,
    /// Placed views that an unplaced one is compared with by features.
    pub feature_candidates: usize,
    /// Seed of the random choices.
    pub seed: u64,
}

impl Default for GlobalConfig {
    fn default() -> Self {
        Self {
            acceptance: Acceptance::default(),
            acceptance_of_found: Acceptance::strict(),
            extra_links: 3,
            max_link_angle: 0.75,
            feature_candidates: 4,
            seed: 0,
        }
    }
}

/// A pair of views that was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairLink {
    /// View whose frame the pose is in.
    pub target: usize,
    /// The other view.
    pub source: usize,
    /// The pose and how well it fits.
    pub link: Link,
    /// Weight 0 to 1 in the pose graph.
    pub weight: f64,
}

/// What became of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewVerdict {
    /// Whether it was placed.
    pub placed: bool,
    /// Why not, in words that complete "view 003 was left out: …".
    pub reason: Option<String>,
    /// The best agreement with another view, where any was measured.
    pub agreement: Option<Agreement>,
}

/// Poses of all views that could be placed.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// One a view; the world is the first placed view's camera frame.
    pub world_from_view: Vec<Option<Pose>>,
    /// One a view.
    pub verdicts: Vec<ViewVerdict>,
    /// The verified links.
    pub pairs: Vec<PairLink>,
    /// What moved between the views.
    pub moving: Moving,
}

/// Places the views, which are in the order they were taken in.
pub fn place_views(views: &[RegisterView], config: &GlobalConfig) -> Placement {
    let (moving, cut) = motion::decide(views);
    let views: &[RegisterView] = cut.as_deref().unwrap_or(views);
    let mut search = Search::new(views, config);
    // The view to start from may itself be the one that doesn't fit.
    for start in [0, views.len() / 2] {
        search.start_from(start);
        search.follow_sequence();
        search.find_rest();
        if 2 * search.placed() > views.len() {
            break;
        }
    }
    search.link_neighbours();
    search.relax();
    search.measure_anew();
    search.relax();
    search.into_placement(moving)
}

struct Search<'a> {
    views: &'a [RegisterView],
    anchors: Vec<Anchor<'a>>,
    features: Vec<Option<Features>>,
    config: &'a GlobalConfig,
    start: usize,
    poses: Vec<Option<Pose>>,
    pairs: Vec<PairLink>,
    best_failure: Vec<Option<(Agreement, &'static str)>>,
}

impl<'a> Search<'a> {
    fn new(views: &'a [RegisterView], config: &'a GlobalConfig) -> Self {
        Self {
            views,
            anchors: views.par_iter().map(Anchor::new).collect(),
            features: vec![None; views.len()],
            config,
            start: 0,
            poses: vec![None; views.len()],
            pairs: Vec::new(),
            best_failure: vec![None; views.len()],
        }
    }

    /// Forgets everything and takes view `start` as the first to stand.
    fn start_from(&mut self, start: usize) {
        self.start = start;
        self.pairs.clear();
        self.poses.fill(None);
        self.best_failure.fill(None);
        if let Some(first) = self.poses.get_mut(start) {
            *first = Some(Pose::identity());
        }
    }

    fn placed(&self) -> usize {
        self.poses.iter().flatten().count()
    }

    /// Notes a link if it can be believed, and whether it was.
    fn accept(&mut self, target: usize, source: usize, link: Option<&Link>, acceptance: &Acceptance) -> bool {
        let Some(link) = link else { return false };
        let link = *link;
        match acceptance.judge(&link.agreement) {
            Ok(()) => {
                self.pairs.push(PairLink { target, source, link, weight: 1.0 });
                true
            }
            Err(reason) => {
                let best = &mut self.best_failure[source];
                if best.as_ref().is_none_or(|(other, _)| other.score() < link.agreement.score()) {
                    *best = Some((link.agreement, reason));
                }
                false
            }
        }
    }

    /// Follows the views after the first to stand, then those before it backwards.
    fn follow_sequence(&mut self) {
        let (start, count) = (self.start, self.views.len());
        self.follow_one_way(start + 1..count);
        self.follow_one_way((0..start.min(count)).rev());
    }

    /// Follows every view from the last one placed, at rest or moving on as before.
    fn follow_one_way(&mut self, order: impl Iterator<Item = usize>) {
        let mut step = Pose::identity();
        let mut last = self.start;
        for i in order {
            let next_one = last.abs_diff(i) == 1;
            let mut guesses = vec![Pose::identity()];
            if step != Pose::identity() && next_one {
                guesses.insert(0, step);
            }
            let link = follow(&self.views[i], &self.anchors[last], &guesses);
            if self.accept(last, i, link.as_ref(), &self.config.acceptance)
                && let (Some(link), Some(pose)) = (link, self.poses[last])
            {
                step = if next_one { link.target_from_source } else { Pose::identity() };
                self.poses[i] = Some(pose * link.target_from_source);
                last = i;
            } else if last.abs_diff(i) > 3 {
                break; // not a stream: features must place the rest
            }
        }
    }

    /// Places what is left by features, against the placed views nearest in order; again while that places any.
    fn find_rest(&mut self) {
        loop {
            let left: Vec<usize> = (0..self.views.len()).filter(|i| self.poses[*i].is_none()).collect();
            let placed_before = left.len();
            for i in left {
                let mut placed: Vec<usize> = (0..self.views.len())
                    .filter(|j| self.poses[*j].is_some() && !self.tried(i, *j))
                    .collect();
                placed.sort_by_key(|j| (i.abs_diff(*j), *j));
                placed.truncate(self.config.feature_candidates);
                self.find_among(i, &placed);
            }
            let left = self.poses.iter().filter(|p| p.is_none()).count();
            if left == 0 || left == placed_before {
                return;
            }
        }
    }

    fn tried(&self, source: usize, target: usize) -> bool {
        self.pairs.iter().any(|pair| pair.source == source && pair.target == target)
    }

    fn find_among(&mut self, i: usize, placed: &[usize]) {
        for k in placed.iter().copied().chain([i]) {
            if self.features[k].is_none() {
                self.features[k] = Some(features(&self.views[k]));
            }
        }
        let (all, seed) = (&self.features, self.config.seed);
        let acceptance = &self.config.acceptance_of_found;
        let links: Vec<(usize, Option<Link>)> = placed
            .par_iter()
            .map(|j| {
                let pair = all[i].as_ref().zip(all[*j].as_ref());
                (*j, pair.and_then(|(a, b)| find(&self.views[i], a, &self.anchors[*j], b, acceptance, seed)))
            })
            .collect();
        let mut best: Option<(f64, Pose)> = None;
        for (j, link) in links {
            if self.accept(j, i, link.as_ref(), &self.config.acceptance_of_found)
                && let (Some(link), Some(pose)) = (link, self.poses[j])
            {
                let score = link.agreement.score();
                if best.as_ref().is_none_or(|b| score > b.0) {
                    best = Some((score, pose * link.target_from_source));
                }
            }
        }
        self.poses[i] = best.map(|b| b.1);
    }

    /// Links every placed view with those that look from nearby sides, by the poses so far.
    fn link_neighbours(&mut self) {
        let wanted = self.neighbour_pairs();
        let links: Vec<Option<Link>> = wanted
            .par_iter()
            .map(|(target, source)| {
                let (t, s) = (self.poses[*target]?, self.poses[*source]?);
                follow(&self.views[*source], &self.anchors[*target], &[t.inverse() * s])
            })
            .collect();
        for ((target, source), link) in wanted.into_iter().zip(links) {
            self.accept(target, source, link.as_ref(), &self.config.acceptance);
        }
    }

    /// Pairs not measured yet, nearest in viewing direction first.
    fn neighbour_pairs(&self) -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        for i in 0..self.views.len() {
            let Some(pose) = self.poses[i] else { continue };
            let looked_at =
                |pose: &Pose, view: &RegisterView| pose * Point3::new(0.0, 0.0, f64::from(view.distance));
            let mut near: Vec<(f64, usize)> = (0..self.views.len())
                .filter(|j| *j != i)
                .filter_map(|j| {
                    let other = self.poses[j]?;
                    let angle = pose.rotation.angle_to(&other.rotation);
                    let apart = (looked_at(&pose, &self.views[i]) - looked_at(&other, &self.views[j])).norm()
                        / f64::from(self.views[i].distance);
                    (angle.max(apart) < self.config.max_link_angle).then_some((angle + apart, j))
                })
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            pairs.extend(
                near.into_iter().take(self.config.extra_links + 2).map(|(_, j)| (i.min(j), i.max(j))),
            );
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs.retain(|(a, b)| !self.tried(*b, *a) && !self.tried(*a, *b));
        pairs
    }

    /// Makes all links agree as well as they can.
    fn relax(&mut self) {
        let placed: Vec<usize> = (0..self.views.len()).filter(|i| self.poses[*i].is_some()).collect();
        let start: Vec<Pose> = placed.iter().filter_map(|i| self.poses[*i]).collect();
        let index = |view: usize| placed.binary_search(&view).unwrap_or(usize::MAX);
        let edges: Vec<Edge> = self
            .pairs
            .iter()
            .map(|pair| Edge {
                target: index(pair.target),
                source: index(pair.source),
                target_from_source: pair.link.target_from_source,
                information: pair.link.information * independence(&pair.link),
            })
            .collect();
        let fixed = index(self.start);
        // First with a wide kernel, so that drift is not taken for wrong links.
        let wide = optimise(&start, &edges, fixed, 60.0, 15);
        let tight = optimise(&wide.world_from_view, &edges, fixed, 12.0, 15);
        for (i, pose) in placed.iter().zip(&tight.world_from_view) {
            self.poses[*i] = Some(*pose);
        }
        for (pair, weight) in self.pairs.iter_mut().zip(&tight.edge_weights) {
            pair.weight = *weight;
        }
    }

    /// Measures every link again from the poses that all agree on; one that runs away from them is dropped.
    fn measure_anew(&mut self) {
        let links: Vec<Option<Link>> = self
            .pairs
            .par_iter()
            .map(|pair| {
                let (t, s) = (self.poses[pair.target]?, self.poses[pair.source]?);
                polish(&self.views[pair.source], &self.anchors[pair.target], &(t.inverse() * s))
            })
            .collect();
        let poses: Vec<Pose> = self.poses.iter().map(|p| p.unwrap_or_default()).collect();
        let mut kept = Vec::new();
        for (pair, link) in self.pairs.drain(..).zip(links) {
            let Some(link) = link else { continue };
            let edge = Edge {
                target: pair.target,
                source: pair.source,
                target_from_source: link.target_from_source,
                information: link.information,
            };
            let moved = error(&poses, &edge);
            let cell = f64::from(self.views[pair.source].cell);
            let near = moved.fixed_rows::<3>(0).norm() < 4.0 * cell && moved.fixed_rows::<3>(3).norm() < 0.03;
            if near && self.config.acceptance.judge(&link.agreement).is_ok() {
                kept.push(PairLink { link, ..pair });
            }
        }
        self.pairs = kept;
    }

    fn into_placement(self, moving: Moving) -> Placement {
        let count = self.views.len();
        let connected = connected(count, self.start, &self.pairs);
        let verdicts = (0..count)
            .map(|i| {
                let of_view = self.pairs.iter().filter(|p| p.source == i || p.target == i);
                let best = of_view
                    .map(|p| p.link.agreement)
                    .max_by(|a, b| a.score().total_cmp(&b.score()))
                    .or(self.best_failure[i].map(|f| f.0));
                let placed = connected[i];
                let reason = (!placed).then(|| {
                    self.best_failure[i]
                        .map_or("nothing in it could be recognised in the other views", |f| f.1)
                        .to_owned()
                });
                ViewVerdict { placed, reason, agreement: best }
            })
            .collect();
        let mut world_from_view: Vec<Option<Pose>> =
            (0..count).map(|i| self.poses[i].filter(|_| connected[i])).collect();
        if let Some(first) = world_from_view.iter().flatten().next().copied() {
            let world_from_start = first.inverse();
            for pose in world_from_view.iter_mut().flatten() {
                *pose = world_from_start * *pose;
            }
        }
        Placement { world_from_view, verdicts, pairs: self.pairs, moving }
    }
}

/// Neighbouring points err alike: a link never counts for more than this many independent pairs of points.
fn independence(link: &Link) -> f64 {
    const INDEPENDENT: f64 = 400.0;
    INDEPENDENT / (link.agreement.points.max(1) as f64).max(INDEPENDENT)
}

/// Views that trusted links connect with the one to start from. That one is placed even alone.
fn connected(count: usize, start: usize, pairs: &[PairLink]) -> Vec<bool> {
    let mut reached = vec![false; count];
    if let Some(first) = reached.get_mut(start) {
        *first = true;
    }
    loop {
        let mut grew = false;
        for pair in pairs.iter().filter(|p| p.weight > 0.05) {
            if reached[pair.source] != reached[pair.target] {
                (reached[pair.source], reached[pair.target]) = (true, true);
                grew = true;
            }
        }
        if !grew {
            return reached;
        }
    }
}

#[cfg(test)]
mod tests;
