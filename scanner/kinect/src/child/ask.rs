//! One question to a driver's process: its first message is the answer.

use std::time::{Duration, Instant};

use super::launch::Launch;
use super::reader::{Impatient, Wish, farewell};
use crate::wire::{self, Message};

/// Starts the process, takes its first message and lets it go.
///
/// # Errors
/// Why there was no answer, in words.
pub fn ask(launch: &Launch, patience: Duration) -> Result<Message, String> {
    let (mut child, orders, mut messages) = launch.start().map_err(|error| error.to_string())?;
    let wish = Wish::default();
    let mut input = Impatient::new(&mut messages, &wish, Instant::now() + patience);
    let answer = wire::read(&mut input);
    if answer.is_err() {
        // Ended already is as good.
        let _ = child.kill();
    }
    drop(orders);
    farewell(&mut child);
    match answer {
        Ok(Some(message)) => Ok(message),
        Ok(None) => Err("it ended without a word".into()),
        Err(error) => Err(error.to_string()),
    }
}
