//! A link between two views: their relative pose, found by following a guess or from nothing by features, and verified.

use nalgebra::{Matrix6, Point3, Vector3};

use super::fpfh::{LENGTH, describe};
use super::icp::{IcpConfig, Metric, Registration, Target, register_in_rounds};
use super::kernel::Kernel;
use super::keypoints::{KeypointConfig, largest_curvature};
use super::matching::{MatchConfig, match_descriptors};
use super::plane::{PlaneConfig, support_plane, world_from_first_view};
use super::ransac::{Match, RansacConfig, consensus};
use super::verify::{Agreement, agreement};
use super::view::RegisterView;
use crate::knn::Tree;
use crate::normals::{Neighbourhood, estimate};
use crate::pose::Pose;
use crate::segment_free::{ProductConfig, product_of_view};

/// FPFH and the colour.
const DESCRIPTOR: usize = LENGTH + 3;
/// Weight of a colour channel 0..1 beside histograms that total 200.
const COLOR_WEIGHT: f32 = 120.0;
/// Angles tried where both views show a support plane; ICP reaches half the step between them.
const TURNS: u32 = 18;
/// Different RANSAC answers that are refined and compared.
const HYPOTHESES: usize = 4;

/// A relative pose of two views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Source points to target points, each in its camera's frame.
    pub target_from_source: Pose,
    /// Information of a left twist on it.
    pub information: Matrix6<f64>,
    /// Root mean square distance of the paired surfaces, metres.
    pub inlier_rmse_metres: f64,
    /// How well it fits.
    pub agreement: Agreement,
}

/// What a link must reach to be believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acceptance {
    /// Least overlap.
    pub min_overlap: f64,
    /// Most points in free space.
    pub max_in_free_space: f64,
    /// Least share of the overlap with the same colour.
    pub min_same_color: f64,
    /// Least number of points that agree.
    pub min_points: usize,
    /// Least share of the patterned points that find their colour, where there are enough to tell. Measured on stills 45 degrees apart and a
    /// stream of small steps: right links 0.93 and more, products on a board laid on each other 0.35 to 0.87.
    pub min_same_pattern: f64,
}

/// Fewer patterned points tell nothing.
const MIN_PATTERNED: usize = 40;

impl Default for Acceptance {
    fn default() -> Self {
        Self {
            min_overlap: 0.35,
            max_in_free_space: 0.03,
            min_same_color: 0.65,
            min_points: 60,
            min_same_pattern: 0.9,
        }
    }
}

impl Acceptance {
    /// For links found from nothing. Measured on a bottle on a board, both nearly the same after half a turn: right links have
    /// nothing in free space and 0.95 or more of the same colour, wrong ones 0.03 to 0.05 and 0.73 to 0.93.
    pub fn strict() -> Self {
        Self { max_in_free_space: 0.015, min_same_color: 0.8, ..Self::default() }
    }

    /// Whether the agreement is enough, else what is missing, in words.
    pub fn judge(&self, agreement: &Agreement) -> Result<(), &'static str> {
        if agreement.overlap < self.min_overlap || agreement.points < self.min_points {
            Err("too little of it overlaps with other views")
        } else if agreement.in_free_space > self.max_in_free_space {
            Err("it contradicts what other views see through")
        } else if agreement.same_color < self.min_same_color
            || (agreement.patterned >= MIN_PATTERNED && agreement.same_pattern < self.min_same_pattern)
        {
            Err("its colours don't match those of other views")
        } else {
            Ok(())
        }
    }
}

/// A view prepared as the fixed side of links.
pub struct Anchor<'a> {
    view: &'a RegisterView,
    coarse: Target<'a>,
    fine: Target<'a>,
}

impl<'a> Anchor<'a> {
    /// Builds the search trees and colour gradients.
    pub fn new(view: &'a RegisterView) -> Self {
        Self {
            view,
            coarse: Target::with_colors(&view.coarse, 5.0 * view.cell),
            fine: Target::with_colors(&view.fine, 2.5 * view.cell),
        }
    }
}

/// Follows each guess by coloured symmetric ICP, coarse to fine, and keeps the one that agrees best.
///
/// `None` where ICP can't run at all (too few points, no colours).
pub fn follow(source: &RegisterView, target: &Anchor<'_>, guesses: &[Pose]) -> Option<Link> {
    let cell = f64::from(source.cell);
    let coarse = rounds(source.cell, &[(10.0, 2.0, 12, 2), (5.0, 1.0, 15, 1)]);
    let mut best: Option<(f64, Registration)> = None;
    for guess in guesses {
        let Ok(found) = register_in_rounds(&source.coarse, &target.coarse, guess, &coarse) else { continue };
        let again = best.as_ref().is_some_and(|(_, b)| {
            let apart = b.target_from_source.inverse() * found.target_from_source;
            apart.translation.vector.norm() < cell && apart.rotation.angle() < 0.01
        });
        if again {
            continue;
        }
        let score = agreement(source, target.view, &found.target_from_source).score();
        if best.as_ref().is_none_or(|b| score > b.0) {
            best = Some((score, found));
        }
    }
    refine(source, target, &best?.1.target_from_source, 4)
}

/// Fine coloured ICP from a pose that is nearly right.
pub fn polish(source: &RegisterView, target: &Anchor<'_>, start: &Pose) -> Option<Link> {
    refine(source, target, start, 1)
}

fn refine(source: &RegisterView, target: &Anchor<'_>, start: &Pose, stride: usize) -> Option<Link> {
    let fine = rounds(source.cell, &[(2.5, 0.5, 10, stride)]);
    let found = register_in_rounds(&source.fine, &target.fine, start, &fine).ok()?;
    let target_from_source = found.target_from_source;
    Some(Link {
        target_from_source,
        information: found.information,
        inlier_rmse_metres: found.inlier_rmse_metres,
        agreement: agreement(source, target.view, &target_from_source),
    })
}

/// Rounds of ICP: reach and kernel scale in cells, iterations, and every how many-th point.
fn rounds(cell: f32, steps: &[(f32, f64, usize, usize)]) -> Vec<IcpConfig> {
    let metres = f64::from(cell);
    steps
        .iter()
        .map(|(reach, kernel, iterations, stride)| IcpConfig {
            metric: Metric::Symmetric,
            max_distance: reach * cell,
            min_normal_cosine: Some(0.7),
            kernel: Kernel::GemanMcClure(kernel * metres),
            sigma_metres: metres / 3.0,
            sigma_color: Some(0.2),
            iterations: *iterations,
            stride: *stride,
            tolerance_metres: metres * 1e-2,
            ..IcpConfig::default()
        })
        .collect()
}

/// Key points and descriptors of a view for [`find`].
#[derive(Debug, Clone)]
pub struct Features {
    /// Upright frame on the support plane under what stands in the middle, where a plane was seen.
    upright_from_view: Option<Pose>,
    points: Vec<[f32; 3]>,
    descriptors: Vec<[f32; DESCRIPTOR]>,
}

/// Key points of large curvature with FPFH and colour.
pub fn features(view: &RegisterView) -> Features {
    let cloud = &view.coarse;
    let tree = Tree::new(&cloud.points);
    let surface = estimate(&cloud.points, &tree, Neighbourhood::Radius(5.0 * view.cell), &[0.0; 3]);
    let config = KeypointConfig { min_curvature: 0.004, min_spacing: 1.5 * view.cell, max_count: 2500 };
    let seen_well = |i: &usize| {
        let (p, n) = (Vector3::from(cloud.points[*i]), Vector3::from(cloud.normals[*i]));
        -p.normalize().dot(&n) > 0.3
    };
    let chosen: Vec<usize> = largest_curvature(&cloud.points, &surface.curvatures, &tree, &config)
        .into_iter()
        .filter(seen_well)
        .collect();
    let described = describe(cloud, &tree, 12.0 * view.cell, &chosen);
    let descriptors = chosen
        .iter()
        .zip(&described)
        .map(|(i, histogram)| {
            let mut all = [0.0; DESCRIPTOR];
            all[..LENGTH].copy_from_slice(histogram);
            if histogram.iter().any(|v| *v > 0.0) && cloud.has_colors() {
                for k in 0..3 {
                    all[LENGTH + k] = f32::from(cloud.colors[*i][k]) / 255.0 * COLOR_WEIGHT;
                }
            }
            all
        })
        .collect();
    Features {
        upright_from_view: upright(view),
        points: chosen.iter().map(|i| cloud.points[*i]).collect(),
        descriptors,
    }
}

/// The upright frame of a view, on its support plane under the product or, where none stands out, under the point looked at.
fn upright(view: &RegisterView) -> Option<Pose> {
    let config = PlaneConfig { tolerance_metres: 1.5 * f64::from(view.cell), ..PlaneConfig::default() };
    let plane = support_plane(&view.coarse, &config)?;
    let product = view.depth.as_ref().and_then(|map| {
        let config = ProductConfig::for_cell(view.cell);
        let mask = product_of_view(&map.points, map.width, map.height, &plane, &config)?;
        let members =
            || map.points.iter().zip(&mask).filter(|(_, m)| **m).map(|(p, _)| Vector3::from(*p).cast());
        Some(Point3::from(members().sum::<Vector3<f64>>() / members().count().max(1) as f64))
    });
    let ahead = Point3::new(0.0, 0.0, f64::from(view.distance));
    Some(world_from_first_view(&plane, &product.unwrap_or(ahead)))
}

/// Guesses from turning one upright frame on the other: the best of a full circle, each after a few cheap steps of ICP.
fn turned(source: &RegisterView, from: &Features, target: &Anchor<'_>, to: &Features) -> Vec<Pose> {
    let (Some(up_s), Some(up_t)) = (from.upright_from_view, to.upright_from_view) else { return Vec::new() };
    let cheap = &rounds(source.cell, &[(10.0, 2.0, 5, 8)]);
    let mut tried: Vec<(f64, Pose)> = (0..TURNS)
        .filter_map(|k| {
            let angle = f64::from(k) * std::f64::consts::TAU / f64::from(TURNS);
            let guess = up_t.inverse() * Pose::rotation(Vector3::new(0.0, 0.0, angle)) * up_s;
            let found = register_in_rounds(&source.coarse, &target.coarse, &guess, cheap).ok()?;
            let score = agreement(source, target.view, &found.target_from_source).score();
            Some((score, found.target_from_source))
        })
        .collect();
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    tried.into_iter().take(HYPOTHESES).map(|t| t.1).collect()
}

/// Finds a relative pose from nothing: mutual matches, several RANSAC answers, each followed by ICP; where none is accepted and
/// both views show a support plane, a full circle about the upright too. The best agreement wins.
pub fn find(
    source: &RegisterView,
    source_features: &Features,
    target: &Anchor<'_>,
    target_features: &Features,
    acceptance: &Acceptance,
    seed: u64,
) -> Option<Link> {
    let mut matches: Vec<Match> =
        match_descriptors(&source_features.descriptors, &target_features.descriptors, MatchConfig::default());
    let mut guesses = Vec::new();
    for attempt in 0..HYPOTHESES {
        let config = RansacConfig {
            iterations: 30_000,
            inlier_distance: 2.5 * f64::from(source.cell),
            min_edge: 8.0 * f64::from(source.cell),
            seed: seed.wrapping_add(attempt as u64),
            ..RansacConfig::default()
        };
        let Some(found) = consensus(&source_features.points, &target_features.points, &matches, &config)
        else {
            break;
        };
        guesses.push(found.target_from_source);
        // The next answer must come from the other matches.
        let mut index = 0;
        matches.retain(|_| {
            index += 1;
            found.inliers.binary_search(&(index - 1)).is_err()
        });
    }
    let matched = follow(source, target, &guesses);
    if matched.as_ref().is_some_and(|link| acceptance.judge(&link.agreement).is_ok()) {
        return matched;
    }
    let turned = follow(source, target, &turned(source, source_features, target, target_features));
    let score = |link: &Option<Link>| link.as_ref().map_or(f64::NEG_INFINITY, |l| l.agreement.score());
    if score(&turned) > score(&matched) { turned } else { matched }
}
