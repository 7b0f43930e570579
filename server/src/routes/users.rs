//! Accounts, for admins.

use axum::Json as Answer;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::text::account_name;
use crate::auth::Admin;
use crate::db::account::{Account, AccountChange};
use crate::error::{Error, Problem, Result};
use crate::extract::Json;
use crate::model::{Role, rfc3339};
use crate::state::App;

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct User {
    id: String,
    name: String,
    role: Role,
    disabled: bool,
    created_at: String,
}

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct UserList {
    items: Vec<User>,
}

#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct NewUser {
    name: String,
    password: String,
    role: Role,
}

/// What is absent stays as it is.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct UserChange {
    role: Option<Role>,
    disabled: Option<bool>,
    password: Option<String>,
}

impl From<Account> for User {
    fn from(account: Account) -> Self {
        let Account { id, name, role, disabled, created_at, .. } = account;
        Self { id, name, role, disabled, created_at: rfc3339(created_at) }
    }
}

/// A taken name as a refusal.
pub(super) fn name_taken(error: sqlx::Error) -> Error {
    if crate::db::violates_unique(&error) {
        Error::conflict("name_taken", "Somebody has this name already; choose another.")
    } else {
        error.into()
    }
}

/// All accounts.
#[utoipa::path(get, path = "/api/users", tag = "users",
    responses((status = 200, body = UserList), (status = 403, body = Problem)))]
pub(super) async fn list(State(app): State<App>, _admin: Admin) -> Result<Answer<UserList>> {
    let items = app.db.accounts().await?.into_iter().map(User::from).collect();
    Ok(Answer(UserList { items }))
}

/// Make an account.
#[utoipa::path(post, path = "/api/users", tag = "users", request_body = NewUser,
    responses((status = 201, body = User), (status = 409, body = Problem), (status = 422, body = Problem)))]
pub(super) async fn create(
    State(app): State<App>,
    _admin: Admin,
    Json(body): Json<NewUser>,
) -> Result<(StatusCode, Answer<User>)> {
    let name = account_name(&body.name)?;
    let hash = app.passwords.hash(body.password).await?;
    let account = app.db.insert_account(&name, &hash, body.role).await.map_err(name_taken)?;
    Ok((StatusCode::CREATED, Answer(account.into())))
}

/// Change role or password, or lock an account; a new password or a lock ends its sessions.
#[utoipa::path(patch, path = "/api/users/{id}", tag = "users", request_body = UserChange, params(("id" = String, Path)),
    responses((status = 200, body = User), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub(super) async fn change(
    State(app): State<App>,
    _admin: Admin,
    Path(id): Path<String>,
    Json(body): Json<UserChange>,
) -> Result<Answer<User>> {
    let missing = || Error::not_found("user");
    let account = app.db.account(&id).await?.ok_or_else(missing)?;
    let password_hash = match body.password {
        Some(password) => Some(app.passwords.hash(password).await?),
        None => None,
    };
    let change = AccountChange { role: body.role, disabled: body.disabled, password_hash };
    if !app.db.change_account(&account.id, &change).await? {
        let detail = "This is the last admin; make another one first.";
        return Err(Error::conflict("last_admin", detail));
    }
    Ok(Answer(app.db.account(&id).await?.ok_or_else(missing)?.into()))
}
