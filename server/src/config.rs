//! Everything that can be set, with its defaults. The command line fills it; nothing deeper reads arguments or environment.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// Settings of a running server.
#[derive(Debug, Clone)]
pub struct Config {
    /// Database, stored files and uploads under way.
    pub data: PathBuf,
    pub listen: SocketAddr,
    /// The address people use, without a slash at the end; `https` makes cookies secure.
    pub public_url: Option<String>,
    /// The last `X-Forwarded-For` entry is the client: only behind a proxy that writes it.
    pub behind_proxy: bool,
    pub limits: Limits,
    pub times: Times,
    pub password_cost: PasswordCost,
}

/// What is accepted.
#[derive(Debug, Clone)]
pub struct Limits {
    pub model_bytes: u64,
    pub poster_bytes: u64,
    pub report_bytes: u64,
    pub json_bytes: u64,
    pub points: usize,
    pub triangles: usize,
    pub line_bytes: usize,
    pub picture_pixels: usize,
    pub connections: usize,
    /// Files parsed at the same time; each may need a few hundred bytes a point.
    pub parsers: usize,
    pub uploads_under_way: i64,
    /// Attempts to log in that one name or one address has at once; one comes back every `login_every`.
    pub login_burst: u32,
}

/// How long things may take.
#[derive(Debug, Clone)]
pub struct Times {
    pub header_read: Duration,
    /// A body may pause this long, and on the whole must come faster than `body_bytes_per_second`.
    pub body_pause: Duration,
    pub body_bytes_per_second: u64,
    pub session_idle: Duration,
    pub session_lifetime: Duration,
    pub upload_lifetime: Duration,
    pub login_every: Duration,
    pub database_busy: Duration,
    /// After a signal to stop: how long requests under way may still take.
    pub shutdown_grace: Duration,
}

/// Work factors of argon2id.
#[derive(Debug, Clone, Copy)]
pub struct PasswordCost {
    pub memory_kib: u32,
    pub passes: u32,
}

const DAY: u64 = 24 * 3600;

impl Config {
    /// The defaults, for a data folder.
    pub fn new(data: impl Into<PathBuf>, listen: SocketAddr) -> Self {
        Self {
            data: data.into(),
            listen,
            public_url: None,
            behind_proxy: false,
            limits: Limits::default(),
            times: Times::default(),
            password_cost: PasswordCost::default(),
        }
    }

    pub fn is_https(&self) -> bool {
        self.public_url.as_deref().is_some_and(|url| url.starts_with("https://"))
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            model_bytes: 256 << 20,
            poster_bytes: 16 << 20,
            report_bytes: 4 << 20,
            json_bytes: 64 << 10,
            points: 5_000_000,
            triangles: 10_000_000,
            line_bytes: 4096,
            picture_pixels: 40_000_000,
            connections: 512,
            parsers: 2,
            uploads_under_way: 20,
            login_burst: 10,
        }
    }
}

impl Default for Times {
    fn default() -> Self {
        Self {
            header_read: Duration::from_secs(10),
            body_pause: Duration::from_secs(30),
            body_bytes_per_second: 1024,
            session_idle: Duration::from_secs(7 * DAY),
            session_lifetime: Duration::from_secs(30 * DAY),
            upload_lifetime: Duration::from_secs(DAY),
            login_every: Duration::from_secs(6),
            database_busy: Duration::from_secs(5),
            shutdown_grace: Duration::from_mins(1),
        }
    }
}

impl Default for PasswordCost {
    /// The second choice of OWASP's list (2023): 19 MiB, 2 passes.
    fn default() -> Self {
        Self { memory_kib: 19 * 1024, passes: 2 }
    }
}
