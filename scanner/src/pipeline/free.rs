//! Instead of the second to fourth stage, where there is no board: the views are placed by their surfaces alone.
//!
//! World: z up along the support plane's normal with the origin under the product where a plane is found, else the first
//! placed view's camera frame.

use nalgebra::{Matrix6, Point3, Vector6};
use rayon::prelude::*;
use reconstruct::pose::Pose;
use reconstruct::refine::PosePrior;
use reconstruct::register::global::{GlobalConfig, Placement, place_views};
use reconstruct::register::plane::{Plane, PlaneConfig, support_plane, world_from_first_view};
use reconstruct::register::view::RegisterView;
use reconstruct::report::{Ground, LeftOut};
use reconstruct::segment_free::{PlacedPoints, ProductConfig, product_in_world, product_of_view};
use reconstruct::view::DepthView;

use super::alone;
use super::load::Work;
use crate::config::Config;

/// Standard deviation of a view's place before the joint refinement, metres and radians; the first one is held.
const PLACED_SD: [f64; 2] = [0.003, 0.005];
pub(super) const HELD_SD: [f64; 2] = [1e-5; 2];

/// Places the views by their surfaces and tells the product from what it stands on.
pub fn place_by_surfaces(scan: &mut Work, config: &Config) {
    super::depth::correct_as_calibrated(scan, config);
    let (camera, rays) = (scan.rig.color, &scan.rays);
    scan.views.par_iter_mut().filter(|v| v.is_used()).for_each(|view| {
        let depth: Vec<f32> =
            (0..view.disparity.disparity_px.len()).map(|i| view.disparity.metres(i)).collect();
        view.geometry = Some(DepthView::new(camera, rays, &depth));
    });
    if alone::stands_alone(scan) {
        return alone::place_alone(scan);
    }
    let (indices, views) = register_views(scan);
    if views.is_empty() {
        scan.failure
            .get_or_insert("no view has any depth: keep 0.5 to 1.5 m distance and avoid sunlight".to_owned());
        return;
    }
    let placement = place_views(&views, &GlobalConfig { seed: config.seed, ..GlobalConfig::default() });
    let placed = keep_placed(scan, &indices, &placement);
    if placed.len() < 2 && indices.len() > 1 {
        let why = "the views could not be placed by their surfaces alone: take them closer together (10 to 15 degrees), or use the marker board";
        scan.failure.get_or_insert(why.to_owned());
        return;
    }
    let Some(&(first, first_view)) = placed.first() else { return };
    match tell_product(scan, &placed, &views[first], first_view) {
        Ok(()) => {}
        Err(why) => {
            scan.failure.get_or_insert(why);
        }
    }
}

/// The used views as registration takes them, with their indices in the scan.
fn register_views(scan: &Work) -> (Vec<usize>, Vec<RegisterView>) {
    let camera = scan.rig.color;
    let usable = |i: &usize| scan.views[*i].is_used() && scan.views[*i].geometry.is_some();
    let geometry = |i: usize| scan.views[i].geometry.as_ref();
    let cell = (0..scan.views.len())
        .filter(usable)
        .find_map(|i| RegisterView::cell_for(&camera, &geometry(i)?.points));
    let Some(cell) = cell else { return (Vec::new(), Vec::new()) };
    let views: Vec<(usize, RegisterView)> = (0..scan.views.len())
        .into_par_iter()
        .filter(usable)
        .filter_map(|i| {
            let colors = &scan.views[i].color.data;
            Some((i, RegisterView::organised(camera, &geometry(i)?.points, colors, cell)?))
        })
        .collect();
    views.into_iter().unzip()
}

/// Names the views that were not placed; gives (index among the registered, index in the scan) of the others.
fn keep_placed(scan: &mut Work, indices: &[usize], placement: &Placement) -> Vec<(usize, usize)> {
    let mut placed = Vec::new();
    for (k, &i) in indices.iter().enumerate() {
        scan.views[i].world_from_camera = placement.world_from_view[k];
        if placement.world_from_view[k].is_some() {
            placed.push((k, i));
        } else {
            let reason = placement.verdicts[k].reason.clone();
            scan.views[i].leave_out(reason.map_or(LeftOut::NoOverlap, LeftOut::Unsure));
        }
    }
    let unseen = scan.views.iter_mut().filter(|v| v.is_used() && v.world_from_camera.is_none());
    unseen.for_each(|v| v.leave_out(LeftOut::NoDepth));
    placed
}

/// Finds what the product stands on, turns the world upright, and marks the product in every view.
fn tell_product(
    scan: &mut Work,
    placed: &[(usize, usize)],
    first: &RegisterView,
    first_view: usize,
) -> Result<(), String> {
    let (width, height) = (scan.rig.color.width as usize, scan.rig.color.height as usize);
    let nothing = || {
        "nothing stands out in the middle of the first view: put the product in the middle of the picture"
            .to_owned()
    };
    let first_geometry = scan.views[first_view].geometry.as_ref().ok_or_else(nothing)?;
    let product = ProductConfig::for_cell(first.cell);
    let found = support_plane(&first.fine, &PlaneConfig::default());
    // Without a table, what is clearly nearer than the rest stands in front of an imagined wall.
    let wall = Plane { normal: [0.0, 0.0, -1.0], offset: 1.25 * f64::from(first.distance), support: 0.0 };
    let plane = found.unwrap_or(wall);
    let seed =
        product_of_view(&first_geometry.points, width, height, &plane, &product).ok_or_else(nothing)?;
    let world_from_first = if found.is_some() {
        scan.ground = Ground::Table;
        world_from_first_view(&plane, &centre(&first_geometry.points, &seed))
    } else {
        scan.warnings.push(
            "no table was found under the product: which way is up is unknown, and so are its sizes along it"
                .to_owned(),
        );
        Pose::identity()
    };
    for &(_, i) in placed {
        let pose = scan.views[i].world_from_camera.map(|first_from_view| world_from_first * first_from_view);
        scan.views[i].world_from_camera = pose;
        let sd = if i == first_view { HELD_SD } else { PLACED_SD };
        scan.views[i].prior = pose.map(|p| prior(p, sd));
    }
    let points: Vec<PlacedPoints<'_>> = placed
        .iter()
        .filter_map(|&(_, i)| {
            let view = &scan.views[i];
            Some(PlacedPoints {
                points: &view.geometry.as_ref()?.points,
                world_from_view: view.world_from_camera?,
            })
        })
        .collect();
    let masks = product_in_world(&points, &seed, &plane.transformed(&world_from_first), &product)
        .map_err(|e| e.to_string())?;
    for (&(_, i), mask) in placed.iter().zip(masks) {
        if let Some(geometry) = scan.views[i].geometry.as_mut() {
            geometry.set_product(mask);
        }
    }
    Ok(())
}

/// What is known of a view's place, with a standard deviation of metres and radians.
pub(super) fn prior(world_from_camera: Pose, [place, turn]: [f64; 2]) -> PosePrior {
    let information = Vector6::new(place, place, place, turn, turn, turn).map(|sd| 1.0 / (sd * sd));
    PosePrior { world_from_camera, information: Matrix6::from_diagonal(&information) }
}

fn centre(points: &[[f32; 3]], mask: &[bool]) -> Point3<f64> {
    let inside = points.iter().zip(mask).filter(|(_, m)| **m).map(|(p, _)| Point3::from(*p).cast::<f64>());
    let (sum, count) = inside.fold((nalgebra::Vector3::zeros(), 0.0), |(s, n), p| (s + p.coords, n + 1.0));
    Point3::from(sum / f64::max(count, 1.0))
}
