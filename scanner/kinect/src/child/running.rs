//! One driver process, the thread that reads from it, and the orders given to it.

use std::io::Write;
use std::process::ChildStdin;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::launch::Launch;
use super::queue::Queue;
use super::reader::{self, Intake, Reader, Wish};
use crate::source::{Control, Event, SensorInfo, SourceError};
use crate::wire::{Failure, Order};

/// How long the sensor may take to do what it is asked.
const ANSWER: Duration = Duration::from_secs(3);

/// A driver that runs; dropping it asks it to stop the sensor and waits until it has ended.
#[derive(Debug)]
pub(super) struct Running {
    orders: Option<ChildStdin>,
    refusals: Receiver<Option<String>>,
    wish: Arc<Wish>,
    queue: Arc<Queue>,
    reader: Option<JoinHandle<()>>,
}

impl Running {
    /// Starts the process and waits until the sensor is open.
    pub(super) fn start(launch: &Launch) -> Result<(Self, SensorInfo), SourceError> {
        let failed = |error: std::io::Error| {
            SourceError::Driver(format!("{} cannot be started: {error}", launch.program.display()))
        };
        let (child, orders, messages) = launch.start().map_err(failed)?;
        let (answers, is_open, refusals) = reader::answers();
        let queue = Arc::new(Queue::new(launch.overflow));
        let wish = Arc::new(Wish::default());
        let reader = Reader {
            child,
            messages,
            intake: Intake::new(Arc::clone(&queue), answers),
            wish: Arc::clone(&wish),
            patience: launch.patience,
        };
        let reader = Some(thread::spawn(move || reader.run()));
        let running = Self { orders: Some(orders), refusals, wish, queue, reader };
        // The reader has its own patience, and always says something before it ends.
        match is_open.recv() {
            Ok(Ok(info)) => Ok((running, info)),
            Ok(Err(failure)) => Err(error_of(&launch.driver, failure)),
            Err(_gone) => Err(SourceError::Driver("it ended before the sensor was open".into())),
        }
    }

    /// Whether the streams have been started: they start only once.
    pub(super) fn has_streamed(&self) -> bool {
        self.wish.streaming.load(Ordering::SeqCst)
    }

    /// Starts the streams.
    pub(super) fn stream(&mut self) -> Result<(), SourceError> {
        self.order(Order::Start)?;
        self.wish.streaming.store(true, Ordering::SeqCst);
        Ok(())
    }

    pub(super) fn next_event(&self, patience: Duration) -> Event {
        self.queue.next(patience)
    }

    /// Gives an order and waits for the answer.
    pub(super) fn control(&mut self, control: Control) -> Result<(), SourceError> {
        // An answer that came too late is nobody's.
        while self.refusals.try_recv().is_ok() {}
        self.order(Order::Control(control))?;
        match self.refusals.recv_timeout(ANSWER) {
            Ok(None) => Ok(()),
            Ok(Some(why)) => Err(SourceError::Refused(why)),
            Err(RecvTimeoutError::Timeout) => Err(SourceError::Driver("it does not answer".into())),
            Err(RecvTimeoutError::Disconnected) => Err(SourceError::Driver("it has ended".into())),
        }
    }

    fn order(&mut self, order: Order) -> Result<(), SourceError> {
        let gone = || SourceError::Driver("it has ended".into());
        let mut line = serde_json::to_vec(&order).map_err(|error| SourceError::Driver(error.to_string()))?;
        line.push(b'\n');
        let orders = self.orders.as_mut().ok_or_else(gone)?;
        orders.write_all(&line).map_err(|_closed| gone())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Set before the orders end, so that the driver's end is no surprise to the reader.
        let _ = self.wish.ending.set(Instant::now());
        self.queue.close();
        self.orders = None;
        if let Some(reader) = self.reader.take() {
            // It has nothing to hand over, and its panic would have been printed.
            let _ = reader.join();
        }
    }
}

fn error_of(driver: &str, failure: Failure) -> SourceError {
    match failure {
        Failure::LibraryMissing(advice) => {
            let library = if driver == "openni2" { "libOpenNI2" } else { "libfreenect" };
            SourceError::LibraryMissing { library, advice }
        }
        Failure::NotFound(words) => SourceError::NotFound(words),
        Failure::Refused(words) => SourceError::Refused(words),
        Failure::Other(words) => SourceError::Driver(words),
    }
}
