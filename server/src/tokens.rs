//! Making API tokens: for the HTTP API and for the command line.

use std::time::Duration;

use crate::auth::secret;
use crate::db::token::Token;
use crate::db::{Db, now_micros, session::micros};
use crate::error::{Error, Result};
use crate::model::{Scope, new_id};

/// How much of a token is kept to tell tokens apart.
const PREFIX_CHARS: usize = 10;
const MOST_DAYS: u32 = 3650;

/// A token somebody wants.
#[derive(Debug)]
pub struct NewToken {
    pub name: String,
    pub scopes: Vec<Scope>,
    /// Days until it runs out; `None`: never.
    pub days: Option<u32>,
}

/// Makes a token; its text is not kept and cannot be had again.
pub async fn issue(db: &Db, account_id: &str, new: NewToken) -> Result<(String, Token)> {
    let mut scopes = new.scopes;
    scopes.dedup();
    if scopes.is_empty() {
        return Err(Error::unprocessable("no_scope", "Name at least one scope: upload or manage."));
    }
    if new.days.is_some_and(|days| days == 0 || days > MOST_DAYS) {
        let detail = format!("expires_in_days is 1 to {MOST_DAYS}, or absent.");
        return Err(Error::unprocessable("bad_expiry", detail));
    }
    let text = format!("{}{}", secret::TOKEN_MARK, secret::random()?);
    let now = now_micros();
    let token = Token {
        id: new_id(),
        account_id: account_id.to_string(),
        name: new.name,
        prefix: text.chars().take(PREFIX_CHARS).collect(),
        scopes,
        created_at: now,
        expires_at: new.days.map(|days| now + micros(Duration::from_secs(u64::from(days) * 24 * 3600))),
        last_used_at: None,
    };
    db.insert_token(&token, &secret::hash(&text)).await?;
    Ok((text, token))
}
