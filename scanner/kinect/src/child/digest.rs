//! What becomes of whatever a driver may say, without a process: for tests that make up what it says.

use std::io::Read;
use std::sync::Arc;

use super::launch::Overflow;
use super::queue::Queue;
use super::reader::{Intake, answers};
use crate::source::{Event, SensorInfo};
use crate::wire;

/// What came of it.
#[derive(Debug)]
pub struct Digest {
    /// Messages that were understood.
    pub messages: usize,
    /// The sensor that the first of them to say so announced.
    pub sensor: Option<SensorInfo>,
    /// What waited to be taken at the end, oldest first.
    pub events: Vec<Event>,
}

/// Reads what a driver says to its end, as the program does that nobody takes events from.
pub fn digest(input: &mut impl Read) -> Digest {
    let queue = Arc::new(Queue::new(Overflow::NewestWins));
    let (answers, is_open, _refusals) = answers();
    let mut intake = Intake::new(Arc::clone(&queue), answers);
    let mut messages = 0;
    while let Ok(Some(message)) = wire::read(input) {
        messages += 1;
        if intake.take(message).is_some() {
            break;
        }
    }
    let sensor = is_open.try_recv().ok().and_then(Result::ok);
    let events = (0..queue.waiting()).map(|_| queue.next(std::time::Duration::ZERO)).collect();
    Digest { messages, sensor, events }
}
