//! Resumable uploads.

use sqlx::Row;

use super::{Db, DbResult, DbRow, now_micros};
use crate::model::{UploadKind, UploadState, Word};

/// An upload as it is stored. How many bytes have come is the length of its file in the spool.
#[derive(Debug, Clone)]
pub struct Upload {
    pub id: String,
    pub account_id: String,
    pub product_id: String,
    pub kind: UploadKind,
    pub filename: String,
    pub sha256: Option<String>,
    pub length: i64,
    pub state: UploadState,
    pub detail: Option<String>,
    pub created_at: i64,
    pub expires_at: i64,
}

const COLUMNS: &str = "upload_id, account_id, product_id, kind, filename, sha256, length, state, detail, \
                       created_at, expires_at";

fn upload(row: &DbRow) -> DbResult<Upload> {
    Ok(Upload {
        id: row.try_get("upload_id")?,
        account_id: row.try_get("account_id")?,
        product_id: row.try_get("product_id")?,
        kind: super::word(row, "kind")?,
        filename: row.try_get("filename")?,
        sha256: row.try_get("sha256")?,
        length: row.try_get("length")?,
        state: super::word(row, "state")?,
        detail: row.try_get("detail")?,
        created_at: row.try_get("created_at")?,
        expires_at: row.try_get("expires_at")?,
    })
}

impl Db {
    pub async fn insert_upload(&self, upload: &Upload) -> DbResult<()> {
        sqlx::query(
            "insert into upload (upload_id, account_id, product_id, kind, filename, sha256, length, state,
             created_at, expires_at) values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
        )
        .bind(&upload.id)
        .bind(&upload.account_id)
        .bind(&upload.product_id)
        .bind(upload.kind.word())
        .bind(&upload.filename)
        .bind(&upload.sha256)
        .bind(upload.length)
        .bind(upload.state.word())
        .bind(upload.created_at)
        .bind(upload.expires_at)
        .execute(self.writer())
        .await?;
        Ok(())
    }

    /// An upload that has not run out.
    pub async fn upload(&self, id: &str) -> DbResult<Option<Upload>> {
        let sql = format!("select {COLUMNS} from upload where upload_id = $1 and expires_at > $2");
        let query = sqlx::query(super::from_pieces(sql)).bind(id).bind(now_micros());
        query.fetch_optional(self.reader()).await?.as_ref().map(upload).transpose()
    }

    /// How many uploads of the account are under way.
    pub async fn uploads_under_way(&self, account_id: &str) -> DbResult<i64> {
        let sql = "select count(*) as n from upload
                   where account_id = $1 and state = 'receiving' and expires_at > $2";
        let query = sqlx::query(sql).bind(account_id).bind(now_micros());
        query.fetch_one(self.reader()).await?.try_get("n")
    }

    pub async fn end_upload(&self, id: &str, state: UploadState, detail: Option<&str>) -> DbResult<()> {
        let update = sqlx::query("update upload set state = $2, detail = $3 where upload_id = $1");
        update.bind(id).bind(state.word()).bind(detail).execute(self.writer()).await?;
        Ok(())
    }

    pub async fn delete_upload(&self, id: &str) -> DbResult<()> {
        sqlx::query("delete from upload where upload_id = $1").bind(id).execute(self.writer()).await?;
        Ok(())
    }

    /// Forgets uploads that have run out.
    pub async fn delete_old_uploads(&self) -> DbResult<()> {
        let delete = sqlx::query("delete from upload where expires_at <= $1");
        delete.bind(now_micros()).execute(self.writer()).await?;
        Ok(())
    }

    /// Ids of all uploads whose bytes are still wanted.
    pub async fn receiving_uploads(&self) -> DbResult<Vec<String>> {
        let sql = "select upload_id from upload where state = 'receiving' and expires_at > $1";
        let rows = sqlx::query(sql).bind(now_micros()).fetch_all(self.reader()).await?;
        rows.iter().map(|row| row.try_get("upload_id")).collect()
    }
}
