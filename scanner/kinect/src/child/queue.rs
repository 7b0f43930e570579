//! What a driver has delivered and nobody has taken yet: few frames, the newest of them, and every event.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use reconstruct::image::{ColorImage, DepthImage};

use super::launch::Overflow;
use crate::source::{Event, Frame};
use crate::wire::Stamped;

/// Frames that may wait: enough for a short pause of the reader, little enough that none is stale.
const WAITING: usize = 3;

/// A pair that waits.
#[derive(Debug)]
pub(super) struct Waiting {
    pub(super) color: Stamped<ColorImage>,
    pub(super) depth: Stamped<DepthImage>,
    pub(super) gravity: Option<[f64; 3]>,
}

#[derive(Debug)]
enum Item {
    Pair(Waiting),
    Event(Event),
}

#[derive(Debug, Default)]
struct State {
    items: VecDeque<Item>,
    pairs: usize,
    skipped: u32,
    delivered: u64,
    closed: bool,
}

/// Between the thread that reads from the driver and the one that takes events.
#[derive(Debug)]
pub(super) struct Queue {
    overflow: Overflow,
    state: Mutex<State>,
    changed: Condvar,
}

impl Queue {
    pub(super) fn new(overflow: Overflow) -> Self {
        Self { overflow, state: Mutex::default(), changed: Condvar::new() }
    }

    /// A pair has come.
    pub(super) fn push(&self, pair: Waiting) {
        let mut state = self.lock();
        if self.overflow == Overflow::Wait {
            let full = |state: &mut State| state.pairs >= WAITING && !state.closed;
            state = self.changed.wait_while(state, full).unwrap_or_else(PoisonError::into_inner);
        }
        while state.pairs >= WAITING {
            let oldest = state.items.iter().position(|item| matches!(item, Item::Pair(_)));
            state.items.remove(oldest.unwrap_or_default());
            state.pairs -= 1;
            state.skipped = state.skipped.saturating_add(1);
        }
        state.items.push_back(Item::Pair(pair));
        state.pairs += 1;
        self.changed.notify_all();
    }

    /// Something else has happened.
    pub(super) fn event(&self, event: Event) {
        let mut state = self.lock();
        if matches!(event, Event::Still(_)) {
            // Large, and nobody asks for a second one before the first has come.
            state.items.retain(|item| !matches!(item, Item::Event(Event::Still(_))));
        }
        state.items.push_back(Item::Event(event));
        drop(state);
        self.changed.notify_all();
    }

    /// How many things wait.
    pub(super) fn waiting(&self) -> usize {
        self.lock().items.len()
    }

    /// Lets a driver that waits for room go on: nobody will take anything.
    pub(super) fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// The next thing that happened, or [`Event::Nothing`] after `patience`.
    pub(super) fn next(&self, patience: Duration) -> Event {
        let until = Instant::now() + patience.min(Duration::from_hours(1));
        let mut state = self.lock();
        loop {
            match state.items.pop_front() {
                Some(Item::Event(event)) => return event,
                Some(Item::Pair(pair)) => {
                    state.pairs -= 1;
                    self.changed.notify_all();
                    return Event::Frame(Arc::new(state.deliver(pair)));
                }
                None => {}
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Event::Nothing;
            }
            state = self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Whoever panicked with it left counts and queue whole: every change is finished under the lock.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn deliver(&mut self, pair: Waiting) -> Frame {
        let frame = Frame {
            index: self.delivered,
            color_timestamp_nanos: pair.color.timestamp_nanos,
            depth_timestamp_nanos: pair.depth.timestamp_nanos,
            lost_packets: pair.color.lost_packets.saturating_add(pair.depth.lost_packets),
            color: Arc::new(pair.color.image),
            depth: Arc::new(pair.depth.image),
            skipped: self.skipped,
            gravity: pair.gravity,
        };
        self.delivered += 1;
        self.skipped = 0;
        frame
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    fn pair(time: u64) -> Waiting {
        let color = Stamped { image: ColorImage::default(), timestamp_nanos: time, lost_packets: 1 };
        let depth = Stamped { image: DepthImage::default(), timestamp_nanos: time, lost_packets: 2 };
        Waiting { color, depth, gravity: None }
    }

    fn frame(queue: &Queue) -> Arc<Frame> {
        match queue.next(Duration::ZERO) {
            Event::Frame(frame) => frame,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_newest_win_and_the_lost_ones_are_counted() {
        let queue = Queue::new(Overflow::NewestWins);
        (0..10).for_each(|time| queue.push(pair(time)));
        queue.event(Event::Unplugged);
        let times = [7, 8, 9].map(|time| (frame(&queue), time));
        for (index, (frame, time)) in times.iter().enumerate() {
            assert_eq!((frame.index, frame.color_timestamp_nanos), (index as u64, *time));
            assert_eq!((frame.skipped, frame.lost_packets), (if index == 0 { 7 } else { 0 }, 3));
        }
        assert!(matches!(queue.next(Duration::ZERO), Event::Unplugged));
        assert!(matches!(queue.next(Duration::ZERO), Event::Nothing));
    }

    #[test]
    fn one_still_at_most_waits() {
        let queue = Queue::new(Overflow::NewestWins);
        (0..100).for_each(|_| queue.event(Event::Still(Arc::default())));
        queue.event(Event::Unplugged);
        assert_eq!(queue.waiting(), 2);
    }

    #[test]
    fn a_file_waits_for_its_reader() {
        let queue = Arc::new(Queue::new(Overflow::Wait));
        let feeder = Arc::clone(&queue);
        let thread = thread::spawn(move || (0..100).for_each(|time| feeder.push(pair(time))));
        for time in 0..100 {
            let Event::Frame(frame) = queue.next(Duration::from_secs(20)) else { panic!("no frame {time}") };
            assert_eq!((frame.index, frame.depth_timestamp_nanos, frame.skipped), (time, time, 0));
        }
        thread.join().unwrap();
    }

    #[test]
    fn who_waits_for_room_is_let_go_at_the_end() {
        let queue = Arc::new(Queue::new(Overflow::Wait));
        let feeder = Arc::clone(&queue);
        let thread = thread::spawn(move || (0..10).for_each(|time| feeder.push(pair(time))));
        queue.close();
        thread.join().unwrap();
    }
}
