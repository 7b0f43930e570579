//! Which samples touch which solved bricks.

use super::level::Level;

/// Samples of each brick, in their order.
pub(super) struct Touches {
    /// End of each brick's part; it begins where the one before ends.
    ends: Vec<u32>,
    samples: Vec<u32>,
}

impl Touches {
    /// `reach(i)`: lowest and highest corner that sample i touches; `None` for none.
    pub(super) fn new(
        level: &Level,
        samples: usize,
        reach: impl Fn(usize) -> Option<([i32; 3], [i32; 3])>,
    ) -> Self {
        let mut ends = vec![0u32; level.solved];
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(2 * samples);
        for i in 0..samples {
            let Some((low, high)) = reach(i) else { continue };
            for z in low[2] >> 3..=high[2] >> 3 {
                for y in low[1] >> 3..=high[1] >> 3 {
                    for x in low[0] >> 3..=high[0] >> 3 {
                        if let Some(slot) = level.slot([x, y, z]).filter(|&slot| slot < level.solved) {
                            ends[slot] += 1;
                            pairs.push((slot as u32, i as u32));
                        }
                    }
                }
            }
        }
        let mut before = 0;
        for end in &mut ends {
            before += std::mem::replace(end, before);
        }
        let mut list = vec![0; pairs.len()];
        for (slot, i) in pairs {
            let to = &mut ends[slot as usize];
            list[*to as usize] = i;
            *to += 1;
        }
        Self { ends, samples: list }
    }

    /// Samples that touch a brick, ascending.
    pub(super) fn of(&self, slot: usize) -> &[u32] {
        let first = if slot == 0 { 0 } else { self.ends[slot - 1] };
        &self.samples[first as usize..self.ends[slot] as usize]
    }
}
