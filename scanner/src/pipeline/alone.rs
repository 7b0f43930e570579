//! Views that show the product and nothing else: no board, no table, nothing behind it within reach.
//!
//! All that was measured is the product, and where nothing was measured nothing is, which is what verifies the placement.
//! World: the first placed view's camera frame; which way is up is unknown.

use rayon::prelude::*;
use reconstruct::pose::Pose;
use reconstruct::register::stills::place_stills;
use reconstruct::report::LeftOut;
use reconstruct::view::DepthView;

use super::free::{HELD_SD, prior};
use super::load::Work;

/// Standard deviation of a view's place before the joint refinement, metres and radians.
const PLACED_SD: [f64; 2] = [3e-4, 4e-4];
/// Most of a picture that a product standing alone fills.
const MOST_FILLED: f64 = 0.5;
/// Most of its measured pixels that may lie at the picture's border.
const MOST_AT_BORDER: f64 = 0.002;
/// Width of the border, pixels.
const BORDER_PX: usize = 12;
/// Fewer measured pixels show nothing.
const MIN_PIXELS: usize = 300;

/// Whether every view that shows anything shows it standing free in the picture.
pub fn stands_alone(scan: &Work) -> bool {
    let seen: Vec<&DepthView> = geometries(scan).collect();
    seen.len() > 1 && seen.into_iter().all(is_free_in_the_picture)
}

fn geometries(scan: &Work) -> impl Iterator<Item = &DepthView> {
    let used = scan.views.iter().filter(|v| v.is_used()).filter_map(|v| v.geometry.as_ref());
    used.filter(|g| measured(g).count() >= MIN_PIXELS)
}

fn measured(view: &DepthView) -> impl Iterator<Item = usize> + '_ {
    (0..view.points.len()).filter(|&i| view.points[i][2] > 0.0)
}

fn is_free_in_the_picture(view: &DepthView) -> bool {
    let (width, height) = (view.camera.width as usize, view.camera.height as usize);
    let at_border = |i: &usize| {
        let (u, v) = (i % width, i / width);
        u.min(v) < BORDER_PX || u + BORDER_PX >= width || v + BORDER_PX >= height
    };
    let all = measured(view).count() as f64;
    let border = measured(view).filter(at_border).count() as f64;
    all <= MOST_FILLED * view.points.len() as f64 && border <= MOST_AT_BORDER * all
}

/// Places the views by what they show, all of which is the product.
pub fn place_alone(scan: &mut Work) {
    let points: Vec<Vec<[f32; 3]>> = scan
        .views
        .iter()
        .map(|view| match &view.geometry {
            Some(g) if view.is_used() => measured(g).map(|i| g.points[i]).collect(),
            _ => Vec::new(),
        })
        .collect();
    let poses = place_stills(&points);
    if poses.iter().flatten().count() < 2 {
        scan.failure.get_or_insert(
            "the views could not be placed by their surfaces alone: take them closer together (30 degrees or less), or use the marker board"
                .to_owned(),
        );
        return;
    }
    scan.warnings.push(
        "no table was found under the product: which way is up is unknown, and so are its sizes along it"
            .to_owned(),
    );
    let first = poses.iter().position(Option::is_some);
    let placed: Vec<(usize, Option<Pose>)> = poses.into_iter().enumerate().collect();
    scan.views.par_iter_mut().zip(placed).filter(|(v, _)| v.is_used()).for_each(|(view, (i, pose))| {
        let Some((geometry, pose)) = view.geometry.as_mut().zip(pose) else {
            let nothing = view.geometry.as_ref().is_none_or(|g| measured(g).count() < MIN_PIXELS);
            return view.leave_out(if nothing { LeftOut::NoDepth } else { LeftOut::NoOverlap });
        };
        view.world_from_camera = Some(pose);
        view.prior = Some(prior(pose, if Some(i) == first { HELD_SD } else { PLACED_SD }));
        let mask = geometry.points.iter().map(|p| p[2] > 0.0).collect();
        geometry.set_product(mask);
    });
}
