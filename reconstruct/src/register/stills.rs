//! Placement of views that show one object and nothing else, in any order of steps up to about 60 degrees: no board, no table, no clutter.
//!
//! Neighbours in the order they were taken in, the last and the first among them, are placed against each other by features and
//! verified in both directions ([`pairwise`](super::pairwise)); where that leaves parts unconnected, views farther apart in the order are tried.
//! Good pairs are refined on fine surfels and a pose graph makes all agree; a pair that the others contradict is dropped.
//! Nothing is random. Camera frames, metres; the world is the first placed view's frame.

use nalgebra::{Matrix6, Point3, Vector3, Vector6};
use rayon::prelude::*;

use super::fine::{FineConfig, register_fine};
use super::fpfh::{Descriptor, describe};
use super::graph::{Edge, optimise};
use super::matching::{MatchConfig, match_descriptors};
use super::pairwise::{Beside, PairwiseConfig, Seen, outdoes, place};
use super::surfel::Surfels;
use crate::cloud::PointCloud;
use crate::knn::Tree;
use crate::normals::{Neighbourhood, estimate};
use crate::pose::Pose;
use crate::voxel::downsample;

/// Spacing of the points that features are taken of, as a share of the distance; and of those that surfels are.
const CELL_PER_DISTANCE: f32 = 0.00625;
const FINE_CELL_PER_DISTANCE: f32 = 0.0025;
/// Surroundings of a normal and of a feature, cells; of a fine surfel, fine cells.
const NORMAL_CELLS: f32 = 2.5;
const FEATURE_CELLS: f32 = 5.0;
const SURFEL_CELLS: f32 = 3.5;
/// Views are tried against others up to so many places away in the order.
const FARTHEST_NEIGHBOUR: usize = 4;
/// Fewer points are no view.
const MIN_POINTS: usize = 100;
/// A refined pair with fewer of its surfels on the other's surface was not refined but lost.
const LEAST_FITNESS: f64 = 0.1;
/// Neighbouring points err alike: a pair counts for so many independent ones.
const INDEPENDENT: f64 = 400.0;
/// Standard deviation of a point, metres: what a pair's information is counted in.
const POINT_SD_METRES: f64 = 0.001;
/// A pair that weighs less in the end is contradicted by the others.
const LEAST_WEIGHT: f64 = 0.05;
/// Turns about the axis that the surfaces hold least, radians: what looks the same after them was not placed, only laid on itself.
const SLIDES: [f64; 4] = [-0.7, -0.3, 0.3, 0.7];
/// The sensor stands in the origin of its frame.
const SENSOR: [f32; 3] = [0.0; 3];

/// Where each view is; `None` for views that no good pair connects with the others.
pub fn place_stills(views: &[Vec<[f32; 3]>]) -> Vec<Option<Pose>> {
    let Some(distance) = median_distance(views) else { return vec![None; views.len()] };
    let described: Vec<Option<View>> = views.par_iter().map(|points| View::new(points, distance)).collect();
    let config = PairwiseConfig {
        cell: CELL_PER_DISTANCE * distance,
        beside: Beside::Empty,
        ..PairwiseConfig::default()
    };
    let mut edges: Vec<Edge> = Vec::new();
    for step in 1..=FARTHEST_NEIGHBOUR.min(views.len() / 2) {
        let parts = parts(views.len(), &edges);
        let wanted: Vec<(usize, usize)> = (0..views.len())
            .map(|i| (i, (i + step) % views.len()))
            .filter(|&(target, source)| target != source && (step == 1 || parts[target] != parts[source]))
            .collect();
        let pair = |&(target, source): &(usize, usize)| {
            edge(target, source, described[target].as_ref()?, described[source].as_ref()?, &config)
        };
        edges.extend(wanted.par_iter().filter_map(pair).collect::<Vec<_>>());
    }
    agreed(views.len(), edges)
}

/// Over all points of all views.
fn median_distance(views: &[Vec<[f32; 3]>]) -> Option<f32> {
    let mut depths: Vec<f32> = views.iter().flatten().map(|p| p[2]).filter(|z| *z > 0.0).collect();
    let middle = depths.len() / 2;
    (depths.len() >= MIN_POINTS).then(|| *depths.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// A view with what pairs need of it.
struct View {
    cloud: PointCloud,
    descriptors: Vec<Descriptor>,
    surfels: Surfels,
}

impl View {
    fn new(points: &[[f32; 3]], distance: f32) -> Option<Self> {
        let all = PointCloud { points: points.to_vec(), ..PointCloud::default() };
        let fine = downsample(&all, FINE_CELL_PER_DISTANCE * distance).ok()?.cloud.points;
        let cell = CELL_PER_DISTANCE * distance;
        let points = downsample(&all, cell).ok()?.cloud.points;
        if points.len() < MIN_POINTS {
            return None;
        }
        let tree = Tree::new(&points);
        let normals = estimate(&points, &tree, Neighbourhood::Radius(NORMAL_CELLS * cell), &SENSOR).normals;
        let cloud = PointCloud { points, normals, ..PointCloud::default() };
        let every: Vec<usize> = (0..cloud.len()).collect();
        let descriptors = describe(&cloud, &tree, FEATURE_CELLS * cell, &every);
        let surfels = Surfels::new(&fine, &SENSOR, SURFEL_CELLS * FINE_CELL_PER_DISTANCE * distance);
        Some(Self { cloud, descriptors, surfels })
    }

    fn seen(&self) -> Seen<'_> {
        Seen { points: &self.cloud.points, normals: &self.cloud.normals, sensor: SENSOR }
    }
}

/// A good and refined pair.
fn edge(
    target: usize,
    source: usize,
    of_target: &View,
    of_source: &View,
    config: &PairwiseConfig,
) -> Option<Edge> {
    let matches = match_descriptors(&of_source.descriptors, &of_target.descriptors, MatchConfig::default());
    let placed = place(&of_source.seen(), &of_target.seen(), &matches, config)?;
    let slid = slid(&of_source.surfels, &placed.target_from_source);
    if !placed.good || !outdoes(&of_source.seen(), &of_target.seen(), &placed, &slid, config) {
        return None;
    }
    let fine = register_fine(
        &of_source.surfels,
        &of_target.surfels,
        &placed.target_from_source,
        &FineConfig::default(),
    )?;
    let target_from_source = fine.target_from_source;
    (fine.fitness >= LEAST_FITNESS).then(|| Edge {
        target,
        source,
        target_from_source,
        information: information(&of_source.surfels, &target_from_source, &Point3::origin()),
    })
}

/// The placement, turned about the axis through the surfaces that they hold least: a bottle's own axis.
fn slid(source: &Surfels, target_from_source: &Pose) -> Vec<Pose> {
    let centre = target_from_source * source.centre;
    let held = information(source, target_from_source, &centre);
    let part = |row: usize, column: usize| held.fixed_view::<3, 3>(row, column).into_owned();
    let Some(inverse) = part(0, 0).try_inverse() else { return Vec::new() };
    // Moves of the middle go along with the turn as the surfaces want.
    let along = -inverse * part(0, 3);
    let turns = (part(3, 3) + part(3, 0) * along).symmetric_eigen();
    let axis: Vector3<f64> = turns.eigenvectors.column(turns.eigenvalues.imin()).into_owned();
    let Some(axis) = axis.try_normalize(1e-9) else { return Vec::new() };
    let moved = along * axis;
    // A turn by w about the point q moves the centre by w x (centre - q).
    let q = centre + axis.cross(&moved);
    let turned = |angle: &f64| {
        let about = Pose::translation(q.x, q.y, q.z)
            * Pose::rotation(axis * *angle)
            * Pose::translation(-q.x, -q.y, -q.z);
        about * target_from_source
    };
    SLIDES.iter().map(turned).collect()
}

/// Of a left twist `(translation, rotation about a point)` in the target's frame: what the source's surfels hold along their normals.
fn information(source: &Surfels, target_from_source: &Pose, about: &Point3<f64>) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for (p, n) in source.points.iter().zip(&source.normals) {
        let offset = Vector3::from(p.map(f64::from));
        let place: Point3<f64> = target_from_source * (source.centre + offset);
        let normal = target_from_source.rotation * Vector3::from(n.map(f64::from));
        let turn = (place - about).cross(&normal);
        let row = Vector6::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z);
        sum += row * row.transpose();
    }
    sum * (INDEPENDENT / source.len().max(1) as f64 / POINT_SD_METRES.powi(2))
}

/// Poses along the edges, then all edges together; views whose edges the others contradict have none.
fn agreed(count: usize, mut edges: Vec<Edge>) -> Vec<Option<Pose>> {
    loop {
        let (members, start) = largest_part(count, &edges);
        let Some(&fixed) = members.first() else { return vec![None; count] };
        let index = |view: usize| members.binary_search(&view).ok();
        let inside: Vec<Edge> = edges
            .iter()
            .filter_map(|e| Some(Edge { target: index(e.target)?, source: index(e.source)?, ..*e }))
            .collect();
        let wide = optimise(&start, &inside, 0, 60.0, 15);
        let tight = optimise(&wide.world_from_view, &inside, 0, 12.0, 15);
        let least = tight.edge_weights.iter().copied().fold(f64::INFINITY, f64::min);
        if least >= LEAST_WEIGHT || inside.is_empty() {
            let mut poses = vec![None; count];
            for (&view, &pose) in members.iter().zip(&tight.world_from_view) {
                poses[view] = Some(tight.world_from_view[0].inverse() * pose);
            }
            debug_assert!(poses[fixed].is_some());
            return poses;
        }
        let contradicted: Vec<(usize, usize)> = inside
            .iter()
            .zip(&tight.edge_weights)
            .filter(|(_, weight)| **weight < LEAST_WEIGHT)
            .map(|(e, _)| (members[e.target], members[e.source]))
            .collect();
        edges.retain(|e| !contradicted.contains(&(e.target, e.source)));
    }
}

/// A number of the part that each view belongs to.
fn parts(count: usize, edges: &[Edge]) -> Vec<usize> {
    let mut part: Vec<usize> = (0..count).collect();
    for e in edges {
        let (from, to) = (part[e.source].max(part[e.target]), part[e.source].min(part[e.target]));
        part.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
    }
    part
}

/// The views of the largest connected part, and their poses along its edges, the first one's frame as the world.
fn largest_part(count: usize, edges: &[Edge]) -> (Vec<usize>, Vec<Pose>) {
    let part = parts(count, edges);
    let size = |p: usize| part.iter().filter(|&&q| q == p).count();
    let Some(largest) = (0..count).max_by_key(|&p| (size(p), count - p)) else { return Default::default() };
    let members: Vec<usize> = (0..count).filter(|&i| part[i] == largest).collect();
    let mut poses: Vec<Option<Pose>> = vec![None; count];
    poses[members[0]] = Some(Pose::identity());
    while members.iter().any(|&i| poses[i].is_none()) {
        for e in edges.iter().filter(|e| part[e.target] == largest) {
            match (poses[e.target], poses[e.source]) {
                (Some(target), None) => poses[e.source] = Some(target * e.target_from_source),
                (None, Some(source)) => poses[e.target] = Some(source * e.target_from_source.inverse()),
                _ => {}
            }
        }
    }
    let starts = members.iter().filter_map(|&i| poses[i]).collect();
    (members, starts)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::super::fine::tests::seen_from;
    use super::*;
    use crate::pose::{exp, rotation_error_radians};

    /// Eight views round the lump of the other tests, each in its camera's frame, and their true poses.
    fn views(count: usize) -> (Vec<Vec<[f32; 3]>>, Vec<Pose>) {
        let camera = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / count as f64;
            let eye = Point3::new(0.8 * angle.sin(), 0.25, 0.8 * angle.cos());
            (eye, Pose::face_towards(&eye, &Point3::origin(), &-Vector3::y()))
        };
        let seen = (0..count).map(|k| {
            let (eye, lump_from_camera) = camera(k);
            seen_from(&eye.coords, &lump_from_camera.inverse(), 0.002, k as u64).0
        });
        (seen.collect(), (0..count).map(|k| camera(k).1).collect())
    }

    #[test]
    fn views_round_an_object_are_placed_and_a_stranger_is_not() {
        let (mut views, truth) = views(8);
        // A view of nothing that the others show: their own points on a bowl.
        views.push(views[0].iter().map(|p| [p[0], p[1], 0.8 + 3.0 * (p[0] * p[0] + p[1] * p[1])]).collect());
        let found = place_stills(&views);
        for (k, pose) in truth.iter().enumerate() {
            let expected = truth[0].inverse() * pose;
            let pose = found[k].unwrap_or_else(|| panic!("view {k} was not placed"));
            let turned = rotation_error_radians(&pose, &expected).to_degrees();
            assert!(turned < 0.5, "{k}: {turned}");
        }
        assert_eq!(found[8], None);
    }

    #[test]
    fn nothing_is_placed_of_nothing() {
        assert_eq!(place_stills(&[]), Vec::<Option<Pose>>::new());
        assert_eq!(place_stills(&[Vec::new(), vec![[0.0, 0.0, 1.0]; 3]]), vec![None, None]);
        let nan = vec![[f32::NAN; 3]; 500];
        assert_eq!(place_stills(&[nan.clone(), nan]), vec![None, None]);
    }

    #[test]
    fn a_pair_that_the_others_contradict_is_dropped() {
        let step = exp(&Vector6::new(0.3, 0.0, 0.1, 0.0, 0.8, 0.0));
        let information = Matrix6::identity() * 1e8;
        let edge = |target: usize, source: usize, pose: Pose| Edge {
            target,
            source,
            target_from_source: pose,
            information,
        };
        let mut edges: Vec<Edge> = (0..4).map(|i| edge(i, i + 1, step)).collect();
        edges.push(edge(0, 2, step * step));
        edges.push(edge(2, 4, step * step));
        edges.push(edge(0, 4, exp(&Vector6::new(0.1, 0.2, 0.0, 0.5, 0.0, 0.0))));
        let found = agreed(6, edges);
        let expected = step * step * step * step;
        assert!(rotation_error_radians(&found[4].unwrap(), &expected) < 1e-3);
        assert_eq!(found[5], None);
    }
}
