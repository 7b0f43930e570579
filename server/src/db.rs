//! The database: connections, migrations, and the words all queries share. The queries are in `db/`, a table each.
//!
//! SQL is written so that another database can run it: `$1`, `text`, `bigint`, `boolean`; times are microseconds since
//! 1970 UTC, ids text.

pub mod account;
pub mod product;
pub mod session;
pub mod token;
pub mod upload;

use std::borrow::Cow;
use std::path::Path;
use std::time::Duration;

use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{AssertSqlSafe, Row, SqlSafeStr, Sqlite, Transaction};

pub use sqlx::sqlite::SqliteRow as DbRow;

use crate::model::Word;

/// All migrations, in order.
pub const MIGRATIONS: &[(i64, &str, &str)] =
    &[(1, "init", include_str!("../../migrations/sqlite/0001_init.sql"))];

/// How many connections read at once.
const READERS: u32 = 4;

/// What a query gives.
pub type DbResult<T> = Result<T, sqlx::Error>;

/// A transaction that writes.
pub type Tx = Transaction<'static, Sqlite>;

/// One connection writes, several read: SQLite allows one writer, and waiting here is cheaper than being told "busy".
#[derive(Debug, Clone)]
pub struct Db {
    writer: SqlitePool,
    reader: SqlitePool,
}

impl Db {
    /// Opens (or makes) the database file and brings it to the newest schema.
    pub async fn open(file: &Path, busy_timeout: Duration) -> anyhow::Result<Self> {
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Normal)
            .foreign_keys(true)
            .busy_timeout(busy_timeout);
        let pool = |connections| {
            SqlitePoolOptions::new()
                .max_connections(connections)
                .acquire_timeout(busy_timeout + Duration::from_secs(1))
        };
        let writer = pool(1).connect_with(options.clone()).await?;
        migrator().run(&writer).await?;
        let reader = pool(READERS).connect_with(options.read_only(true)).await?;
        Ok(Self { writer, reader })
    }

    /// Connections for queries that only read.
    pub fn reader(&self) -> &SqlitePool {
        &self.reader
    }

    /// The connection for single statements that write.
    pub fn writer(&self) -> &SqlitePool {
        &self.writer
    }

    /// A transaction that writes: it takes the write lock at once, so that what it read stays true.
    pub async fn begin(&self) -> DbResult<Tx> {
        self.writer.begin_with("begin immediate").await
    }

    /// Whether the database can be read and its write lock be had.
    pub async fn ping(&self) -> DbResult<()> {
        sqlx::query("select 1 from account limit 1").fetch_optional(&self.reader).await?;
        self.begin().await?.rollback().await
    }

    /// Closes all connections, writing what is left in the log into the file.
    pub async fn close(&self) {
        self.reader.close().await;
        self.writer.close().await;
    }
}

fn migrator() -> Migrator {
    let migration = |&(version, name, sql): &(i64, &'static str, &'static str)| {
        let name = Cow::Borrowed(name);
        Migration::new(version, name, MigrationType::Simple, sql.into_sql_str(), false)
    };
    Migrator::with_migrations(MIGRATIONS.iter().map(migration).collect())
}

/// SQL put together from fixed pieces of this crate; never from what somebody sent.
fn from_pieces(sql: String) -> AssertSqlSafe<String> {
    AssertSqlSafe(sql)
}

/// A column that holds one of an enum's words.
fn word<T: Word>(row: &DbRow, column: &str) -> DbResult<T> {
    let text: String = row.try_get(column)?;
    T::from_word(&text).ok_or_else(|| sqlx::Error::ColumnDecode {
        index: column.to_string(),
        source: format!("the word {text:?} means nothing here").into(),
    })
}

/// A column of JSON made by this program.
fn json<T: serde::de::DeserializeOwned>(row: &DbRow, column: &str) -> DbResult<Option<T>> {
    let text: Option<String> = row.try_get(column)?;
    let read = |text: String| {
        let source =
            |e: serde_json::Error| sqlx::Error::ColumnDecode { index: column.into(), source: e.into() };
        serde_json::from_str(&text).map_err(source)
    };
    text.map(read).transpose()
}

/// Now, as the database keeps it: microseconds since 1970 UTC.
pub fn now_micros() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |d| i64::try_from(d.as_micros()).unwrap_or(i64::MAX))
}

/// A `like` pattern that finds `words` anywhere, with what `like` would read as a wildcard taken literally.
/// Use with `escape '\'`.
pub fn like_pattern(words: &str) -> String {
    let mut pattern = String::from("%");
    for c in words.trim().to_lowercase().chars() {
        if matches!(c, '%' | '_' | '\\') {
            pattern.push('\\');
        }
        pattern.push(c);
    }
    pattern.push('%');
    pattern
}

/// Whether the error is the named unique constraint's.
pub fn violates_unique(error: &sqlx::Error) -> bool {
    error.as_database_error().is_some_and(sqlx::error::DatabaseError::is_unique_violation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_migration_file_is_listed() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../migrations/sqlite");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        files.sort();
        let listed: Vec<String> =
            MIGRATIONS.iter().map(|(v, name, _)| format!("{v:04}_{name}.sql")).collect();
        assert_eq!(files, listed);
    }

    #[test]
    fn wildcards_are_taken_literally() {
        assert_eq!(like_pattern(" 100%_\\ Wool "), "%100\\%\\_\\\\ wool%");
    }
}
