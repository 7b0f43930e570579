//! Building the model behind the page's back: progress into the state, and an end when it is cancelled.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};

use reconstruct::report::Report;

use super::{Done, Session, lock};
use crate::capture::model::{Model, Shape};
use crate::capture::refusal::{Refusal, sentence};
use crate::capture::state::{BuildState, Step};
use crate::config::Config;
use crate::output::OutputDir;
use crate::pipeline;
use crate::recording::Recording;
use crate::result;
use crate::ui::{Listener, Ui};
use crate::unit_calibration;

/// Folder of the model inside the recording's.
pub(super) const MODEL: &str = "model";
/// Stages of a build with a board: load, markers, calibrate, cut, align, fuse, surface, write.
const STAGES: usize = 8;
/// The same seed as `scan-product build` takes, so that both give the same bytes.
const SEED: u64 = 1;

/// Tells the state how far a build is.
#[derive(Debug)]
struct Progress {
    session: Weak<Session>,
    number: u64,
    stages: AtomicU64,
}

impl Listener for Progress {
    fn stage(&self, name: &str, _total: usize) {
        let done = self.stages.fetch_add(1, Ordering::Relaxed) as usize;
        let Some(session) = self.session.upgrade() else { return };
        session.change(|inner| {
            if inner.build_number == self.number {
                inner.build = Some(BuildState { stage: name.to_owned(), done, of: STAGES });
            }
        });
    }

    fn advanced(&self, _steps: u64) {}

    fn is_wanted(&self) -> bool {
        self.session.upgrade().is_some_and(|session| session.lock().build_number == self.number)
    }
}

impl Session {
    /// Begins to build the model of all views.
    pub fn build(self: &Arc<Self>) -> Done {
        let (folder, number, version) = self.change(|inner| {
            inner.check_rests()?;
            let none = || Refusal::not_now("take at least one view first");
            let journal = inner.journal.as_ref().filter(|_| !inner.views.is_empty()).ok_or_else(none)?;
            let folder = lock(journal).folder().to_owned();
            inner.build_number += 1;
            inner.model_version += 1;
            inner.build = Some(BuildState { stage: "load".to_owned(), done: 0, of: STAGES });
            (inner.step, inner.error, inner.publish) = (Step::Building, None, None);
            Ok::<_, Refusal>((folder, inner.build_number, inner.model_version))
        })?;
        let session = Arc::clone(self);
        let work = move || session.build_in(&folder, number, version);
        let spawned = std::thread::Builder::new().name("build".to_owned()).spawn(work);
        if let Err(error) = spawned {
            self.change(|inner| (inner.build, inner.step) = (None, Step::Views));
            return Err(Refusal::failed(&error));
        }
        Ok(())
    }

    /// Gives the build up; an earlier model stays.
    pub fn cancel_build(&self) -> Done {
        self.change(|inner| {
            if inner.build.take().is_none() {
                return Err(Refusal::not_now("nothing is being built"));
            }
            inner.build_number += 1;
            inner.step = Step::Views;
            Ok(())
        })
    }

    fn build_in(self: &Arc<Self>, folder: &Path, number: u64, version: u64) {
        let progress = Progress { session: Arc::downgrade(self), number, stages: AtomicU64::new(0) };
        let built = built(folder, &Ui::followed_by(Arc::new(progress)));
        // In one go with the decision: a build that was cancelled replaces nothing.
        self.change(|inner| {
            // Cancelled meanwhile: nobody is interested.
            if inner.build_number != number {
                return;
            }
            inner.build = None;
            let built =
                built.and_then(|built| built.files.commit().map(|()| built.model).map_err(|e| e.to_string()));
            match built {
                Ok((shape, report)) => {
                    inner.model = Some(Model::new(shape, report, version, folder.join(MODEL)));
                    inner.step = Step::Result;
                }
                Err(reason) => {
                    inner.step = Step::Views;
                    inner.error = Some(sentence(&reason));
                }
            }
        });
    }
}

/// A model that is complete, beside the place where it belongs.
struct Built {
    files: OutputDir,
    model: (Shape, Report),
}

/// Builds and writes beside; why there is no model otherwise.
fn built(folder: &Path, ui: &Ui) -> Result<Built, String> {
    let recording = Recording::open(folder).map_err(|e| e.to_string())?;
    let depth_prior = unit_calibration::prior_of(&recording).map_err(|e| e.to_string())?;
    let config = Config { seed: SEED, depth_prior, ..Config::default() };
    let mut scan = pipeline::build(&recording, &config, ui).map_err(|e| e.to_string())?;
    if scan.model.vertices.is_empty() {
        return Err(format!("no model could be built: {}", scan.report.verdict_reason));
    }
    let stage = ui.stage("write", 1);
    let mesh = std::mem::take(&mut scan.model);
    let files = result::write_beside(&folder.join(MODEL), &mesh, &scan.report).map_err(|e| e.to_string())?;
    let shape = Shape::new(mesh).map_err(|e| e.to_string())?;
    stage.done();
    Ok(Built { files, model: (shape, scan.report) })
}
