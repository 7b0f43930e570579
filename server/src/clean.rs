//! Throwing away what has run out: sessions, resumable uploads, and bodies that a crash left in the spool folder.

use std::collections::HashSet;
use std::time::{Duration, SystemTime};

use crate::error::Result;
use crate::state::App;

/// How often.
const EVERY: Duration = Duration::from_mins(10);
/// A body without an owner is younger than this only while it is being received.
const ORPHAN_AGE: Duration = Duration::from_hours(24);

/// Cleans now and then, for ever.
pub async fn keep_clean(app: App) {
    let mut ticks = tokio::time::interval(EVERY);
    loop {
        ticks.tick().await;
        if let Err(error) = clean(&app).await {
            tracing::warn!(%error, "could not clean up; trying again later");
        }
    }
}

/// Cleans once.
pub async fn clean(app: &App) -> Result<()> {
    app.db.delete_old_sessions(app.config.times.session_idle).await?;
    app.db.delete_old_uploads().await?;
    let wanted: HashSet<String> =
        app.db.receiving_uploads().await?.iter().map(|id| format!("{id}.upload")).collect();
    let mut entries = tokio::fs::read_dir(app.spool()).await?;
    while let Some(entry) = entries.next_entry().await? {
        let name = entry.file_name().to_string_lossy().into_owned();
        let modified = entry.metadata().await.and_then(|meta| meta.modified());
        let age = modified.ok().and_then(|at| SystemTime::now().duration_since(at).ok()).unwrap_or_default();
        if !wanted.contains(&name) && age > ORPHAN_AGE {
            tokio::fs::remove_file(entry.path()).await?;
        }
    }
    Ok(())
}
