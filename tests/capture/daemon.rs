//! Starts the daemon and gives it orders.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::cli::support::{Ran, command};

/// Longer than anything takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(90);

/// A running daemon; killed when dropped.
pub(crate) struct Daemon {
    child: Mutex<Child>,
    pub(crate) base: String,
    pub(crate) token: String,
    pub(crate) agent: ureq::Agent,
}

/// An agent that gives answers of every status. It keeps no connection: one on which a body was refused is closed.
pub(crate) fn agent() -> ureq::Agent {
    ureq::Agent::config_builder().http_status_as_error(false).max_idle_connections(0).build().new_agent()
}

impl Daemon {
    /// `scan-product capture` with a sensor at work, recordings below `out`.
    pub(crate) fn capture(out: &Path, sensor: &str) -> Self {
        Self::start(&["capture", "--sensor", sensor, "--out", out.to_str().unwrap()])
    }

    /// A command that starts the daemon.
    pub(crate) fn start(arguments: &[&str]) -> Self {
        let mut command = command();
        command.args(arguments).args(["--json", "--no-browser"]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let said: Value = serde_json::from_str(&line).unwrap_or_else(|e| panic!("{e}: {line:?}"));
        let (base, token) = said["address"].as_str().unwrap().split_once("/#token=").unwrap();
        Self { child: Mutex::new(child), base: base.to_owned(), token: token.to_owned(), agent: agent() }
    }

    /// A start that must fail with status 2; gives the error line.
    #[track_caller]
    pub(crate) fn refuses_to_start(arguments: &[&str]) -> String {
        let ran: Ran = command().args(arguments).arg("--no-browser").output().unwrap().into();
        let ran = ran.with_status(2);
        assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
        ran.err
    }

    pub(crate) fn bearer(&self) -> String {
        format!("Bearer {}", self.token)
    }

    pub(crate) fn get(&self, path: &str) -> (u16, Vec<u8>) {
        let request = self.agent.get(format!("{}{path}", self.base)).header("authorization", self.bearer());
        let mut answer = request.call().unwrap();
        (answer.status().as_u16(), answer.body_mut().read_to_vec().unwrap())
    }

    pub(crate) fn post_bytes(
        &self,
        path: &str,
        kind: &str,
        body: &[u8],
    ) -> Result<(u16, Value), ureq::Error> {
        let request = self.agent.post(format!("{}{path}", self.base)).header("authorization", self.bearer());
        let mut answer = request.header("content-type", kind).send(body)?;
        let body = answer.body_mut().read_to_vec()?;
        Ok((answer.status().as_u16(), serde_json::from_slice(&body).unwrap_or(Value::Null)))
    }

    pub(crate) fn try_post(&self, path: &str, body: &Value) -> Result<(u16, Value), ureq::Error> {
        self.post_bytes(path, "application/json", body.to_string().as_bytes())
    }

    pub(crate) fn post(&self, path: &str, body: &Value) -> (u16, Value) {
        self.try_post(path, body).unwrap()
    }

    /// An order that must be carried out; gives the new state.
    #[track_caller]
    pub(crate) fn order(&self, path: &str, body: &Value) -> Value {
        let (status, answer) = self.post(path, body);
        assert_eq!(status, 200, "{path}: {answer}");
        answer
    }

    /// An order that must be refused; gives the words.
    #[track_caller]
    pub(crate) fn refused(&self, path: &str, body: &Value, expected: u16) -> String {
        let (status, answer) = self.post(path, body);
        assert_eq!(status, expected, "{path}: {answer}");
        assert_eq!(answer["status"], expected);
        answer["detail"].as_str().unwrap().to_owned()
    }

    pub(crate) fn try_delete(&self, path: &str) -> Result<u16, ureq::Error> {
        let request =
            self.agent.delete(format!("{}{path}", self.base)).header("authorization", self.bearer());
        Ok(request.call()?.status().as_u16())
    }

    pub(crate) fn state(&self) -> Value {
        let (status, body) = self.get("/api/state");
        assert_eq!(status, 200);
        serde_json::from_slice(&body).unwrap()
    }

    /// Asks until the state is as wanted.
    #[track_caller]
    pub(crate) fn wait_for(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let started = Instant::now();
        loop {
            let state = self.state();
            if wanted(&state) {
                return state;
            }
            assert!(started.elapsed() < PATIENCE, "{what} did not come: {state}");
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// The sensor goes elsewhere.
    #[track_caller]
    pub(crate) fn stand_at(&self, azimuth: f64) {
        self.order("/api/control", &json!({"what": "station", "value": azimuth}));
    }

    /// As a crash ends it.
    pub(crate) fn kill(&self) {
        let mut child = self.child.lock().unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
    }

    /// Waits for an end in order; the exit status.
    pub(crate) fn ended(self) -> Option<i32> {
        self.child.lock().unwrap().wait().unwrap().code()
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.lock().unwrap().id()
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let child = self.child.get_mut().unwrap();
        let _ = (child.kill(), child.wait());
    }
}
