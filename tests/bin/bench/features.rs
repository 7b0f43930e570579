//! Describing and matching: how fast, and how many mutual matches are right on the registration pairs.

use anyhow::Context;
use nalgebra::Point3;
use reconstruct::cloud::PointCloud;
use reconstruct::knn::Tree;
use reconstruct::normals::{Neighbourhood, estimate};
use reconstruct::pose::{Pose, from_row_major};
use reconstruct::register::fpfh::{Descriptor, describe};
use reconstruct::register::matching::{MatchConfig, match_descriptors};
use reconstruct::voxel::downsample;

use crate::clock::{Bench, Times};
use crate::inputs::{CLOUDS, cloud, numbers};
use crate::reference::quantile;

/// Radius of the features, metres.
const RADIUS: f32 = 0.025;
/// A match is right where the points meet within this, metres: as the peers' features are judged.
const RIGHT: f64 = 0.0075;
/// Pairs 45 degrees apart.
const PAIRS: usize = 64;

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    for name in CLOUDS {
        let stage = format!("fpfh r25mm (5mm) {name}");
        if bench.wants(&stage) {
            let points = downsample(&cloud(&bench.data.join(name))?, 0.005)?.cloud.points;
            let cloud = with_normals(points, Neighbourhood::Radius(0.01), &[0.0; 3]);
            let all: Vec<usize> = (0..cloud.len()).collect();
            bench.stage(
                &stage,
                || describe(&cloud, &Tree::new(&cloud.points), RADIUS, &all),
                |found| format!("n={} described={}", found.len(), described(found)),
            );
        }
    }
    pairs(bench)
}

fn described(descriptors: &[Descriptor]) -> usize {
    descriptors.iter().filter(|d| **d != [0.0; 33]).count()
}

fn with_normals(points: Vec<[f32; 3]>, around: Neighbourhood, viewpoint: &[f32; 3]) -> PointCloud {
    let normals = estimate(&points, &Tree::new(&points), around, viewpoint).normals;
    PointCloud { points, normals, ..PointCloud::default() }
}

/// Two clouds at 5 mm, where their sensors stood, and how they lie.
struct Pair {
    clouds: [Vec<[f32; 3]>; 2],
    origins: [[f32; 3]; 2],
    target_from_source: Pose,
}

impl Pair {
    fn read(bench: &Bench, k: usize) -> anyhow::Result<Self> {
        let file = |end: &str| bench.data.join(format!("pairs/p{k:03}_{end}"));
        let origin: [f64; 3] = numbers(&file("srcorigin.txt"))?;
        let truth: [f64; 16] = numbers(&file("gt.txt"))?;
        Ok(Self {
            clouds: [cloud(&file("src5.pcd"))?.points, cloud(&file("tgt5.pcd"))?.points],
            origins: [origin.map(|v| v as f32), [0.0; 3]],
            target_from_source: from_row_major(&truth).context("the truth is no pose")?,
        })
    }

    fn describe(&self) -> [(PointCloud, Vec<Descriptor>); 2] {
        std::array::from_fn(|k| {
            let points = self.clouds[k].clone();
            let tree = Tree::new(&points);
            let normals = estimate(&points, &tree, Neighbourhood::Nearest(30), &self.origins[k]).normals;
            let cloud = PointCloud { points, normals, ..PointCloud::default() };
            let all: Vec<usize> = (0..cloud.len()).collect();
            let descriptors = describe(&cloud, &tree, RADIUS, &all);
            (cloud, descriptors)
        })
    }
}

fn pairs(bench: &Bench) -> anyhow::Result<()> {
    const FEATURES: &str = "pair features (normals+fpfh x2; 5mm)";
    const MATCHING: &str = "feature matching mutual";
    if !bench.wants(FEATURES) && !bench.wants(MATCHING) {
        return Ok(());
    }
    let (mut features, mut matching) = (Times::default(), Times::default());
    let (mut right, mut all, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..PAIRS {
        let pair = Pair::read(bench, k)?;
        let [source, target] = features.add(|| pair.describe());
        let matches = matching.add(|| match_descriptors(&source.1, &target.1, MatchConfig::default()));
        let place = |p: [f32; 3]| Point3::from(p.map(f64::from));
        let good = matches.iter().filter(|[i, j]| {
            let moved = pair.target_from_source * place(source.0.points[*i]);
            (moved - place(target.0.points[*j])).norm() <= RIGHT
        });
        right.push(good.count() as f64);
        all.push(matches.len() as f64);
        sizes.push(target.0.len() as f64);
    }
    let total: f64 = right.iter().sum();
    bench.print(FEATURES, &features, &format!("pairs={PAIRS} points_med={}", quantile(sizes, 0.5)));
    bench.print(
        MATCHING,
        &matching,
        &format!(
            "pairs={PAIRS} right_total={total} right_med={} matches_med={}",
            quantile(right, 0.5),
            quantile(all, 0.5)
        ),
    );
    Ok(())
}
