//! A simulated scan as a source of views: the pipeline builds from memory what it would read from disk.

use reconstruct::board::BoardFile;
use reconstruct::recording::{Rig, ViewImages};

use super::SimulatedScan;
use crate::pipeline::ViewSource;
use crate::recording::RecordingError;

impl ViewSource for SimulatedScan {
    fn rig(&self) -> Rig {
        self.rig
    }

    fn board(&self) -> Option<&BoardFile> {
        self.board_file.as_ref()
    }

    fn view_names(&self) -> Vec<String> {
        self.views.iter().map(|view| view.name.clone()).collect()
    }

    fn load_view(&self, index: usize) -> Result<ViewImages, RecordingError> {
        self.views.get(index).cloned().ok_or(RecordingError::NoSuchView(index))
    }

    fn is_stream(&self) -> bool {
        self.board_file.is_none()
    }
}
