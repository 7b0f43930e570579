//! Normals of scattered points (search structure included) and of an organised depth map.

use reconstruct::knn::Tree;
use reconstruct::normals::{DepthJump, Neighbourhood, Surface, estimate, normals_of_depth};
use reconstruct::voxel::downsample;

use crate::clock::Bench;
use crate::inputs::{CLOUDS, cloud};
use crate::reference::{degrees, nearest, normal, quantile, sq_dist};

/// Points whose normals are compared with the plain ones.
const JUDGED: usize = 2000;
/// Half the window of organised normals, pixels.
const WINDOW_RADIUS: usize = 5;

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    for name in CLOUDS {
        let points = downsample(&cloud(&bench.data.join(name))?, 0.002)?.cloud.points;
        for (label, around) in [("k30", Neighbourhood::Nearest(30)), ("r10mm", Neighbourhood::Radius(0.01))] {
            bench.stage(
                &format!("normals {label} (2mm) {name}"),
                || estimate(&points, &Tree::new(&points), around, &[0.0; 3]),
                |found| judge(&points, found, |i| neighbours(&points, i, around)),
            );
        }
    }
    organised(bench)
}

fn neighbours(points: &[[f32; 3]], i: usize, around: Neighbourhood) -> Vec<[f32; 3]> {
    match around {
        Neighbourhood::Nearest(k) => nearest(points, &points[i], k).iter().map(|n| points[n.0]).collect(),
        Neighbourhood::Radius(r) => {
            points.iter().copied().filter(|p| sq_dist(p, &points[i]) <= r * r).collect()
        }
    }
}

fn judge(points: &[[f32; 3]], found: &Surface, around: impl Fn(usize) -> Vec<[f32; 3]>) -> String {
    let step = (points.len() / JUDGED).max(1);
    let has_normal = |i: &usize| found.normals[*i] != [0.0; 3];
    let angles: Vec<f64> = (0..points.len())
        .step_by(step)
        .filter(has_normal)
        .map(|i| degrees(&normal(&around(i)), &found.normals[i]))
        .collect();
    let described = (0..points.len()).filter(has_normal).count();
    format!(
        "n={} with_normal={described} angle_med={:.4}deg p99={:.4}deg",
        points.len(),
        quantile(angles.clone(), 0.5),
        quantile(angles, 0.99)
    )
}

/// PCL leaves NaN where nothing was measured; our reader leaves such points out, so the pixels are read here.
fn organised(bench: &Bench) -> anyhow::Result<()> {
    const STAGE: &str = "integral-image normals 640x480";
    let (width, height) = (640, 480);
    if !bench.wants(STAGE) {
        return Ok(());
    }
    let bytes = std::fs::read(bench.data.join("tsdf/scene0_organized.pcd"))?;
    let start = bytes.len() - width * height * 12;
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let points: Vec<[f32; 3]> =
        bytes[start..].chunks_exact(12).map(|b| [float(b), float(&b[4..]), float(&b[8..])]).collect();
    let jump = DepthJump::default();
    let window = |i: usize| -> Vec<[f32; 3]> {
        let (u, v, r) = ((i % width) as isize, (i / width) as isize, WINDOW_RADIUS as isize);
        let limit = jump.metres + jump.per_square_metre * points[i][2].powi(2);
        (-r..=r)
            .flat_map(|dy| (-r..=r).map(move |dx| (u + dx, v + dy)))
            .filter(|(x, y)| (0..width as isize).contains(x) && (0..height as isize).contains(y))
            .map(|(x, y)| points[y as usize * width + x as usize])
            .filter(|q| (q[2] - points[i][2]).abs() <= limit)
            .collect()
    };
    bench.stage(
        STAGE,
        || normals_of_depth(&points, width, height, WINDOW_RADIUS, jump),
        |found| judge(&points, found, window),
    );
    Ok(())
}
