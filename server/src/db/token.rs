//! API tokens, kept under their hash.

use sqlx::Row;

use super::{Db, DbResult, DbRow, now_micros};
use crate::model::{Scope, Word};

/// A token as it is stored.
#[derive(Debug, Clone)]
pub struct Token {
    pub id: String,
    pub account_id: String,
    pub name: String,
    pub prefix: String,
    pub scopes: Vec<Scope>,
    pub created_at: i64,
    pub expires_at: Option<i64>,
    pub last_used_at: Option<i64>,
}

const COLUMNS: &str = "token_id, account_id, name, prefix, scopes, created_at, expires_at, last_used_at";

/// How often the time of last use is written down.
const USED_STEP: i64 = 60 * 1_000_000;

fn token(row: &DbRow) -> DbResult<Token> {
    let scopes: String = row.try_get("scopes")?;
    Ok(Token {
        id: row.try_get("token_id")?,
        account_id: row.try_get("account_id")?,
        name: row.try_get("name")?,
        prefix: row.try_get("prefix")?,
        scopes: scopes.split(' ').filter_map(Scope::from_word).collect(),
        created_at: row.try_get("created_at")?,
        expires_at: row.try_get("expires_at")?,
        last_used_at: row.try_get("last_used_at")?,
    })
}

impl Db {
    pub async fn tokens(&self, account_id: &str) -> DbResult<Vec<Token>> {
        let sql = format!("select {COLUMNS} from token where account_id = $1 order by token_id desc");
        let query = sqlx::query(super::from_pieces(sql)).bind(account_id);
        query.fetch_all(self.reader()).await?.iter().map(token).collect()
    }

    pub async fn insert_token(&self, token: &Token, token_hash: &str) -> DbResult<()> {
        let scopes: Vec<&str> = token.scopes.iter().map(|s| s.word()).collect();
        sqlx::query(
            "insert into token (token_id, account_id, name, prefix, token_hash, scopes, created_at, expires_at)
             values ($1, $2, $3, $4, $5, $6, $7, $8)",
        )
        .bind(&token.id)
        .bind(&token.account_id)
        .bind(&token.name)
        .bind(&token.prefix)
        .bind(token_hash)
        .bind(scopes.join(" "))
        .bind(token.created_at)
        .bind(token.expires_at)
        .execute(self.writer())
        .await?;
        Ok(())
    }

    /// The token of that hash, where it has not run out; its use is written down.
    pub async fn use_token(&self, token_hash: &str) -> DbResult<Option<Token>> {
        let now = now_micros();
        let sql = format!(
            "select {COLUMNS} from token where token_hash = $1 and (expires_at is null or expires_at > $2)"
        );
        let query = sqlx::query(super::from_pieces(sql)).bind(token_hash).bind(now);
        let Some(row) = query.fetch_optional(self.reader()).await? else { return Ok(None) };
        let token = token(&row)?;
        if token.last_used_at.is_none_or(|used| now - used > USED_STEP) {
            let touch = sqlx::query("update token set last_used_at = $2 where token_id = $1");
            touch.bind(&token.id).bind(now).execute(self.writer()).await?;
        }
        Ok(Some(token))
    }

    /// Whether there was such a token of this account.
    pub async fn delete_token(&self, id: &str, account_id: &str) -> DbResult<bool> {
        let delete = sqlx::query("delete from token where token_id = $1 and account_id = $2");
        Ok(delete.bind(id).bind(account_id).execute(self.writer()).await?.rows_affected() > 0)
    }
}
