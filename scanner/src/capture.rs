//! The guided capture: a daemon on this computer with a page in the browser, from the sensor to the published listing.
//!
//! `session` is the page to read first: what the seller has done so far and what can be done next. Below it: `camera` (the
//! sensor's thread), `live` (what the newest frame shows), `journal` (the recording on the disk), `preview` and `model`.
//! `http` gives it to the page in `web/capture/`. Metres, radians, seconds; world = board, z up.

pub mod auto;
pub mod camera;
pub mod depth_picture;
pub mod hints;
pub mod http;
pub mod journal;
pub mod live;
pub mod model;
pub mod preview;
pub mod refusal;
pub mod replay;
pub mod sensors;
pub mod session;
pub mod simulated;
pub mod state;

use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, anyhow};
use serde_json::json;
use tokio::sync::watch;

use crate::output;
use crate::ui::Ui;
use http::{Daemon, Gate, Token};
use sensors::ThisComputer;
use session::Session;

/// How the daemon is started.
#[derive(Debug)]
pub struct Options {
    /// Where it listens; port 0 for any free one.
    pub address: SocketAddr,
    /// Whether the browser is opened.
    pub browser: bool,
    /// Sensor to begin with.
    pub sensor: Option<String>,
    /// Folder in which every product gets one.
    pub home: PathBuf,
    /// Recording to go on with.
    pub resume: Option<PathBuf>,
    /// Server to propose for publishing.
    pub server: Option<String>,
}

/// Set by Ctrl-C to end the running capture in order.
static STOP: Mutex<Option<watch::Sender<bool>>> = Mutex::new(None);

/// Asks the running capture to end; false where none runs, or where it was asked before.
pub fn ask_to_stop() -> bool {
    let stop = STOP.lock().unwrap_or_else(PoisonError::into_inner).take();
    stop.is_some_and(|stop| !stop.send_replace(true))
}

/// Runs the daemon until it is told to end.
pub fn run(options: &Options, ui: &Ui) -> anyhow::Result<()> {
    std::fs::create_dir_all(&options.home)
        .with_context(|| format!("cannot make the folder {} for the scans", options.home.display()))?;
    output::check_writable(&options.home)?;
    warn_of_listening(options.address.ip(), ui);
    let session = Session::new(Box::new(ThisComputer), &options.home, options.server.clone());
    look_for_sensors(&session);
    if let Some(folder) = &options.resume {
        session.resume(folder, ui).map_err(|refusal| anyhow!("{refusal}"))?;
    }
    if let Some(address) = &options.sensor {
        session.choose_sensor(address).map_err(|refusal| anyhow!("{refusal}"))?;
    }
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("the program cannot start its threads")?;
    let result = runtime.block_on(serve(options, session.clone(), ui));
    session.close();
    // What still runs is not waited for: the recording is complete at any moment.
    runtime.shutdown_background();
    output::remove_unfinished();
    result
}

/// Libraries and USB devices are looked at while the page opens.
fn look_for_sensors(session: &std::sync::Arc<Session>) {
    let session = std::sync::Arc::clone(session);
    // Where no thread can be had, the page's own order looks.
    let _ = std::thread::Builder::new().name("look".to_owned()).spawn(move || session.look_for_sensors());
}

async fn serve(options: &Options, session: std::sync::Arc<Session>, ui: &Ui) -> anyhow::Result<()> {
    let listener = tokio::net::TcpListener::bind(options.address)
        .await
        .with_context(|| format!("cannot listen at {}; is the port in use?", options.address))?;
    let token = Token::random().map_err(|e| anyhow!("the system gives no random numbers: {e}"))?;
    let gate = Gate::new(token, listener.local_addr()?);
    let url = gate.url();
    let stop = watch::Sender::new(false);
    *STOP.lock().unwrap_or_else(PoisonError::into_inner) = Some(stop.clone());
    ui.result(
        &format!("The capture is at {url}\nKeep this address to yourself: whoever has it can give orders. Ctrl-C ends the capture."),
        &json!({"address": url, "scans": options.home}),
    );
    if options.browser && open::that_detached(&url).is_err() {
        ui.note("no browser could be opened: open the address above yourself");
    }
    let daemon = Daemon { session, gate: std::sync::Arc::new(gate), stop };
    http::serve(listener, daemon).await.context("the daemon cannot go on listening")
}

fn warn_of_listening(ip: IpAddr, ui: &Ui) {
    if !ip.is_loopback() {
        ui.warn(
            "the capture can be reached from the network, without encryption: whoever can read the traffic can see the \
             pictures, take the token and give orders; use --listen only in a network in which you trust everybody",
        );
    }
}
