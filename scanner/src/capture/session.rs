//! One capture: the sensor, the board, the views, the model, and the step the seller is at.
//!
//! All of it stands behind one mutex that is held for moments only. What takes longer (a view, a build, an upload) marks
//! its beginning, works without the mutex, and comes back with what it found; orders that would disturb it are refused
//! meanwhile. Everything blocks: the HTTP side calls it from threads that may.

mod building;
mod choosing;
mod lamp;
mod looking;
mod publishing;
mod result;
mod resuming;
mod taking;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use kinect::source::Control;
use reconstruct::board::{BoardFile, Family, KnownBoard};
use reconstruct::calibrate::CalibrationPrior;
use reconstruct::cloud::PointCloud;
use tokio::sync::watch;

use super::auto::{SECONDS, Trigger};
use super::camera::{Camera, Frames, Remote};
use super::journal::{self, Journal};
use super::live::Picture;
use super::model::Model;
use super::preview::sectors;
use super::refusal::Refusal;
use super::sensors::{Found, Opener, always_there};
use super::simulated;
use super::state::{
    AutoMode, BoardState, BuildState, OpenSensor, PreviewState, PublishState, State, Step, TakenView, Taking,
};
use crate::simulate::{Paper, ring};
use lamp::Lamp;

/// Result of an order.
pub type Done = Result<(), Refusal>;

/// How long ending waits for a view in work.
const CLOSE_TIME: Duration = Duration::from_secs(2);
/// A board with fewer tags is placed poorly.
const FEW_TAGS: usize = 8;

/// A running capture.
pub struct Session {
    inner: Mutex<Inner>,
    /// Counts changes of the state.
    changes: watch::Sender<u64>,
    /// The newest live picture; drawn only while somebody looks on.
    pictures: watch::Sender<Option<Arc<Picture>>>,
    frames: Arc<Frames>,
    opener: Box<dyn Opener>,
    /// Where recordings go.
    home: PathBuf,
    /// Server to propose.
    server: Option<String>,
}

struct Inner {
    step: Step,
    found: Found,
    camera: Option<Camera>,
    /// Counts opened sensors, so that what an earlier one still reports is not taken for the present one's.
    camera_number: u64,
    sensor: Option<OpenSensor>,
    /// What is known of the sensor's depth, where it was calibrated.
    depth_prior: Option<CalibrationPrior>,
    lamp: Lamp,
    /// The sensor was asked for a sharper picture and gave none: it is asked no more.
    no_stills: bool,
    board: Option<Board>,
    journal: Option<Arc<Mutex<Journal>>>,
    /// Where the journal lies.
    folder: Option<PathBuf>,
    views: Vec<View>,
    taking: Option<Taking>,
    trigger: Trigger,
    preview: Option<Preview>,
    preview_version: u64,
    build: Option<BuildState>,
    /// Counts builds, so that a cancelled one is not listened to.
    build_number: u64,
    model: Option<Model>,
    /// Counts the versions of all models of this capture.
    model_version: u64,
    publish: Option<PublishState>,
    error: Option<String>,
    closed: bool,
}

#[derive(Clone)]
struct Board {
    known: KnownBoard,
    state: BoardState,
}

struct View {
    taken: TakenView,
    cloud: Arc<PointCloud>,
}

struct Preview {
    state: PreviewState,
    stream: Arc<Vec<u8>>,
}

/// Which board to use.
#[derive(Debug, Clone)]
pub enum BoardChoice {
    /// The one that this program prints.
    Paper(Paper),
    /// A description.
    File(Vec<u8>),
}

impl Session {
    /// Nothing chosen yet. Recordings go below `home`.
    pub fn new(opener: Box<dyn Opener>, home: &Path, server: Option<String>) -> Arc<Self> {
        let inner = Inner {
            step: Step::Sensor,
            found: always_there(),
            camera: None,
            camera_number: 0,
            sensor: None,
            depth_prior: None,
            lamp: Lamp::default(),
            no_stills: false,
            board: None,
            journal: None,
            folder: None,
            views: Vec::new(),
            taking: None,
            trigger: Trigger::manual(Instant::now()),
            preview: None,
            preview_version: 0,
            build: None,
            build_number: 0,
            model: None,
            model_version: 0,
            publish: None,
            error: None,
            closed: false,
        };
        let session = Arc::new(Self {
            inner: Mutex::new(inner),
            changes: watch::Sender::new(0),
            pictures: watch::Sender::new(None),
            frames: Arc::default(),
            opener,
            home: home.to_owned(),
            server,
        });
        looking::start(&session);
        session
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes something and tells everybody.
    fn change<T>(&self, change: impl FnOnce(&mut Inner) -> T) -> T {
        let result = {
            let mut inner = self.lock();
            let result = change(&mut inner);
            inner.show_by_lamp();
            result
        };
        self.changes.send_modify(|count| *count += 1);
        result
    }

    /// Told of every change.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// Live pictures, newest only; they are drawn while such a receiver is there.
    pub fn pictures(&self) -> watch::Receiver<Option<Arc<Picture>>> {
        self.pictures.subscribe()
    }

    /// Everything for the page.
    pub fn state(&self) -> State {
        let inner = self.lock();
        let folder = inner.folder.clone();
        let azimuths: Vec<f64> = inner.views.iter().map(|view| view.taken.azimuth).collect();
        State {
            version: 1,
            step: inner.step,
            sensors: inner.found.sensors.clone(),
            libraries: inner.found.libraries.clone(),
            sensor: inner.sensor.clone(),
            board: inner.board.as_ref().map(|board| board.state.clone()),
            views: inner.views.iter().map(|view| view.taken.clone()).collect(),
            sectors: sectors(&azimuths),
            taking: inner.taking.clone(),
            auto: inner.trigger.state(),
            preview: inner.preview.as_ref().map(|preview| preview.state),
            build: inner.build.clone(),
            result: inner.model.as_ref().map(Model::state),
            publish: inner.publish.clone(),
            free_bytes: journal::free_bytes(folder.as_deref().unwrap_or(&self.home)).unwrap_or(0),
            folder,
            server: self.server.clone(),
            error: inner.error.clone(),
        }
    }

    /// Looks for sensors again.
    pub fn look_for_sensors(&self) -> Done {
        let found = self.opener.look();
        self.change(|inner| inner.found = found);
        Ok(())
    }

    /// Asks the sensor for something it can do.
    pub fn control(&self, control: Control) -> Done {
        let remote: Remote = {
            let inner = self.lock();
            if inner.taking.is_some() {
                return Err(Refusal::not_now("a view is being taken: wait a moment"));
            }
            let no_sensor = || Refusal::not_now("choose a sensor first");
            inner.camera.as_ref().map(Camera::remote).ok_or_else(no_sensor)?
        };
        Ok(remote.control(control)?)
    }

    /// Chooses the board.
    pub fn choose_board(self: &Arc<Self>, choice: &BoardChoice) -> Done {
        let board = board_of(choice)?;
        let address = {
            let inner = self.lock();
            inner.check_rests()?;
            let sensor = inner.sensor.as_ref().ok_or_else(|| Refusal::not_now("choose a sensor first"))?;
            let same = inner.board.as_ref().is_some_and(|present| present.known == board.known);
            if !same && !inner.views.is_empty() {
                let text = "the views so far were taken on another board: undo them, or begin a new product";
                return Err(Refusal::not_now(text));
            }
            // The simulated sensor sees the board that was chosen.
            let seen =
                inner.board.as_ref().map_or_else(simulated::usual_board, |present| present.known.clone());
            (seen != board.known && simulated::is_simulated(&sensor.address)).then(|| sensor.address.clone())
        };
        if let Some(address) = address {
            self.open(&address, Some(&board.known))?;
        }
        self.change(|inner| {
            if let Some(journal) = &inner.journal {
                lock(journal).set_board(&BoardFile::Known(board.known.clone()))?;
            }
            inner.board = Some(board);
            inner.step = Step::Views;
            inner.error = None;
            Ok(())
        })
    }

    /// Says when views are taken by themselves.
    pub fn set_auto(&self, mode: AutoMode, seconds: f64) -> Done {
        if !SECONDS.contains(&seconds) {
            let text = format!("between {} and {} seconds are possible", SECONDS.start(), SECONDS.end());
            return Err(Refusal::wrong(text));
        }
        self.change(|inner| inner.trigger.set(mode, seconds, Instant::now()));
        Ok(())
    }

    /// Goes back to an earlier step, or to the result once there is one; nothing that was taken is lost.
    pub fn go_to(&self, step: Step) -> Done {
        self.change(|inner| {
            inner.check_rests()?;
            let missing = match step {
                Step::Board | Step::Views if inner.sensor.is_none() => Some("choose a sensor first"),
                Step::Views if inner.board.is_none() => Some("choose the board first"),
                Step::Result if inner.model.is_none() => Some("build the model first"),
                Step::Sensor | Step::Board | Step::Views | Step::Result => None,
                _ => Some("this step cannot be gone to; it comes by itself"),
            };
            if let Some(text) = missing {
                return Err(Refusal::not_now(text));
            }
            inner.step = step;
            inner.error = None;
            Ok(())
        })
    }

    /// Begins another product with the same sensor and board.
    pub fn begin_another(&self) -> Done {
        self.change(|inner| {
            inner.check_rests()?;
            (inner.journal, inner.folder) = (None, None);
            inner.views.clear();
            (inner.preview, inner.model, inner.publish, inner.error) = (None, None, None, None);
            inner.trigger = Trigger::manual(Instant::now());
            inner.step = match (&inner.sensor, &inner.board) {
                (None, _) => Step::Sensor,
                (_, None) => Step::Board,
                _ => Step::Views,
            };
            Ok(())
        })
    }

    /// Ends it in order: what is being written is written, the sensor is stopped.
    pub fn close(&self) {
        self.frames.stop();
        // A view in work notices, and takes its files away.
        let asked = Instant::now();
        while self.lock().taking.is_some() && asked.elapsed() < CLOSE_TIME {
            std::thread::sleep(Duration::from_millis(10));
        }
        let camera = self.change(|inner| {
            inner.closed = true;
            inner.build_number += 1;
            inner.camera.take()
        });
        drop(camera);
        let edition = self.lock().model.as_ref().map(Model::edition);
        if let Some(edition) = edition {
            // There is nobody left to tell; the model of before is still there.
            let _ = edition.write();
        }
        // Whoever works on the journal is waited for.
        let journal = self.lock().journal.take();
        drop(journal.as_ref().map(|journal| lock(journal)));
    }
}

impl Inner {
    /// Refuses while something is under way that an order would disturb.
    fn check_rests(&self) -> Done {
        let busy = if self.closed {
            Some("the program is ending")
        } else if self.taking.is_some() {
            Some("a view is being taken: wait a moment")
        } else if self.build.is_some() {
            Some("the model is being built: wait, or cancel it")
        } else if self.step == Step::Publishing {
            Some("the model is being sent: wait until it is there")
        } else {
            None
        };
        busy.map_or(Ok(()), |text| Err(Refusal::not_now(text)))
    }
}

fn lock(journal: &Mutex<Journal>) -> MutexGuard<'_, Journal> {
    journal.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The board of a choice, with what the seller should know of it.
fn board_of(choice: &BoardChoice) -> Result<Board, Refusal> {
    match choice {
        BoardChoice::Paper(paper) => {
            let known = ring(*paper, Family::Aruco4x4_50);
            let name = format!("{} {}", format!("{paper:?}").to_uppercase(), known.family.name());
            Ok(board_with(name, known))
        }
        BoardChoice::File(bytes) => {
            let board = crate::recording::parse_board(bytes).map_err(|e| Refusal::wrong(e.to_string()))?;
            known_board(board)
        }
    }
}

fn known_board(board: BoardFile) -> Result<Board, Refusal> {
    match board {
        BoardFile::Known(known) => {
            let paper =
                [Paper::A4, Paper::A3, Paper::A2].into_iter().find(|p| ring(*p, known.family) == known);
            let size = paper.map_or("Board of its own".to_owned(), |p| format!("{p:?}").to_uppercase());
            Ok(board_with(format!("{size} {}", known.family.name()), known))
        }
        BoardFile::Loose(_) => Err(Refusal::wrong(
            "loose sheets cannot be used here, since their places are known only after the scan: use a printed board",
        )),
    }
}

fn board_with(name: String, known: KnownBoard) -> Board {
    let mut warnings = Vec::new();
    if known.tags.len() < FEW_TAGS {
        warnings.push(format!(
            "The board has only {} tags: views will be placed less exactly.",
            known.tags.len()
        ));
    }
    let state = BoardState { name, tags: known.tags.len(), warnings };
    Board { known, state }
}

#[cfg(test)]
mod tests;
