//! Bodies from outside: never longer, never slower than allowed, and to disk where they are long.

use std::path::{Path, PathBuf};
use std::time::Duration;

use axum::body::Body;
use axum::http::{HeaderMap, StatusCode, header};
use bytes::Bytes;
use http_body_util::BodyExt;
use sha2::{Digest, Sha256};
use tokio::io::AsyncWriteExt;
use tokio::time::{Instant, timeout_at};

use crate::config::Times;
use crate::error::{Error, Result};
use crate::state::App;
use crate::storage::Key;

/// Bytes and time spent on reading what is refused anyway, so that the client gets to read the answer.
const DRAIN_BYTES: u64 = 4 << 20;
const DRAIN_TIME: Duration = Duration::from_secs(2);

/// A body that is read chunk by chunk under a limit of bytes and a lowest speed.
#[derive(Debug)]
pub struct Incoming<'a> {
    body: Body,
    limit: u64,
    times: &'a Times,
    started: Instant,
    last: Instant,
    received: u64,
}

impl<'a> Incoming<'a> {
    /// Refuses at once what announces too many bytes or is packed.
    pub async fn new(headers: &HeaderMap, body: Body, limit: u64, times: &'a Times) -> Result<Self> {
        let now = Instant::now();
        let mut incoming = Self { body, limit, times, started: now, last: now, received: 0 };
        if content_length(headers).is_some_and(|announced| announced > limit) {
            incoming.refuse(headers).await;
            return Err(Error::too_large(limit));
        }
        if headers.get(header::CONTENT_ENCODING).is_some_and(|coding| coding != "identity") {
            incoming.refuse(headers).await;
            let detail = "Packed bodies are not taken. Send the file as it is, without Content-Encoding.";
            return Err(Error::refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, "packed_body", detail));
        }
        Ok(incoming)
    }

    /// The next bytes; `None` at the end.
    pub async fn next(&mut self) -> Result<Option<Bytes>> {
        loop {
            let earned = Duration::from_secs(self.received / self.times.body_bytes_per_second.max(1));
            let pause_ends = self.last + self.times.body_pause;
            let too_slow_at = self.started + self.times.body_pause + earned;
            let frame = timeout_at(pause_ends.min(too_slow_at), self.body.frame()).await;
            let Some(frame) = frame.map_err(|_elapsed| too_slow())? else { return Ok(None) };
            let Ok(data) = frame.map_err(|error| broken(&error))?.into_data() else { continue };
            self.received += data.len() as u64;
            self.last = Instant::now();
            if self.received > self.limit {
                self.drain().await;
                return Err(Error::too_large(self.limit));
            }
            return Ok(Some(data));
        }
    }

    /// All bytes in memory: for small limits.
    pub async fn collect(mut self) -> Result<Vec<u8>> {
        let mut all = Vec::new();
        while let Some(data) = self.next().await? {
            all.extend_from_slice(&data);
        }
        Ok(all)
    }

    /// As [`Self::drain`], unless the client waits for a word before it sends anything.
    pub async fn refuse(&mut self, headers: &HeaderMap) {
        if !headers.contains_key(header::EXPECT) {
            self.drain().await;
        }
    }

    /// Reads on for a moment without keeping anything.
    pub async fn drain(&mut self) {
        let until = Instant::now() + DRAIN_TIME;
        let mut drained = 0;
        while let Ok(Some(Ok(frame))) = timeout_at(until, self.body.frame()).await {
            drained += frame.data_ref().map_or(0, |data| data.len() as u64);
            if drained > DRAIN_BYTES {
                break;
            }
        }
    }
}

fn content_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

fn too_slow() -> Error {
    let detail = "The body came too slowly and was given up. Try again on a better connection, or use a resumable \
                  upload.";
    Error::refuse(StatusCode::REQUEST_TIMEOUT, "too_slow", detail)
}

fn broken(error: &axum::Error) -> Error {
    tracing::debug!(%error, "body broke off");
    Error::bad_request("broken_body", "The body broke off before its end. Send it again.")
}

/// A file in the spool folder; deleted when dropped.
#[derive(Debug)]
pub struct SpoolFile {
    pub path: PathBuf,
    pub bytes: u64,
    pub key: Key,
}

impl Drop for SpoolFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Deletes an unfinished file when dropped before `keep`.
struct Unfinished(Option<PathBuf>);

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(path) = self.0.take() {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Writes a whole body into the spool folder.
pub async fn to_spool(app: &App, mut incoming: Incoming<'_>) -> Result<SpoolFile> {
    let path = app.spool().join(format!("{}.body", crate::model::new_id()));
    let mut unfinished = Unfinished(Some(path.clone()));
    let mut file = tokio::fs::File::create(&path).await?;
    let mut digest = Sha256::new();
    let mut bytes = 0;
    while let Some(data) = incoming.next().await? {
        digest.update(&data);
        bytes += data.len() as u64;
        if let Err(error) = file.write_all(&data).await {
            incoming.drain().await;
            return Err(error.into());
        }
    }
    file.flush().await?;
    unfinished.0 = None;
    Ok(SpoolFile { path, bytes, key: Key::from_digest(&digest.finalize()) })
}

/// SHA-256 of a file.
pub async fn digest_of(path: &Path) -> Result<[u8; 32]> {
    let path = path.to_path_buf();
    let digest = tokio::task::spawn_blocking(move || -> std::io::Result<[u8; 32]> {
        let mut file = std::fs::File::open(path)?;
        let mut digest = Sha256::new();
        std::io::copy(&mut file, &mut HashWriter(&mut digest))?;
        Ok(digest.finalize().into())
    });
    Ok(digest.await.map_err(Error::internal)??)
}

struct HashWriter<'a>(&'a mut Sha256);

impl std::io::Write for HashWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
