//! The sensor's lamp says what the seller should know away from the screen: whether a view can be taken, whether one is being
//! taken, whether something must be changed.

use std::time::{Duration, Instant};

use kinect::source::Led;

use super::Inner;
use crate::capture::hints::Level;
use crate::capture::state::Step;

/// Hints that last no longer than this are not shown: the lamp would flicker.
const STEADY: Duration = Duration::from_millis(300);

/// What the lamp shows, and why.
#[derive(Debug, Default)]
pub(super) struct Lamp {
    ordered: Option<Led>,
    /// What the hints have said for a while.
    level: Option<Level>,
    /// What they say now, where that is something else, and since when.
    other: Option<(Option<Level>, Instant)>,
}

impl Lamp {
    /// The newest frame shows this; nothing where nobody looks at frames.
    pub(super) fn see(&mut self, level: Option<Level>, now: Instant) {
        if level == self.level {
            self.other = None;
            return;
        }
        let since = match self.other {
            Some((other, since)) if other == level => since,
            _ => now,
        };
        if level.is_none() || self.level.is_none() || now.duration_since(since) >= STEADY {
            (self.level, self.other) = (level, None);
        } else {
            self.other = Some((level, since));
        }
    }

    /// Another sensor has a lamp of its own.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

impl Inner {
    /// Has the lamp show how things are, where it shows something else.
    pub(super) fn show_by_lamp(&mut self) {
        let is_running = self.sensor.as_ref().is_some_and(|sensor| sensor.running);
        let Some(camera) = self.camera.as_ref().filter(|_| is_running) else { return };
        let wanted = match (self.taking.is_some(), self.step, self.lamp.level) {
            (true, _, _) => Led::BlinkGreen,
            (false, Step::Views, Some(Level::Green)) => Led::Green,
            (false, Step::Views, Some(Level::Yellow)) => Led::Yellow,
            (false, Step::Views, Some(Level::Red)) => Led::Red,
            _ => Led::Off,
        };
        if self.lamp.ordered != Some(wanted) {
            camera.show(wanted);
            self.lamp.ordered = Some(wanted);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lasts_is_shown() {
        let start = Instant::now();
        let at = |millis| start + Duration::from_millis(millis);
        let mut lamp = Lamp::default();
        lamp.see(Some(Level::Green), at(0));
        assert_eq!(lamp.level, Some(Level::Green));
        lamp.see(Some(Level::Red), at(100));
        lamp.see(Some(Level::Green), at(200));
        lamp.see(Some(Level::Red), at(300));
        lamp.see(Some(Level::Red), at(500));
        assert_eq!(lamp.level, Some(Level::Green));
        lamp.see(Some(Level::Red), at(600));
        assert_eq!(lamp.level, Some(Level::Red));
        lamp.see(None, at(601));
        assert_eq!(lamp.level, None);
    }
}
