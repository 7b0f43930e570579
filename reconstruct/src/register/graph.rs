//! Pose graph: the poses of all views that agree best with measured relative poses (Lu and Milios 1997; robust weights in the
//! manner of Choi, Zhou and Koltun 2015, so that a wrong link can't bend the rest).

use std::ops::AddAssign;

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use crate::pose::{Pose, exp, log};

/// A measured relative pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// View whose frame the measurement is in.
    pub target: usize,
    /// The other view.
    pub source: usize,
    /// What was measured.
    pub target_from_source: Pose,
    /// Information of a left twist `(translation, rotation)` on it.
    pub information: Matrix6<f64>,
}

/// Result of the optimisation.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimised {
    /// One pose a view.
    pub world_from_view: Vec<Pose>,
    /// Weight 0 to 1 of every edge in the end: near 0 for one that the others contradict.
    pub edge_weights: Vec<f64>,
}

/// Gauss–Newton with Geman–McClure weights from `start`; view `fixed` keeps its pose.
///
/// `scale` is the normalised error (standard deviations, of six numbers) at which an edge weighs a quarter.
pub fn optimise(start: &[Pose], edges: &[Edge], fixed: usize, scale: f64, iterations: usize) -> Optimised {
    let n = start.len();
    let mut poses = start.to_vec();
    let mut edge_weights = vec![1.0; edges.len()];
    let edges_usable = edges.iter().all(|e| e.target < n && e.source < n && e.target != e.source);
    if n == 0 || fixed >= n || !edges_usable {
        return Optimised { world_from_view: poses, edge_weights };
    }
    for _ in 0..iterations {
        let (mut hessian, mut right) = (DMatrix::zeros(6 * n, 6 * n), DVector::zeros(6 * n));
        for (edge, weight) in edges.iter().zip(&mut edge_weights) {
            let error = error(&poses, edge);
            let normalised = (error.dot(&(edge.information * error))).max(0.0).sqrt();
            *weight = 1.0 / (1.0 + (normalised / scale).powi(2)).powi(2);
            // With left steps x: e(x) = e + Ad(target_from_world) (x_source - x_target).
            let adjoint = adjoint(&poses[edge.target].inverse());
            let block = adjoint.transpose() * (edge.information * *weight);
            let (h, g) = (block * adjoint, block * error);
            let (s, t) = (6 * edge.source, 6 * edge.target);
            for (row, column, sign) in [(s, s, 1.0), (t, t, 1.0), (s, t, -1.0), (t, s, -1.0)] {
                hessian.fixed_view_mut::<6, 6>(row, column).add_assign(&(h * sign));
            }
            right.fixed_rows_mut::<6>(s).add_assign(&(-g));
            right.fixed_rows_mut::<6>(t).add_assign(&g);
        }
        let strength = hessian.diagonal().amax().max(1.0);
        for k in 0..6 * n {
            // The fixed view is held hard; views without edges by next to nothing.
            hessian[(k, k)] += if k / 6 == fixed { strength * 1e9 } else { strength * 1e-12 };
        }
        let Some(step) = hessian.cholesky().map(|c| c.solve(&right)) else { break };
        for (i, pose) in poses.iter_mut().enumerate() {
            *pose = exp(&step.fixed_rows::<6>(6 * i).into_owned()) * *pose;
            pose.rotation.renormalize();
        }
        if step.amax() < 1e-8 {
            break;
        }
    }
    Optimised { world_from_view: poses, edge_weights }
}

/// Left twist from the measured to the present relative pose, target frame.
pub fn error(world_from_view: &[Pose], edge: &Edge) -> Vector6<f64> {
    let present = world_from_view[edge.target].inverse() * world_from_view[edge.source];
    log(&(present * edge.target_from_source.inverse()))
}

/// Carries twists `(translation, rotation)` from frame b to frame a.
fn adjoint(a_from_b: &Pose) -> Matrix6<f64> {
    let rotation = a_from_b.rotation.to_rotation_matrix().into_inner();
    let mut result = Matrix6::zeros();
    result.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    result.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    result.fixed_view_mut::<3, 3>(0, 3).copy_from(&(a_from_b.translation.vector.cross_matrix() * rotation));
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed ring of views with slightly wrong steps, and one link that is plain wrong.
    fn ring(wrong: bool) -> (Vec<Pose>, Vec<Pose>, Vec<Edge>) {
        let n = 12;
        let truth: Vec<Pose> = (0..n)
            .map(|i| {
                let turn = exp(&Vector6::new(
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                    f64::from(i) * std::f64::consts::TAU / f64::from(n),
                ));
                turn * exp(&Vector6::new(0.7, 0.0, 0.4, 0.3, -0.2, 0.1))
            })
            .collect();
        let mut rng = fastrand::Rng::with_seed(2);
        let information = Matrix6::identity() * 1e6;
        let mut edges: Vec<Edge> = (0..truth.len())
            .map(|i| {
                let (target, source) = (i, (i + 1) % truth.len());
                let noise = exp(&Vector6::from_fn(|_, _| (rng.f64() - 0.5) * 0.004));
                let target_from_source = noise * truth[target].inverse() * truth[source];
                Edge { target, source, target_from_source, information }
            })
            .collect();
        if wrong {
            let target_from_source = exp(&Vector6::new(0.3, 0.1, 0.0, 0.0, 0.5, 0.0));
            edges.push(Edge { target: 2, source: 8, target_from_source, information });
        }
        let mut start = vec![truth[0]];
        for edge in &edges[..truth.len() - 1] {
            start.push(start[edge.target] * edge.target_from_source);
        }
        (truth, start, edges)
    }

    fn worst(truth: &[Pose], poses: &[Pose]) -> f64 {
        truth.iter().zip(poses).map(|(a, b)| log(&(a * b.inverse())).norm()).fold(0.0, f64::max)
    }

    #[test]
    fn closing_the_ring_spreads_the_drift() {
        let (truth, start, edges) = ring(false);
        let result = optimise(&start, &edges, 0, 1e3, 20);
        assert!(worst(&truth, &result.world_from_view) < 0.8 * worst(&truth, &start));
        assert!(log(&(result.world_from_view[0] * truth[0].inverse())).norm() < 1e-6);
        let squares = |poses: &[Pose]| edges.iter().map(|e| error(poses, e).norm_squared()).sum::<f64>();
        assert!(squares(&result.world_from_view) < squares(&start) / 3.0);
    }

    #[test]
    fn a_wrong_link_is_ignored() {
        let (truth, start, edges) = ring(true);
        let result = optimise(&start, &edges, 0, 20.0, 30);
        assert!(result.edge_weights[12] < 0.01 && result.edge_weights[..12].iter().all(|w| *w > 0.5));
        assert!(worst(&truth, &result.world_from_view) < worst(&truth, &start) + 1e-3);
    }

    #[test]
    fn links_to_nowhere_change_nothing() {
        let (_, start, mut edges) = ring(false);
        edges[0].source = 99;
        assert_eq!(optimise(&start, &edges, 0, 1.0, 5).world_from_view, start);
        assert!(optimise(&[], &[], 0, 1.0, 5).world_from_view.is_empty());
    }
}
