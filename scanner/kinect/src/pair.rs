//! Pairs colour pictures with depth images: the cameras of a sensor run freely, so each is paired with the nearest in time.
//!
//! At equal rates the nearest lies within half a frame's time, and nothing that comes later can lie nearer: a pair is
//! handed on as soon as its second half is there.

use std::collections::VecDeque;

/// Half the time between frames at 30 a second, and a little for their jitter, nanoseconds.
pub const HALF_FRAME_NANOS: u64 = 17_000_000;

/// Images that may wait for their partner, a stream: half a second, as long as a busy computer may hold up the other one.
const WAITING: usize = 15;

/// Two streams being paired.
#[derive(Debug)]
pub struct Pairer<C, D> {
    tolerance_nanos: u64,
    colors: VecDeque<(u64, C)>,
    depths: VecDeque<(u64, D)>,
}

/// What belongs together.
#[derive(Debug, PartialEq, Eq)]
pub struct Pair<C, D> {
    /// Colour and its time, nanoseconds.
    pub color: (u64, C),
    /// Depth and its time, nanoseconds.
    pub depth: (u64, D),
}

impl<C, D> Pairer<C, D> {
    /// Pairs what lies within `tolerance_nanos`.
    pub fn new(tolerance_nanos: u64) -> Self {
        Self { tolerance_nanos, colors: VecDeque::new(), depths: VecDeque::new() }
    }

    /// A colour picture has come.
    pub fn color(&mut self, nanos: u64, color: C) -> Option<Pair<C, D>> {
        let Some(depth) = take_nearest(&mut self.depths, nanos, self.tolerance_nanos) else {
            wait(&mut self.colors, nanos, color);
            return None;
        };
        self.colors.clear();
        Some(Pair { color: (nanos, color), depth })
    }

    /// A depth image has come.
    pub fn depth(&mut self, nanos: u64, depth: D) -> Option<Pair<C, D>> {
        let Some(color) = take_nearest(&mut self.colors, nanos, self.tolerance_nanos) else {
            wait(&mut self.depths, nanos, depth);
            return None;
        };
        self.depths.clear();
        Some(Pair { color, depth: (nanos, depth) })
    }
}

/// Takes the nearest one within the tolerance; what is older than it has missed its chance and goes.
fn take_nearest<T>(waiting: &mut VecDeque<(u64, T)>, nanos: u64, tolerance: u64) -> Option<(u64, T)> {
    let distance = |item: &(u64, T)| item.0.abs_diff(nanos);
    let (index, nearest) = waiting.iter().enumerate().min_by_key(|(_, item)| distance(item))?;
    if distance(nearest) > tolerance {
        return None;
    }
    waiting.drain(..index);
    waiting.pop_front()
}

fn wait<T>(waiting: &mut VecDeque<(u64, T)>, nanos: u64, item: T) {
    waiting.push_back((nanos, item));
    while waiting.len() > WAITING {
        waiting.pop_front();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: u64 = 33_333_333;

    /// Runs both streams in order of arrival, `(is_color, nanos)`, and returns the pairs' times.
    fn run(arrivals: impl IntoIterator<Item = (bool, u64)>) -> Vec<(u64, u64)> {
        let mut pairer = Pairer::new(HALF_FRAME_NANOS);
        let pairs = arrivals.into_iter().filter_map(|(is_color, nanos)| {
            if is_color { pairer.color(nanos, nanos) } else { pairer.depth(nanos, nanos) }
        });
        pairs.map(|pair: Pair<u64, u64>| (pair.color.1, pair.depth.1)).collect()
    }

    #[test]
    fn a_steady_skew_pairs_every_frame() {
        for skew in [0, 1_500_000, 10_000_000, 16_600_000] {
            let arrivals = (0..50).flat_map(|i| [(false, i * FRAME), (true, i * FRAME + skew)]);
            let pairs = run(arrivals);
            assert_eq!(pairs.len(), 50, "skew {skew}");
            assert!(pairs.iter().all(|(color, depth)| color - depth == skew));
        }
    }

    #[test]
    fn more_than_half_a_frame_apart_belongs_to_the_next() {
        let skew = 25_000_000;
        let pairs = run((0..10).flat_map(|i| [(false, i * FRAME), (true, i * FRAME + skew)]));
        assert_eq!(pairs.len(), 9);
        assert!(pairs.iter().all(|(color, depth)| depth.abs_diff(*color) == FRAME - skew), "{pairs:?}");
    }

    #[test]
    fn a_lost_image_costs_one_pair() {
        let arrivals = (0..10).flat_map(|i| [(false, i * FRAME), (true, i * FRAME + 2_000_000)]);
        let pairs = run(arrivals.filter(|&arrival| arrival != (true, 4 * FRAME + 2_000_000)));
        assert_eq!(pairs.len(), 9);
        assert!(pairs.iter().all(|(color, depth)| color - depth == 2_000_000));
    }

    #[test]
    fn a_stream_that_rests_keeps_little_waiting() {
        let mut pairer: Pairer<u64, u64> = Pairer::new(HALF_FRAME_NANOS);
        for i in 0..1000 {
            assert!(pairer.depth(i * FRAME, i).is_none());
        }
        assert_eq!(pairer.depths.len(), WAITING);
        let pair = pairer.color(999 * FRAME, 7).unwrap();
        assert_eq!((pair.color.1, pair.depth.1), (7, 999));
        assert!(pairer.depths.is_empty());
    }
}
