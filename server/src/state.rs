//! What every handler can reach.

use std::collections::HashSet;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use metrics_exporter_prometheus::PrometheusHandle;
use tokio::sync::{RwLock, Semaphore};

use crate::auth::password::Passwords;
use crate::auth::throttle::Throttle;
use crate::config::Config;
use crate::db::Db;
use crate::storage::{Key, Storage};

/// The server's state; cheap to clone.
#[derive(Debug, Clone)]
pub struct App(Arc<Inner>);

/// See [`App`].
#[derive(Debug)]
pub struct Inner {
    pub config: Config,
    pub db: Db,
    pub storage: Storage,
    pub passwords: Passwords,
    pub login_throttle: Throttle,
    /// Files parsed at the same time.
    pub parsers: Semaphore,
    /// Held for reading while new files are stored and named in the database, for writing while unused ones are deleted.
    pub files_lock: RwLock<()>,
    /// Resumable uploads that a request is writing to.
    busy_uploads: Mutex<HashSet<String>>,
    pub metrics: PrometheusHandle,
}

impl Deref for App {
    type Target = Inner;
    fn deref(&self) -> &Inner {
        &self.0
    }
}

/// Ends the sole use of a resumable upload when dropped.
#[derive(Debug)]
pub struct UploadGuard(App, String);

impl App {
    /// Opens database and storage under the data folder.
    pub async fn open(config: Config) -> anyhow::Result<Self> {
        let storage = Storage::folder(&config.data.join("files"))?;
        Self::with_storage(config, storage).await
    }

    /// As [`App::open`], over any storage.
    pub async fn with_storage(config: Config, storage: Storage) -> anyhow::Result<Self> {
        std::fs::create_dir_all(config.data.join("spool"))?;
        let db = Db::open(&config.data.join("allround.sqlite"), config.times.database_busy).await?;
        Ok(Self(Arc::new(Inner {
            db,
            storage,
            passwords: Passwords::new(config.password_cost)?,
            login_throttle: Throttle::new(config.limits.login_burst, config.times.login_every),
            parsers: Semaphore::new(config.limits.parsers),
            files_lock: RwLock::new(()),
            busy_uploads: Mutex::default(),
            metrics: crate::observe::metrics_handle(),
            config,
        })))
    }

    /// The folder of bodies that are still coming.
    pub fn spool(&self) -> PathBuf {
        self.config.data.join("spool")
    }

    /// Sole use of a resumable upload; `None` while another request has it.
    pub fn take_upload(&self, id: &str) -> Option<UploadGuard> {
        let mut busy = self.busy_uploads.lock().unwrap_or_else(PoisonError::into_inner);
        busy.insert(id.to_string()).then(|| UploadGuard(self.clone(), id.to_string()))
    }

    /// Deletes stored files that no product uses; a failure only costs room and is logged.
    pub async fn delete_unused(&self, keys: Vec<String>) {
        let _alone = self.files_lock.write().await;
        for key in keys.iter().filter_map(|key| Key::parse(key)) {
            let deleted = match self.db.is_used(key.as_str()).await {
                Ok(false) => self.storage.delete(&key).await.map_err(crate::error::Error::from),
                Ok(true) => Ok(()),
                Err(error) => Err(error.into()),
            };
            if let Err(error) = deleted {
                tracing::warn!(key = key.as_str(), %error, "an unused file stays in the storage");
            }
        }
    }
}

impl Drop for UploadGuard {
    fn drop(&mut self) {
        self.0.busy_uploads.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.1);
    }
}
