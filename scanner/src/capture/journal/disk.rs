//! Files that are on the disk for good: written beside, synced, renamed, and the folder synced after them.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use super::error::{JournalError, at};

/// Bytes that this user may still write to the disk of a folder; of the nearest one above that exists.
pub fn free_bytes(folder: &Path) -> io::Result<u64> {
    let there = folder.ancestors().find(|path| path.is_dir()).unwrap_or(Path::new("."));
    fs4::available_space(there)
}

/// Writes a file and waits until it is on the disk.
pub(super) fn write_synced(path: &Path, bytes: &[u8]) -> Result<(), JournalError> {
    let write = || {
        let mut file = File::create(path)?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write().map_err(at(path))
}

/// Waits until a folder's names are on the disk.
pub(super) fn sync_folder(folder: &Path) -> Result<(), JournalError> {
    // Only Unix lets a folder be opened; elsewhere the file system's own journal has to do.
    if cfg!(unix) {
        File::open(folder).and_then(|folder| folder.sync_all()).map_err(at(folder))?;
    }
    Ok(())
}

/// Replaces a JSON file as a whole: at any moment the old one or the new one is there.
pub(super) fn replace_json(folder: &Path, name: &str, value: &impl Serialize) -> Result<(), JournalError> {
    let path = folder.join(name);
    let mut bytes = serde_json::to_vec_pretty(value).map_err(|e| at(&path)(e.into()))?;
    bytes.push(b'\n');
    let beside = folder.join(partial(name));
    write_synced(&beside, &bytes)?;
    fs::rename(&beside, &path).map_err(at(&path))?;
    sync_folder(folder)
}

/// Removes what a crash left of [`replace_json`].
pub(super) fn remove_partial(folder: &Path, names: &[&str]) -> Result<(), JournalError> {
    names.iter().try_for_each(|name| remove(&folder.join(partial(name))))
}

/// Removes a file, a link or a folder with all in it; what is not there is no error.
pub(super) fn remove(path: &Path) -> Result<(), JournalError> {
    let Ok(metadata) = path.symlink_metadata() else { return Ok(()) };
    if metadata.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.map_err(at(path))
}

fn partial(name: &str) -> String {
    format!(".{name}.partial")
}
