//! Voxel grid: the same cells as a plain map of cells, centroids to the micrometre.

use reconstruct::cloud::PointCloud;
use reconstruct::voxel::{Downsampled, VoxelError, downsample};

use crate::clock::Bench;
use crate::inputs::{CLOUDS, cloud};
use crate::reference;

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    for name in CLOUDS {
        let cloud = cloud(&bench.data.join(name))?;
        for (label, cell) in [("2mm", 0.002), ("5mm", 0.005)] {
            let stage = format!("voxel{label} {name}");
            bench.stage(&stage, || downsample(&cloud, cell), |thinned| judge(&cloud, cell, thinned));
        }
    }
    Ok(())
}

fn judge(cloud: &PointCloud, cell: f32, thinned: &Result<Downsampled, VoxelError>) -> String {
    let Ok(thinned) = thinned else { return "failed".to_owned() };
    let expected = reference::voxels(&cloud.points, cell);
    let same = expected.len() == thinned.cloud.len()
        && expected.iter().zip(&thinned.counts).all(|((_, count), found)| count == found);
    let worst = expected.iter().zip(&thinned.cloud.points).map(|((centroid, _), p)| {
        (0..3).map(|k| (centroid[k] - f64::from(p[k])).powi(2)).sum::<f64>().sqrt()
    });
    format!(
        "n={}->{} same_cells={same} worst={:.3}um",
        cloud.len(),
        thinned.cloud.len(),
        worst.fold(0.0, f64::max) * 1e6
    )
}
