//! What the fuzz targets share: seed inputs, made by the project's own writers, and the check of a model that was read.
//!
//! A target that is started with `FUZZ_SEEDS=folder` writes its seeds there and ends.

use std::path::Path;

use reconstruct::cloud::PointCloud;
use reconstruct::mesh::Mesh;
use reconstruct::model_file::{self, Kind, Limits};

/// Writes the seeds and ends the process, if that is what was asked for.
pub fn write_seeds(seeds: impl FnOnce() -> Vec<Vec<u8>>) {
    let Some(folder) = std::env::var_os("FUZZ_SEEDS") else { return };
    for (i, seed) in seeds().iter().enumerate() {
        std::fs::write(Path::new(&folder).join(format!("seed-{i}")), seed)
            .expect("the seed folder can be written");
    }
    std::process::exit(0);
}

/// Models with all, with some and without attributes.
pub fn models() -> Vec<Mesh> {
    let points = vec![[0.1, 0.2, 0.3], [0.0, -0.1, 0.5], [1.0, 0.0, 0.0], [0.5, 0.5, -0.5]];
    let colors = vec![[255, 0, 1], [3, 200, 30], [0; 3], [255; 3]];
    let normals = vec![[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.6, 0.8, 0.0]];
    let bare = PointCloud { points, ..PointCloud::default() };
    let colored = PointCloud { colors, ..bare.clone() };
    let full = PointCloud { normals, ..colored.clone() };
    vec![
        Mesh::of_points(bare),
        Mesh::of_points(colored),
        Mesh { vertices: full, triangles: vec![[0, 1, 2], [3, 2, 1]], ..Mesh::default() },
    ]
}

/// Reads bytes as a model: refused or sound, never anything else.
pub fn read_model(kind: Kind, data: &[u8]) {
    let Ok(mesh) = model_file::read(kind, data, &Limits::default()) else { return };
    let count = mesh.vertices.len();
    assert!(count > 0);
    assert!(mesh.vertices.points.iter().flatten().all(|v| v.is_finite()));
    assert!(mesh.vertices.normals.iter().flatten().all(|v| v.is_finite()));
    assert!(mesh.vertices.colors.is_empty() || mesh.vertices.colors.len() == count);
    assert!(mesh.vertices.normals.is_empty() || mesh.vertices.normals.len() == count);
    assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < count));
}
