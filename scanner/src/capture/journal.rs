//! The recording on the disk while it is being taken: a crash, a kill or a power cut loses at most the view in work.
//!
//! A view's pictures lie in `views/NAME/`, losslessly as they came. They are on the disk for good (synced, and their folder)
//! before `recording.json`, replaced as a whole, names the view: from then on it is confirmed. What lies in `views/` without
//! being named there is what a crash left, and goes when the recording is opened again. A sharper picture of a view, where the
//! sensor takes such, lies in `stills/NAME.png` and is named after the view is.

mod disk;
mod error;
mod view;

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use kinect::source::SensorInfo;
use reconstruct::board::BoardFile;
use reconstruct::image::ColorImage;
use reconstruct::pose;
use reconstruct::recording::{DepthCamera, Device, RecordingFile, ViewEntry};

pub use disk::free_bytes;
pub use error::JournalError;
pub use view::ViewWriter;

use crate::pictures;
use crate::recording::{parse_board, parse_unfinished, read_limited};
use error::at;

/// Folder of the views inside the recording.
const VIEWS: &str = "views";
/// Folder of the sharper pictures.
const STILLS: &str = "stills";
const RECORDING: &str = "recording.json";
const BOARD: &str = "board.json";
/// Held while a capture works on the folder; the system lets go of it however the program ends.
const LOCK: &str = "capture.lock";
/// Left free for everything else on the disk, bytes.
const RESERVE_BYTES: u64 = 64 << 20;
const MAX_JSON_BYTES: u64 = 32 << 20;

/// A recording that grows view by view.
#[derive(Debug)]
pub struct Journal {
    folder: PathBuf,
    file: RecordingFile,
    board: Option<BoardFile>,
    measure_free: fn(&Path) -> io::Result<u64>,
    /// Kept open for its lock.
    _lock: File,
}

impl Journal {
    /// Begins a recording in a folder that is new or empty.
    pub fn begin(folder: &Path, sensor: &SensorInfo, board: &BoardFile) -> Result<Self, JournalError> {
        fs::create_dir_all(folder).map_err(at(folder))?;
        let lock = lock(folder)?;
        if folder.join(RECORDING).exists() || folder.join(VIEWS).exists() {
            return Err(JournalError::NotEmpty(folder.to_owned()));
        }
        let file = RecordingFile {
            version: 1,
            device: Device { backend: sensor.backend.clone(), serial: sensor.serial.clone() },
            color: sensor.rig.color,
            depth: DepthCamera { intrinsics: sensor.rig.depth, units_per_metre: sensor.units_per_metre },
            color_from_depth: pose::to_row_major(&sensor.rig.color_from_depth),
            mirrored: false,
            views: Vec::new(),
            frames: Vec::new(),
        };
        let views = folder.join(VIEWS);
        fs::create_dir(&views).map_err(at(&views))?;
        let mut journal =
            Self { folder: folder.to_owned(), file, board: None, measure_free: free_bytes, _lock: lock };
        journal.set_board(board)?;
        journal.replace_description(&journal.file)?;
        Ok(journal)
    }

    /// Goes on with a recording: removes what is left of a view in work.
    pub fn resume(folder: &Path) -> Result<Self, JournalError> {
        let folder = folder.canonicalize().map_err(at(folder))?;
        let file = parse_unfinished(&read_limited(&folder, RECORDING, MAX_JSON_BYTES)?)?;
        if !is_ours(&file) {
            return Err(JournalError::NotOurs(folder));
        }
        let board = if folder.join(BOARD).exists() {
            Some(parse_board(&read_limited(&folder, BOARD, MAX_JSON_BYTES)?)?)
        } else {
            None
        };
        let lock = lock(&folder)?;
        let journal = Self { folder, file, board, measure_free: free_bytes, _lock: lock };
        journal.remove_leftovers()?;
        Ok(journal)
    }

    /// Where it lies.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The description as it stands on the disk.
    pub fn file(&self) -> &RecordingFile {
        &self.file
    }

    /// The board beside it.
    pub fn board(&self) -> Option<&BoardFile> {
        self.board.as_ref()
    }

    /// Whether frames of this sensor may be added: the cameras must be the same.
    pub fn fits(&self, sensor: &SensorInfo) -> bool {
        self.file.color == sensor.rig.color
            && self.file.depth.intrinsics == sensor.rig.depth
            && self.file.depth.units_per_metre == sensor.units_per_metre
            && self.file.device.backend == sensor.backend
            && self.file.device.serial == sensor.serial
    }

    /// Puts `board.json` beside, or replaces it.
    pub fn set_board(&mut self, board: &BoardFile) -> Result<(), JournalError> {
        disk::replace_json(&self.folder, BOARD, board)?;
        self.board = Some(board.clone());
        Ok(())
    }

    /// Starts a view of at most `frames` frames where the disk has room for it.
    pub fn begin_view(&self, frames: usize) -> Result<ViewWriter, JournalError> {
        let pixels = |width: u32, height: u32| u64::from(width) * u64::from(height);
        let (color, depth) = (&self.file.color, &self.file.depth.intrinsics);
        let pair = 3 * pixels(color.width, color.height) + 2 * pixels(depth.width, depth.height);
        let needed = frames as u64 * pair + RESERVE_BYTES;
        let free = (self.measure_free)(&self.folder).map_err(at(&self.folder))?;
        if free < needed {
            return Err(JournalError::DiskFull { folder: self.folder.clone(), free, needed });
        }
        ViewWriter::begin(&self.folder, self.next_name())
    }

    /// Names a view in the description: when this returns, no crash can lose it any more.
    pub fn confirm(&mut self, view: ViewWriter) -> Result<(), JournalError> {
        let mut file = self.file.clone();
        file.views.push(view.sync()?);
        disk::sync_folder(&self.folder.join(VIEWS))?;
        self.replace_description(&file)?;
        view.keep();
        self.file = file;
        Ok(())
    }

    /// Adds a sharper picture to a view that is confirmed: first the file, then its name.
    pub fn add_still(&mut self, view: &str, picture: &ColorImage) -> Result<(), JournalError> {
        let mut file = self.file.clone();
        let none = || JournalError::NoSuchView(view.to_owned());
        let entry = file.views.iter_mut().find(|entry| entry.name == view).ok_or_else(none)?;
        let bytes = pictures::record_color(picture)?;
        let size = bytes.len() as u64 + RESERVE_BYTES;
        let free = (self.measure_free)(&self.folder).map_err(at(&self.folder))?;
        if free < size {
            return Err(JournalError::DiskFull { folder: self.folder.clone(), free, needed: size });
        }
        let stills = self.folder.join(STILLS);
        fs::create_dir_all(&stills).map_err(at(&stills))?;
        let name = format!("{STILLS}/{view}.png");
        disk::write_synced(&self.folder.join(&name), &bytes)?;
        disk::sync_folder(&stills)?;
        entry.still = Some(name);
        self.replace_description(&file)?;
        self.file = file;
        Ok(())
    }

    /// Takes a view back: first its name, then its files.
    pub fn undo(&mut self, name: &str) -> Result<(), JournalError> {
        let mut file = self.file.clone();
        file.views.retain(|view| view.name != name);
        if file.views.len() == self.file.views.len() {
            return Err(JournalError::NoSuchView(name.to_owned()));
        }
        self.replace_description(&file)?;
        self.file = file;
        self.remove_leftovers()
    }

    /// One more than the highest number so far: a name is not used twice as long as later ones are there.
    fn next_name(&self) -> String {
        let highest = self.file.views.iter().filter_map(|v| v.name.parse::<u32>().ok()).max();
        format!("{:03}", highest.map_or(0, |n| n.saturating_add(1)))
    }

    fn replace_description(&self, file: &RecordingFile) -> Result<(), JournalError> {
        disk::replace_json(&self.folder, RECORDING, file)
    }

    /// Removes what lies in `views/` and `stills/` but is not named in the description, and half-written descriptions.
    fn remove_leftovers(&self) -> Result<(), JournalError> {
        disk::remove_partial(&self.folder, &[RECORDING, BOARD])?;
        let views = self.folder.join(VIEWS);
        fs::create_dir_all(&views).map_err(at(&views))?;
        for entry in fs::read_dir(&views).map_err(at(&views))? {
            let entry = entry.map_err(at(&views))?;
            let inside = format!("{VIEWS}/{}/", entry.file_name().to_string_lossy());
            let frames = self.file.views.iter().flat_map(|view| &view.frames);
            let named = frames.flat_map(|f| [&f.color, &f.depth]).any(|path| path.starts_with(&inside));
            if !named {
                disk::remove(&entry.path())?;
            }
        }
        disk::sync_folder(&views)?;
        self.remove_unnamed_stills()
    }

    fn remove_unnamed_stills(&self) -> Result<(), JournalError> {
        let stills = self.folder.join(STILLS);
        let Ok(entries) = fs::read_dir(&stills) else { return Ok(()) };
        for entry in entries {
            let entry = entry.map_err(at(&stills))?;
            let name = format!("{STILLS}/{}", entry.file_name().to_string_lossy());
            if !self.file.views.iter().any(|view| view.still.as_deref() == Some(name.as_str())) {
                disk::remove(&entry.path())?;
            }
        }
        disk::sync_folder(&stills)
    }
}

/// Whether all views lie where this program puts them: nothing else is touched.
fn is_ours(file: &RecordingFile) -> bool {
    let lies_right = |view: &ViewEntry| {
        let folder = format!("{VIEWS}/{}/", view.name);
        view.frames.iter().flat_map(|f| [&f.color, &f.depth]).all(|path| path.starts_with(&folder))
    };
    file.frames.is_empty() && !file.mirrored && file.views.iter().all(lies_right)
}

fn lock(folder: &Path) -> Result<File, JournalError> {
    let path = folder.join(LOCK);
    let file = File::create(&path).map_err(at(&path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(JournalError::InUse(folder.to_owned())),
        Err(TryLockError::Error(source)) => Err(at(&path)(source)),
    }
}

#[cfg(test)]
mod tests;
