//! Starts a driver's process.

use std::ffi::OsString;
use std::io::{self, PipeReader};
use std::os::fd::AsRawFd;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

use rustix::io::{FdFlags, fcntl_setfd};

/// The hidden sub-command that runs a driver.
pub const SUBCOMMAND: &str = "__driver";
/// Names another program to run the drivers in: tests set it.
const PROGRAM_VARIABLE: &str = "SCAN_DRIVER_PROGRAM";
/// Where set, what the C libraries print is let through to standard error.
const LOG_VARIABLE: &str = "SCAN_DRIVER_LOG";
/// What the pipe should hold: most of a pair of images, so that the driver seldom waits.
const PIPE_BYTES: usize = 1 << 20;

/// What to start, and how long to wait for it.
#[derive(Debug, Clone)]
pub struct Launch {
    /// `freenect` or `openni2`.
    pub driver: String,
    /// Which sensor, in the driver's own words; empty for the first one.
    pub target: String,
    /// The program that has [`crate::worker::run`] behind the sub-command `__driver`.
    pub program: PathBuf,
    /// Set in its environment.
    pub environment: Vec<(OsString, OsString)>,
    /// How long it may be silent.
    pub patience: Patience,
    /// What becomes of frames that come faster than they are taken.
    pub overflow: Overflow,
}

/// How long a driver may take before it counts as stuck.
#[derive(Debug, Clone, Copy)]
pub struct Patience {
    /// To open the sensor: some need their firmware first.
    pub opening: Duration,
    /// Between two signs of life.
    pub silence: Duration,
    /// Between two images of a sensor that streams.
    pub images: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        let [opening, silence, images] = [15, 3, 8].map(Duration::from_secs);
        Self { opening, silence, images }
    }
}

/// What becomes of frames that come faster than they are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Overflow {
    /// The oldest goes and is counted as skipped: a live sensor.
    NewestWins,
    /// The driver waits: a file of which every frame is wanted.
    Wait,
}

impl Launch {
    /// This very program (or the one `SCAN_DRIVER_PROGRAM` names), the newest frame wins.
    ///
    /// # Errors
    /// Where the system does not say what program this is.
    pub fn new(driver: &str, target: &str) -> io::Result<Self> {
        let program = match std::env::var_os(PROGRAM_VARIABLE) {
            Some(program) => PathBuf::from(program),
            None => std::env::current_exe()?,
        };
        Ok(Self {
            driver: driver.to_owned(),
            target: target.to_owned(),
            program,
            environment: Vec::new(),
            patience: Patience::default(),
            overflow: Overflow::NewestWins,
        })
    }

    /// Starts the process; messages come from the pipe, orders go to its standard input.
    pub(super) fn start(&self) -> io::Result<(Child, ChildStdin, PipeReader)> {
        let (messages, inherited) = io::pipe()?;
        // A refusal costs speed only.
        let _ = rustix::pipe::fcntl_setpipe_size(&inherited, PIPE_BYTES);
        let mut command = Command::new(&self.program);
        command.arg(SUBCOMMAND).arg(&self.driver).arg(inherited.as_raw_fd().to_string()).arg(&self.target);
        command.envs(self.environment.iter().map(|(name, value)| (name, value)));
        // The libraries print on both: not a word of it may get between the program's own.
        let log = if std::env::var_os(LOG_VARIABLE).is_some() { Stdio::inherit } else { Stdio::null };
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(log());
        // Ctrl-C is for the program, which ends its drivers itself, in order.
        command.process_group(0);
        let number = inherited.as_raw_fd();
        let keep_open = move || {
            // SAFETY: open in the new process: it is a copy of this one, in which `inherited` lives until after the start.
            let pipe = unsafe { std::os::fd::BorrowedFd::borrow_raw(number) };
            fcntl_setfd(pipe, FdFlags::empty()).map_err(io::Error::from)
        };
        // SAFETY: between fork and exec only what is safe in a signal handler may be done: the closure makes one system call.
        unsafe { command.pre_exec(keep_open) };
        let mut child = command.spawn()?;
        drop(inherited);
        let Some(orders) = child.stdin.take() else {
            return Err(io::Error::other("the driver's process has no standard input"));
        };
        Ok((child, orders, messages))
    }
}
