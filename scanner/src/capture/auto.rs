//! When a view is taken without being ordered. Pure; seconds.

use std::time::Instant;

use super::hints::Level;
use super::state::{Auto, AutoMode};

/// Shortest and longest waiting that can be asked for, seconds.
pub const SECONDS: std::ops::RangeInclusive<f64> = 0.5..=60.0;

/// Decides.
#[derive(Debug)]
pub struct Trigger {
    mode: AutoMode,
    seconds: f64,
    since: Instant,
    /// Whether something moved since the last view: without that the same view would be taken again and again.
    moved: bool,
    next_in: Option<f64>,
}

impl Trigger {
    /// By order only.
    pub fn manual(now: Instant) -> Self {
        Self { mode: AutoMode::Manual, seconds: 3.0, since: now, moved: true, next_in: None }
    }

    /// From now on so.
    pub fn set(&mut self, mode: AutoMode, seconds: f64, now: Instant) {
        *self = Self { mode, seconds, since: now, moved: true, next_in: None };
    }

    /// A view was taken, or could not be: the next one is waited for anew.
    pub fn taken(&mut self, now: Instant) {
        (self.since, self.moved, self.next_in) = (now, false, None);
    }

    /// How it stands after a look at the scene; `is_new` where no view was taken from about there. True: take one now.
    pub fn look(&mut self, light: Level, still_seconds: f64, is_new: bool, now: Instant) -> bool {
        self.moved |= still_seconds < 0.2;
        self.next_in = match self.mode {
            AutoMode::Timer => Some(self.seconds - now.saturating_duration_since(self.since).as_secs_f64()),
            AutoMode::Still if light == Level::Green && self.moved && is_new => {
                Some(self.seconds - still_seconds)
            }
            AutoMode::Manual | AutoMode::Still => None,
        };
        self.next_in = self.next_in.map(|seconds| seconds.max(0.0));
        self.next_in == Some(0.0) && light != Level::Red
    }

    /// Whether scenes have to be looked at even where nobody sees the pictures.
    pub fn is_on(&self) -> bool {
        self.mode != AutoMode::Manual
    }

    /// For the page.
    pub fn state(&self) -> Auto {
        let next_in = self.next_in.map(|seconds| (seconds * 10.0).round() / 10.0);
        Auto { mode: self.mode, seconds: self.seconds, next_in }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn by_order_only_nothing_is_taken() {
        let now = Instant::now();
        let mut trigger = Trigger::manual(now);
        assert!(!trigger.look(Level::Green, 100.0, true, now + Duration::from_secs(100)) && !trigger.is_on());
    }

    #[test]
    fn the_timer_waits_for_its_time_and_for_a_usable_scene() {
        let now = Instant::now();
        let at = |seconds| now + Duration::from_secs_f64(seconds);
        let mut trigger = Trigger::manual(now);
        trigger.set(AutoMode::Timer, 3.0, now);
        assert!(!trigger.look(Level::Yellow, 0.0, false, at(1.0)));
        assert_eq!(trigger.state().next_in, Some(2.0));
        assert!(!trigger.look(Level::Red, 0.0, false, at(3.5)));
        assert!(trigger.look(Level::Yellow, 0.0, false, at(3.6)));
        trigger.taken(at(3.6));
        assert!(!trigger.look(Level::Yellow, 0.0, false, at(5.0)));
    }

    #[test]
    fn a_still_scene_is_taken_once() {
        let now = Instant::now();
        let mut trigger = Trigger::manual(now);
        trigger.set(AutoMode::Still, 2.0, now);
        assert!(!trigger.look(Level::Green, 1.5, true, now));
        assert_eq!(trigger.state().next_in, Some(0.5));
        assert!(!trigger.look(Level::Yellow, 5.0, true, now), "only where all is well");
        assert!(!trigger.look(Level::Green, 5.0, false, now), "only where no view was taken yet");
        assert!(trigger.look(Level::Green, 2.0, true, now));
        trigger.taken(now);
        assert!(!trigger.look(Level::Green, 9.0, true, now), "the same scene");
        assert!(!trigger.look(Level::Green, 0.0, true, now));
        assert!(trigger.look(Level::Green, 2.1, true, now));
    }
}
