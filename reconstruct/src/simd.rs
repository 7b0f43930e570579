//! Runs a loop with the widest registers of the machine that runs it, chosen once at run time (`pulp`).
//!
//! A loop is a struct that implements [`WithSimd`]. The portable path is the same code with one lane (`pulp::Scalar`); where
//! lanes are summed, both agree to rounding, which each module's tests state and check.

//!
//! Inside such a loop everything must be inlined to see the registers: no closures around `Simd` calls, hence no `array::map`.

use pulp::{Arch, WithSimd};

/// Lanes are never wider than this many single-precision numbers; buffers are padded to multiples of it.
pub(crate) const LANES: usize = 16;

/// Runs the loop on this machine's best path.
pub(crate) fn run<Op: WithSimd>(op: Op) -> Op::Output {
    Arch::new().dispatch(op)
}
