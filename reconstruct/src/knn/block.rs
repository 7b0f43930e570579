//! All points in a box as plain columns: what the neighbours of a whole leaf are searched in at once.

use super::Tree;
use crate::simd::LANES;

/// Points in a box in the order of the tree, padded with infinitely far ones to whole registers.
#[derive(Debug, Default)]
pub(crate) struct Block {
    pub(crate) axes: [Vec<f32>; 3],
    /// Places in the order of the tree; not padded.
    pub(crate) slots: Vec<u32>,
}

impl Tree {
    /// Places of each leaf's points in the order of the tree.
    pub(crate) fn leaves(&self) -> Vec<std::ops::Range<usize>> {
        let leaves = self.nodes.iter().filter(|node| node.second == 0);
        leaves.map(|node| node.first as usize..node.end as usize).collect()
    }

    /// Coordinates of the point at a place in the order of the tree.
    #[inline]
    pub(crate) fn point(&self, slot: usize) -> [f32; 3] {
        self.at(slot)
    }

    /// Indices of the points in the order of the tree.
    pub(crate) fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// Fills a block with the points in the box around some places, widened by `reach` metres on every side.
    pub(crate) fn gather(&self, slots: &[u32], reach: f32, block: &mut Block) {
        self.gather_around(slots.iter().map(|&slot| self.at(slot as usize)), reach, block);
    }

    /// The same around places that need not be points of the tree.
    pub(crate) fn gather_around(
        &self,
        places: impl Iterator<Item = [f32; 3]>,
        reach: f32,
        block: &mut Block,
    ) {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in places {
            for k in 0..3 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        // A little more than asked for: rounding must not lose what lies just at the reach.
        let reach = reach * 1.000_001;
        let (low, high) = (low.map(|v| v - reach), high.map(|v| v + reach));
        let Block { axes: [xs, ys, zs], slots } = block;
        for axis in [&mut *xs, &mut *ys, &mut *zs] {
            axis.clear();
        }
        slots.clear();
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            let apart = (0..3).any(|k| node.high[k] < low[k] || node.low[k] > high[k]);
            let inside = (0..3).all(|k| node.low[k] >= low[k] && node.high[k] <= high[k]);
            if !apart && (inside || node.second == 0) {
                let range = node.first as usize..node.end as usize;
                let [x, y, z] = self.axes.each_ref().map(|axis| &axis[range.clone()]);
                if inside {
                    xs.extend_from_slice(x);
                    ys.extend_from_slice(y);
                    zs.extend_from_slice(z);
                    slots.extend(node.first..node.end);
                } else {
                    let before = slots.len();
                    for axis in [&mut *xs, &mut *ys, &mut *zs] {
                        axis.resize(before + x.len(), 0.0);
                    }
                    slots.resize(before + x.len(), 0);
                    let mut end = before;
                    for (slot, ((&x, &y), &z)) in (node.first..).zip(x.iter().zip(y).zip(z)) {
                        (xs[end], ys[end], zs[end], slots[end]) = (x, y, z, slot);
                        end += usize::from(is_within(&[x, y, z], &low, &high));
                    }
                    for axis in [&mut *xs, &mut *ys, &mut *zs] {
                        axis.truncate(end);
                    }
                    slots.truncate(end);
                }
            }
            at = if apart || inside { node.after as usize } else { at + 1 };
        }
        let padded = slots.len().next_multiple_of(LANES);
        for axis in [xs, ys, zs] {
            axis.resize(padded, f32::INFINITY);
        }
    }
}

#[inline]
#[expect(clippy::needless_bitwise_bool, reason = "six branches would cost more than six comparisons")]
fn is_within(p: &[f32; 3], low: &[f32; 3], high: &[f32; 3]) -> bool {
    let along = |k: usize| (p[k] >= low[k]) & (p[k] <= high[k]);
    along(0) & along(1) & along(2)
}
