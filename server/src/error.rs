//! What goes wrong, and what the client is told: `application/problem+json`.
//!
//! 4xx says what to change. 5xx says nothing about the inside; the cause is logged once, with the request's id, in
//! [`crate::observe`], which also writes the body.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

/// The result of a handler.
pub type Result<T> = std::result::Result<T, Error>;

/// A refusal or a failure.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The client can do something about it.
    #[error("{detail}")]
    Refused { status: StatusCode, code: &'static str, detail: String },
    #[error("database: {0}")]
    Database(#[from] sqlx::Error),
    #[error("storage: {0}")]
    Storage(#[from] object_store::Error),
    #[error("files: {0}")]
    Io(#[from] std::io::Error),
    #[error("{0}")]
    Internal(String),
}

/// The body of every error.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Problem {
    /// Always `about:blank`: the status and the code say what kind of problem it is.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// The status in words.
    pub title: String,
    /// The HTTP status.
    pub status: u16,
    /// What to change, in plain English.
    pub detail: String,
    /// A short word for programs.
    pub code: String,
    /// Name this when asking the operator.
    pub request_id: String,
}

/// What an error response carries until its body is written.
#[derive(Debug, Clone)]
pub struct Told {
    pub code: &'static str,
    pub detail: String,
    /// For the log only.
    pub cause: Option<String>,
}

impl Error {
    pub fn refuse(status: StatusCode, code: &'static str, detail: impl Into<String>) -> Self {
        Self::Refused { status, code, detail: detail.into() }
    }

    pub fn bad_request(code: &'static str, detail: impl Into<String>) -> Self {
        Self::refuse(StatusCode::BAD_REQUEST, code, detail)
    }

    pub fn unprocessable(code: &'static str, detail: impl Into<String>) -> Self {
        Self::refuse(StatusCode::UNPROCESSABLE_ENTITY, code, detail)
    }

    pub fn conflict(code: &'static str, detail: impl Into<String>) -> Self {
        Self::refuse(StatusCode::CONFLICT, code, detail)
    }

    pub fn forbidden(code: &'static str, detail: impl Into<String>) -> Self {
        Self::refuse(StatusCode::FORBIDDEN, code, detail)
    }

    pub fn not_found(what: &str) -> Self {
        Self::refuse(StatusCode::NOT_FOUND, "not_found", format!("There is no such {what}."))
    }

    pub fn too_large(limit: u64) -> Self {
        let detail = format!("The body is larger than the {limit} bytes allowed here. Send less.");
        Self::refuse(StatusCode::PAYLOAD_TOO_LARGE, "too_large", detail)
    }

    pub fn internal(cause: impl std::fmt::Display) -> Self {
        Self::Internal(cause.to_string())
    }

    /// Status and what is told.
    pub fn told(self) -> (StatusCode, Told) {
        let cause = self.to_string();
        let (status, code, detail) = match self {
            Self::Refused { status, code, detail } => return (status, Told { code, detail, cause: None }),
            Self::Database(error) if is_busy(&error) => BUSY,
            Self::Database(error) if database_code(&error).is_some_and(|code| code & 0xff == SQLITE_FULL) => {
                FULL
            }
            Self::Storage(error) if is_full(&error) => FULL,
            Self::Io(error) if is_full_io(&error) => FULL,
            _ => FAILED,
        };
        (status, Told { code, detail: detail.to_string(), cause: Some(cause) })
    }
}

type Known = (StatusCode, &'static str, &'static str);
const BUSY: Known = (
    StatusCode::SERVICE_UNAVAILABLE,
    "busy",
    "The server is busy. Nothing was changed; try again in a few seconds.",
);
const FULL: Known = (
    StatusCode::INSUFFICIENT_STORAGE,
    "storage_full",
    "The server has no room left. Nothing was changed; tell the operator and try again later.",
);
const FAILED: Known = (
    StatusCode::INTERNAL_SERVER_ERROR,
    "internal",
    "Something went wrong inside the server. Try again; if it stays, tell the operator the request id.",
);
/// Seconds after which a busy server may be asked again.
const RETRY_AFTER: HeaderValue = HeaderValue::from_static("5");

const SQLITE_BUSY: u32 = 5;
const SQLITE_LOCKED: u32 = 6;
const SQLITE_FULL: u32 = 13;

fn database_code(error: &sqlx::Error) -> Option<u32> {
    error.as_database_error()?.code()?.parse().ok()
}

fn is_busy(error: &sqlx::Error) -> bool {
    let code = database_code(error).map(|code| code & 0xff);
    matches!(error, sqlx::Error::PoolTimedOut) || matches!(code, Some(SQLITE_BUSY | SQLITE_LOCKED))
}

fn is_full_io(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{QuotaExceeded, StorageFull};
    matches!(error.kind(), StorageFull | QuotaExceeded)
}

/// Whether an I/O error that says "full" is somewhere among the causes.
fn is_full(error: &object_store::Error) -> bool {
    let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(error);
    while let Some(error) = cause {
        if error.downcast_ref::<std::io::Error>().is_some_and(is_full_io) {
            return true;
        }
        cause = error.source();
    }
    false
}

impl IntoResponse for Error {
    fn into_response(self) -> Response {
        let (status, told) = self.told();
        let mut response = status.into_response();
        if status == StatusCode::SERVICE_UNAVAILABLE || status == StatusCode::TOO_MANY_REQUESTS {
            response.headers_mut().insert(header::RETRY_AFTER, RETRY_AFTER);
        }
        if status == StatusCode::UNAUTHORIZED {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response.extensions_mut().insert(told);
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inside_stays_inside() {
        let (status, told) = Error::internal("secret path /var/lib").told();
        assert_eq!(status, StatusCode::INTERNAL_SERVER_ERROR);
        assert!(!told.detail.contains("secret"));
        assert!(told.cause.is_some_and(|cause| cause.contains("secret")));
    }

    #[test]
    fn a_full_disk_is_told_as_such_through_layers() {
        let io = std::io::Error::from(std::io::ErrorKind::StorageFull);
        let wrapped = object_store::Error::Generic { store: "local", source: Box::new(io) };
        assert_eq!(Error::from(wrapped).told().0, StatusCode::INSUFFICIENT_STORAGE);
    }
}
