//! Taking a view: frames as they come to the disk, then a look whether the view can be used, then it is confirmed.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use kinect::source::{Ability, Frame};
use reconstruct::board::{BoardFile, KnownBoard};
use reconstruct::calibrate::CalibrationPrior;
use reconstruct::image::ColorImage;
use reconstruct::recording::{Rig, ViewImages};

use super::{Done, Inner, Preview, Session, View, lock};
use crate::capture::camera::{Camera, Remote};
use crate::capture::journal::{Journal, JournalError, ViewWriter};
use crate::capture::live::has_sizes_of;
use crate::capture::preview::{self, ViewPreview};
use crate::capture::refusal::Refusal;
use crate::capture::state::{PreviewState, Step, TakenView, Taking};

/// Frames of a view.
pub(super) const FRAMES: usize = 10;
/// A sensor that sends nothing for this long is not waited for.
const FRAME_TIME: Duration = Duration::from_secs(3);
/// A sharper picture that takes longer is done without.
const STILL_TIME: Duration = Duration::from_secs(3);
/// How often a wait is interrupted to see whether all is over.
const GLANCE: Duration = Duration::from_millis(50);
/// Folders of one day that are tried.
const MOST_FOLDERS: usize = 10_000;

/// What taking a view needs.
struct Job {
    journal: Arc<Mutex<Journal>>,
    rig: Rig,
    board: KnownBoard,
    depth_prior: Option<CalibrationPrior>,
    /// Where a sharper picture can be ordered.
    stills: Option<Remote>,
}

/// A sharper picture that was ordered.
struct Still {
    ordered: Instant,
    coming: Receiver<Arc<ColorImage>>,
}

impl Session {
    /// Takes a view now. When this returns, no crash can lose it any more.
    pub fn take_view(&self) -> Done {
        let started = Instant::now();
        let job = self.begin_taking()?;
        let result = self.take(&job, started);
        let still = self.change(|inner| match result {
            Ok((view, still)) => {
                let name = view.taken.name.clone();
                inner.views.push(view);
                inner.error = None;
                let still = still.map(|still| (name, still));
                if still.is_none() {
                    inner.taken();
                }
                Ok(still)
            }
            Err(refusal) => {
                inner.error = Some(refusal.to_string());
                inner.taken();
                Err(refusal)
            }
        })?;
        self.draw_preview();
        if let Some((name, still)) = still {
            let is_kept = self.keep_still(&job, &name, &still);
            self.change(|inner| {
                inner.no_stills |= !is_kept;
                inner.taken();
            });
        }
        Ok(())
    }

    /// Waits for the sharper picture of a view that is confirmed. Without it the view is as good.
    fn keep_still(&self, job: &Job, name: &str, still: &Still) -> bool {
        while still.ordered.elapsed() < STILL_TIME && !self.frames.is_stopped() {
            match still.coming.recv_timeout(GLANCE) {
                Ok(picture) => return lock(&job.journal).add_still(name, &picture).is_ok(),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
        false
    }

    /// Takes a view back.
    pub fn undo_view(&self, name: &str) -> Done {
        self.change(|inner| {
            inner.check_rests()?;
            let none = || Refusal::absent(format!("there is no view {name}"));
            let journal = inner.journal.as_ref().ok_or_else(none)?;
            lock(journal).undo(name)?;
            inner.views.retain(|view| view.taken.name != name);
            inner.error = None;
            Ok::<(), Refusal>(())
        })?;
        self.draw_preview();
        Ok(())
    }

    /// The preview's stream and its version.
    pub fn preview(&self) -> Result<(u64, Arc<Vec<u8>>), Refusal> {
        let inner = self.lock();
        let preview =
            inner.preview.as_ref().ok_or_else(|| Refusal::absent("there is no preview yet: take a view"))?;
        Ok((preview.state.version, Arc::clone(&preview.stream)))
    }

    fn begin_taking(&self) -> Result<Job, Refusal> {
        self.change(|inner| {
            inner.check_rests()?;
            if inner.step != Step::Views {
                return Err(Refusal::not_now("views are taken once sensor and board are chosen"));
            }
            let sensor = inner.sensor.as_ref().filter(|sensor| sensor.running);
            let info = inner.camera.as_ref().filter(|_| sensor.is_some()).map(|camera| camera.info().clone());
            let info = info
                .ok_or_else(|| Refusal::not_now("the sensor does not run: plug it in, or choose another"))?;
            let board = inner.board.as_ref().ok_or_else(|| Refusal::not_now("choose the board first"))?;
            let board = board.known.clone();
            let journal = if let Some(journal) = &inner.journal {
                Arc::clone(journal)
            } else {
                let folder = self.new_folder()?;
                let file = BoardFile::Known(board.clone());
                let journal = Arc::new(Mutex::new(Journal::begin(&folder, &info, &file)?));
                inner.folder = Some(folder);
                Arc::clone(inner.journal.insert(journal))
            };
            inner.taking = Some(Taking { view: String::new(), frames: 0, of: FRAMES });
            let offers = info.abilities.contains(&Ability::Stills) && !inner.no_stills;
            let stills = inner.camera.as_ref().filter(|_| offers).map(Camera::remote);
            Ok(Job { journal, rig: info.rig, board, depth_prior: inner.depth_prior, stills })
        })
    }

    /// A folder of today that nobody has.
    fn new_folder(&self) -> Result<PathBuf, Refusal> {
        let io = |path: &Path, source| JournalError::Io { path: path.to_owned(), source };
        std::fs::create_dir_all(&self.home).map_err(|e| io(&self.home, e))?;
        let today = time::OffsetDateTime::now_utc().date();
        for number in 1..MOST_FOLDERS {
            let folder = self.home.join(format!("{today}-{number}"));
            match std::fs::create_dir(&folder) {
                Ok(()) => return Ok(folder),
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(io(&folder, e).into()),
            }
        }
        Err(Refusal::not_now(format!("there are too many scans in {}: tidy up there", self.home.display())))
    }

    fn take(&self, job: &Job, started: Instant) -> Result<(View, Option<Still>), Refusal> {
        let mut writer = lock(&job.journal).begin_view(FRAMES)?;
        let name = writer.name().to_owned();
        let images = self.collect(&mut writer, &job.rig)?;
        // At once: it is to show what the frames show. It comes while they are looked at.
        let order = |remote: &Remote| Still { ordered: Instant::now(), coming: remote.still() };
        let still = job.stills.as_ref().map(order);
        let (rig, board) = (job.rig, &job.board);
        let seen = preview::of_view(rig, board, job.depth_prior, images)
            .map_err(|reason| Refusal::not_now(format!("the view was not kept: {reason}")))?;
        lock(&job.journal).confirm(writer)?;
        Ok((view_of(name, FRAMES, seen, started.elapsed().as_secs_f64()), still))
    }

    /// All frames of the view, to the disk as they come; all depth images and the middle picture stay.
    fn collect(&self, writer: &mut ViewWriter, rig: &Rig) -> Result<ViewImages, Refusal> {
        let name = writer.name().to_owned();
        let frames = self.frames.take_all(FRAMES);
        let mut taken: Vec<Arc<Frame>> = Vec::new();
        let mut result = Ok(());
        while taken.len() < FRAMES && result.is_ok() {
            let (view, count) = (name.clone(), taken.len());
            self.change(|inner| inner.taking = Some(Taking { view, frames: count, of: FRAMES }));
            result = match frames.recv_timeout(FRAME_TIME) {
                Ok(frame) if !has_sizes_of(&frame, rig) => Err(Refusal::not_now(
                    "the sensor sends pictures of another size than it announced; choose it anew",
                )),
                Ok(frame) => {
                    let written = writer.add(&frame).map_err(Refusal::from);
                    taken.push(frame);
                    written
                }
                Err(_) => Err(Refusal::not_now("the sensor sent no pictures, so the view was not taken")),
            };
        }
        self.frames.enough();
        result?;
        let color = (*taken[FRAMES / 2].color).clone();
        Ok(ViewImages { name, color, depths: taken.iter().map(|frame| (*frame.depth).clone()).collect() })
    }

    /// Draws the preview of all views anew.
    pub(super) fn draw_preview(&self) {
        let clouds: Vec<_> = self.lock().views.iter().map(|view| Arc::clone(&view.cloud)).collect();
        let merged = preview::merged(clouds.iter().map(AsRef::as_ref));
        self.change(|inner| {
            let version = inner.next_preview();
            inner.preview = merged.map(|(stream, points)| Preview {
                state: PreviewState { version, points },
                stream: Arc::new(stream),
            });
        });
    }
}

impl Inner {
    /// The view in work is done with.
    fn taken(&mut self) {
        self.taking = None;
        self.trigger.taken(Instant::now());
    }

    fn next_preview(&mut self) -> u64 {
        self.preview_version += 1;
        self.preview_version
    }
}

/// A view as the page is told of it.
pub(super) fn view_of(name: String, frames: usize, seen: ViewPreview, seconds: f64) -> View {
    let [azimuth, elevation, distance] = preview::place_of(&seen.world_from_camera);
    let taken = TakenView {
        name,
        azimuth,
        elevation,
        distance,
        tags: seen.tags,
        frames,
        points: seen.points,
        seconds: (seconds * 100.0).round() / 100.0,
    };
    View { taken, cloud: Arc::new(seen.cloud) }
}
