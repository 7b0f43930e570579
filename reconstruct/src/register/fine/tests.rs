use nalgebra::{Point3, Vector3, Vector6};

use super::*;

/// A lump of about 10 cm at the origin: its points as a noisy sensor at `sensor` sees them, in the frame `frame_from_lump`.
pub(in crate::register) fn seen_from(
    sensor: &Vector3<f64>,
    frame_from_lump: &Pose,
    spacing: f64,
    seed: u64,
) -> (Vec<[f32; 3]>, [f32; 3]) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let radius = |d: &Vector3<f64>| {
        0.1 * (1.0 + 0.2 * (3.0 * d.x + 1.0).sin() * (2.0 * d.y).cos() + 0.15 * (4.0 * d.z * d.x + d.y).sin())
    };
    let count = (4.0 * std::f64::consts::PI * 0.01 / (spacing * spacing)) as usize;
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let mut points = Vec::new();
    for i in 0..count {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let (r, turn) = ((1.0 - z * z).sqrt(), golden * i as f64 + 0.1 * seed as f64);
        let d = Vector3::new(r * turn.cos(), r * turn.sin(), z);
        let p = d * radius(&d);
        // Nearly star-shaped and smooth: what faces the sensor is seen.
        let side = |axis: Vector3<f64>| {
            let d = (d + axis * 1e-4).normalize();
            d * radius(&d) - p
        };
        let (u, v) = (d.cross(&Vector3::new(0.3, 0.5, 0.8)).normalize(), Vector3::zeros());
        let normal = side(u).cross(&side(d.cross(&u) + v)).normalize();
        let normal = if normal.dot(&d) < 0.0 { -normal } else { normal };
        let sight = (sensor - p).normalize();
        if normal.dot(&sight) > 0.2 {
            let noise: f64 = (0..6).map(|_| rng.f64() - 0.5).sum::<f64>() * 0.0012;
            let p = frame_from_lump * Point3::from(p + sight * noise);
            points.push(p.map(|v| v as f32).into());
        }
    }
    let sensor = frame_from_lump * Point3::from(*sensor);
    (points, sensor.map(|v| v as f32).into())
}

/// Two views 45 degrees apart at 2 mm, and how they lie.
fn pair() -> (Surfels, Surfels, Pose) {
    let truth = exp(&Vector6::new(0.3, -0.2, 0.1, 0.9, -1.3, 0.4));
    let (a, b) = (Vector3::new(0.0, 0.1, 0.8), Vector3::new(0.56, 0.1, 0.56));
    let (target, target_sensor) = seen_from(&a, &Pose::identity(), 0.002, 1);
    let (source, source_sensor) = seen_from(&b, &truth.inverse(), 0.002, 2);
    (Surfels::new(&source, &source_sensor, 0.007), Surfels::new(&target, &target_sensor, 0.007), truth)
}

fn start(source: &Surfels, truth: &Pose) -> Pose {
    let middle = truth * source.centre;
    let about = Pose::translation(middle.x, middle.y, middle.z)
        * exp(&Vector6::new(0.006, -0.005, 0.006, 0.05, 0.05, -0.05))
        * Pose::translation(-middle.x, -middle.y, -middle.z);
    about * truth
}

fn error(found: &Pose, truth: &Pose, at: &Point3<f64>) -> (f64, f64) {
    (found.rotation.angle_to(&truth.rotation).to_degrees(), (found * at - truth * at).norm() * 1e3)
}

#[test]
fn every_cost_and_acceleration_ends_at_the_truth() {
    let (source, target, truth) = pair();
    let start = start(&source, &truth);
    for cost in [Cost::PointToPoint, Cost::PointToPlane, Cost::Symmetric, Cost::PlaneToPlane] {
        for acceleration in [Acceleration::None, Acceleration::BeslMcKay, Acceleration::Anderson] {
            let config = FineConfig { cost, acceleration, ..FineConfig::default() };
            let found = register_fine(&source, &target, &start, &config).unwrap();
            let (turned, moved) = error(&found.target_from_source, &truth, &source.centre);
            println!("{cost:?} {acceleration:?}: {turned:.3} deg {moved:.3} mm {}", found.iterations);
            // The start is 5 degrees and 10 mm off. Points slide along a smooth lump; planes with slack along them are slow.
            let limits = match cost {
                Cost::PointToPoint => (8.0, 6.0),
                Cost::PointToPlane | Cost::Symmetric => (0.3, 0.3),
                Cost::PlaneToPlane => (1.0, 0.5),
            };
            assert!(
                turned < limits.0 && moved < limits.1,
                "{cost:?} {acceleration:?}: {turned} deg {moved} mm"
            );
            assert!(found.fitness > 0.3 && found.rmse_metres < 0.002, "{found:?}");
        }
    }
}

#[test]
fn threads_change_nothing() {
    let (source, target, truth) = pair();
    let start = start(&source, &truth);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| register_fine(&source, &target, &start, &FineConfig::default()).unwrap())
    });
    assert_eq!(one, three);
}

#[test]
fn what_cannot_be_registered_gives_nothing() {
    let (source, target, truth) = pair();
    let config = FineConfig::default();
    let empty = Surfels::new(&[], &[0.0; 3], 0.01);
    assert!(register_fine(&empty, &target, &truth, &config).is_none());
    assert!(register_fine(&source, &empty, &truth, &config).is_none());
    let broken = Pose::translation(f64::NAN, 0.0, 0.0);
    assert!(register_fine(&source, &target, &broken, &config).is_none());
    let strange = [[f32::NAN; 3], [3e38; 3], [-3e38; 3], [1.0; 3], [1e30, 0.0, 0.0]];
    assert!(Surfels::new(&strange, &[0.0; 3], 0.01).is_empty());
    assert!(NearField::new(&strange, 1, 0.01, 0.02).nearest(&[1.0; 3]).is_none());
}

#[test]
fn the_grid_finds_what_is_near() {
    let mut rng = fastrand::Rng::with_seed(4);
    let points: Vec<[f32; 3]> = (0..500).map(|_| [(); 3].map(|()| rng.f32() * 0.1)).collect();
    let (cell, reach) = (0.002f32, 0.01f32);
    let field = NearField::new(&points, 1, cell, reach);
    for _ in 0..2000 {
        let query = [(); 3].map(|()| rng.f32() * 0.14 - 0.02);
        let distance = |p: &[f32; 3]| (Vector3::from(*p) - Vector3::from(query)).norm();
        let best = points.iter().map(distance).fold(f32::INFINITY, f32::min);
        // The middle of a cell is at most half a diagonal away.
        let slack = cell * 3f32.sqrt() / 2.0;
        match field.nearest(&query) {
            Some(found) => assert!(distance(&points[found]) <= best + 2.0 * slack + 1e-6),
            None => assert!(best >= reach - slack - 1e-6, "{best}"),
        }
    }
}
