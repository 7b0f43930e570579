//! The driver's side: a process of its own that owns the C library, so that whatever the library does ends that process only.
//!
//! `scan-product __driver DRIVER FD TARGET` runs [`run`]. Messages go out over the inherited pipe `FD`, never over standard
//! output, on which the libraries print. Orders come in over standard input; when it ends, or a signal asks for the end,
//! the driver stops the sensor and returns, or is killed where it does not within [`GRACE`].

use std::any::Any;
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufRead, Read};
use std::os::fd::{FromRawFd, OwnedFd, RawFd};
use std::panic::{self, AssertUnwindSafe};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

use rustix::io::{FdFlags, fcntl_getfd, fcntl_setfd};
use rustix::process::{Signal, getpid, kill_process};

use crate::probe;
use crate::source::{Control, SensorInfo};
use crate::wire::{self, Failure, Message, Order};

/// How long a driver may take to stop its sensor when it is asked to end.
pub const GRACE: Duration = Duration::from_millis(1500);
/// How often a driver that delivers nothing says that it is alive.
const HEARTBEAT: Duration = Duration::from_millis(250);
/// Longest order, bytes.
const MOST_ORDER: u64 = 4096;

/// Exit status: the driver ended as it should.
const ENDED: u8 = 0;
/// Exit status: the driver failed, and has said so.
const FAILED: u8 = 1;
/// Exit status: not started by the program itself.
const NOT_FOR_PEOPLE: u8 = 2;

/// What a driver's process is to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// Which sensor, in the driver's own words: a serial number, a file; empty for the first one.
    pub target: String,
}

/// A driver: opens the sensor, says [`Link::opened`], and streams until [`Link::is_over`].
pub type Driver = fn(&Request, &mut Link) -> Result<(), DriverError>;

/// Why a driver returns early.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DriverError {
    /// What the program is to be told.
    #[error("{0:?}")]
    Failed(Failure),
    /// Nobody listens any more, or the end was asked for: no failure.
    #[error("asked to end")]
    Over,
}

impl DriverError {
    /// A failure without a kind of its own.
    pub fn other(text: impl Into<String>) -> Self {
        Self::Failed(Failure::Other(text.into()))
    }
}

/// The drivers this program was built with, by the name of their backend.
const DRIVERS: &[(&str, Driver)] = &[
    #[cfg(feature = "freenect")]
    ("freenect", crate::freenect::run),
    #[cfg(feature = "openni2")]
    ("openni2", crate::openni2::run),
];

/// Runs a driver as the command line says: `DRIVER FD TARGET`. Returns the exit status.
pub fn run(args: &[OsString]) -> u8 {
    run_one_of(DRIVERS, args)
}

/// As [`run`], with these drivers; tests bring some that misbehave.
pub fn run_one_of(drivers: &[(&str, Driver)], args: &[OsString]) -> u8 {
    let Some((driver, out, request)) = understand(drivers, args) else {
        eprintln!("error: this part of the program is started by the program itself");
        return NOT_FOR_PEOPLE;
    };
    let mut link = Link::new(out);
    let ended = panic::catch_unwind(AssertUnwindSafe(|| driver(&request, &mut link)));
    let failure = match ended {
        Ok(Ok(()) | Err(DriverError::Over)) => return ENDED,
        Ok(Err(DriverError::Failed(failure))) => failure,
        Err(panic) => Failure::Other(format!("it stopped with a fault of its own: {}", words_of(&*panic))),
    };
    // Where nobody listens there is nobody to tell.
    let _ = wire::write(&mut link.out, &Message::Failed(failure));
    FAILED
}

fn understand(drivers: &[(&str, Driver)], args: &[OsString]) -> Option<(Driver, File, Request)> {
    let [name, fd, target] = args else { return None };
    let known = drivers.iter().find(|(known, _)| name == known).map(|(_, driver)| *driver);
    let driver = known.or_else(|| probe::driver_of(name.to_str()?))?;
    let out = take_pipe(fd.to_str()?.parse().ok()?)?;
    Some((driver, out, Request { target: target.to_str()?.to_owned() }))
}

/// Takes over the pipe that was inherited under this number; `None` where there is none.
fn take_pipe(fd: RawFd) -> Option<File> {
    if fd <= 2 {
        return None;
    }
    // SAFETY: borrowed for two calls only; a number that is no open file makes them fail, nothing worse.
    let borrowed = unsafe { std::os::fd::BorrowedFd::borrow_raw(fd) };
    fcntl_getfd(borrowed).ok()?;
    // What the library starts must not keep the pipe open.
    fcntl_setfd(borrowed, FdFlags::CLOEXEC).ok()?;
    // SAFETY: open, as just seen, and nobody else's: it was inherited for this, at the start of the process.
    Some(File::from(unsafe { OwnedFd::from_raw_fd(fd) }))
}

fn words_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason given")
}

/// A driver's connection to the program.
#[derive(Debug)]
pub struct Link {
    out: File,
    orders: Receiver<Order>,
    over: Arc<AtomicBool>,
    said: Instant,
}

impl Link {
    fn new(out: File) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let (sender, orders) = mpsc::channel();
        let ending = Arc::clone(&over);
        thread::spawn(move || {
            listen(&sender);
            end(&ending);
        });
        let ending = Arc::clone(&over);
        // Without a handler a signal ends the process at once: worse for the sensor, but no reason not to work.
        if let Err(error) = ctrlc::set_handler(move || end(&ending)) {
            eprintln!("warning: the sensor will not be stopped by a signal: {error}");
        }
        Self { out, orders, over, said: Instant::now() }
    }

    /// Says that the sensor is open and waits to be told to begin.
    ///
    /// # Errors
    /// [`DriverError::Over`] where the end comes first.
    pub fn opened(&mut self, info: SensorInfo) -> Result<(), DriverError> {
        self.send(&Message::Opened(Box::new(info)))?;
        loop {
            match self.orders.recv_timeout(HEARTBEAT) {
                Ok(Order::Start) => return Ok(()),
                Ok(Order::Control(_)) => self.answer(Err("the sensor has not been started".into()))?,
                Err(RecvTimeoutError::Timeout) => self.alive()?,
                Err(RecvTimeoutError::Disconnected) => return Err(DriverError::Over),
            }
        }
    }

    /// Sends a message.
    ///
    /// # Errors
    /// [`DriverError::Over`] where nobody listens or the end was asked for.
    pub fn send(&mut self, message: &Message) -> Result<(), DriverError> {
        if self.is_over() {
            return Err(DriverError::Over);
        }
        self.said = Instant::now();
        wire::write(&mut self.out, message).map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData => DriverError::other(error.to_string()),
            _ => DriverError::Over,
        })
    }

    /// To be called whenever the driver's loop turns: tells the program now and then that it does.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn alive(&mut self) -> Result<(), DriverError> {
        if self.is_over() {
            return Err(DriverError::Over);
        }
        if self.said.elapsed() < HEARTBEAT { Ok(()) } else { self.send(&Message::Alive) }
    }

    /// What the sensor is asked to do next; each wants one [`Self::answer`].
    pub fn order(&mut self) -> Option<Control> {
        loop {
            match self.orders.try_recv().ok()? {
                Order::Control(control) => return Some(control),
                Order::Start => {}
            }
        }
    }

    /// Says how the last order went.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn answer(&mut self, outcome: Result<(), String>) -> Result<(), DriverError> {
        self.send(&Message::Answer(outcome.err()))
    }

    /// Whether the driver is to stop its sensor and return.
    pub fn is_over(&self) -> bool {
        self.over.load(Ordering::SeqCst)
    }
}

/// Passes orders on until the program ends, or says what makes no sense.
fn listen(orders: &Sender<Order>) {
    let mut input = io::stdin().lock();
    loop {
        let mut line = Vec::new();
        let read = (&mut input).take(MOST_ORDER).read_until(b'\n', &mut line);
        let Some(order) = read.ok().and_then(|_| serde_json::from_slice(&line).ok()) else { return };
        if orders.send(order).is_err() {
            return;
        }
    }
}

/// Asks the driver to end, and sees to it that it does. Never returns: the process is over before.
fn end(over: &AtomicBool) {
    over.store(true, Ordering::SeqCst);
    thread::sleep(GRACE);
    // Stuck inside the library. An orderly exit would run the library's own, which may be stuck too.
    let _ = kill_process(getpid(), Signal::KILL);
}
