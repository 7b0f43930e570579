//! Which samples touch which solved bricks.

use rayon::prelude::*;

use super::level::Level;

/// Samples a thread takes at a time.
const CHUNK: usize = 8192;

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
        reach: impl Fn(usize) -> Option<([i32; 3], [i32; 3])> + Sync,
    ) -> Self {
        let slots_of = |i: usize, pairs: &mut Vec<(u32, u32)>| {
            let Some((low, high)) = reach(i) else { return };
            for z in low[2] >> 3..=high[2] >> 3 {
                for y in low[1] >> 3..=high[1] >> 3 {
                    for x in low[0] >> 3..=high[0] >> 3 {
                        if let Some(slot) = level.slot([x, y, z]).filter(|&slot| slot < level.solved) {
                            pairs.push((slot as u32, i as u32));
                        }
                    }
                }
            }
        };
        let of_chunk = |chunk: usize| {
            let mut pairs = Vec::with_capacity(2 * CHUNK);
            (chunk * CHUNK..samples.min((chunk + 1) * CHUNK)).for_each(|i| slots_of(i, &mut pairs));
            pairs
        };
        let pairs: Vec<Vec<(u32, u32)>> =
            (0..samples.div_ceil(CHUNK)).into_par_iter().map(of_chunk).collect();
        let mut ends = vec![0u32; level.solved];
        pairs.iter().flatten().for_each(|&(slot, _)| ends[slot as usize] += 1);
        let mut before = 0;
        for end in &mut ends {
            before += std::mem::replace(end, before);
        }
        let mut list = vec![0; before as usize];
        for &(slot, i) in pairs.iter().flatten() {
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
