//! Accounts and the one-time link for the first admin.

use sqlx::Row;

use super::{Db, DbResult, DbRow, Tx, now_micros};
use crate::model::{Role, Word};

/// An account as it is stored.
#[derive(Debug, Clone)]
pub struct Account {
    pub id: String,
    pub name: String,
    pub password_hash: String,
    pub role: Role,
    pub disabled: bool,
    pub created_at: i64,
}

/// What may be changed of an account; `None` stays.
#[derive(Debug, Default)]
pub struct AccountChange {
    pub role: Option<Role>,
    pub disabled: Option<bool>,
    pub password_hash: Option<String>,
}

const COLUMNS: &str = "account_id, name, password_hash, role, disabled, created_at";

fn account(row: &DbRow) -> DbResult<Account> {
    Ok(Account {
        id: row.try_get("account_id")?,
        name: row.try_get("name")?,
        password_hash: row.try_get("password_hash")?,
        role: super::word(row, "role")?,
        disabled: row.try_get("disabled")?,
        created_at: row.try_get("created_at")?,
    })
}

impl Db {
    /// All accounts by name.
    pub async fn accounts(&self) -> DbResult<Vec<Account>> {
        let sql = super::from_pieces(format!("select {COLUMNS} from account order by name_key"));
        sqlx::query(sql).fetch_all(self.reader()).await?.iter().map(account).collect()
    }

    pub async fn account(&self, id: &str) -> DbResult<Option<Account>> {
        let sql = super::from_pieces(format!("select {COLUMNS} from account where account_id = $1"));
        sqlx::query(sql).bind(id).fetch_optional(self.reader()).await?.as_ref().map(account).transpose()
    }

    pub async fn account_by_name(&self, name: &str) -> DbResult<Option<Account>> {
        let sql = super::from_pieces(format!("select {COLUMNS} from account where name_key = $1"));
        let row = sqlx::query(sql).bind(name.to_lowercase()).fetch_optional(self.reader()).await?;
        row.as_ref().map(account).transpose()
    }

    pub async fn has_admin(&self) -> DbResult<bool> {
        let row = sqlx::query("select 1 from account where role = 'admin' and not disabled limit 1");
        Ok(row.fetch_optional(self.reader()).await?.is_some())
    }

    /// Makes an account; fails on the constraint `account_name_key` where the name is taken.
    pub async fn insert_account(&self, name: &str, password_hash: &str, role: Role) -> DbResult<Account> {
        let mut tx = self.begin().await?;
        let account = insert_account(&mut tx, name, password_hash, role).await?;
        tx.commit().await?;
        Ok(account)
    }

    /// Changes an account; `Ok(false)`: nothing was changed, because no admin would be left.
    pub async fn change_account(&self, id: &str, change: &AccountChange) -> DbResult<bool> {
        let mut tx = self.begin().await?;
        sqlx::query(
            "update account set role = coalesce($2, role), disabled = coalesce($3, disabled),
             password_hash = coalesce($4, password_hash), updated_at = $5 where account_id = $1",
        )
        .bind(id)
        .bind(change.role.map(Role::word))
        .bind(change.disabled)
        .bind(&change.password_hash)
        .bind(now_micros())
        .execute(&mut *tx)
        .await?;
        let admin = sqlx::query("select 1 from account where role = 'admin' and not disabled limit 1");
        if admin.fetch_optional(&mut *tx).await?.is_none() {
            tx.rollback().await?;
            return Ok(false);
        }
        if change.password_hash.is_some() || change.disabled == Some(true) {
            sqlx::query("delete from session where account_id = $1").bind(id).execute(&mut *tx).await?;
        }
        tx.commit().await?;
        Ok(true)
    }

    /// Keeps the hash of a new one-time link; older links stop working.
    pub async fn replace_setup_link(&self, link_hash: &str) -> DbResult<()> {
        let mut tx = self.begin().await?;
        sqlx::query("delete from setup_link").execute(&mut *tx).await?;
        let insert = sqlx::query("insert into setup_link (link_hash, created_at) values ($1, $2)");
        insert.bind(link_hash).bind(now_micros()).execute(&mut *tx).await?;
        tx.commit().await
    }

    /// Uses the one-time link up and makes the first admin; `None` where the link is not (or no longer) good.
    pub async fn first_admin(
        &self,
        link_hash: &str,
        name: &str,
        password: &str,
    ) -> DbResult<Option<Account>> {
        let mut tx = self.begin().await?;
        let used = sqlx::query("delete from setup_link where link_hash = $1").bind(link_hash);
        if used.execute(&mut *tx).await?.rows_affected() == 0 {
            return Ok(None);
        }
        let account = insert_account(&mut tx, name, password, Role::Admin).await?;
        tx.commit().await?;
        Ok(Some(account))
    }
}

async fn insert_account(tx: &mut Tx, name: &str, password_hash: &str, role: Role) -> DbResult<Account> {
    let now = now_micros();
    let id = crate::model::new_id();
    sqlx::query(
        "insert into account (account_id, name, name_key, password_hash, role, disabled, created_at, updated_at)
         values ($1, $2, $3, $4, $5, false, $6, $6)",
    )
    .bind(&id)
    .bind(name)
    .bind(name.to_lowercase())
    .bind(password_hash)
    .bind(role.word())
    .bind(now)
    .execute(&mut **tx)
    .await?;
    let (name, password_hash) = (name.to_string(), password_hash.to_string());
    Ok(Account { id, name, password_hash, role, disabled: false, created_at: now })
}
