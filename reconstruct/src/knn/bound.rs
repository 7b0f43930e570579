//! The nearest of a block without sorting it: a squared distance within which there are as many as wanted is found by counting.

use pulp::Simd;
use pulp::bytemuck::cast_slice;

use super::{Block, Tree};

/// Steps of the search for a bounding distance before the candidates left are sorted.
const STEPS: usize = 12;

impl Tree {
    /// Index of a block's point.
    pub(crate) fn index_in(&self, block: &Block, at: usize) -> u32 {
        block.slots.get(at).map_or(u32::MAX, |&slot| self.indices[slot as usize])
    }

    /// Radius of the disc that holds `count` points where they lie as dense as in the leaf.
    pub(crate) fn likely_reach(&self, leaf: &std::ops::Range<usize>, count: usize) -> f32 {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for slot in leaf.clone() {
            let p = self.point(slot);
            for k in 0..3 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        let mut sides: [f32; 3] = std::array::from_fn(|k| high[k] - low[k]);
        sides.sort_by(f32::total_cmp);
        let area = sides[2] * sides[1].max(0.1 * sides[2]);
        let reach = (area / leaf.len() as f32 * count as f32 / std::f32::consts::PI).sqrt() * 1.3;
        if reach.is_finite() { reach.max(f32::MIN_POSITIVE) } else { f32::MAX }
    }
}

/// The next reach to try where only `fewest` were found: on a surface their number grows with its square.
pub(crate) fn larger_reach(reach: f32, count: usize, fewest: usize) -> f32 {
    let growth = (count as f32 / fewest.max(1) as f32).sqrt() * 1.1;
    (reach * growth.clamp(1.3, 4.0)).clamp(f32::MIN_POSITIVE, f32::MAX)
}

/// Squared distances of a block's points.
#[inline(always)]
pub(crate) fn distances<S: Simd>(simd: S, block: &Block, p: &[f32; 3], out: &mut Vec<f32>) {
    let [xs, ys, zs] = &block.axes;
    out.resize(xs.len(), 0.0);
    let (xs, ys, zs) = (S::as_simd_f32s(xs).0, S::as_simd_f32s(ys).0, S::as_simd_f32s(zs).0);
    let (px, py, pz) = (simd.splat_f32s(p[0]), simd.splat_f32s(p[1]), simd.splat_f32s(p[2]));
    let out = S::as_mut_simd_f32s(out).0;
    for (((&x, &y), &z), out) in xs.iter().zip(ys).zip(zs).zip(out) {
        let (x, y, z) = (simd.sub_f32s(x, px), simd.sub_f32s(y, py), simd.sub_f32s(z, pz));
        // Not fused: equal to what everyone else computes.
        let xy = simd.add_f32s(simd.mul_f32s(x, x), simd.mul_f32s(y, y));
        *out = simd.add_f32s(xy, simd.mul_f32s(z, z));
    }
}

/// How many are not above a limit.
#[inline(always)]
fn count_within<S: Simd>(simd: S, sq_dists: &[f32], limit: f32) -> usize {
    let (limit, one, zero) = (simd.splat_f32s(limit), simd.splat_u32s(1), simd.splat_u32s(0));
    let mut counts = zero;
    for &d in S::as_simd_f32s(sq_dists).0 {
        let within = simd.less_than_or_equal_f32s(d, limit);
        counts = simd.add_u32s(counts, simd.select_u32s(within, one, zero));
    }
    let lanes: &[u32] = cast_slice(std::slice::from_ref(&counts));
    lanes.iter().sum::<u32>() as usize
}

/// A squared distance within which exactly `count` points lie; how many lie within `limit` where those are too few. Of points as far
/// as the last one, those with the highest index are moved away.
#[inline(always)]
pub(crate) fn bound<S: Simd>(
    simd: S,
    sq_dists: &mut [f32],
    count: usize,
    likely: f32,
    limit: f32,
    index: impl Fn(usize) -> u32,
) -> Result<f32, usize> {
    let (mut low, mut below) = (0.0f32, 0);
    // Above the limit nothing is known; it is asked for only when the search comes there.
    let (mut high, mut above) = (limit, None);
    let mut middle = likely;
    for step in 0..STEPS {
        if !(middle > low && middle < high) {
            middle = if above.is_none() { limit } else { 0.5 * (low + high) };
        }
        let found = count_within(simd, sq_dists, middle);
        match found.cmp(&count) {
            std::cmp::Ordering::Equal => return Ok(middle),
            std::cmp::Ordering::Less if middle >= limit => return Err(found),
            std::cmp::Ordering::Less => (low, below) = (middle, found),
            std::cmp::Ordering::Greater => (high, above) = (middle, Some(found)),
        }
        // The number grows about evenly with the square of the distance; now and then a halving against slow progress.
        middle = match above {
            None => (low * count as f32 / below.max(1) as f32 * 1.05).min(limit),
            Some(above) => {
                let share = (count - below) as f32 / (above - below) as f32;
                low + (high - low) * if step % 4 == 3 { 0.5 } else { share }
            }
        };
    }
    if above.is_none() {
        let found = count_within(simd, sq_dists, limit);
        if found <= count {
            return if found == count { Ok(limit) } else { Err(found) };
        }
    }
    Ok(sorted_bound(sq_dists, count, high, index))
}

#[cold]
fn sorted_bound(sq_dists: &mut [f32], count: usize, high: f32, index: impl Fn(usize) -> u32) -> f32 {
    let mut near: Vec<(f32, u32, usize)> =
        sq_dists.iter().enumerate().filter(|(_, d)| **d <= high).map(|(at, &d)| (d, index(at), at)).collect();
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let bound = near[count - 1].0;
    for (_, _, at) in near[count..].iter().take_while(|(d, ..)| *d == bound) {
        sq_dists[*at] = f32::INFINITY;
    }
    bound
}
