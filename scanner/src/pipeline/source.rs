//! Where views come from: a recording on disk, or a simulated scan in memory.

use reconstruct::board::BoardFile;
use reconstruct::recording::{Rig, ViewImages};

use crate::recording::{Recording, RecordingError};

/// Views to build from. Loading may be called from several threads.
pub trait ViewSource: Sync {
    /// The cameras.
    fn rig(&self) -> Rig;
    /// The board, where one is known.
    fn board(&self) -> Option<&BoardFile>;
    /// Names of the views, in order.
    fn view_names(&self) -> Vec<String>;
    /// The images of a view.
    fn load_view(&self, index: usize) -> Result<ViewImages, RecordingError>;
    /// Whether the views are neighbouring frames of one moving stream.
    fn is_stream(&self) -> bool;
    /// Number of views.
    fn view_count(&self) -> usize {
        self.view_names().len()
    }
}

impl ViewSource for Recording {
    fn rig(&self) -> Rig {
        self.rig()
    }

    fn board(&self) -> Option<&BoardFile> {
        self.board()
    }

    fn view_names(&self) -> Vec<String> {
        self.view_names()
    }

    fn load_view(&self, index: usize) -> Result<ViewImages, RecordingError> {
        self.load_view(index)
    }

    fn is_stream(&self) -> bool {
        self.is_stream()
    }
}
