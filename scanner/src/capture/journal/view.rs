//! A view being written: its frames as they come. Dropped before it is confirmed, it leaves nothing.

use std::fs;
use std::path::{Path, PathBuf};

use kinect::source::Frame;
use reconstruct::recording::{FrameEntry, ViewEntry};

use super::error::{JournalError, at};
use super::{VIEWS, disk};
use crate::pictures;

/// Writes the frames of one view.
#[derive(Debug)]
pub struct ViewWriter {
    folder: PathBuf,
    entry: ViewEntry,
    kept: bool,
}

impl ViewWriter {
    pub(super) fn begin(recording: &Path, name: String) -> Result<Self, JournalError> {
        let folder = recording.join(VIEWS).join(&name);
        // What a failed removal left under this name.
        disk::remove(&folder)?;
        fs::create_dir(&folder).map_err(at(&folder))?;
        Ok(Self { folder, entry: ViewEntry { name, frames: Vec::new(), still: None }, kept: false })
    }

    /// The view's name.
    pub fn name(&self) -> &str {
        &self.entry.name
    }

    /// Writes a frame as it came.
    pub fn add(&mut self, frame: &Frame) -> Result<(), JournalError> {
        let number = self.entry.frames.len();
        let (color, depth) = (format!("color-{number:03}.png"), format!("depth-{number:03}.png"));
        let (a, b) = rayon::join(
            || self.write(&color, &pictures::record_color(&frame.color)?),
            || self.write(&depth, &pictures::record_depth(&frame.depth)?),
        );
        a.and(b)?;
        let inside = |file: &str| format!("{VIEWS}/{}/{file}", self.entry.name);
        let (color, depth) = (inside(&color), inside(&depth));
        self.entry.frames.push(FrameEntry { color, depth, timestamp_nanos: frame.color_timestamp_nanos });
        Ok(())
    }

    /// Written now, synced with all others at the end: the disk works while the next frames come.
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), JournalError> {
        let path = self.folder.join(name);
        fs::write(&path, bytes).map_err(at(&path))
    }

    /// Waits until all frames are on the disk; gives what the description says of them.
    pub(super) fn sync(&self) -> Result<ViewEntry, JournalError> {
        for entry in fs::read_dir(&self.folder).map_err(at(&self.folder))? {
            let path = entry.map_err(at(&self.folder))?.path();
            fs::File::open(&path).and_then(|file| file.sync_all()).map_err(at(&path))?;
        }
        disk::sync_folder(&self.folder)?;
        Ok(self.entry.clone())
    }

    pub(super) fn keep(mut self) {
        self.kept = true;
    }
}

impl Drop for ViewWriter {
    fn drop(&mut self) {
        if !self.kept {
            // What cannot be removed now is removed as a leftover later.
            let _ = disk::remove(&self.folder);
        }
    }
}
