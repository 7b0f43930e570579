//! How time grows: with the number of points, 10 thousand to a million on a bumpy sheet, 2 mm apart; and with the number of views of a whole build,
//! from pictures in memory to the model.

use reconstruct::cloud::PointCloud;
use reconstruct::knn::Tree;
use reconstruct::normals::{Neighbourhood, estimate};
use reconstruct::voxel::downsample;
use scanner::config::Config;
use scanner::pipeline;
use scanner::simulate::{Kind, ScanSpec, scan};
use scanner::ui::Ui;

use crate::clock::Bench;

/// Numbers of points.
const SIZES: [usize; 5] = [10_000, 30_000, 100_000, 300_000, 1_000_000];
const SPACING: f32 = 0.002;
/// Numbers of views.
const VIEWS: [usize; 3] = [8, 30, 60];

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    with_points(bench);
    with_views(bench)
}

fn with_views(bench: &Bench) -> anyhow::Result<()> {
    for views in VIEWS {
        let stage = format!("scaling build {views} views");
        if !bench.wants(&stage) {
            continue;
        }
        let recording = scan(&ScanSpec { views, frames: 1, ..ScanSpec::new(Kind::Camera, 1) })?;
        let build = || pipeline::build(&recording, &Config::default(), &Ui::silent());
        bench.stage(&stage, build, |built| match built {
            Ok(built) => {
                let ms = |stage: &str| built.report.timings_ms[stage].as_f64().unwrap_or_default();
                let joint = ms("align");
                let used = built.report.views.iter().filter(|v| v.used).count();
                format!("used={used} points={} joint_step={joint:.0}ms", built.report.points)
            }
            Err(error) => error.to_string(),
        });
    }
    Ok(())
}

fn with_points(bench: &Bench) {
    for size in SIZES {
        let stages =
            ["voxel5mm", "kdtree", "normals k30"].map(|name| format!("scaling {name} {}k", size / 1000));
        if !stages.iter().any(|stage| bench.wants(stage)) {
            continue;
        }
        let cloud = PointCloud { points: sheet(size), ..PointCloud::default() };
        let points = &cloud.points;
        let count = |n: &usize| format!("n={size}->{n}");
        bench.stage(&stages[0], || downsample(&cloud, 0.005).map_or(0, |d| d.cloud.len()), count);
        bench.stage(&stages[1], || Tree::new(points).len(), count);
        let normals = || estimate(points, &Tree::new(points), Neighbourhood::Nearest(30), &[0.0; 3]);
        bench.stage(&stages[2], || normals().normals.len(), count);
    }
}

/// Rows of points with a little disorder, about as a fused cloud has it.
fn sheet(count: usize) -> Vec<[f32; 3]> {
    let side = (count as f64).sqrt().ceil() as usize;
    // A fixed sequence without a library: the fractions of multiples of two irrational numbers.
    let wobble = |i: usize, step: f64| ((i as f64 * step).fract() as f32 - 0.5) * SPACING;
    (0..count)
        .map(|i| {
            let x = (i % side) as f32 * SPACING + wobble(i, 0.754_877_666);
            let y = (i / side) as f32 * SPACING + wobble(i, 0.569_840_291);
            [x, y, 0.5 + 0.01 * (40.0 * x).sin() * (30.0 * y).cos() + wobble(i, 0.618_033_989)]
        })
        .collect()
}
