//! Robust kernels: how much a residual still counts once it is large. Iteratively reweighted least squares.

/// A robust kernel; the scale has the unit of the residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kernel {
    /// Plain least squares.
    LeastSquares,
    /// Huber: linear beyond the scale.
    Huber(f64),
    /// Tukey's biweight: nothing beyond the scale.
    Tukey(f64),
    /// Geman–McClure: falls with the fourth power.
    GemanMcClure(f64),
}

impl Kernel {
    /// Weight of a residual in reweighted least squares, 0 to 1.
    pub fn weight(self, residual: f64) -> f64 {
        match self {
            Self::LeastSquares => 1.0,
            Self::Huber(scale) => {
                let size = residual.abs();
                if size <= scale { 1.0 } else { scale / size }
            }
            Self::Tukey(scale) => {
                let x = residual / scale;
                if x.abs() >= 1.0 { 0.0 } else { (1.0 - x * x).powi(2) }
            }
            Self::GemanMcClure(scale) => {
                let x = residual / scale;
                1.0 / (1.0 + x * x).powi(2)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_start_at_one_and_never_grow() {
        for kernel in
            [Kernel::LeastSquares, Kernel::Huber(0.5), Kernel::Tukey(0.5), Kernel::GemanMcClure(0.5)]
        {
            assert_eq!(kernel.weight(0.0), 1.0);
            let weights: Vec<f64> = (0..50).map(|i| kernel.weight(-0.05 * f64::from(i))).collect();
            assert!(weights.windows(2).all(|w| w[1] <= w[0] && w[1] >= 0.0), "{kernel:?}");
        }
        assert_eq!(Kernel::Tukey(0.5).weight(0.6), 0.0);
        assert!((Kernel::Huber(0.5).weight(2.0) - 0.25).abs() < 1e-12);
    }
}
