//! The poster shows the product, in its place, in its colours.

use super::*;

/// Points on a sphere that stands on the ground, red where x is positive, else blue.
fn sphere(count: usize) -> Mesh {
    let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
    let on_sphere = |i: usize| {
        let z = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
        let (r, angle) = ((1.0 - z * z).sqrt(), golden * i as f32);
        [r * angle.cos(), r * angle.sin(), z]
    };
    let normals: Vec<[f32; 3]> = (0..count).map(on_sphere).collect();
    let points = normals.iter().map(|n| [n[0] * 0.1, n[1] * 0.1, n[2] * 0.1 + 0.1]).collect();
    let colors = normals.iter().map(|n| if n[0] > 0.0 { [200, 30, 30] } else { [30, 30, 200] }).collect();
    Mesh { vertices: PointCloud { points, colors, normals }, triangles: Vec::new(), ..Mesh::default() }
}

fn config() -> PosterConfig {
    PosterConfig { width: 160, height: 160, azimuth: 0.0, ..PosterConfig::default() }
}

/// Pixels that are neither ground nor shadow.
fn is_product([r, g, b]: [u8; 3]) -> bool {
    r.max(g).max(b) - r.min(g).min(b) > 40
}

#[test]
fn the_product_fills_the_frame_without_gaps() {
    let picture = draw(&sphere(4000), &config());
    let radius = 0.82 * 160.0 / 2.0;
    for (i, &pixel) in picture.data.iter().enumerate() {
        let (x, y) = ((i % 160) as f64 - 79.5, (i / 160) as f64 - 79.5);
        let distance = x.hypot(y);
        // Where the two colours meet neither wins.
        if distance < radius - 4.0 && x.abs() > 6.0 {
            assert!(is_product(pixel), "a gap at {x} {y}: {pixel:?}");
        }
        if distance > radius + 5.0 {
            assert!(!is_product(pixel), "paint at {x} {y}: {pixel:?}");
        }
    }
}

#[test]
fn right_is_right() {
    let picture = draw(&sphere(4000), &config());
    let (left, right) = (picture.data[80 * 160 + 50], picture.data[80 * 160 + 110]);
    assert!(left[2] > left[0] && right[0] > right[2], "{left:?} {right:?}");
    let behind = draw(&sphere(4000), &PosterConfig { azimuth: std::f64::consts::PI, ..config() });
    assert!(behind.data[80 * 160 + 50][0] > behind.data[80 * 160 + 50][2]);
}

#[test]
fn a_shadow_lies_below_and_not_above() {
    let picture = draw(&sphere(4000), &config());
    // Rows that hold no part of the product.
    let darkest = |rows: std::ops::Range<usize>| {
        picture.data[rows.start * 160..rows.end * 160].iter().map(|p| p[1]).min()
    };
    assert!(darkest(149..160) < Some(240), "{:?}", darkest(149..160));
    assert!(darkest(0..10) > Some(244), "{:?}", darkest(0..10));
}

#[test]
fn triangles_are_filled() {
    let points = vec![[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.0, 0.2], [-0.1, 0.0, 0.2]];
    let colors = vec![[20, 160, 40]; 4];
    let vertices = PointCloud { points, colors, normals: Vec::new() };
    let mesh = Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
    let picture = draw(&mesh, &config());
    let painted = picture.data.iter().filter(|p| is_product(**p)).count();
    assert!((12_000..18_000).contains(&painted), "{painted} pixels");
}

#[test]
fn the_same_on_any_number_of_threads() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| draw(&sphere(3000), &config()))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn odd_models_are_drawn_too() {
    let empty = draw(&Mesh::default(), &config());
    assert!(empty.data.iter().all(|&p| p == config().background));
    for points in [vec![[0.5; 3]], vec![[0.0; 3]; 20], vec![[1e6, -1e6, 0.0], [-1e6, 1e6, 1.0]]] {
        let vertices = PointCloud { points, ..PointCloud::default() };
        let picture = draw(&Mesh { vertices, triangles: vec![[0, 0, 9]], ..Mesh::default() }, &config());
        assert_eq!(picture.data.len(), 160 * 160);
    }
    let vertices = PointCloud { points: vec![[0.5; 3]], ..PointCloud::default() };
    draw(&Mesh::of_points(vertices), &PosterConfig { width: 0, ..config() });
}

#[test]
fn what_was_seen_from_one_side_is_drawn_from_there() {
    let facing = |normals: Vec<[f32; 3]>| {
        let vertices = PointCloud { points: vec![[0.0; 3]; normals.len()], colors: vec![], normals };
        PosterConfig::facing(&Mesh::of_points(vertices))
    };
    let all_round = facing(vec![[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    assert_eq!(all_round, PosterConfig::default());
    let from_the_front = facing(vec![[0.0, -1.0, 0.0]]);
    assert!(from_the_front.azimuth.abs() < 1e-9);
    let from_the_right = facing(vec![[1.0, 0.0, 0.0]]);
    assert!((from_the_right.azimuth - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
}
