use nalgebra::{Point3, Vector3, Vector6};

use super::super::fine::tests::seen_from;
use super::*;
use crate::knn::Tree;
use crate::normals::{Neighbourhood, estimate};
use crate::pose::exp;

struct View {
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    sensor: [f32; 3],
}

impl View {
    fn new(sensor: Vector3<f64>, frame_from_lump: &Pose, seed: u64) -> Self {
        let (points, sensor) = seen_from(&sensor, frame_from_lump, 0.005, seed);
        let tree = Tree::new(&points);
        let normals = estimate(&points, &tree, Neighbourhood::Radius(0.0125), &sensor).normals;
        Self { points, normals, sensor }
    }

    fn seen(&self) -> Seen<'_> {
        Seen { points: &self.points, normals: &self.normals, sensor: self.sensor }
    }
}

fn pair() -> (View, View, Pose) {
    let truth = exp(&Vector6::new(0.3, -0.2, 0.1, 0.9, -1.3, 0.4));
    let target = View::new(Vector3::new(0.0, 0.1, 0.8), &Pose::identity(), 1);
    let source = View::new(Vector3::new(0.56, 0.1, 0.56), &truth.inverse(), 2);
    (source, target, truth)
}

/// Some right matches, by nearness at `truth`, among many that mean nothing.
fn matches(source: &View, target: &View, truth: &Pose, right: usize, wrong: usize) -> Vec<Match> {
    let mut rng = fastrand::Rng::with_seed(8);
    let tree = Tree::new(&target.points);
    let mut found = Vec::new();
    while found.len() < right {
        let i = rng.usize(0..source.points.len());
        let p = truth * Point3::from(source.points[i].map(f64::from));
        if let Some(near) = tree.nearest_within(&p.map(|v| v as f32).into(), 0.005) {
            found.push([i, near.index]);
        }
    }
    for _ in 0..wrong {
        found.push([rng.usize(0..source.points.len()), rng.usize(0..target.points.len())]);
    }
    found
}

#[test]
fn few_right_matches_among_many_wrong_ones_are_enough_and_known_to_be() {
    let (source, target, truth) = pair();
    let matches = matches(&source, &target, &truth, 12, 200);
    for beside in [Beside::Empty, Beside::Unknown] {
        let config = PairwiseConfig { beside, ..PairwiseConfig::default() };
        let found = place(&source.seen(), &target.seen(), &matches, &config).unwrap();
        let turned = found.target_from_source.rotation.angle_to(&truth.rotation).to_degrees();
        assert!(turned < 1.5, "{turned} {found:?}");
        assert!(found.good, "{found:?}");
        // A placement next to it is worse, and is not believed.
        let off = exp(&Vector6::new(0.0, 0.03, 0.0, 0.0, 0.0, 0.3)) * truth;
        let [there, away] = [&truth, &off].map(|p| judge_at(&source.seen(), &target.seen(), p, &config));
        assert!(there.score > away.score + 0.1, "{there:?} {away:?}");
    }
}

#[test]
fn nothing_but_wrong_matches_is_not_called_good() {
    let (source, target, truth) = pair();
    let matches = matches(&source, &target, &truth, 0, 300);
    if let Some(found) = place(&source.seen(), &target.seen(), &matches, &PairwiseConfig::default()) {
        let turned = found.target_from_source.rotation.angle_to(&truth.rotation).to_degrees();
        assert!(!found.good || turned < 2.0, "{turned} {found:?}");
    }
}

#[test]
fn threads_change_nothing() {
    let (source, target, truth) = pair();
    let matches = matches(&source, &target, &truth, 12, 200);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| place(&source.seen(), &target.seen(), &matches, &PairwiseConfig::default()).unwrap())
    });
    assert_eq!(one, three);
}

#[test]
fn without_matches_or_points_there_is_no_placement() {
    let (source, target, _) = pair();
    let config = PairwiseConfig::default();
    assert!(place(&source.seen(), &target.seen(), &[], &config).is_none());
    assert!(place(&source.seen(), &target.seen(), &[[9_999_999, 0], [0, 9_999_999]], &config).is_none());
    let nothing = Seen { points: &[], normals: &[], sensor: [0.0; 3] };
    assert!(place(&nothing, &nothing, &[[0, 0], [1, 1]], &config).is_none());
    let config = PairwiseConfig { cell: f32::NAN, ..config };
    assert!(place(&source.seen(), &target.seen(), &[[0, 0], [1, 1]], &config).is_none());
}
