use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

proptest! {
    #[test]
    fn agrees_with_a_map_of_cells(points in prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), 0..200)) {
        let cell = 0.3f32;
        let mut cells: BTreeMap<[i64; 3], (Vector3<f64>, u32)> = BTreeMap::new();
        for p in &points {
            let mut key = p.map(|v| (f64::from(v) / f64::from(cell)).floor() as i64);
            key.reverse();
            let entry = cells.entry(key).or_default();
            entry.0 += Vector3::from(p.map(f64::from));
            entry.1 += 1;
        }
        let out = downsample(&PointCloud { points, ..PointCloud::default() }, cell).unwrap();
        prop_assert_eq!(out.cloud.len(), cells.len());
        for ((p, n), (sum, count)) in out.cloud.points.iter().zip(&out.counts).zip(cells.values()) {
            prop_assert_eq!(n, count);
            prop_assert!((Vector3::from(p.map(f64::from)) - sum / f64::from(*count)).norm() < 1e-6);
        }
    }

    #[test]
    fn no_finite_or_other_input_panics(points in prop::collection::vec(prop::array::uniform3(any::<f32>()), 0..30), cell in any::<f32>()) {
        let len = points.len();
        if let Ok(out) = downsample(&PointCloud { points, ..PointCloud::default() }, cell) {
            prop_assert_eq!(out.counts.iter().sum::<u32>() as usize + out.dropped, len);
        }
    }
}

#[test]
fn attributes_are_averaged_and_bad_points_counted() {
    let cloud = PointCloud {
        points: vec![[0.1, 0.1, 0.1], [f32::NAN, 0.0, 0.0], [0.3, 0.1, 0.1]],
        colors: vec![[0, 10, 255], [9; 3], [100, 20, 255]],
        normals: vec![[1.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]],
    };
    let out = downsample(&cloud, 1.0).unwrap();
    assert_eq!((out.cloud.len(), out.dropped, out.counts[0]), (1, 1, 2));
    assert_eq!(out.cloud.colors, vec![[50, 15, 255]]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    assert!((out.cloud.normals[0][0] - half).abs() < 1e-6 && (out.cloud.normals[0][1] - half).abs() < 1e-6);
}

#[test]
fn cells_too_small_for_the_cloud_are_refused() {
    let cloud = PointCloud { points: vec![[-3e38; 3], [3e38; 3]], ..PointCloud::default() };
    assert!(matches!(downsample(&cloud, 1e-3), Err(VoxelError::TooFine { .. })));
    assert!(matches!(downsample(&cloud, 0.0), Err(VoxelError::BadCell(_))));
}

/// Points of which some lie exactly on faces of cells and some have no place.
fn scattered(count: usize) -> Vec<[f32; 3]> {
    let mut rng = fastrand::Rng::with_seed(4);
    let mut points: Vec<[f32; 3]> = (0..count)
        .map(|_| {
            std::array::from_fn(|_| if rng.u8(..) == 0 { 0.02 * f32::from(rng.u8(..)) } else { rng.f32() })
        })
        .collect();
    points[count / 2][1] = f32::NAN;
    points[count / 3][2] = f32::INFINITY;
    points
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let cloud = PointCloud { points: scattered(70_000), ..PointCloud::default() };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| downsample(&cloud, 0.02).unwrap())
    };
    let one = on(1);
    assert_eq!(one.dropped, 2);
    assert!(one == on(2) && one == on(5));
}

#[test]
fn keys_and_bounds_are_the_same_on_every_path() {
    let points = scattered(1003);
    let lattice = Lattice::over(&points, 0.02).unwrap().unwrap();
    let keys = |scalar: bool| {
        let mut keys = vec![0; points.len()];
        let op = PackedKeys { points: &points, keys: &mut keys, lattice: &lattice, first: 0, index_bits: 10 };
        if scalar {
            op.with_simd(pulp::Scalar);
        } else {
            run(op);
        }
        keys
    };
    assert_eq!(keys(true), keys(false));
    for (index, p) in points.iter().enumerate().filter(|(_, p)| is_finite(p)) {
        let cell = |k: usize| ((f64::from(p[k]) / lattice.cell).floor() - lattice.low[k]) as u64;
        let number = (cell(2) * lattice.size[1] + cell(1)) * lattice.size[0] + cell(0);
        assert_eq!(keys(false)[index], (number << 10) | index as u64);
    }
    assert_eq!(Bounds(&points[..300]).with_simd(pulp::Scalar), run(Bounds(&points[..300])));
}
