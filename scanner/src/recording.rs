//! Recordings on disk: `recording.json`, `board.json` and the images beside them, read with every check before use.
//!
//! Nothing outside the folder is read, whatever the paths say; every error is one sentence that says what to do.

mod board;
mod description;
mod error;
mod writer;

use std::fs;
use std::path::{Component, Path, PathBuf};

use rayon::prelude::*;
use reconstruct::board::BoardFile;
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::pose;
use reconstruct::recording::{RecordingFile, Rig, ViewEntry, ViewImages};

pub use board::parse as parse_board;
pub(crate) use description::{check_camera, check_units};
pub use description::{parse as parse_description, parse_unfinished};
pub use error::RecordingError;
pub use writer::{OWNED_NAMES, RecordingWriter, check_place};

use crate::pictures;

/// Largest `recording.json` or `board.json` that is read.
const MAX_JSON_BYTES: u64 = 32 << 20;
/// Largest picture file that is read.
const MAX_PICTURE_BYTES: u64 = 64 << 20;
/// Most memory the images of one view may take.
const MAX_VIEW_BYTES: usize = 512 << 20;
/// A sensor's median distance outside of this means another unit, metres.
const PLAUSIBLE_MEDIAN_METRES: std::ops::RangeInclusive<f64> = 0.12..=8.0;

/// A recording whose description has been checked; images are read view by view.
#[derive(Debug, Clone)]
pub struct Recording {
    folder: PathBuf,
    file: RecordingFile,
    rig: Rig,
    views: Vec<ViewEntry>,
    board: Option<BoardFile>,
}

impl Recording {
    /// Reads and checks `recording.json` and, where there is one, `board.json`; the images must exist inside the folder.
    pub fn open(folder: &Path) -> Result<Self, RecordingError> {
        let folder = recording_folder(folder)?;
        let file = parse_description(&read_limited(&folder, "recording.json", MAX_JSON_BYTES)?)?;
        let board = if folder.join("board.json").exists() {
            Some(parse_board(&read_limited(&folder, "board.json", MAX_JSON_BYTES)?)?)
        } else {
            None
        };
        let views = file.view_entries();
        for frame in views.iter().flat_map(|view| &view.frames) {
            inside(&folder, &frame.color)?;
            inside(&folder, &frame.depth)?;
        }
        let color_from_depth =
            pose::from_row_major(&file.color_from_depth).ok_or(RecordingError::NotRigid)?;
        let rig = Rig { color: file.color, depth: file.depth.intrinsics, color_from_depth };
        Ok(Self { folder, file, rig, views, board })
    }

    /// The folder the recording lies in.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The description as written.
    pub fn file(&self) -> &RecordingFile {
        &self.file
    }

    /// The cameras and how they stand to each other.
    pub fn rig(&self) -> Rig {
        self.rig
    }

    /// The board, where `board.json` lies beside.
    pub fn board(&self) -> Option<&BoardFile> {
        self.board.as_ref()
    }

    /// Whether this is one moving stream rather than views of a resting scene.
    pub fn is_stream(&self) -> bool {
        self.file.views.is_empty()
    }

    /// Number of views, at least one.
    pub fn view_count(&self) -> usize {
        self.views.len()
    }

    /// Names of the views, in order.
    pub fn view_names(&self) -> Vec<String> {
        self.views.iter().map(|view| view.name.clone()).collect()
    }

    /// Decodes the images of view `index`: as many depth images as frames with any depth, unflipped where mirrored.
    pub fn load_view(&self, index: usize) -> Result<ViewImages, RecordingError> {
        let view = self.views.get(index).ok_or(RecordingError::NoSuchView(index))?;
        self.check_memory(view)?;
        let middle = &view.frames[view.frames.len() / 2];
        let (color, depths) = rayon::join(
            || self.load_color(&middle.color),
            || {
                let frames = view.frames.par_iter();
                frames.map(|frame| self.load_depth(&frame.depth)).collect::<Result<Vec<_>, _>>()
            },
        );
        let (color, mut depths) = (color?, depths?);
        depths.retain(|depth| depth.data.iter().any(|&raw| raw != 0));
        let first = depths.first().ok_or_else(|| RecordingError::NoDepth { view: view.name.clone() })?;
        check_unit(first)?;
        Ok(ViewImages { name: view.name.clone(), color, depths })
    }

    /// Decodes a colour picture that the description names, unflipped where mirrored.
    pub fn load_color(&self, path: &str) -> Result<ColorImage, RecordingError> {
        let camera = &self.file.color;
        let bytes = read_limited(&self.folder, path, MAX_PICTURE_BYTES)?;
        let image = pictures::decode_color(&bytes, camera.width as usize, camera.height as usize)
            .map_err(|source| RecordingError::Picture { path: path.to_owned(), source })?;
        Ok(if self.file.mirrored { image.mirrored() } else { image })
    }

    /// Decodes a depth picture that the description names, unflipped where mirrored.
    pub fn load_depth(&self, path: &str) -> Result<DepthImage, RecordingError> {
        let camera = &self.file.depth;
        let bytes = read_limited(&self.folder, path, MAX_PICTURE_BYTES)?;
        let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        let image = pictures::decode_depth(&bytes, width, height, camera.units_per_metre)
            .map_err(|source| RecordingError::Picture { path: path.to_owned(), source })?;
        Ok(if self.file.mirrored { image.mirrored() } else { image })
    }

    fn check_memory(&self, view: &ViewEntry) -> Result<(), RecordingError> {
        let pixels = |width: u32, height: u32| width as usize * height as usize;
        let depth = pixels(self.rig.depth.width, self.rig.depth.height) * 2;
        let most = (MAX_VIEW_BYTES - pixels(self.rig.color.width, self.rig.color.height) * 3) / depth.max(1);
        if view.frames.len() > most {
            return Err(RecordingError::TooManyFrames { view: view.name.clone(), most });
        }
        Ok(())
    }
}

/// The folder itself, also where `recording.json` in it was named.
fn recording_folder(path: &Path) -> Result<PathBuf, RecordingError> {
    let folder = if path.file_name().is_some_and(|name| name == "recording.json") && path.is_file() {
        path.parent().unwrap_or(path)
    } else {
        path
    };
    let nowhere = |source| RecordingError::NoFolder { path: path.to_owned(), source };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    folder.canonicalize().map_err(nowhere)
}

/// The path of a file inside the folder; refused where it leaves it, be it by name or by a link.
fn inside(folder: &Path, name: &str) -> Result<PathBuf, RecordingError> {
    let leaves = || RecordingError::LeavesFolder(name.to_owned());
    let path = Path::new(name);
    let plain = path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if name.is_empty() || name.contains('\0') || !plain {
        return Err(leaves());
    }
    let path = folder.join(path);
    let real =
        path.canonicalize().map_err(|source| RecordingError::Missing { path: name.to_owned(), source })?;
    if real.starts_with(folder) { Ok(real) } else { Err(leaves()) }
}

/// Reads a file inside the folder, up to a size.
pub(crate) fn read_limited(folder: &Path, name: &str, most: u64) -> Result<Vec<u8>, RecordingError> {
    let path = inside(folder, name)?;
    let unreadable = |source| RecordingError::Unreadable { path: name.to_owned(), source };
    let metadata = fs::metadata(&path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(RecordingError::NotAFile(name.to_owned()));
    }
    if metadata.len() > most {
        return Err(RecordingError::TooLarge { path: name.to_owned(), megabytes: metadata.len() >> 20 });
    }
    fs::read(&path).map_err(unreadable)
}

/// Refuses depth whose unit puts the scene where no sensor measures, and names the unit that would fit.
fn check_unit(depth: &DepthImage) -> Result<(), RecordingError> {
    let mut raw: Vec<u16> = depth.data.iter().copied().filter(|&raw| raw != 0).step_by(7).collect();
    let middle = raw.len() / 2;
    let Some((_, &mut median, _)) = (!raw.is_empty()).then(|| raw.select_nth_unstable(middle)) else {
        return Ok(());
    };
    let metres = f64::from(median) / depth.units_per_metre;
    if PLAUSIBLE_MEDIAN_METRES.contains(&metres) {
        return Ok(());
    }
    let fits = |units: &f64| (0.3..=3.0).contains(&(f64::from(median) / units));
    let likely = [1000.0, 5000.0, 10_000.0, 2000.0, 500.0, 4000.0].into_iter().find(fits).unwrap_or(1000.0);
    Err(RecordingError::Unit { metres, units: depth.units_per_metre, likely })
}

#[cfg(test)]
mod tests;
