//! Averaging depth pictures into a volume, and its mesh: the truth of both is judged by how they agree with the pictures.

use std::path::Path;

use anyhow::Context;
use nalgebra::Matrix4;
use reconstruct::camera::Intrinsics;
use reconstruct::pose::{Pose, from_row_major};
use reconstruct::tsdf::{DepthPicture, Volume, VolumeConfig};

use crate::clock::{Bench, Times};

/// Pictures that are averaged; the first two warm up, as for the peers.
const PICTURES: usize = 8;
const PIXELS: usize = 640 * 480;

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    if !bench.wants("tsdf integrate 2mm") && !bench.wants("tsdf mesh extract") {
        return Ok(());
    }
    let depth = depth_pictures(&bench.data.join("tsdf/depth.npy"))?;
    let poses = poses(&bench.data.join("tsdf/poses.txt"))?;
    let camera = Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5);
    let mut volume = Volume::new(VolumeConfig::default());
    let mut times = Times::default();
    for (i, (depth_metres, world_from_camera)) in depth.chunks_exact(PIXELS).zip(&poses).enumerate() {
        let picture = DepthPicture { depth_metres, camera: &camera, world_from_camera };
        if i < 2 {
            volume.integrate(&picture);
        } else {
            times.add(|| volume.integrate(&picture));
        }
    }
    bench.print("tsdf integrate 2mm", &times, &format!("blocks={}", volume.blocks()));
    bench.stage("tsdf mesh extract", || volume.mesh(1.0), |mesh| format!("tris={}", mesh.triangles.len()));
    Ok(())
}

/// The first pictures of a float32 array of pictures, metres; what is no number becomes 0.
fn depth_pictures(path: &Path) -> anyhow::Result<Vec<f32>> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let header = bytes.get(8..10).context("no npy file")?;
    let start = 10 + usize::from(u16::from_le_bytes([header[0], header[1]]));
    let numbers = bytes.get(start..).context("no npy file")?.chunks_exact(4);
    let metres = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    Ok(numbers.take(PICTURES * PIXELS).map(metres).map(|z| if z.is_finite() { z } else { 0.0 }).collect())
}

fn poses(path: &Path) -> anyhow::Result<Vec<Pose>> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let pose = |n: &[f64]| {
        // saved with few digits: the nearest rotation
        let m = Matrix4::from_row_slice(n);
        let rotation = nalgebra::Rotation3::from_matrix(&m.fixed_view::<3, 3>(0, 0).into_owned());
        let mut exact = rotation.to_homogeneous();
        exact.fixed_view_mut::<3, 1>(0, 3).copy_from(&m.fixed_view::<3, 1>(0, 3));
        let row_major: Vec<f64> = exact.transpose().iter().copied().collect();
        from_row_major(&row_major.try_into().ok()?)
    };
    numbers.chunks_exact(16).map(|n| pose(n).context("a pose that is none")).collect()
}
