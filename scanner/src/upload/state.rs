//! What was begun, kept beside the files: addresses and hashes, no secrets.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::UploadError;

/// The file's name in the folder that is uploaded; gone when all is done.
pub const STATE_FILE: &str = "upload-state.json";

/// An upload that was begun.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    pub(super) server: String,
    pub(super) product_id: Option<String>,
    /// What the listing was made with: another title is another listing.
    pub(super) listing: Value,
    pub(super) files: BTreeMap<String, Begun>,
}

/// One file of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Begun {
    pub(super) address: String,
    pub(super) sha256: String,
}

impl State {
    pub(super) fn new(server: &str) -> Self {
        Self { server: server.to_string(), ..Self::default() }
    }

    /// Where the file is being sent, unless it has changed meanwhile.
    pub(super) fn address(&self, kind: &str, sha256: &str) -> Option<String> {
        let begun = self.files.get(kind).filter(|begun| begun.sha256 == sha256)?;
        Some(begun.address.clone())
    }
}

/// The state for this server; a file that cannot be read, or another server's, is as none.
pub(super) fn load(folder: &Path, server: &str) -> State {
    let text = std::fs::read(folder.join(STATE_FILE)).unwrap_or_default();
    let state: Option<State> = serde_json::from_slice(&text).ok();
    state.filter(|state| state.server == server).unwrap_or_else(|| State::new(server))
}

pub(super) fn save(folder: &Path, state: &State) -> Result<(), UploadError> {
    let path = folder.join(STATE_FILE);
    let bytes = serde_json::to_vec_pretty(state).unwrap_or_default();
    crate::output::write_file(&path, &bytes).map_err(|error| UploadError::File {
        what: "write",
        path,
        cause: std::io::Error::other(error.to_string()),
    })
}

pub(super) fn remove(folder: &Path) -> Result<(), UploadError> {
    let path = folder.join(STATE_FILE);
    match std::fs::remove_file(&path) {
        Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
            Err(UploadError::File { what: "remove", path, cause })
        }
        _ => Ok(()),
    }
}
