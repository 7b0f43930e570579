//! Whether anything moves: the tags' corners against where they were when all came to rest, or the picture itself where no
//! tag is seen. Pixels, seconds.

use std::time::Instant;

use reconstruct::image::GrayImage;
use reconstruct::marker::Detection;

/// Median shift of the corners that counts as motion, pixels: a few times what noise does.
const SHIFT_PX: f64 = 0.8;
/// Mean difference of the picture that counts as motion, grey levels.
const CHANGE: f64 = 6.0;
/// Pixels a step where pictures are compared.
const SAMPLE: usize = 97;

/// Remembers the scene at rest.
#[derive(Debug, Default)]
pub(super) struct Motion {
    rest: Option<Rest>,
}

#[derive(Debug)]
struct Rest {
    since: Instant,
    corners: Vec<(u32, [f64; 2])>,
    samples: Vec<u8>,
}

impl Motion {
    /// How long the scene has been as it is now.
    pub(super) fn still_seconds(&mut self, tags: &[Detection], gray: &GrayImage, now: Instant) -> f64 {
        let corners: Vec<(u32, [f64; 2])> =
            tags.iter().flat_map(|tag| tag.corners.map(|c| (tag.id, [c.x, c.y]))).collect();
        let samples: Vec<u8> = gray.data.iter().step_by(SAMPLE).copied().collect();
        match &self.rest {
            Some(rest) if !rest.has_moved(&corners, &samples) => {
                now.saturating_duration_since(rest.since).as_secs_f64()
            }
            _ => {
                self.rest = Some(Rest { since: now, corners, samples });
                0.0
            }
        }
    }
}

impl Rest {
    fn has_moved(&self, corners: &[(u32, [f64; 2])], samples: &[u8]) -> bool {
        match self.median_shift(corners) {
            Some(shift) => shift > SHIFT_PX,
            None => self.change(samples) > CHANGE,
        }
    }

    /// Of tags that are seen now and were then; none where hardly any are.
    fn median_shift(&self, corners: &[(u32, [f64; 2])]) -> Option<f64> {
        let ids = |corners: &[(u32, [f64; 2])]| corners.chunks_exact(4).map(|c| c[0].0).collect::<Vec<_>>();
        let then = ids(&self.corners);
        let mut shifts = Vec::new();
        for (k, id) in ids(corners).into_iter().enumerate() {
            let Some(before) = then.iter().position(|&other| other == id) else { continue };
            for (a, b) in corners[4 * k..4 * k + 4].iter().zip(&self.corners[4 * before..4 * before + 4]) {
                shifts.push((a.1[0] - b.1[0]).hypot(a.1[1] - b.1[1]));
            }
        }
        if shifts.len() < 8 {
            return None;
        }
        let middle = shifts.len() / 2;
        Some(*shifts.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    fn change(&self, samples: &[u8]) -> f64 {
        if samples.len() != self.samples.len() || samples.is_empty() {
            return f64::INFINITY;
        }
        let sum: u64 = samples.iter().zip(&self.samples).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        sum as f64 / samples.len() as f64
    }
}
