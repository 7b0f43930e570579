//! Sessions of browsers, kept under the hash of their id.

use std::time::Duration;

use sqlx::Row;

use super::{Db, DbResult, now_micros};

/// How often the time of last use is written down.
const SEEN_STEP: i64 = 60 * 1_000_000;

impl Db {
    pub async fn insert_session(&self, hash: &str, account_id: &str, lifetime: Duration) -> DbResult<()> {
        let now = now_micros();
        sqlx::query(
            "insert into session (session_hash, account_id, created_at, seen_at, expires_at)
             values ($1, $2, $3, $3, $4)",
        )
        .bind(hash)
        .bind(account_id)
        .bind(now)
        .bind(now.saturating_add(micros(lifetime)))
        .execute(self.writer())
        .await?;
        Ok(())
    }

    /// The account of a session that has neither ended nor lain idle for longer than `idle`.
    pub async fn session_account(&self, hash: &str, idle: Duration) -> DbResult<Option<String>> {
        let now = now_micros();
        let row = sqlx::query(
            "select account_id, seen_at from session
             where session_hash = $1 and expires_at > $2 and seen_at > $3",
        )
        .bind(hash)
        .bind(now)
        .bind(now.saturating_sub(micros(idle)))
        .fetch_optional(self.reader())
        .await?;
        let Some(row) = row else { return Ok(None) };
        let seen_at: i64 = row.try_get("seen_at")?;
        if now - seen_at > SEEN_STEP.min(micros(idle) / 4) {
            let touch = sqlx::query("update session set seen_at = $2 where session_hash = $1");
            touch.bind(hash).bind(now).execute(self.writer()).await?;
        }
        Ok(Some(row.try_get("account_id")?))
    }

    pub async fn delete_session(&self, hash: &str) -> DbResult<()> {
        let delete = sqlx::query("delete from session where session_hash = $1");
        delete.bind(hash).execute(self.writer()).await?;
        Ok(())
    }

    /// Forgets sessions that have ended.
    pub async fn delete_old_sessions(&self, idle: Duration) -> DbResult<()> {
        let now = now_micros();
        let delete = sqlx::query("delete from session where expires_at <= $1 or seen_at <= $2");
        delete.bind(now).bind(now.saturating_sub(micros(idle))).execute(self.writer()).await?;
        Ok(())
    }
}

/// A span as the database keeps it.
pub fn micros(span: Duration) -> i64 {
    i64::try_from(span.as_micros()).unwrap_or(i64::MAX)
}
