//! The normal equations: six unknowns a view (left step on `world_from_camera`, world frame), then one set of depth
//! coefficients for all views where those are free.

use nalgebra::{DMatrix, DVector};

use crate::calibrate::TERMS;

/// Unknowns of a view's own residuals: its pose, the depth.
const OF_VIEW: usize = 6 + TERMS;
/// Unknowns of a pair's residuals: source, target, the depth; one more makes whole registers.
pub(super) const OF_PAIR: usize = 12 + TERMS + 1;

/// Sums of one view's own residuals.
pub(super) type ViewBlock = Block<OF_VIEW>;
/// Sums of a pair's residuals.
pub(super) type PairBlock = Block<OF_PAIR>;

/// `J^T W J` (by rows) and `-J^T W r` of some residuals.
#[derive(Debug, Clone)]
pub(super) struct Block<const N: usize> {
    pub(super) rows: [[f64; N]; N],
    pub(super) right: [f64; N],
}

/// Derivative of a residual of one view.
pub(super) struct Row {
    pub(super) by_pose: [f64; 6],
    pub(super) by_depth: [f64; TERMS],
}

impl Row {
    pub(super) fn flat(&self) -> [f64; OF_VIEW] {
        std::array::from_fn(|i| if i < 6 { self.by_pose[i] } else { self.by_depth[i - 6] })
    }
}

impl<const N: usize> Block<N> {
    pub(super) fn zero() -> Self {
        Self { rows: [[0.0; N]; N], right: [0.0; N] }
    }

    /// Adds one residual with its derivative.
    pub(super) fn add(&mut self, row: &[f64; N], residual: f64, weight: f64) {
        for (i, sums) in self.rows.iter_mut().enumerate() {
            let factor = weight * row[i];
            self.right[i] -= factor * residual;
            // Whole rows, though half would do: fixed lengths run in registers.
            for (sum, other) in sums.iter_mut().zip(row) {
                *sum += factor * other;
            }
        }
    }

    pub(super) fn scale(&mut self, factor: f64) {
        self.rows.iter_mut().flatten().chain(&mut self.right).for_each(|v| *v *= factor);
    }

    pub(super) fn join(&mut self, other: &Self) {
        let all = self.rows.iter_mut().flatten().zip(other.rows.iter().flatten());
        all.for_each(|(a, b)| *a += b);
        self.right.iter_mut().zip(&other.right).for_each(|(a, b)| *a += b);
    }

    /// The 6x6 block of the unknowns from `at` on.
    pub(super) fn square(&self, at: usize) -> nalgebra::Matrix6<f64> {
        nalgebra::Matrix6::from_fn(|i, j| self.rows[at + i][at + j])
    }
}

/// The whole system.
pub(super) struct System {
    views: usize,
    depth_is_free: bool,
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl System {
    pub(super) fn new(views: usize, depth_is_free: bool) -> Self {
        let n = 6 * views + if depth_is_free { TERMS } else { 0 };
        Self { views, depth_is_free, normal: DMatrix::zeros(n, n), right: DVector::zeros(n) }
    }

    /// Adds a view's block.
    pub(super) fn add_view(&mut self, view: usize, block: &ViewBlock) {
        self.add(block, &[(0, 6 * view, 6), (6, 6 * self.views, TERMS)]);
    }

    /// Adds a pair's block.
    pub(super) fn add_pair(&mut self, (source, target): (usize, usize), block: &PairBlock) {
        self.add(block, &[(0, 6 * source, 6), (6, 6 * target, 6), (12, 6 * self.views, TERMS)]);
    }

    /// Adds what holds a view's pose.
    pub(super) fn add_anchor(
        &mut self,
        view: usize,
        (normal, right): &(nalgebra::Matrix6<f64>, nalgebra::Vector6<f64>),
    ) {
        let mut square = self.normal.fixed_view_mut::<6, 6>(6 * view, 6 * view);
        square += normal;
        let mut rows = self.right.fixed_rows_mut::<6>(6 * view);
        rows += right;
    }

    /// Adds the prior of the depth coefficients: how far they are from where they are expected, and how far they may be.
    pub(super) fn add_depth_prior(&mut self, off: &[f64; TERMS], standard_deviations: &[f64; TERMS]) {
        for k in 0..TERMS {
            let (at, information) = (6 * self.views + k, standard_deviations[k].powi(-2));
            self.normal[(at, at)] += information;
            self.right[at] -= information * off[k];
        }
    }

    /// `parts`: (first in the block, first in the system, how many).
    fn add<const N: usize>(&mut self, block: &Block<N>, parts: &[(usize, usize, usize)]) {
        let parts = if self.depth_is_free { parts } else { &parts[..parts.len() - 1] };
        for &(bi, si, ni) in parts {
            for i in 0..ni {
                self.right[si + i] += block.right[bi + i];
                for &(bj, sj, nj) in parts {
                    for j in 0..nj {
                        self.normal[(si + i, sj + j)] += block.rows[bi + i][bj + j];
                    }
                }
            }
        }
    }

    /// The step of least cost; `None` where the equations do not determine it.
    pub(super) fn solve(&self) -> Option<DVector<f64>> {
        Some(self.normal.clone().cholesky()?.solve(&self.right))
    }

    /// The covariance of all unknowns.
    pub(super) fn covariance(self) -> Option<DMatrix<f64>> {
        Some(self.normal.cholesky()?.inverse())
    }
}
