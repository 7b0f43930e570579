//! Runs a loop with the widest registers of the machine that runs it, chosen once at run time (`pulp`).
//!
//! A loop is a struct that implements [`WithSimd`]: with AVX-512, with AVX2, or portable with one lane (`pulp::Scalar`), the same
//! code. Where lanes are summed, the paths agree to rounding, which each module's tests state and check.

//!
//! Inside such a loop everything must be inlined to see the registers: no closures around `Simd` calls, hence no `array::map`.

use pulp::{Arch, WithSimd};

/// Lanes are never wider than this many single-precision numbers; buffers are padded to multiples of it.
pub(crate) const LANES: usize = 16;

/// Runs the loop on this machine's best path.
pub(crate) fn run<Op: WithSimd>(op: Op) -> Op::Output {
    Arch::new().dispatch(op)
}

/// What the loop gives on the portable path first, then on every other that this machine has.
#[cfg(test)]
pub(crate) fn on_every_path<Op: WithSimd>(op: impl Fn() -> Op) -> Vec<Op::Output> {
    let mut outputs = vec![op().with_simd(pulp::Scalar), run(op())];
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        outputs.push(pulp::Simd::vectorize(avx2, op()));
    }
    outputs
}
