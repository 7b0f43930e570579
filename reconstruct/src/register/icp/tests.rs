//! ICP on a bumpy, coloured surface sampled twice at different places.

use super::*;
use crate::normals::{Neighbourhood, estimate};
use proptest::prelude::*;

/// A 20 cm patch of a bumpy surface with a colour pattern, about `count` points; the seed chooses where it is sampled.
fn patch(count: usize, seed: u64, noise: f32) -> PointCloud {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut cloud = PointCloud::default();
    for _ in 0..count {
        let (x, y) = (rng.f32() * 0.2 - 0.1, rng.f32() * 0.2 - 0.1);
        let z = 0.5 + 0.012 * (40.0 * x).sin() * (33.0 * y).cos() + 0.3 * x * x;
        cloud.points.push([x, y, z + noise * (rng.f32() - 0.5)]);
        let wave = |v: f32| (128.0 + 100.0 * v.sin()) as u8;
        cloud.colors.push([wave(90.0 * x), wave(80.0 * y), wave(60.0 * (x + y))]);
    }
    let tree = Tree::new(&cloud.points);
    cloud.normals = estimate(&cloud.points, &tree, Neighbourhood::Nearest(16), &[0.0; 3]).normals;
    cloud
}

/// A flat sheet with a pattern: geometry says nothing about sliding.
fn flattened(mut cloud: PointCloud) -> PointCloud {
    for (p, n) in cloud.points.iter_mut().zip(&mut cloud.normals) {
        p[2] = 0.5;
        *n = [0.0, 0.0, -1.0];
    }
    cloud
}

fn error_at_centre(truth: &Pose, found: &Pose) -> (f64, f64) {
    let centre = Point3::new(0.0, 0.0, 0.5);
    ((found * centre - truth * centre).norm(), crate::pose::rotation_error_radians(truth, found))
}

fn check(config: &IcpConfig, noise: f32, metres: f64, radians: f64) {
    let target_cloud = patch(6000, 1, noise);
    let truth = exp(&Vector6::new(0.3, -0.1, 0.2, 0.5, 0.8, -0.3));
    let source = patch(5000, 2, noise).transformed(&truth.inverse());
    let target = Target::with_colors(&target_cloud, 0.01);
    for (seed, sign) in [(3, 1.0), (4, -1.0)] {
        let mut rng = fastrand::Rng::with_seed(seed);
        let nudge = Vector6::from_fn(|i, _| (rng.f64() - 0.5) * if i < 3 { 0.008 } else { 0.08 }) * sign;
        let about = Pose::translation(0.0, 0.0, 0.5);
        let start = about * exp(&nudge) * about.inverse() * truth;
        let result = register(&source, &target, &start, config).unwrap();
        let (moved, turned) = error_at_centre(&truth, &result.target_from_source);
        assert!(moved < metres && turned < radians, "{moved} m, {turned} rad, {result:?}");
        assert!(result.fitness > 0.9 && result.converged, "{result:?}");
        assert!(result.inlier_rmse_metres < f64::from(noise) + 3e-3);
    }
}

#[test]
fn every_metric_finds_the_motion() {
    let plane = IcpConfig { max_distance: 0.02, ..IcpConfig::default() };
    check(&plane, 0.0, 2e-4, 2e-3);
    check(&IcpConfig { metric: Metric::Symmetric, ..plane.clone() }, 0.0, 1e-4, 1e-3);
    check(&IcpConfig { sigma_color: Some(0.05), ..plane.clone() }, 0.001, 2e-4, 2e-3);
    check(&IcpConfig { kernel: Kernel::Tukey(0.004), stride: 3, ..plane.clone() }, 0.001, 4e-4, 4e-3);
    check(&IcpConfig { metric: Metric::PointToPoint, iterations: 300, ..plane.clone() }, 0.0, 3e-3, 1e-2);
}

#[test]
fn extrapolation_saves_iterations() {
    let target_cloud = patch(6000, 1, 0.0);
    let source = patch(5000, 2, 0.0);
    let target = Target::new(&target_cloud);
    let start = Pose::translation(0.008, 0.006, 0.0);
    let plain = IcpConfig {
        metric: Metric::PointToPoint,
        max_distance: 0.05,
        iterations: 400,
        tolerance_metres: 1e-5,
        ..IcpConfig::default()
    };
    let fast = IcpConfig { extrapolate: true, ..plain.clone() };
    let plain = register(&source, &target, &start, &plain).unwrap();
    let fast = register(&source, &target, &start, &fast).unwrap();
    assert!(plain.converged && fast.converged);
    assert!(fast.iterations * 3 < plain.iterations * 2, "{} of {}", fast.iterations, plain.iterations);
    assert!(error_at_centre(&Pose::identity(), &fast.target_from_source).0 < 1e-3);
}

#[test]
fn ransac_in_the_loop_drops_what_moved_by_itself() {
    let target_cloud = patch(4000, 1, 0.0);
    let mut source = patch(3000, 2, 0.0);
    for p in source.points.iter_mut().filter(|p| p[0] > 0.05) {
        p[2] += 0.015; // a quarter of the product was knocked
    }
    let target = Target::new(&target_cloud);
    let plain = IcpConfig {
        metric: Metric::PointToPoint,
        max_distance: 0.03,
        min_normal_cosine: None,
        iterations: 100,
        ..IcpConfig::default()
    };
    let ransac = RansacConfig { inlier_distance: 0.004, iterations: 500, ..RansacConfig::default() };
    let robust = IcpConfig { outlier_ransac: Some(ransac), ..plain.clone() };
    let error = |config: &IcpConfig| {
        let found = register(&source, &target, &Pose::identity(), config).unwrap();
        error_at_centre(&Pose::identity(), &found.target_from_source).0
    };
    let (plain, robust) = (error(&plain), error(&robust));
    assert!(robust < 1.5e-3 && robust < plain / 2.0, "{robust} {plain}");
}

#[test]
fn colour_holds_what_geometry_lets_slide() {
    let target_cloud = flattened(patch(6000, 1, 0.0));
    let source = flattened(patch(5000, 2, 0.0));
    let target = Target::with_colors(&target_cloud, 0.008);
    let start = Pose::translation(0.006, -0.004, 0.001);
    let geometry = IcpConfig { max_distance: 0.02, ..IcpConfig::default() };
    let color = IcpConfig { sigma_color: Some(0.05), ..geometry.clone() };
    let error = |config: &IcpConfig| {
        let found = register(&source, &target, &start, config).unwrap();
        error_at_centre(&Pose::identity(), &found.target_from_source).0
    };
    assert!(error(&geometry) > 5e-3);
    assert!(error(&color) < 5e-4, "{}", error(&color));
}

#[test]
fn the_inverse_way_gives_the_inverse() {
    let (a, b) = (patch(5000, 1, 0.0), patch(5000, 2, 0.0));
    let config = IcpConfig { metric: Metric::Symmetric, max_distance: 0.02, ..IcpConfig::default() };
    let start = exp(&Vector6::new(0.004, 0.002, -0.003, 0.01, -0.01, 0.02));
    let forward = register(&a, &Target::new(&b), &start, &config).unwrap();
    let back = register(&b, &Target::new(&a), &start.inverse(), &config).unwrap();
    let round = back.target_from_source * forward.target_from_source;
    let (moved, turned) = error_at_centre(&Pose::identity(), &round);
    assert!(moved < 2e-4 && turned < 2e-3, "{moved} {turned}");
}

#[test]
fn threads_do_not_change_a_bit() {
    let (a, b) = (patch(5000, 1, 0.001), patch(5000, 2, 0.001));
    let config = IcpConfig { sigma_color: Some(0.05), max_distance: 0.02, ..IcpConfig::default() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            register(&a, &Target::with_colors(&b, 0.01), &Pose::translation(0.003, 0.0, 0.0), &config)
        })
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn unusable_input_is_refused() {
    let cloud = patch(100, 1, 0.0);
    let bare = PointCloud { points: cloud.points.clone(), ..PointCloud::default() };
    let config = IcpConfig::default();
    let few = cloud.select(&[0, 1]);
    assert!(matches!(
        register(&few, &Target::new(&cloud), &Pose::identity(), &config),
        Err(IcpError::TooFewPoints { cloud: "source", found: 2, .. })
    ));
    assert_eq!(
        register(&cloud, &Target::new(&bare), &Pose::identity(), &config),
        Err(IcpError::NoNormals("target"))
    );
    let color = IcpConfig { sigma_color: Some(0.1), ..config.clone() };
    assert_eq!(
        register(&cloud, &Target::new(&cloud), &Pose::identity(), &color),
        Err(IcpError::NoColors("target"))
    );
    let nowhere = Pose::translation(f64::NAN, 0.0, 0.0);
    assert_eq!(register(&cloud, &Target::new(&cloud), &nowhere, &config), Err(IcpError::BadStart));
    // Nothing in reach: no step, no fitness, no panic.
    let far = register(&cloud, &Target::new(&cloud), &Pose::translation(9.0, 0.0, 0.0), &config).unwrap();
    assert_eq!((far.fitness, far.iterations, far.converged), (0.0, 0, false));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn recovers_a_small_random_motion(twist in prop::array::uniform6(-1.0f64..1.0)) {
        let v = Vector6::from_row_slice(&twist);
        let v = Vector6::from_fn(|i, _| v[i] * if i < 3 { 0.004 } else { 0.04 });
        let about = Pose::translation(0.0, 0.0, 0.5);
        let truth = about * exp(&v) * about.inverse();
        let target_cloud = patch(3000, 1, 0.0);
        let source = target_cloud.transformed(&truth.inverse());
        let config = IcpConfig { max_distance: 0.03, min_normal_cosine: Some(0.5), ..IcpConfig::default() };
        let found = register(&source, &Target::new(&target_cloud), &Pose::identity(), &config).unwrap();
        let (moved, turned) = error_at_centre(&truth, &found.target_from_source);
        prop_assert!(moved < 1e-5 && turned < 1e-4, "{moved} {turned}");
    }
}
