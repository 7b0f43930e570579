//! Reads what a driver's process says, pairs its images, and notices when it falls silent or ends.

use std::io::{self, PipeReader, Read};
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ExitStatus};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use reconstruct::image::{ColorImage, DepthImage};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::launch::Patience;
use super::queue::{Queue, Waiting};
use crate::pair::{HALF_FRAME_NANOS, Pair, Pairer};
use crate::source::{Event, SensorInfo};
use crate::wire::{self, Failure, Message, Stamped};
use crate::worker::GRACE;

/// How often a wait is interrupted to see whether the end was asked for.
const GLANCE: Duration = Duration::from_millis(100);
/// How long a process that has closed its pipe may take to end.
const FAREWELL: Duration = Duration::from_millis(500);

/// What is known from outside of how the driver is to behave.
#[derive(Debug, Default)]
pub(super) struct Wish {
    /// The streams have been ordered to start.
    pub(super) streaming: AtomicBool,
    /// When the end was asked for.
    pub(super) ending: OnceLock<Instant>,
}

impl Wish {
    fn is_ending(&self) -> bool {
        self.ending.get().is_some()
    }

    fn is_overdue(&self) -> bool {
        self.ending.get().is_some_and(|asked| asked.elapsed() > GRACE + FAREWELL)
    }
}

/// The answers that somebody waits for.
pub(super) struct Answers {
    pub(super) opened: SyncSender<Result<SensorInfo, Failure>>,
    pub(super) controls: SyncSender<Option<String>>,
}

/// Answers that may wait to be heard: more than anybody asks for.
const ANSWERS: usize = 16;

/// Room for the answers. A driver that says more than anybody wants to hear must not fill the memory.
pub(super) fn answers() -> (Answers, Receiver<Result<SensorInfo, Failure>>, Receiver<Option<String>>) {
    let (opened, is_open) = mpsc::sync_channel(1);
    let (controls, refusals) = mpsc::sync_channel(ANSWERS);
    (Answers { opened, controls }, is_open, refusals)
}

/// Reads from one process until it ends.
pub(super) struct Reader {
    pub(super) child: Child,
    pub(super) messages: PipeReader,
    pub(super) intake: Intake,
    pub(super) wish: Arc<Wish>,
    pub(super) patience: Patience,
}

/// Why reading came to an end.
#[derive(Debug)]
pub(super) enum End {
    /// The driver said so.
    Said,
    /// Its end of the pipe was closed, perhaps within a message.
    Closed,
    /// It did something that no driver does; in words.
    Wrong(String),
    /// The end was asked for, and it did not come.
    Stubborn,
}

type Images = Pairer<Stamped<ColorImage>, Stamped<DepthImage>>;

impl Reader {
    /// Reads until the process has ended; afterwards there is none left.
    pub(super) fn run(mut self) {
        let end = self.read_all();
        if matches!(end, End::Wrong(_) | End::Stubborn) {
            // Already gone is as good.
            let _ = self.child.kill();
        }
        let status = farewell(&mut self.child);
        if !self.wish.is_ending() {
            match end {
                End::Wrong(words) => self.intake.failed(Failure::Other(words)),
                End::Closed => self.intake.failed(Failure::Other(obituary(status))),
                End::Said | End::Stubborn => {}
            }
        }
    }

    fn read_all(&mut self) -> End {
        loop {
            let streaming = self.wish.streaming.load(Ordering::SeqCst);
            if !streaming {
                self.intake.seen = Instant::now();
            } else if self.intake.seen.elapsed() > self.patience.images {
                return End::Wrong(
                    "the sensor is there but sends no pictures; unplug it and plug it in again".into(),
                );
            }
            let silence = if self.intake.opened { self.patience.silence } else { self.patience.opening };
            let mut input = Impatient::new(&mut self.messages, &self.wish, Instant::now() + silence);
            let message = match wire::read(&mut input) {
                Ok(Some(message)) => message,
                Ok(None) => return End::Closed,
                Err(error) => return end_of(&error),
            };
            if let Some(end) = self.intake.take(message) {
                return end;
            }
        }
    }
}

/// What becomes of what a driver says, whatever it says: few things wait, and nothing else is kept.
pub(super) struct Intake {
    queue: Arc<Queue>,
    answers: Answers,
    images: Images,
    gravity: Option<[f64; 3]>,
    opened: bool,
    /// When the last image came.
    seen: Instant,
}

impl Intake {
    pub(super) fn new(queue: Arc<Queue>, answers: Answers) -> Self {
        let (images, seen) = (Images::new(HALF_FRAME_NANOS), Instant::now());
        Self { queue, answers, images, gravity: None, opened: false, seen }
    }

    /// Takes a message; says where it is the last one.
    pub(super) fn take(&mut self, message: Message) -> Option<End> {
        match message {
            Message::Opened(info) => {
                self.opened = true;
                // Nobody waits where the program has gone on without.
                let _ = self.answers.opened.try_send(Ok(*info));
            }
            Message::Color(color) => {
                self.seen = Instant::now();
                let pair = self.images.color(color.timestamp_nanos, color);
                self.deliver(pair);
            }
            Message::Depth(depth) => {
                self.seen = Instant::now();
                let pair = self.images.depth(depth.timestamp_nanos, depth);
                self.deliver(pair);
            }
            Message::Still(still) => {
                self.seen = Instant::now();
                self.queue.event(Event::Still(Arc::new(still)));
            }
            Message::Gravity(down) => self.gravity = down.iter().all(|g| g.is_finite()).then_some(down),
            Message::Answer(refusal) => {
                let _ = self.answers.controls.try_send(refusal);
            }
            // The answer to a question of [`super::ask()`], which nobody has asked here.
            Message::Alive | Message::Found(_) => {}
            Message::Unplugged => {
                self.queue.event(Event::Unplugged);
                return Some(End::Said);
            }
            Message::Ended => {
                self.queue.event(Event::Ended);
                return Some(End::Said);
            }
            Message::Failed(failure) => {
                self.failed(failure);
                return Some(End::Said);
            }
        }
        None
    }

    fn deliver(&self, pair: Option<Pair<Stamped<ColorImage>, Stamped<DepthImage>>>) {
        if let Some(Pair { color: (_, color), depth: (_, depth) }) = pair {
            self.queue.push(Waiting { color, depth, gravity: self.gravity });
        }
    }

    /// Whoever waits for the opening is told; an event is it only once it was open.
    fn failed(&self, failure: Failure) {
        let words = match &failure {
            Failure::LibraryMissing(words)
            | Failure::NotFound(words)
            | Failure::Refused(words)
            | Failure::Other(words) => words.clone(),
        };
        let _ = self.answers.opened.try_send(Err(failure));
        self.queue.event(Event::Failed(words));
    }
}

fn end_of(error: &io::Error) -> End {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => End::Closed,
        io::ErrorKind::TimedOut => End::Wrong("it hangs; it was ended".into()),
        io::ErrorKind::ConnectionAborted => End::Stubborn,
        _ => End::Wrong(format!("it says what makes no sense ({error}); it was ended")),
    }
}

/// Waits for a process that should be ending, and ends it where it does not.
pub(super) fn farewell(child: &mut Child) -> Option<ExitStatus> {
    let until = Instant::now() + FAREWELL;
    while Instant::now() < until {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        thread::sleep(Duration::from_millis(5));
    }
    let _ = child.kill();
    child.wait().ok()
}

/// How a process ended that said nothing of it.
fn obituary(status: Option<ExitStatus>) -> String {
    let Some(status) = status else { return "it is gone".into() };
    match (status.signal(), status.code()) {
        // The numbers are the same on all systems for these.
        (Some(6), _) => "it gave up (abort)".into(),
        (Some(11 | 7 | 4 | 8), _) => "it crashed".into(),
        (Some(signal), _) => format!("it was ended by signal {signal}"),
        (None, Some(code)) => format!("it left with status {code}"),
        (None, None) => "it is gone".into(),
    }
}

/// A pipe that is waited for no longer than it is worth.
pub(super) struct Impatient<'a> {
    pipe: &'a mut PipeReader,
    wish: &'a Wish,
    until: Instant,
}

impl<'a> Impatient<'a> {
    pub(super) fn new(pipe: &'a mut PipeReader, wish: &'a Wish, until: Instant) -> Self {
        Self { pipe, wish, until }
    }
}

impl Read for Impatient<'_> {
    /// `TimedOut` where nothing comes in time, `ConnectionAborted` where the driver goes on though it was asked to end.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if self.wish.is_overdue() {
                return Err(io::ErrorKind::ConnectionAborted.into());
            }
            let left = self.until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(io::ErrorKind::TimedOut.into());
            }
            let glance = Timespec::try_from(left.min(GLANCE)).map_err(io::Error::other)?;
            let ready = poll(&mut [PollFd::new(&*self.pipe, PollFlags::IN)], Some(&glance));
            match ready {
                Ok(0) | Err(rustix::io::Errno::INTR) => {}
                Ok(_) => return self.pipe.read(buffer),
                Err(error) => return Err(error.into()),
            }
        }
    }
}
