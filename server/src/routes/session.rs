//! Logging in and out, the first admin, one's own password.

use axum::Json as Answer;
use axum::extract::State;
use axum::http::request::Parts;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::text::account_name;
use crate::auth::{COOKIE, MaybeCaller, Person, origin, secret, session_cookie};
use crate::db::account::{Account, AccountChange};
use crate::error::{Error, Problem, Result};
use crate::extract::Json;
use crate::model::Role;
use crate::state::App;

#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct LogIn {
    name: String,
    password: String,
}

#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct SetUp {
    /// From the link printed at the first start.
    token: String,
    name: String,
    password: String,
}

#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct ChangePassword {
    current: String,
    new: String,
}

/// Who is logged in.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Session {
    #[schema(required)]
    user: Option<SessionUser>,
}

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct SessionUser {
    id: String,
    name: String,
    role: Role,
}

impl From<Account> for Session {
    fn from(account: Account) -> Self {
        Self { user: Some(SessionUser { id: account.id, name: account.name, role: account.role }) }
    }
}

/// Who is asking; `user` is null for nobody.
#[utoipa::path(get, path = "/api/session", tag = "session", responses((status = 200, body = Session)))]
pub(super) async fn show(MaybeCaller(caller): MaybeCaller) -> Answer<Session> {
    Answer(caller.map_or(Session { user: None }, |caller| caller.account.into()))
}

/// Log in; the cookie comes with the answer.
#[utoipa::path(post, path = "/api/session", tag = "session", request_body = LogIn,
    responses((status = 200, body = Session), (status = 401, body = Problem), (status = 429, body = Problem)))]
pub(super) async fn log_in(
    State(app): State<App>,
    parts: Parts,
    Json(body): Json<LogIn>,
) -> Result<Response> {
    origin::refuse_foreign(&parts.headers, &app.config)?;
    let name = format!("name {}", body.name.to_lowercase().chars().take(64).collect::<String>());
    if !app.login_throttle.allow(&[&client_address(&app, &parts), &name]) {
        let detail = "Too many attempts to log in. Wait a minute.";
        return Err(Error::refuse(StatusCode::TOO_MANY_REQUESTS, "too_many_attempts", detail));
    }
    let account = app.db.account_by_name(&body.name).await?.filter(|account| !account.disabled);
    let hash = account.as_ref().map(|account| account.password_hash.clone());
    let right = app.passwords.verify(body.password, hash.as_deref()).await?;
    match account.filter(|_| right) {
        Some(account) => begin_session(&app, StatusCode::OK, account).await,
        None => Err(Error::refuse(StatusCode::UNAUTHORIZED, "wrong_password", "Name or password is wrong.")),
    }
}

/// Log out.
#[utoipa::path(delete, path = "/api/session", tag = "session", responses((status = 204)))]
pub(super) async fn log_out(State(app): State<App>, _person: Person, headers: HeaderMap) -> Result<Response> {
    if let Some(id) = session_cookie(&headers) {
        app.db.delete_session(&secret::hash(id)).await?;
    }
    Ok((StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie(&app, "", 0))]).into_response())
}

/// Make the first admin with the one-time link, and log in.
#[utoipa::path(post, path = "/api/setup", tag = "session", request_body = SetUp,
    responses((status = 201, body = Session), (status = 403, body = Problem)))]
pub(super) async fn set_up(
    State(app): State<App>,
    parts: Parts,
    Json(body): Json<SetUp>,
) -> Result<Response> {
    origin::refuse_foreign(&parts.headers, &app.config)?;
    if !app.login_throttle.allow(&[&client_address(&app, &parts)]) {
        let detail = "Too many attempts. Wait a minute.";
        return Err(Error::refuse(StatusCode::TOO_MANY_REQUESTS, "too_many_attempts", detail));
    }
    let name = account_name(&body.name)?;
    let hash = app.passwords.hash(body.password).await?;
    let used = || {
        let detail = "This link was used already or is mistyped. Start the server again for a new one, or use \
                      `product-server user add --admin`.";
        Error::forbidden("link_used", detail)
    };
    let made = app.db.first_admin(&secret::hash(&body.token), &name, &hash).await;
    let account = made.map_err(super::users::name_taken)?.ok_or_else(used)?;
    begin_session(&app, StatusCode::CREATED, account).await
}

/// Change one's own password; other sessions end.
#[utoipa::path(post, path = "/api/account/password", tag = "session", request_body = ChangePassword,
    responses((status = 204), (status = 403, body = Problem)))]
pub(super) async fn change_password(
    State(app): State<App>,
    Person(account): Person,
    parts: Parts,
    Json(body): Json<ChangePassword>,
) -> Result<Response> {
    if !app.login_throttle.allow(&[&client_address(&app, &parts)]) {
        let detail = "Too many attempts. Wait a minute.";
        return Err(Error::refuse(StatusCode::TOO_MANY_REQUESTS, "too_many_attempts", detail));
    }
    if !app.passwords.verify(body.current, Some(&account.password_hash)).await? {
        return Err(Error::forbidden("wrong_password", "The current password is wrong."));
    }
    let hash = app.passwords.hash(body.new).await?;
    let change = AccountChange { password_hash: Some(hash), ..AccountChange::default() };
    app.db.change_account(&account.id, &change).await?;
    let mut response = begin_session(&app, StatusCode::NO_CONTENT, account).await?;
    *response.body_mut() = axum::body::Body::empty();
    response.headers_mut().remove(header::CONTENT_TYPE);
    response.headers_mut().remove(header::CONTENT_LENGTH);
    Ok(response)
}

async fn begin_session(app: &App, status: StatusCode, account: Account) -> Result<Response> {
    let id = secret::random()?;
    let lifetime = app.config.times.session_lifetime;
    app.db.insert_session(&secret::hash(&id), &account.id, lifetime).await?;
    let cookie = cookie(app, &id, lifetime.as_secs());
    Ok((status, [(header::SET_COOKIE, cookie)], Answer(Session::from(account))).into_response())
}

fn cookie(app: &App, value: &str, seconds: u64) -> String {
    let secure = if app.config.is_https() { "; Secure" } else { "" };
    format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Lax; Max-Age={seconds}{secure}")
}

/// The client's address as the key of a throttle.
fn client_address(app: &App, parts: &Parts) -> String {
    let forwarded = || {
        let value = parts.headers.get_all("x-forwarded-for").iter().next_back()?.to_str().ok()?;
        value.rsplit(',').next().map(|last| last.trim().to_string())
    };
    let peer = || {
        let info = parts.extensions.get::<axum::extract::ConnectInfo<std::net::SocketAddr>>();
        info.map_or_else(|| "unknown".to_string(), |info| info.0.ip().to_string())
    };
    let address = if app.config.behind_proxy { forwarded().unwrap_or_else(peer) } else { peer() };
    format!("address {address}")
}
