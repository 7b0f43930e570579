//! One's own API tokens.

use axum::Json as Answer;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::text::one_line;
use crate::auth::Person;
use crate::db::token::Token;
use crate::error::{Error, Problem, Result};
use crate::extract::Json;
use crate::model::{Scope, rfc3339};
use crate::state::App;
use crate::tokens::{NewToken, issue};

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct TokenItem {
    id: String,
    name: String,
    /// The token's first characters.
    prefix: String,
    scopes: Vec<Scope>,
    created_at: String,
    #[schema(required)]
    expires_at: Option<String>,
    #[schema(required)]
    last_used_at: Option<String>,
}

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct TokenList {
    items: Vec<TokenItem>,
}

#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct TokenRequest {
    name: String,
    scopes: Vec<Scope>,
    /// 1 to 3650; absent: does not run out.
    expires_in_days: Option<u32>,
}

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct TokenMade {
    /// Shown this once.
    token: String,
    item: TokenItem,
}

impl From<Token> for TokenItem {
    fn from(token: Token) -> Self {
        Self {
            id: token.id,
            name: token.name,
            prefix: token.prefix,
            scopes: token.scopes,
            created_at: rfc3339(token.created_at),
            expires_at: token.expires_at.map(rfc3339),
            last_used_at: token.last_used_at.map(rfc3339),
        }
    }
}

/// All of one's tokens.
#[utoipa::path(get, path = "/api/tokens", tag = "tokens", responses((status = 200, body = TokenList)))]
pub(super) async fn list(State(app): State<App>, Person(account): Person) -> Result<Answer<TokenList>> {
    let items = app.db.tokens(&account.id).await?.into_iter().map(TokenItem::from).collect();
    Ok(Answer(TokenList { items }))
}

/// Make a token.
#[utoipa::path(post, path = "/api/tokens", tag = "tokens", request_body = TokenRequest,
    responses((status = 201, body = TokenMade), (status = 422, body = Problem)))]
pub(super) async fn create(
    State(app): State<App>,
    Person(account): Person,
    Json(body): Json<TokenRequest>,
) -> Result<(StatusCode, Answer<TokenMade>)> {
    let name = one_line("name", &body.name, 100)?;
    let new = NewToken { name, scopes: body.scopes, days: body.expires_in_days };
    let (token, item) = issue(&app.db, &account.id, new).await?;
    Ok((StatusCode::CREATED, Answer(TokenMade { token, item: item.into() })))
}

/// Revoke a token.
#[utoipa::path(delete, path = "/api/tokens/{id}", tag = "tokens", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn revoke(
    State(app): State<App>,
    Person(account): Person,
    Path(id): Path<String>,
) -> Result<StatusCode> {
    if app.db.delete_token(&id, &account.id).await? {
        Ok(StatusCode::NO_CONTENT)
    } else {
        Err(Error::not_found("token"))
    }
}
