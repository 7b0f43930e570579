//! Anderson's mixing of a fixed-point iteration (Anderson 1965; for ICP Zhang, Yao and Deng 2021): the next place is the combination of the last
//! ones whose steps cancel best. A place where the cost grew is given up for the plain step.

use nalgebra::{DMatrix, DVector, Vector6};

/// Steps remembered.
const MEMORY: usize = 5;

pub(super) struct Anderson {
    /// Plain results and steps, newest last.
    history: Vec<(Vector6<f64>, Vector6<f64>)>,
    last_cost: f64,
    /// The newest plain result, as the caller writes places.
    pub(super) plain: Option<Vector6<f64>>,
}

impl Anderson {
    pub(super) fn new() -> Self {
        Self { history: Vec::new(), last_cost: f64::INFINITY, plain: None }
    }

    /// The plain result to go back to where mixing made the cost grow.
    pub(super) fn take_back(&mut self, cost: f64) -> Option<Vector6<f64>> {
        let worse = cost > self.last_cost && self.history.len() > 1;
        if worse {
            self.history.clear();
            self.last_cost = f64::INFINITY;
        }
        self.plain.filter(|_| worse)
    }

    /// The mixed place after a step from `before` to `after`, at whose beginning the cost was `cost`.
    pub(super) fn mix(&mut self, before: &Vector6<f64>, after: &Vector6<f64>, cost: f64) -> Vector6<f64> {
        self.last_cost = cost;
        self.history.push((*after, after - before));
        if self.history.len() > MEMORY + 1 {
            self.history.remove(0);
        }
        let steps = self.history.len() - 1;
        if steps == 0 {
            return *after;
        }
        let step = self.history[steps].1;
        let differences = DMatrix::from_fn(6, steps, |r, c| step[r] - self.history[c].1[r]);
        let right = DVector::from_fn(6, |r, _| step[r]);
        let gram = differences.transpose() * &differences;
        let scale = gram.trace().max(1e-30);
        let damped = gram + DMatrix::identity(steps, steps) * (1e-8 * scale);
        let Some(shares) = damped.cholesky().map(|c| c.solve(&(differences.transpose() * right))) else {
            return *after;
        };
        let mut mixed = *after;
        for c in 0..steps {
            mixed -= (after - self.history[c].0) * shares[c];
        }
        if mixed.iter().all(|v| v.is_finite()) { mixed } else { *after }
    }
}
