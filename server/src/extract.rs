//! JSON bodies and query strings, refused in our own words.

use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::request::Parts;
use axum::http::{StatusCode, header};
use serde::de::DeserializeOwned;

use crate::body::Incoming;
use crate::error::{Error, Result};
use crate::state::App;

/// A JSON body.
#[derive(Debug)]
pub struct Json<T>(pub T);

/// A query string.
#[derive(Debug)]
pub struct Query<T>(pub T);

impl<T: DeserializeOwned> FromRequest<App> for Json<T> {
    type Rejection = Error;
    async fn from_request(request: Request, app: &App) -> Result<Self> {
        let (parts, body) = request.into_parts();
        let mut incoming =
            Incoming::new(&parts.headers, body, app.config.limits.json_bytes, &app.config.times).await?;
        if !is_json(&parts) {
            incoming.refuse(&parts.headers).await;
            let detail = "Send JSON, with Content-Type: application/json.";
            return Err(Error::refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, "wrong_content_type", detail));
        }
        let bytes = incoming.collect().await?;
        let bad =
            |e: serde_json::Error| Error::unprocessable("bad_json", format!("The JSON cannot be used: {e}."));
        serde_json::from_slice(&bytes).map(Self).map_err(bad)
    }
}

fn is_json(parts: &Parts) -> bool {
    let content_type = parts.headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    content_type.is_some_and(|text| text.split(';').next().is_some_and(|t| t.trim() == "application/json"))
}

impl<T: DeserializeOwned> FromRequestParts<App> for Query<T> {
    type Rejection = Error;
    async fn from_request_parts(parts: &mut Parts, _app: &App) -> Result<Self> {
        let bad = |e: axum::extract::rejection::QueryRejection| {
            Error::bad_request("bad_query", format!("The address's query cannot be used: {}.", e.body_text()))
        };
        axum::extract::Query::try_from_uri(&parts.uri).map(|query| Self(query.0)).map_err(bad)
    }
}
