//! One more recording is found in those joined before, and all views are refined together.

use std::ops::Range;

use nalgebra::{Matrix6, Vector3, Vector6};
use reconstruct::cloud::PointCloud;
use reconstruct::consistency::agreement;
use reconstruct::fuse;
use reconstruct::knn::Tree;
use reconstruct::pose::{self, Pose};
use reconstruct::refine::{Anchor, PosePrior, RefineConfig, RefineView, refine};
use reconstruct::register::flip::{self, FlipConfig, Found, Side};
use reconstruct::report::{LeftOut, half_contradict};
use reconstruct::view::DepthView;

use super::super::align::take_poses;
use super::super::load::Work;
use super::{Merged, described, words};
use crate::config::Config;

/// Rounds in which a recording as a whole moves after its views.
const ROUNDS: usize = 3;
/// The whole counts as settled when it moves less, metres and radians.
const SETTLED: f64 = 2e-5;
/// No view is known better than this in its recording, metres and radians.
const LEAST_SD: [f64; 2] = [0.0002, 0.0003];
/// Views of two recordings look at each other from far apart, so each is tied to more others.
const NEIGHBOURS: usize = 10;
/// Pixels up to this height above a board may be the board's noise, metres.
const LOW: f32 = 0.006;
/// Low pixels farther from the fused cloud are, metres.
const OF_PRODUCT: f32 = 0.0025;
/// Two recordings in which "up" differs by less (cosine) show the product standing on the same side.
const SAME_UP: f64 = 0.97;

impl Merged {
    /// Joins a recording, or says in the scan's failure why that cannot be done.
    pub(super) fn join(&mut self, mut next: Work, number: usize, config: &Config) {
        let mut recording = described(&next, number);
        let range = self.scan.views.len()..self.scan.views.len() + next.views.len();
        self.scan.warnings.append(&mut next.warnings);
        let failure = self.scan.failure.take().or_else(|| next.failure.take());
        let found = match failure {
            Some(why) => Err(why),
            None => self.find(&mut next, number, config),
        };
        let upright = self.scan.views.len();
        self.scan.views.append(&mut next.views);
        self.sessions.push(range.clone());
        match found {
            Ok(found) => {
                move_views(&mut self.scan, range, &found.a_from_b);
                let same_side = (found.a_from_b.rotation * Vector3::z()).z > SAME_UP;
                if same_side {
                    self.scan.warnings.push(words::same_side(number));
                }
                self.turned |= !same_side;
                // Every recording's board was compared with its own views before.
                let boards =
                    [self.scan.joint, next.joint].into_iter().flatten().map(|j| j.board_samples).sum();
                let moved = self.refine_all(&found, boards, config);
                recording = recording.joined(&found, &(moved * found.a_from_b));
                self.check_what_is_left(number);
            }
            Err(why) => {
                self.scan.views[upright..].iter_mut().for_each(|v| v.world_from_camera = None);
                self.scan.failure = Some(why);
            }
        }
        self.recordings.push(recording);
    }

    /// Looks for the recording's product in what is joined so far.
    fn find(&mut self, next: &mut Work, number: usize, config: &Config) -> Result<Found, String> {
        let cloud = fuse::fuse(&next.placed_views(), &config.fuse).cloud;
        drop_board_noise(next, 0..next.views.len(), &cloud);
        let known = fuse::fuse(&self.scan.placed_views(), &self.fuse_config(config)).cloud;
        if self.sessions.len() == 1 {
            let all = 0..self.scan.views.len();
            drop_board_noise(&mut self.scan, all, &known);
        }
        let (views_a, views_b) = (self.scan.placed_views(), next.placed_views());
        let (a, b) = (Side { cloud: &known, views: &views_a }, Side { cloud: &cloud, views: &views_b });
        flip::place(&a, &b, &FlipConfig::default()).map_err(|apart| words::refusal(&apart, number, next))
    }

    /// Refines all views of all recordings, the last recording as a whole too; gives how that one moved.
    fn refine_all(&mut self, found: &Found, board_samples: usize, config: &Config) -> Pose {
        let mut moved = Pose::identity();
        let settings = RefineConfig { neighbours: config.refine.neighbours.max(NEIGHBOURS), ..config.refine };
        let last = self.sessions.last().cloned().unwrap_or_default();
        for round in 0.. {
            let used = used_views(&self.scan);
            let geometry: Vec<&DepthView> =
                used.iter().filter_map(|&i| self.scan.views[i].geometry.as_ref()).collect();
            let priors: Vec<PosePrior> =
                used.iter().filter_map(|&i| self.scan.views[i].prior.clone()).collect();
            let views: Vec<RefineView<'_>> = geometry
                .iter()
                .zip(&priors)
                .map(|(geometry, prior)| RefineView {
                    geometry,
                    luminance: None,
                    start: prior.world_from_camera,
                    anchor: Anchor::Prior(prior),
                    board: &[],
                })
                .collect();
            let refined = refine(&views, None, &settings);
            let step = common_step(&used, &last, &priors, &refined.world_from_camera);
            let step = found.weak.held_part(&step);
            if round + 1 < ROUNDS && step.amax() > SETTLED {
                let step = pose::exp(&step);
                moved = step * moved;
                for view in &mut self.scan.views[last.clone()] {
                    view.prior.iter_mut().for_each(|p| p.world_from_camera = step * p.world_from_camera);
                }
                continue;
            }
            let agreement = agreement(&geometry, &refined.world_from_camera, &config.consistency);
            for (k, &i) in used.iter().enumerate() {
                self.scan.views[i].fit = Some(agreement.views[k]);
            }
            take_poses(&mut self.scan, &used, &refined, board_samples);
            let outsiders = agreement.outsiders(&config.consistency);
            if outsiders.is_empty() {
                break;
            }
            for outsider in outsiders {
                let conflict = outsider.conflict;
                self.scan.views[used[outsider.view]].leave_out(LeftOut::DoesNotFit { conflict });
            }
        }
        moved
    }

    /// Where joining cost a recording half of its views or more, the recordings do not belong together.
    fn check_what_is_left(&mut self, number: usize) {
        for session in &self.sessions {
            let views = &self.scan.views[session.clone()];
            if half_contradict(views.iter().map(|v| v.left_out.as_ref())) {
                self.scan.failure = Some(words::do_not_fit(number));
            }
        }
    }
}

/// Holds every view where its own board and its recording's other views put it.
pub(super) fn hold_views(scan: &mut Work) {
    for view in scan.views.iter_mut().filter(|v| v.is_used()) {
        let Some(world_from_camera) = view.world_from_camera else { continue };
        let (place, turn) = view.pose_sd.unwrap_or_default();
        let (place, turn) = (place.max(LEAST_SD[0]), turn.max(LEAST_SD[1]));
        let sd = Vector6::new(place, place, place, turn, turn, turn);
        let information = Matrix6::from_diagonal(&sd.map(|sd| 1.0 / (sd * sd)));
        view.prior = Some(PosePrior { world_from_camera, information });
    }
}

fn used_views(scan: &Work) -> Vec<usize> {
    let usable = |i: &usize| {
        let v = &scan.views[*i];
        v.is_used() && v.geometry.is_some() && v.prior.is_some()
    };
    (0..scan.views.len()).filter(usable).collect()
}

/// Carries a recording's views from its own board into the world.
fn move_views(scan: &mut Work, range: Range<usize>, a_from_b: &Pose) {
    for view in &mut scan.views[range] {
        view.world_from_camera = view.world_from_camera.map(|p| a_from_b * p);
        view.prior = view.prior.take().map(|prior| prior.moved(a_from_b));
    }
}

/// By how much the views of one recording moved in common, each weighed by what its markers know.
fn common_step(used: &[usize], session: &Range<usize>, priors: &[PosePrior], poses: &[Pose]) -> Vector6<f64> {
    let (mut information, mut sum) = (Matrix6::zeros(), Vector6::zeros());
    for (k, _) in used.iter().enumerate().filter(|(_, i)| session.contains(i)) {
        let off = pose::log(&(poses[k] * priors[k].world_from_camera.inverse()));
        information += priors[k].information;
        sum += priors[k].information * off;
    }
    information.cholesky().map_or_else(Vector6::zeros, |c| c.solve(&sum))
}

/// Takes from the product what lies low over a recording's own board and is not in its fused cloud: the board's noise, which
/// nothing tells from the product once the recording lies elsewhere.
fn drop_board_noise(scan: &mut Work, range: Range<usize>, cloud: &PointCloud) {
    let tree = Tree::new(&cloud.points);
    for view in &mut scan.views[range] {
        let (Some(geometry), Some(pose)) = (view.geometry.as_mut(), view.world_from_camera) else { continue };
        let pose = pose.cast::<f32>();
        for i in 0..geometry.points.len() {
            if !geometry.mask[i] {
                continue;
            }
            let p = pose * nalgebra::Point3::from(geometry.points[i]);
            if p.z < LOW && tree.nearest_within(&p.into(), OF_PRODUCT).is_none() {
                geometry.mask[i] = false;
            }
        }
    }
}
