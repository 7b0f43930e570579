use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;
use crate::mesh::topology::{Defects, borders, defects, pieces};

/// Points spread evenly over a sphere with outward normals, red above and blue below.
fn sphere(count: usize, radius: f32) -> PointCloud {
    let mut cloud = PointCloud::default();
    for i in 0..count {
        let z = 1.0 - (2 * i + 1) as f32 / count as f32;
        let (s, c) = ((i as f64 * 2.399_963_229_728_653) as f32).sin_cos();
        let flat = (1.0 - z * z).sqrt();
        let n = [flat * c, flat * s, z];
        cloud.points.push(n.map(|v| v * radius));
        cloud.normals.push(n);
        cloud.colors.push(if z > 0.0 { [200, 0, 0] } else { [0, 0, 200] });
    }
    cloud
}

fn of_depth(depth: u32) -> PoissonConfig {
    PoissonConfig { depth, ..PoissonConfig::default() }
}

fn volume(mesh: &Mesh) -> f64 {
    let of = |t: &[u32; 3]| {
        let a = Vector3::from(mesh.vertices.points[t[0] as usize]).cast::<f64>();
        mesh.twice_area_vector(t).dot(&a) / 6.0
    };
    mesh.triangles.iter().map(of).sum()
}

#[track_caller]
fn check_closed(mesh: &Mesh) {
    assert_eq!(defects(mesh), Defects::default());
    assert_eq!(borders(&mesh.triangles), Vec::<Vec<u32>>::new());
    assert!(volume(mesh) > 0.0, "faces inwards");
    assert!(mesh.has_deviations());
}

#[test]
fn a_sphere_is_closed_true_and_of_one_piece() {
    let radius = 0.05;
    let made = reconstruct(&sphere(20_000, radius), &of_depth(7)).unwrap();
    let mesh = &made.mesh;
    check_closed(mesh);
    assert_eq!((made.depth, pieces(mesh.vertices.len(), &mesh.triangles).1), (7, 1));
    assert!(made.invented_share < 1e-3, "{}", made.invented_share);
    let off = |p: &[f32; 3]| (Vector3::from(*p).norm() - radius).abs();
    let worst = mesh.vertices.points.iter().map(off).fold(0.0, f32::max);
    let mean = mesh.vertices.points.iter().map(off).sum::<f32>() / mesh.vertices.len() as f32;
    // a cell is 0.86 mm wide
    assert!(worst < 0.00025 && mean < 0.00006, "{worst} {mean}");
    for (i, p) in mesh.vertices.points.iter().enumerate() {
        let n = Vector3::from(mesh.vertices.normals[i]);
        assert!(n.dot(&Vector3::from(*p).normalize()) > 0.9);
        assert!(p[2].abs() < 0.002 || (mesh.vertices.colors[i][0] > 0) == (p[2] > 0.0));
        assert!(mesh.deviations_metres[i] < 0.0002, "{}", mesh.deviations_metres[i]);
    }
}

#[test]
fn noise_is_averaged_and_told() {
    let (radius, noise) = (0.05f32, 0.0008f32);
    let mut cloud = sphere(40_000, radius);
    let mut rng = fastrand::Rng::with_seed(5);
    for p in &mut cloud.points {
        // nearly normal: twelve even ones
        let off = ((0..12).map(|_| rng.f32()).sum::<f32>() - 6.0) * noise;
        *p = p.map(|v| v * (1.0 + off / radius));
    }
    let mesh = reconstruct(&cloud, &of_depth(7)).unwrap().mesh;
    check_closed(&mesh);
    let off = |p: &[f32; 3]| (Vector3::from(*p).norm() - radius).powi(2);
    let count = mesh.vertices.len() as f32;
    let off = (mesh.vertices.points.iter().map(off).sum::<f32>() / count).sqrt();
    let told = (mesh.deviations_metres.iter().map(|d| d * d).sum::<f32>() / count).sqrt();
    assert!(off < 0.45 * noise, "{off}");
    assert!((0.5..2.0).contains(&(told / off)), "{told} for {off}");
}

#[test]
fn a_patch_is_closed_behind_and_that_is_marked() {
    let mut cloud = PointCloud::default();
    for i in 0..100 {
        for j in 0..100 {
            cloud.points.push([0.001 * i as f32, 0.001 * j as f32, 0.3]);
            cloud.normals.push([0.0, 0.0, 1.0]);
        }
    }
    let made = reconstruct(&cloud, &of_depth(7)).unwrap();
    check_closed(&made.mesh);
    assert!((0.3..0.9).contains(&made.invented_share), "{}", made.invented_share);
    let inner = |v: f32| (0.01..0.09).contains(&v);
    let mesh = &made.mesh;
    let over = |p: &&[f32; 3]| inner(p[0]) && inner(p[1]) && p[2] > 0.297;
    let on: Vec<_> = mesh.vertices.points.iter().filter(over).collect();
    assert!(on.len() > 6000 && on.iter().all(|p| (p[2] - 0.3).abs() < 0.0002), "{}", on.len());
    for (i, p) in mesh.vertices.points.iter().enumerate() {
        assert!(mesh.is_invented(i) || (p[2] - 0.3).abs() < 0.004, "{p:?}");
    }
}

#[test]
fn dense_and_sparse_parts_meet_without_cracks() {
    let dense = sphere(40_000, 0.05);
    let keep: Vec<usize> = (0..dense.len()).filter(|&i| dense.points[i][2] > 0.0 || i % 60 == 0).collect();
    let made = reconstruct(&dense.select(&keep), &of_depth(8)).unwrap();
    check_closed(&made.mesh);
    assert_eq!(pieces(made.mesh.vertices.len(), &made.mesh.triangles).1, 1);
    let off = |p: &[f32; 3]| (Vector3::from(*p).norm() - 0.05).abs();
    let worst = made.mesh.vertices.points.iter().map(off).fold(0.0, f32::max);
    // the sparse half's points lie 7 mm apart
    assert!(worst < 0.0022, "{worst}");
}

#[test]
fn few_points_take_coarse_cells() {
    let made = reconstruct(&sphere(400, 0.05), &of_depth(10)).unwrap();
    check_closed(&made.mesh);
    assert!(made.depth <= 6, "{}", made.depth);
    let volume = volume(&made.mesh) / (4.0 / 3.0 * std::f64::consts::PI * 0.05f64.powi(3));
    assert!((volume - 1.0).abs() < 0.05, "{volume}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let cloud = sphere(15_000, 0.05);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| reconstruct(&cloud, &of_depth(7)).unwrap().mesh)
    };
    assert_eq!(on(1), on(2));
}

#[test]
fn what_is_no_surface_is_refused() {
    let small = sphere(3, 0.05);
    let found = PoissonError::TooFewPoints { found: 3 };
    assert_eq!(reconstruct(&small, &PoissonConfig::default()).unwrap_err(), found);
    let mut blind = sphere(500, 0.05);
    blind.normals.fill([0.0; 3]);
    blind.points[0] = [f32::NAN; 3];
    let found = PoissonError::TooFewPoints { found: 0 };
    assert_eq!(reconstruct(&blind, &PoissonConfig::default()).unwrap_err(), found);
    let one = PointCloud { points: vec![[0.1; 3]; 50], normals: vec![[0.0, 0.0, 1.0]; 50], colors: vec![] };
    let error = reconstruct(&one, &PoissonConfig::default()).unwrap_err();
    assert!(matches!(error, PoissonError::TooNearTogether { .. }), "{error}");
    let mut far = sphere(500, 0.05);
    for p in &mut far.points {
        p[0] += 1e6;
    }
    let error = reconstruct(&far, &PoissonConfig::default()).unwrap_err();
    assert!(matches!(error, PoissonError::TooNearTogether { .. }), "{error}");
}

#[test]
fn a_far_product_gets_cells_that_single_precision_tells_apart() {
    let mut cloud = sphere(20_000, 0.05);
    for p in &mut cloud.points {
        p[1] += 500.0;
    }
    let made = reconstruct(&cloud, &of_depth(8)).unwrap();
    assert!(made.depth < 8);
    check_closed(&made.mesh);
}

#[test]
fn duplicates_and_points_without_direction_do_not_harm() {
    let mut cloud = sphere(5000, 0.05);
    for _ in 0..3000 {
        cloud.points.push(cloud.points[17]);
        cloud.normals.push(cloud.normals[17]);
        cloud.colors.push([0; 3]);
    }
    cloud.points[3] = [f32::INFINITY, 0.0, 0.0];
    cloud.normals[5] = [f32::NAN; 3];
    let made = reconstruct(&cloud, &of_depth(7)).unwrap();
    check_closed(&made.mesh);
    let off = |p: &[f32; 3]| (Vector3::from(*p).norm() - 0.05).abs();
    assert!(made.mesh.vertices.points.iter().map(off).fold(0.0, f32::max) < 0.002);
}

fn any_cloud() -> impl Strategy<Value = PointCloud> {
    let value = prop_oneof![8 => -1.0f32..1.0, 1 => Just(0.0f32), 1 => any::<f32>()];
    let near = prop::array::uniform3(prop_oneof![9 => -1.0f32..1.0, 1 => Just(0.5f32)]);
    let point = prop_oneof![30 => near, 1 => prop::array::uniform3(value.clone())];
    prop::collection::vec((point, prop::array::uniform3(value)), 0..300).prop_map(|rows| PointCloud {
        points: rows.iter().map(|r| r.0).collect(),
        normals: rows.iter().map(|r| r.1).collect(),
        colors: Vec::new(),
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn any_points_give_a_manifold_surface_or_a_reason(cloud in any_cloud(), depth in 4u32..7, weight in 0.0f32..20.0) {
        let config = PoissonConfig { depth, point_weight: weight, ..PoissonConfig::default() };
        if let Ok(made) = reconstruct(&cloud, &config) {
            prop_assert_eq!(defects(&made.mesh), Defects::default());
            prop_assert!(borders(&made.mesh.triangles).is_empty());
            prop_assert!(made.mesh.vertices.points.iter().flatten().all(|v| v.is_finite()));
        }
    }
}
