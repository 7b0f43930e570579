//! Placement of views of a small rendered world: a patterned table with boxes, seen through a pinhole.

use super::*;
use crate::camera::Intrinsics;
use crate::pose::rotation_error_radians;
use nalgebra::Vector3;

/// An axis-aligned box in its own frame, with a place in the world.
struct Block {
    place: Pose,
    half: [f64; 3],
    hue: f64,
}

fn pattern(a: f64, b: f64, hue: f64) -> [u8; 3] {
    let wave = |v: f64| (130.0 + 60.0 * v.sin()) as u8;
    [wave(40.0 * a + hue), wave(31.0 * b - 12.0 * a + 2.0 * hue), wave(23.0 * (a + b) + 3.0 * hue)]
}

fn block(x: f64, y: f64, yaw: f64, half: [f64; 3], hue: f64) -> Block {
    let place = Pose::new(Vector3::new(x, y, half[2]), Vector3::new(0.0, 0.0, yaw));
    Block { place, half, hue }
}

/// The product is an L of two blocks; the others stand about.
fn world(product_yaw: f64) -> Vec<Block> {
    let turn = Pose::rotation(Vector3::new(0.0, 0.0, product_yaw));
    let mut blocks =
        vec![block(0.0, 0.0, 0.2, [0.06, 0.03, 0.05], 0.0), block(0.05, 0.05, 0.2, [0.02, 0.05, 0.03], 1.0)];
    for part in &mut blocks {
        part.place = turn * part.place;
    }
    blocks.push(block(0.35, 0.2, 0.7, [0.04, 0.05, 0.06], 2.0));
    blocks.push(block(-0.3, 0.25, 1.2, [0.03, 0.06, 0.08], 3.0));
    blocks.push(block(-0.25, -0.3, 0.4, [0.05, 0.04, 0.03], 4.0));
    blocks
}

/// Where a ray enters a block: distance along it and colour.
fn hit(block: &Block, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<(f64, [u8; 3])> {
    let (o, d) = (block.place.inverse() * origin, block.place.inverse() * direction);
    let (mut near, mut far, mut axis) = (0.0, f64::INFINITY, 0);
    for k in 0..3 {
        let (a, b) = ((-block.half[k] - o[k]) / d[k], (block.half[k] - o[k]) / d[k]);
        if a.min(b) > near {
            (near, axis) = (a.min(b), k);
        }
        far = a.max(b).min(far);
    }
    let p = o + d * near;
    (near > 0.0 && near < far)
        .then(|| (near, pattern(2.0 * p[(axis + 1) % 3], 2.0 * p[(axis + 2) % 3], block.hue)))
}

/// A rendered view from a camera that looks at the origin.
fn render(azimuth: f64, blocks: &[Block], seed: u64) -> (RegisterView, Pose) {
    let camera = Intrinsics::pinhole(320, 240, 262.0, 262.0, 159.5, 119.5);
    let eye = Point3::new(0.6 * azimuth.cos(), 0.6 * azimuth.sin(), 0.45);
    let world_from_camera = Pose::face_towards(&eye, &Point3::new(0.0, 0.0, 0.03), &-Vector3::z());
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut points, mut colors) = (Vec::new(), Vec::new());
    for ray in camera.ray_table() {
        let direction = world_from_camera * Vector3::new(f64::from(ray[0]), f64::from(ray[1]), 1.0);
        let table = -eye.z / direction.z;
        let floor = eye + direction * table;
        let on_table = (table > 0.0).then(|| (table, pattern(floor.x, floor.y, 5.0)));
        let nearest = blocks
            .iter()
            .filter_map(|b| hit(b, &eye, &direction))
            .chain(on_table)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(z, _)| *z < 3.0);
        let (z, color) = nearest.unwrap_or((0.0, [0; 3]));
        let z = (z + (rng.f64() - 0.5) * 0.003 * z) as f32;
        points.push([ray[0] * z, ray[1] * z, z]);
        colors.push(color);
    }
    (RegisterView::organised(camera, &points, &colors, 0.006).unwrap(), world_from_camera)
}

/// Largest error of the placed views' product centres relative to the first view, metres, and of their rotations.
fn worst(placement: &Placement, truth: &[Pose]) -> (f64, f64) {
    let ahead = Point3::new(0.0, 0.0, 0.75);
    let errors = placement.world_from_view.iter().zip(truth).filter_map(|(found, t)| {
        let (found, expected) = ((*found)?, truth[0].inverse() * t);
        Some(((found * ahead - expected * ahead).norm(), rotation_error_radians(&found, &expected)))
    });
    errors.fold((0.0, 0.0), |a, b| (a.0.max(b.0), a.1.max(b.1)))
}

#[test]
fn a_stream_round_a_scene_is_placed_and_a_stranger_is_left_out() {
    let (mut views, mut truth): (Vec<_>, Vec<_>) =
        (0..7).map(|i| render(0.16 * f64::from(i), &world(0.0), i as u64)).unzip();
    // A picture of something else got in between.
    let mut other = world(0.9);
    other.truncate(1);
    other.push(block(0.0, -0.15, 0.3, [0.12, 0.05, 0.1], 8.0));
    let (mut stranger, pose) = render(2.5, &other, 9);
    for color in stranger.fine.colors.iter_mut().chain(&mut stranger.coarse.colors) {
        *color = [color[1], 255 - color[2], color[0] / 2];
    }
    if let Some(map) = &mut stranger.depth {
        map.colors.iter_mut().for_each(|c| *c = [c[1], 255 - c[2], c[0] / 2]);
    }
    views.insert(4, stranger);
    truth.insert(4, pose);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| place_views(&views, &GlobalConfig::default()))
    };
    let placement = run(2);
    let placed: Vec<bool> = placement.verdicts.iter().map(|v| v.placed).collect();
    assert_eq!(placed, [true, true, true, true, false, true, true, true], "{:?}", placement.verdicts);
    assert!(placement.world_from_view[4].is_none() && placement.verdicts[4].reason.is_some());
    assert_eq!(placement.moving, Moving::Camera);
    let (moved, turned) = worst(&placement, &truth);
    assert!(moved < 0.002 && turned < 0.003, "{moved} {turned}");
    assert_eq!(placement, run(1));
}

#[test]
fn a_product_on_a_turntable_is_followed_alone() {
    let steps: Vec<f64> = (0..5).map(|i| 0.14 * f64::from(i)).collect();
    let (views, truth): (Vec<_>, Vec<_>) = steps
        .iter()
        .enumerate()
        .map(|(i, yaw)| {
            let (view, world_from_camera) = render(0.3, &world(*yaw), i as u64);
            (view, Pose::rotation(Vector3::new(0.0, 0.0, -yaw)) * world_from_camera)
        })
        .unzip();
    let placement = place_views(&views, &GlobalConfig::default());
    assert_eq!(placement.moving, Moving::Product);
    assert!(placement.verdicts.iter().all(|v| v.placed), "{:?}", placement.verdicts);
    let (moved, turned) = worst(&placement, &truth);
    assert!(moved < 0.004 && turned < 0.02, "{moved} {turned}");
}

#[test]
fn no_view_and_one_view_are_no_trouble() {
    assert!(place_views(&[], &GlobalConfig::default()).world_from_view.is_empty());
    let (view, _) = render(0.0, &world(0.0), 1);
    let placement = place_views(&[view], &GlobalConfig::default());
    assert_eq!(placement.world_from_view, vec![Some(Pose::identity())]);
    assert!(placement.verdicts[0].placed);
}
