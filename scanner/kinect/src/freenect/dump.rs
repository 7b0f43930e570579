//! Dumps for the replay library. It ends its process where a file is missing: so they are looked for before.

use std::fs;
use std::path::Path;

use crate::wire::Failure;
use crate::worker::DriverError;

/// Where the replay library looks for the dump.
const VARIABLE: &str = "FAKENECT_PATH";
/// The names of its images, one a line.
const INDEX: &str = "INDEX.txt";
/// Longest index that is read, bytes: an hour of frames.
const MOST_INDEX: u64 = 64 * 1024 * 1024;

/// Makes sure that every file is there.
pub(super) fn check() -> Result<(), DriverError> {
    let missing = |words: String| DriverError::Failed(Failure::NotFound(words));
    let Some(folder) = std::env::var_os(VARIABLE) else {
        return Err(missing(format!("{VARIABLE} does not say which dump to play")));
    };
    complete(Path::new(&folder)).map_err(missing)
}

fn complete(folder: &Path) -> Result<(), String> {
    let index = folder.join(INDEX);
    let unreadable = |error: std::io::Error| format!("{} cannot be read: {error}", index.display());
    if fs::metadata(&index).map_err(unreadable)?.len() > MOST_INDEX {
        return Err(format!("{} is too long", index.display()));
    }
    let names = fs::read_to_string(&index).map_err(unreadable)?;
    let mut names = names.lines().map(str::trim).filter(|name| !name.is_empty()).peekable();
    if names.peek().is_none() {
        return Err(format!("{} names no images", index.display()));
    }
    match names.find(|name| !folder.join(name).is_file()) {
        Some(name) => Err(format!("the dump is not complete: {} is missing", folder.join(name).display())),
        None => Ok(()),
    }
}
