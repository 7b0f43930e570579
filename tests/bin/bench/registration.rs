//! Global and fine registration of the pairs; fine with every cost and acceleration on the same pairs.

use reconstruct::cloud::PointCloud;
use reconstruct::knn::Tree;
use reconstruct::normals::{Neighbourhood, estimate};
use reconstruct::register::fine::{Acceleration, Cost, FineConfig, register_fine};
use reconstruct::register::fpfh::{Descriptor, describe};
use reconstruct::register::matching::{MatchConfig, match_descriptors};
use reconstruct::register::pairwise::{Beside, PairwiseConfig, Seen, place};
use reconstruct::register::surfel::Surfels;

use crate::clock::{Bench, Times};
use crate::pairs::{APART, Errors, Pair};
use crate::reference::quantile;

/// Surroundings of a surfel and of a normal, reach of a feature, metres.
const SURFEL: f32 = 0.007;
const NORMAL: f32 = 0.0125;
const FEATURE: f32 = 0.025;

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    fine(bench)?;
    for (angle, pairs) in APART {
        for (beside, known) in [(Beside::Empty, "cut out"), (Beside::Unknown, "partial")] {
            let stage = format!("global verified {angle}deg {known}");
            if bench.wants(&stage) {
                let pairs = pairs.clone().map(|k| Pair::read(bench, k, 5)).collect::<Result<Vec<_>, _>>()?;
                global(bench, &stage, &pairs, beside);
            }
        }
    }
    Ok(())
}

fn global(bench: &Bench, stage: &str, pairs: &[Pair], beside: Beside) {
    let config = PairwiseConfig { beside, ..PairwiseConfig::default() };
    let (mut times, mut errors) = (Times::default(), Errors::default());
    let (mut good, mut wrong_but_good) = (0, 0);
    for pair in pairs {
        let [source, target] = [0, 1].map(|k| described(&pair.clouds[k], &pair.sensors[k]));
        let matches = match_descriptors(&source.1, &target.1, MatchConfig::default());
        let seen = |k: usize, cloud: &PointCloud| (cloud.clone(), pair.sensors[k]);
        let views = [seen(0, &source.0), seen(1, &target.0)];
        let [a, b] = views.each_ref().map(|(cloud, sensor)| Seen {
            points: &cloud.points,
            normals: &cloud.normals,
            sensor: *sensor,
        });
        let found = times.add(|| place(&a, &b, &matches, &config));
        let right = errors.add(found.as_ref().map(|f| pair.error(&f.target_from_source)));
        let said = found.is_some_and(|f| f.good);
        good += usize::from(right && said);
        wrong_but_good += usize::from(!right && said);
    }
    bench.print(stage, &times, &format!("{errors} said_good={good} wrong_said_good={wrong_but_good}"));
}

fn described(points: &[[f32; 3]], sensor: &[f32; 3]) -> (PointCloud, Vec<Descriptor>) {
    let tree = Tree::new(points);
    let normals = estimate(points, &tree, Neighbourhood::Radius(NORMAL), sensor).normals;
    let cloud = PointCloud { points: points.to_vec(), normals, ..PointCloud::default() };
    let all: Vec<usize> = (0..cloud.len()).collect();
    let descriptors = describe(&cloud, &tree, FEATURE, &all);
    (cloud, descriptors)
}

/// Every cost and acceleration from the same starts; what the library takes by itself comes last.
fn fine(bench: &Bench) -> anyhow::Result<()> {
    const PREPARE: &str = "pair surfels x2 (2mm)";
    let costs = [
        (Cost::PointToPoint, "icp point-to-point (2mm)"),
        (Cost::PointToPlane, "icp point-to-plane (2mm)"),
        (Cost::PlaneToPlane, "gicp (2mm; incl cov)"),
        (Cost::Symmetric, "icp symmetric (2mm)"),
    ];
    let accelerations = [
        (Acceleration::None, ""),
        (Acceleration::BeslMcKay, " + extrapolation"),
        (Acceleration::Anderson, " + anderson m=5"),
    ];
    if !bench.wants(PREPARE) && !costs.iter().any(|(_, stage)| bench.wants(stage)) {
        return Ok(());
    }
    let pairs = APART[0].1.clone().map(|k| Pair::read(bench, k, 2)).collect::<Result<Vec<_>, _>>()?;
    let mut prepare = Times::default();
    let views: Vec<[Surfels; 2]> = pairs
        .iter()
        .map(|pair| prepare.add(|| [0, 1].map(|k| Surfels::new(&pair.clouds[k], &pair.sensors[k], SURFEL))))
        .collect();
    bench.print(PREPARE, &prepare, &format!("pairs={}", pairs.len()));
    for (cost, name) in costs {
        for (acceleration, with) in accelerations {
            let stage = format!("{name}{with}");
            if bench.wants(&stage) {
                let config = FineConfig { cost, acceleration, ..FineConfig::default() };
                follow(bench, &stage, &pairs, &views, &config);
            }
            let one = format!("one round: {name}{with}");
            if bench.wants(&one) {
                follow(bench, &one, &pairs, &views, &in_one_round(cost, acceleration));
            }
        }
    }
    Ok(())
}

/// As the peers are run: all points, pairs up to 10 mm apart, no robust kernel, at most 50 iterations.
fn in_one_round(cost: Cost, acceleration: Acceleration) -> FineConfig {
    use reconstruct::register::fine::Round;
    use reconstruct::register::kernel::Kernel;
    let round = Round {
        reach: 0.01,
        cell: 0.003,
        stride: 1,
        thin_target: 1,
        kernel: Kernel::LeastSquares,
        iterations: 50,
        tolerance: 1e-5,
    };
    FineConfig { cost, acceleration, rounds: vec![round], ..FineConfig::default() }
}

fn follow(bench: &Bench, stage: &str, pairs: &[Pair], views: &[[Surfels; 2]], config: &FineConfig) {
    let (mut times, mut errors, mut iterations) = (Times::default(), Errors::default(), Vec::new());
    for (pair, [source, target]) in pairs.iter().zip(views) {
        let found = times.add(|| register_fine(source, target, &pair.start, config));
        iterations.extend(found.as_ref().map(|f| f.iterations as f64));
        errors.add(found.map(|f| pair.error(&f.target_from_source)));
    }
    bench.print(stage, &times, &format!("{errors} iterations_med={}", quantile(iterations, 0.5)));
}
