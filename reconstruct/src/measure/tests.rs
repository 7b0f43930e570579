use super::*;
use crate::cloud::PointCloud;

/// Points on the surface of a 120 x 60 x 200 mm box, turned, each off by noise of `sd` along its face's normal.
fn noisy_box(sd: f32, count: usize) -> Mesh {
    let mut rng = fastrand::Rng::with_seed(2);
    let (s, c) = 0.6f32.sin_cos();
    let normal = |rng: &mut fastrand::Rng| (0..12).map(|_| rng.f32()).sum::<f32>() - 6.0;
    let points: Vec<[f32; 3]> = (0..count)
        .map(|_| {
            let mut p = [0.12 * (rng.f32() - 0.5), 0.06 * (rng.f32() - 0.5), 0.2 * rng.f32()];
            let off = sd * normal(&mut rng);
            match rng.u8(0..5) {
                0 => p[0] = 0.06 + off,
                1 => p[0] = -0.06 + off,
                2 => p[1] = 0.03 + off,
                3 => p[1] = -0.03 + off,
                _ => p[2] = 0.2 + off,
            }
            [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]]
        })
        .collect();
    let deviations_metres = vec![sd; points.len()];
    Mesh {
        vertices: PointCloud { points, ..PointCloud::default() },
        triangles: Vec::new(),
        deviations_metres,
    }
}

#[test]
fn a_turned_box_has_its_own_sizes_however_noisy() {
    for (sd, count) in [(0.0002, 60_000), (0.0006, 60_000), (0.0006, 6_000)] {
        let found = dimensions(&noisy_box(sd, count), 0.001, true).unwrap();
        for (found, truth) in found.metres.iter().zip([0.12, 0.06, 0.2]) {
            // The outermost points of two noisy faces are six deviations and more apart from the truth.
            assert!((found - truth).abs() < 1.4 * f64::from(sd) + 0.0001, "{sd} {count}: {found} {truth}");
        }
        assert!(found.uncertainty_metres.iter().all(|&u| u > 0.0004 && u < 0.003));
    }
}

/// A can of 80 mm whose wall is seen 0.3 mm farther out in two directions, as the views' own errors make it.
#[test]
fn what_is_round_has_one_diameter() {
    let points: Vec<[f32; 3]> = (0..360 * 100)
        .map(|i| {
            let (s, c) = ((i % 360) as f32).to_radians().sin_cos();
            let radius = 0.04 + 0.0003 * (c * c - s * s);
            [radius * c, radius * s, 0.001 * (i / 360 + 1) as f32]
        })
        .collect();
    let deviations_metres = vec![0.0002; points.len()];
    let vertices = PointCloud { points, ..PointCloud::default() };
    let [length, width, _] =
        dimensions(&Mesh { vertices, triangles: Vec::new(), deviations_metres }, 0.001, true).unwrap().metres;
    // The smallest rectangle would be 0.0806 x 0.0794.
    assert!(length == width && (length - 0.08).abs() < 0.0003, "{length} {width}");
}

#[test]
fn invented_vertices_are_not_measured() {
    let mut mesh = noisy_box(0.0003, 20_000);
    let before = dimensions(&mesh, 0.001, true);
    for k in 0..500 {
        mesh.vertices.points.push([0.5, 0.001 * k as f32, 0.4]);
        mesh.deviations_metres.push(crate::mesh::INVENTED);
    }
    assert_eq!(dimensions(&mesh, 0.001, true), before);
}

#[test]
fn nothing_has_no_size() {
    assert_eq!(dimensions(&Mesh::default(), 0.001, true), None);
}
