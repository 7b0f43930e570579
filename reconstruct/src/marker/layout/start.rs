//! First places: in every view the table that makes all its tags squares of the right size, then views joined by the
//! tags they share.

use nalgebra::{Isometry2, Point2, Point3, Rotation2, Translation2, UnitComplex, Vector2};

use super::adjust::{Observation, Problem};
use super::{LayoutConfig, ids_of, lift, local_corners};
use crate::camera::Intrinsics;
use crate::marker::pose::tag_poses;
use crate::pose::Pose;

/// A problem with every view that can be joined to the one with most tags.
pub(super) fn place(
    observations: &[Observation],
    views: usize,
    size: f64,
    camera: &Intrinsics,
    config: &LayoutConfig,
) -> Option<Problem> {
    let mut single: Vec<Problem> =
        (0..views).filter_map(|v| one_view(observations, v, size, camera, config)).collect();
    let most = |problems: &[Problem]| {
        // The first of equals, so that the order of views decides.
        (0..problems.len()).max_by_key(|&i| (problems[i].ids.len(), std::cmp::Reverse(i)))
    };
    let mut joined = single.remove(most(&single)?);
    joined.views.resize(views, None);
    loop {
        let shared = |p: &Problem| p.ids.iter().filter(|id| joined.ids.contains(id)).count();
        let best = (0..single.len()).max_by_key(|&i| (shared(&single[i]), std::cmp::Reverse(i)));
        let Some(best) = best.filter(|&i| shared(&single[i]) > 0) else { break };
        join(&mut joined, &single.remove(best), size);
    }
    joined.observations = observations
        .iter()
        .copied()
        .filter(|o| joined.views[o.view].is_some() && joined.ids.binary_search(&o.id).is_ok())
        .collect();
    Some(joined)
}

/// A view's tags on its own table.
fn one_view(
    observations: &[Observation],
    view: usize,
    size: f64,
    camera: &Intrinsics,
    config: &LayoutConfig,
) -> Option<Problem> {
    let seen: Vec<Observation> = observations.iter().copied().filter(|o| o.view == view).collect();
    let whole = seen.iter().filter(|o| o.sigma_px.iter().all(|s| s.is_finite()));
    let tables = whole.flat_map(|o| tag_poses(&o.corners, size, camera));
    let misfit = |table: &Pose| {
        let each =
            seen.iter().map(|o| square_on(table, o, size, camera).map_or(1.0, |(_, misfit)| misfit.min(1.0)));
        each.sum::<f64>()
    };
    let (_, table) = tables.map(|t| (misfit(&t), t)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let ids = ids_of(&seen);
    let places = ids
        .iter()
        .map(|id| {
            let o = seen.iter().find(|o| o.id == *id)?;
            square_on(&table, o, size, camera).map(|(place, _)| place)
        })
        .collect::<Option<Vec<_>>>()?;
    let mut views = vec![None; view + 1];
    views[view] = Some(table);
    let problem = Problem { ids, places, views, observations: seen, size };
    problem.clone().adjust(camera, config.huber_px).or(Some(problem))
}

/// Table from tag, and how far the corners cast on the table are from a square of the right size, in sizes.
fn square_on(
    camera_from_table: &Pose,
    o: &Observation,
    size: f64,
    camera: &Intrinsics,
) -> Option<(Isometry2<f64>, f64)> {
    let table_from_camera = camera_from_table.inverse();
    let eye = table_from_camera * Point3::origin();
    let cast = |pixel: &Point2<f64>| {
        let ray = camera.ray(pixel);
        let direction = table_from_camera.rotation * nalgebra::Vector3::new(ray.x, ray.y, 1.0);
        let along = -eye.z / direction.z;
        (along.is_finite() && along > 0.0).then(|| (eye + direction * along).xy())
    };
    let pairs: Vec<(Point2<f64>, Point2<f64>)> = (0..4)
        .filter(|&k| o.sigma_px[k].is_finite())
        .map(|k| Some((local_corners(size)[k], cast(&o.corners[k])?)))
        .collect::<Option<_>>()?;
    let place = rigid(&pairs)?;
    let squared: f64 = pairs.iter().map(|(local, on_table)| (place * local - on_table).norm_squared()).sum();
    Some((place, (squared / pairs.len() as f64).sqrt() / size))
}

/// The movement in the plane that takes the first points to the second with least squares.
fn rigid(pairs: &[(Point2<f64>, Point2<f64>)]) -> Option<Isometry2<f64>> {
    let n = pairs.len() as f64;
    if pairs.len() < 2 {
        return None;
    }
    let sum =
        pairs.iter().fold((Vector2::zeros(), Vector2::zeros()), |s, p| (s.0 + p.0.coords, s.1 + p.1.coords));
    let (from, to) = (sum.0 / n, sum.1 / n);
    let (mut dot, mut cross) = (0.0, 0.0);
    for (p, q) in pairs {
        let (a, b) = (p.coords - from, q.coords - to);
        dot += a.dot(&b);
        cross += a.perp(&b);
    }
    let turn = Rotation2::new(cross.atan2(dot));
    let shift = to - turn * from;
    Some(Isometry2::from_parts(Translation2::from(shift), UnitComplex::from_rotation_matrix(&turn)))
}

/// Adds a view and its new tags, moved so that the shared tags lie on each other.
fn join(joined: &mut Problem, one: &Problem, size: f64) {
    let mut pairs = Vec::new();
    for (id, place) in one.ids.iter().zip(&one.places) {
        if let Ok(at) = joined.ids.binary_search(id) {
            pairs.extend(local_corners(size).map(|c| (place * c, joined.places[at] * c)));
        }
    }
    let Some(joined_from_one) = rigid(&pairs) else { return };
    for (&id, place) in one.ids.iter().zip(&one.places) {
        if let Err(slot) = joined.ids.binary_search(&id) {
            joined.ids.insert(slot, id);
            joined.places.insert(slot, joined_from_one * place);
        }
    }
    let one_from_joined = lift(&joined_from_one).inverse();
    for (v, pose) in one.views.iter().enumerate() {
        if let Some(pose) = pose {
            joined.views[v] = Some(pose * one_from_joined);
        }
    }
}
