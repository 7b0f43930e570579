//! A sensor's tick counter as time: a 32-bit counter that begins again becomes nanoseconds that never do.

/// How far a tick may lie behind the newest one and still be an image that arrives late, seconds.
const LATE_SECONDS: i64 = 1;

/// Unwraps the 32-bit counter that a sensor's streams share.
///
/// Right while less than a turn of the counter (minus a second) passes between two ticks: 70 s at 60 MHz.
#[derive(Debug, Clone)]
pub struct Clock {
    ticks_per_second: i64,
    newest: Option<i64>,
}

impl Clock {
    /// A clock of so many ticks a second.
    pub fn new(ticks_per_second: u32) -> Self {
        Self { ticks_per_second: i64::from(ticks_per_second.max(1)), newest: None }
    }

    /// The time of a tick, nanoseconds; the first one counts from the counter's own zero.
    pub fn nanos(&mut self, ticks: u32) -> u64 {
        let time = match self.newest {
            None => i64::from(ticks),
            Some(newest) => newest + self.step(ticks.wrapping_sub(newest as u32)),
        };
        self.newest = Some(self.newest.map_or(time, |newest| newest.max(time)));
        let nanos = i128::from(time.max(0)) * 1_000_000_000 / i128::from(self.ticks_per_second);
        u64::try_from(nanos).unwrap_or(u64::MAX)
    }

    /// Forwards, but for the little by which one stream runs behind the other.
    fn step(&self, forwards: u32) -> i64 {
        let backwards = i64::from(forwards) - (1 << 32);
        if backwards >= -LATE_SECONDS * self.ticks_per_second { backwards } else { i64::from(forwards) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MHZ_60: u32 = 60_000_000;

    #[test]
    fn the_counter_begins_again_and_time_does_not() {
        let mut clock = Clock::new(MHZ_60);
        let start = u32::MAX - 3_000_000;
        let times: Vec<u64> = (0..6).map(|i| clock.nanos(start.wrapping_add(i * 2_000_000))).collect();
        assert_eq!(times[0], u64::from(start) * 50 / 3);
        for pair in times.windows(2) {
            assert!((33_333_332..=33_333_334).contains(&(pair[1] - pair[0])), "{times:?}");
        }
    }

    #[test]
    fn the_other_stream_may_lie_behind_on_the_far_side_of_the_turn() {
        let mut clock = Clock::new(MHZ_60);
        let first = clock.nanos(u32::MAX - 10);
        let after = clock.nanos(900_000);
        let late = clock.nanos(u32::MAX - 10);
        assert_eq!(late, first);
        assert!(after > first);
        assert!(clock.nanos(1_900_000) > after);
    }

    #[test]
    fn a_gap_of_a_minute_and_many_turns() {
        let mut clock = Clock::new(MHZ_60);
        let mut ticks = 5u32;
        let mut before = clock.nanos(ticks);
        for _ in 0..200 {
            ticks = ticks.wrapping_add(60 * MHZ_60);
            let now = clock.nanos(ticks);
            assert_eq!(now - before, 60_000_000_000);
            before = now;
        }
    }

    #[test]
    fn late_before_the_counter_s_zero_is_zero() {
        let mut clock = Clock::new(MHZ_60);
        assert_eq!(clock.nanos(0), 0);
        assert_eq!(clock.nanos(u32::MAX), 0);
    }
}
