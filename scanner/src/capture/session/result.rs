//! The model while it is looked at: points away by hand and back, and what of it would leave the computer.

use std::sync::Arc;

use serde::Serialize;

use super::{Done, Session};
use crate::capture::model::{Edition, Model, Shape};
use crate::capture::refusal::Refusal;
use crate::capture::state::Step;
use crate::upload::files_to_send;

/// What publishing sends, and what stays.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Leaving {
    pub files: Vec<LeavingFile>,
    pub stays: Vec<String>,
}

/// A file that is sent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeavingFile {
    pub name: String,
    pub bytes: u64,
    pub what: String,
}

impl Session {
    /// The model's points as they are now, and their version.
    pub fn model(&self) -> Result<(u64, Arc<Shape>), Refusal> {
        let inner = self.lock();
        let model = inner.model.as_ref().ok_or_else(no_model)?;
        Ok((model.version(), model.shape()))
    }

    /// The picture for the listing.
    pub fn poster(&self) -> Result<Vec<u8>, Refusal> {
        let edition = self.written()?;
        std::fs::read(edition.folder().join("poster.png")).map_err(|e| Refusal::failed(&e))
    }

    /// Takes points away, counted in the stream of the present version.
    pub fn remove_points(self: &Arc<Self>, places: &[u32]) -> Done {
        let (version, shape) = self.editable()?;
        let left = shape.without(places)?;
        self.change(|inner| {
            inner.model.as_mut().ok_or_else(no_model)?.replace(left, version).map_err(Refusal::from)
        })?;
        self.write_behind();
        Ok(())
    }

    /// Takes the last removal back.
    pub fn undo_removal(self: &Arc<Self>) -> Done {
        self.editable()?;
        self.change(|inner| {
            let undone = inner.model.as_mut().ok_or_else(no_model)?.undo();
            undone.then_some(()).ok_or_else(|| Refusal::not_now("nothing was removed"))
        })?;
        self.write_behind();
        Ok(())
    }

    /// Exactly what publishing sends.
    pub fn leaving(&self) -> Result<Leaving, Refusal> {
        let edition = self.written()?;
        let files = files_to_send(edition.folder()).map_err(|e| Refusal::failed(&e))?;
        let file =
            |(name, bytes): (String, u64)| LeavingFile { what: what_is(&name).to_owned(), name, bytes };
        Ok(Leaving {
            files: files.into_iter().map(file).collect(),
            stays: [
                "recording (pictures of the room, depth images)",
                "board.json",
                "model.asc and model.glb (the same points in other formats)",
            ]
            .map(str::to_owned)
            .to_vec(),
        })
    }

    /// The model as it is now, on the disk.
    pub(super) fn written(&self) -> Result<Edition, Refusal> {
        let edition = self.lock().model.as_ref().map(Model::edition).ok_or_else(no_model)?;
        edition.write().map_err(|e| Refusal::failed(&e))?;
        Ok(edition)
    }

    /// The model's present points, where they may be changed now.
    fn editable(&self) -> Result<(u64, Arc<Shape>), Refusal> {
        let inner = self.lock();
        inner.check_rests()?;
        if !matches!(inner.step, Step::Result | Step::Published) {
            return Err(Refusal::not_now("look at the model first"));
        }
        let model = inner.model.as_ref().ok_or_else(no_model)?;
        Ok((model.version(), model.shape()))
    }

    /// Lets the files follow while the seller goes on.
    fn write_behind(self: &Arc<Self>) {
        let session = Arc::clone(self);
        let write = move || {
            if let Err(refusal) = session.written() {
                session.change(|inner| inner.error = Some(refusal.to_string()));
            }
        };
        // Where no thread can be had, publishing and ending write what is missing.
        let _ = std::thread::Builder::new().name("write".to_owned()).spawn(write);
    }
}

fn no_model() -> Refusal {
    Refusal::absent("there is no model yet: build it first")
}

fn what_is(name: &str) -> &'static str {
    match name {
        "report.json" => "size, quality, and where the sensor stood on the board",
        "poster.png" | "poster.jpg" => "the picture for the listing",
        _ => "the points you see",
    }
}
