use super::*;
use crate::camera::Intrinsics;
use crate::image::ColorImage;
use crate::view::DepthView;
use nalgebra::{UnitQuaternion, Vector3};

/// An L of two blocks, 90 x 50 x 60 mm, that stands on z = 0: signed distance, metres.
fn bracket(p: &Vector3<f64>) -> f64 {
    let block = |low: [f64; 3], high: [f64; 3]| {
        let middle = Vector3::from(low) * 0.5 + Vector3::from(high) * 0.5;
        let half = Vector3::from(high) * 0.5 - Vector3::from(low) * 0.5;
        let q = (p - middle).abs() - half;
        q.map(|v| v.max(0.0)).norm() + q.max().min(0.0)
    };
    block([-0.045, -0.025, 0.0], [0.045, 0.025, 0.02]).min(block([-0.045, -0.025, 0.0], [-0.02, 0.025, 0.06]))
}

/// A can, 60 mm wide and 100 mm high.
fn can(p: &Vector3<f64>) -> f64 {
    let q = [p.xy().norm() - 0.03, (p.z - 0.05).abs() - 0.05];
    q[0].max(q[1]).min(0.0) + q[0].max(0.0).hypot(q[1].max(0.0))
}

type Solid = fn(&Vector3<f64>) -> f64;
type Color = fn(&Vector3<f64>) -> [u8; 3];

fn gray(_: &Vector3<f64>) -> [u8; 3] {
    [150; 3]
}

/// Patches of colour that never repeat around the axis.
fn label(p: &Vector3<f64>) -> [u8; 3] {
    let angle = p.y.atan2(p.x);
    let patch = (angle * 1.7).sin() + (angle * 3.0 + 40.0 * p.z).sin() + (70.0 * p.z).cos();
    if patch > 0.6 {
        [200, 60, 40]
    } else if patch > -0.5 {
        [60, 150, 70]
    } else {
        [230, 220, 200]
    }
}

/// A recording: what `eyes` see of a solid placed by `world_from_solid` over a board at z = 0, without noise.
struct Recorded {
    cloud: PointCloud,
    views: Vec<(DepthView, Pose)>,
}

impl Recorded {
    fn of(solid: Solid, color: Color, world_from_solid: &Pose, eyes: usize) -> Self {
        let camera = Intrinsics::pinhole(160, 120, 190.0, 190.0, 79.5, 59.5);
        let rays = camera.ray_table();
        let solid_from_world = world_from_solid.inverse();
        let (mut cloud, mut views) = (PointCloud::default(), Vec::new());
        for k in 0..eyes {
            let angle = std::f64::consts::TAU * k as f64 / eyes as f64;
            let eye = Vector3::new(0.32 * angle.cos(), 0.32 * angle.sin(), 0.28);
            let pose = looking(&eye);
            let march = |ray: &[f32; 2]| {
                let towards = pose.rotation * Vector3::new(f64::from(ray[0]), f64::from(ray[1]), 1.0);
                let to_solid = |z: f64| (solid_from_world * Point3::from(eye + towards * z)).coords;
                let mut z = 0.1;
                for _ in 0..120 {
                    let step = solid(&to_solid(z)) / towards.norm();
                    z += step;
                    if step < 1e-5 || (eye + towards * z).z < 0.0 {
                        break;
                    }
                }
                let floor = -eye.z / towards.z;
                if floor > 0.0 && floor < z { (floor, false) } else { (z.min(2.0), z < 2.0) }
            };
            let hits: Vec<(f64, bool)> = rays.iter().map(march).collect();
            let depth: Vec<f32> = hits.iter().map(|h| h.0 as f32).collect();
            let mut view = DepthView::new(camera, &rays, &depth);
            let world = |i: usize| pose * Point3::from(view.points[i]).cast::<f64>();
            let mask: Vec<bool> = (0..hits.len()).map(|i| hits[i].1 && world(i).z > 0.002).collect();
            for i in (0..mask.len()).filter(|&i| mask[i]) {
                let p = world(i);
                let at = (solid_from_world * p).coords;
                let slope = |k: usize| {
                    let mut by = Vector3::zeros();
                    by[k] = 1e-4;
                    solid(&(at + by)) - solid(&(at - by))
                };
                let normal = Vector3::new(slope(0), slope(1), slope(2)).normalize();
                cloud.points.push(p.coords.cast::<f32>().into());
                cloud.normals.push((world_from_solid.rotation * normal).cast::<f32>().into());
                cloud.colors.push(color(&at));
            }
            view.set_product(mask);
            views.push((view, pose));
        }
        Self { cloud, views }
    }

    fn with<R>(&self, act: impl FnOnce(&Side<'_>) -> R) -> R {
        let blank = ColorImage::default();
        let views: Vec<PlacedView<'_>> = self
            .views
            .iter()
            .map(|(geometry, pose)| PlacedView { geometry, color: &blank, world_from_camera: *pose })
            .collect();
        act(&Side { cloud: &self.cloud, views: &views })
    }
}

/// Camera at `eye` that looks at a place above the origin.
fn looking(eye: &Vector3<f64>) -> Pose {
    let z = (Vector3::new(0.0, 0.0, 0.03) - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let turn = nalgebra::Matrix3::from_columns(&[x, z.cross(&x), z]);
    let turn = UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix(&turn));
    Pose::from_parts((*eye).into(), turn)
}

/// Turned about x by `roll` and about z by `yaw` (degrees), then set down on the board.
fn laid(solid: Solid, roll: f64, yaw: f64) -> Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw.to_radians())
        * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll.to_radians());
    let steps = || (0..30).flat_map(|i| (0..30).flat_map(move |j| (0..40).map(move |k| (i, j, k))));
    let inside = steps()
        .map(|(i, j, k)| {
            let at = |n: i32, count: f64, low: f64, high: f64| low + (high - low) * f64::from(n) / count;
            Vector3::new(at(i, 29.0, -0.05, 0.05), at(j, 29.0, -0.05, 0.05), at(k, 39.0, 0.0, 0.1))
        })
        .filter(|p| solid(p) <= 1e-9);
    let turned: Vec<Vector3<f64>> = inside.map(|p| turn * p).collect();
    let low = turned.iter().map(|p| p.z).fold(f64::MAX, f64::min);
    let middle = turned.iter().sum::<Vector3<f64>>() / turned.len().max(1) as f64;
    Pose::from_parts(Vector3::new(-middle.x, -middle.y, -low).into(), turn)
}

/// Joins a solid as it stands with another as it lies.
fn join(a: (Solid, Color), b: (Solid, Color), roll: f64, eyes: usize) -> (Result<Found, Apart>, Pose) {
    let (stands, lies) = (laid(a.0, 0.0, 10.0), laid(b.0, roll, 75.0));
    let first = Recorded::of(a.0, a.1, &stands, 6);
    let second = Recorded::of(b.0, b.1, &lies, eyes);
    let found = first.with(|a| second.with(|b| place(a, b, &FlipConfig::default())));
    (found, stands * lies.inverse())
}

#[track_caller]
fn assert_found(found: &Result<Found, Apart>, truth: &Pose) -> Found {
    let found = found.clone().unwrap();
    let off = found.a_from_b.inverse() * truth;
    assert!(off.rotation.angle().to_degrees() < 1.2, "{off}");
    assert!(off.translation.vector.norm() < 0.0015, "{off}");
    found
}

#[test]
fn a_plain_thing_of_its_own_shape_is_found_on_its_side_and_upside_down() {
    for roll in [90.0, 180.0, -90.0] {
        let (found, truth) = join((bracket, gray), (bracket, gray), roll, 6);
        let found = assert_found(&found, &truth);
        assert!(found.evidence.texture < 0.2 && found.evidence.overlap > 0.4, "{found:?}");
    }
}

#[test]
fn a_can_is_found_by_its_label() {
    let (found, truth) = join((can, label), (can, label), 90.0, 6);
    let found = assert_found(&found, &truth);
    assert!(found.evidence.texture > 0.5 && found.evidence.color > 0.7, "{found:?}");
    assert!(!found.weak.directions.is_empty(), "a can turns in itself");
}

#[test]
fn a_can_without_a_label_is_ambiguous() {
    let (found, _) = join((can, gray), (can, gray), 90.0, 6);
    assert!(matches!(found, Err(Apart::Ambiguous(e)) if e.texture < 0.5), "{found:?}");
}

/// The bracket with a nose on one side, so that its mirror image is another thing.
fn skewed(p: &Vector3<f64>) -> f64 {
    let q = (p - Vector3::new(0.035, -0.01, 0.04)).abs() - Vector3::new(0.01, 0.015, 0.02);
    bracket(p).min(q.map(|v| v.max(0.0)).norm() + q.max().min(0.0))
}

fn mirrored(p: &Vector3<f64>) -> f64 {
    skewed(&Vector3::new(p.x, -p.y, p.z))
}

fn larger(p: &Vector3<f64>) -> f64 {
    skewed(&(p / 1.08)) * 1.08
}

#[test]
fn another_thing_and_a_mirrored_one_and_a_larger_one_are_refused() {
    let (found, truth) = join((skewed, gray), (skewed, gray), 90.0, 6);
    assert_found(&found, &truth);
    for other in [mirrored as Solid, can, larger] {
        let (found, _) = join((skewed, gray), (other, gray), 90.0, 6);
        assert!(found.is_err(), "{found:?}");
    }
}

#[test]
fn hardly_anything_is_said_to_be_nothing() {
    let (first, second) = (
        Recorded::of(bracket, gray, &laid(bracket, 0.0, 0.0), 4),
        Recorded { cloud: PointCloud::default(), views: Vec::new() },
    );
    let found = first.with(|a| second.with(|b| place(a, b, &FlipConfig::default())));
    assert_eq!(found, Err(Apart::Nothing));
}

#[test]
fn the_wrong_turn_contradicts_what_the_cameras_saw() {
    let (stands, lies) = (laid(bracket, 0.0, 0.0), laid(bracket, 90.0, 0.0));
    let (first, second) = (Recorded::of(bracket, gray, &stands, 6), Recorded::of(bracket, gray, &lies, 6));
    let evidence = |turn: f64| {
        let about = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        let pose = stands * Pose::from_parts(Vector3::zeros().into(), about) * lies.inverse();
        first.with(|a| second.with(|b| judge_at(a, b, &pose, &FlipConfig::default()))).unwrap()
    };
    let (right, wrong) = (evidence(0.0), evidence(std::f64::consts::PI));
    assert!(right.overlap > 0.5 && right.conflict < 0.01, "{right:?}");
    assert!(wrong.conflict > 0.15 && wrong.score < 0.5 * right.score, "{wrong:?}");
}
