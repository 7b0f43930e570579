//! Going on with a recording that was not finished: its board, its views, and the sensor that took them.

use std::path::Path;
use std::sync::{Arc, Mutex};

use reconstruct::cloud::PointCloud;
use reconstruct::recording::Device;

use super::taking::view_of;
use super::{Board, Session, View, known_board};
use crate::capture::journal::Journal;
use crate::capture::preview;
use crate::capture::refusal::Refusal;
use crate::capture::state::{Step, TakenView};
use crate::recording::Recording;
use crate::ui::Ui;

impl Session {
    /// Takes up the recording in `folder`; what is left of a view in work goes.
    pub fn resume(self: &Arc<Self>, folder: &Path, ui: &Ui) -> Result<(), Refusal> {
        let journal = Journal::resume(folder)?;
        let no_board =
            || Refusal::not_now("there is no board.json, so no views can be added to this recording");
        let board = known_board(journal.board().cloned().ok_or_else(no_board)?)?;
        let views = self.views(&journal, &board, ui)?;
        let device = journal.file().device.clone();
        let address = self.sensor_like(&device);
        self.change(|inner| {
            inner.folder = Some(journal.folder().to_owned());
            inner.journal = Some(Arc::new(Mutex::new(journal)));
            inner.board = Some(board);
            inner.views = views;
        });
        self.draw_preview();
        // Where the sensor is not the one of before, the page asks for it.
        if let Some(address) = address
            && self.choose_sensor(&address).is_err()
        {
            self.change(|inner| inner.step = Step::Sensor);
        }
        Ok(())
    }

    /// The address of the sensor that took the recording, where it is there.
    fn sensor_like(&self, device: &Device) -> Option<String> {
        if device.backend == "simulated" {
            return Some(format!("simulated:{}", device.serial));
        }
        let found = self.opener.look();
        let mut same = found.sensors.iter().filter(|s| s.usable && s.backend == device.backend);
        same.find(|s| s.serial == device.serial).map(|s| s.address.clone())
    }

    /// The views that are there, looked at anew for the preview.
    fn views(&self, journal: &Journal, board: &Board, ui: &Ui) -> Result<Vec<View>, Refusal> {
        let entries = &journal.file().views;
        if entries.is_empty() {
            return Ok(Vec::new());
        }
        let recording = Recording::open(journal.folder()).map_err(|e| Refusal::failed(&e))?;
        let kept = self.opener.calibration(&journal.file().device, &recording.rig());
        let depth_prior = kept.map(|calibration| calibration.prior());
        let stage = ui.stage("reading the views", entries.len());
        let mut views = Vec::new();
        for (index, entry) in entries.iter().enumerate() {
            let images = recording.load_view(index).map_err(|e| Refusal::failed(&e))?;
            let seen = preview::of_view(recording.rig(), &board.known, depth_prior, images);
            let (name, frames) = (entry.name.clone(), entry.frames.len());
            views.push(match seen {
                Ok(seen) => view_of(name, frames, seen, 0.0),
                Err(_) => unseen(name, frames),
            });
            stage.step();
        }
        stage.done();
        Ok(views)
    }
}

/// A view that is there but says nothing.
fn unseen(name: String, frames: usize) -> View {
    let taken = TakenView {
        name,
        azimuth: 0.0,
        elevation: 0.0,
        distance: 0.0,
        tags: 0,
        frames,
        points: 0,
        seconds: 0.0,
    };
    View { taken, cloud: Arc::new(PointCloud::default()) }
}
