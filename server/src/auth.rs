//! Who asks: a session cookie or a bearer token, and what they may do.

pub mod origin;
pub mod password;
pub mod secret;
pub mod throttle;

use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{HeaderMap, StatusCode, header};

use crate::db::account::Account;
use crate::db::product::ProductRow;
use crate::error::{Error, Result};
use crate::model::{Role, Scope, Status};
use crate::state::App;

/// The session cookie's name.
pub const COOKIE: &str = "allround_session";

/// Somebody whose cookie or token was good.
#[derive(Debug, Clone)]
pub struct Caller {
    pub account: Account,
    /// `None`: a session, which may do all its account may.
    scopes: Option<Vec<Scope>>,
}

/// A caller, or nobody: what the public sees.
#[derive(Debug, Clone)]
pub struct MaybeCaller(pub Option<Caller>);

/// A person in a browser; tokens are not enough.
#[derive(Debug, Clone)]
pub struct Person(pub Account);

/// An admin in a browser.
#[derive(Debug, Clone)]
pub struct Admin(pub Account);

impl Caller {
    pub fn is_admin(&self) -> bool {
        self.account.role == Role::Admin
    }

    /// Refuses tokens that were not made for this; `manage` includes `upload`.
    pub fn require(&self, scope: Scope) -> Result<()> {
        match &self.scopes {
            Some(scopes) if !scopes.contains(&scope) && !scopes.contains(&Scope::Manage) => {
                let detail =
                    "This token was not made for that. Make one with the right scope under /manage/tokens.";
                Err(Error::forbidden("wrong_scope", detail))
            }
            _ => Ok(()),
        }
    }

    fn owns(&self, product: &ProductRow) -> bool {
        self.is_admin() || product.owner_id == self.account.id
    }

    /// The product, where it is the caller's (or the caller is an admin); to others it does not exist.
    pub async fn own_product(&self, app: &App, id: &str) -> Result<ProductRow> {
        let product = find(app, id).await?;
        if self.owns(&product) { Ok(product) } else { Err(Error::not_found("product")) }
    }
}

impl MaybeCaller {
    /// The product, where it is public or the caller's.
    pub async fn visible_product(&self, app: &App, id: &str) -> Result<ProductRow> {
        let product = find(app, id).await?;
        let visible = product.status == Status::Active || self.0.as_ref().is_some_and(|c| c.owns(&product));
        if visible { Ok(product) } else { Err(Error::not_found("product")) }
    }
}

async fn find(app: &App, id: &str) -> Result<ProductRow> {
    let id = crate::model::parse_id(id).ok_or_else(|| Error::not_found("product"))?;
    app.db.product(&id).await?.ok_or_else(|| Error::not_found("product"))
}

fn not_logged_in(detail: &str) -> Error {
    Error::refuse(StatusCode::UNAUTHORIZED, "not_logged_in", detail)
}

/// The session id in the cookies.
pub fn session_cookie(headers: &HeaderMap) -> Option<&str> {
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    let mut pairs = cookies.flat_map(|line| line.split(';')).filter_map(|pair| pair.trim().split_once('='));
    pairs.find(|(name, _)| *name == COOKIE).map(|(_, value)| value)
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    let value = headers.get(header::AUTHORIZATION)?.to_str().ok()?;
    let (scheme, token) = value.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

async fn identify(parts: &Parts, app: &App) -> Result<Option<Caller>> {
    if parts.headers.contains_key(header::AUTHORIZATION) {
        return by_token(parts, app).await.map(Some);
    }
    let Some(cookie) = session_cookie(&parts.headers) else { return Ok(None) };
    let hash = secret::hash(cookie);
    let Some(id) = app.db.session_account(&hash, app.config.times.session_idle).await? else {
        return Ok(None);
    };
    origin::require_same(&parts.method, &parts.headers, &app.config)?;
    let account = app.db.account(&id).await?.filter(|account| !account.disabled);
    Ok(account.map(|account| Caller { account, scopes: None }))
}

async fn by_token(parts: &Parts, app: &App) -> Result<Caller> {
    let bad = || {
        not_logged_in("The token is not good: it was revoked, has run out, or is mistyped. Make a new one.")
    };
    let sent = bearer(&parts.headers).ok_or_else(bad)?;
    let token = app.db.use_token(&secret::hash(sent)).await?.ok_or_else(bad)?;
    let account = app.db.account(&token.account_id).await?.filter(|account| !account.disabled);
    Ok(Caller { account: account.ok_or_else(bad)?, scopes: Some(token.scopes) })
}

impl FromRequestParts<App> for MaybeCaller {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self> {
        Ok(Self(identify(parts, app).await?))
    }
}

impl FromRequestParts<App> for Caller {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self> {
        let nobody =
            || not_logged_in("Log in first, or send a token. A session that was not used for long ends.");
        identify(parts, app).await?.ok_or_else(nobody)
    }
}

impl FromRequestParts<App> for Person {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self> {
        let caller = Caller::from_request_parts(parts, app).await?;
        match caller.scopes {
            None => Ok(Self(caller.account)),
            Some(_) => Err(Error::forbidden("wrong_scope", "Tokens cannot do this; log in with a browser.")),
        }
    }
}

impl FromRequestParts<App> for Admin {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self> {
        let Person(account) = Person::from_request_parts(parts, app).await?;
        match account.role {
            Role::Admin => Ok(Self(account)),
            Role::Seller => Err(Error::forbidden("not_admin", "Only an admin may do this; ask one.")),
        }
    }
}
