//! The comparison's inputs.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use anyhow::Context;
use reconstruct::cloud::PointCloud;
use reconstruct::model_file::{self, Kind, Limits};

/// Clouds that most stages are measured on.
pub(crate) const CLOUDS: [&str; 4] =
    ["syn/bunny/view0.pcd", "syn/bunny/fused_raw.pcd", "tsdf/scene0.pcd", "real/milk_scene_xyz.pcd"];

/// Reads a cloud as the programs do.
pub(crate) fn cloud(path: &Path) -> anyhow::Result<PointCloud> {
    let name = path.to_string_lossy();
    let kind = Kind::from_name(&name).with_context(|| format!("{name} is no model file"))?;
    let file = File::open(path).with_context(|| name.to_string())?;
    let mesh = model_file::read(kind, BufReader::with_capacity(1 << 18, file), &Limits::default())
        .with_context(|| name.to_string())?;
    Ok(mesh.vertices)
}

/// Row-major numbers of a text file.
pub(crate) fn numbers<const N: usize>(path: &Path) -> anyhow::Result<[f64; N]> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let wrong = |v: Vec<f64>| anyhow::anyhow!("{} has {} numbers, not {N}", path.display(), v.len());
    numbers.try_into().map_err(wrong)
}
