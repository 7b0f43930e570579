//! Stored files: strong ETags, ranges, caching for ever, and only to those who may see the product.

use std::ops::Range;

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::auth::MaybeCaller;
use crate::error::{Error, Problem, Result};
use crate::model::{FileRole, Status};
use crate::state::App;
use crate::storage::Key;

/// What a `Range` header asks for.
#[derive(Debug, PartialEq)]
enum Wanted {
    All,
    Part(Range<u64>),
    Nothing,
}

/// A file of a listing, in full or in part.
#[utoipa::path(get, path = "/api/products/{id}/files/{sha256}/{name}", tag = "files",
    params(("id" = String, Path), ("sha256" = String, Path), ("name" = String, Path)),
    responses((status = 200, body = Vec<u8>, content_type = "application/octet-stream"), (status = 206), (status = 304),
        (status = 404, body = Problem), (status = 416, body = Problem)))]
pub(super) async fn show(
    State(app): State<App>,
    caller: MaybeCaller,
    Path((id, sha256, name)): Path<(String, String, String)>,
    method: Method,
    headers: HeaderMap,
) -> Result<Response> {
    let product = caller.visible_product(&app, &id).await?;
    let missing = || Error::not_found("file");
    let key = Key::parse(&sha256).ok_or_else(missing)?;
    let files = app.db.files(&product.id).await?;
    let file = files.into_iter().find(|f| f.sha256 == sha256 && f.name == name).ok_or_else(missing)?;
    let etag = format!("\"{sha256}\"");
    let mut fixed = vec![
        (header::ETAG, etag.clone()),
        (header::CACHE_CONTROL, cache_control(product.status).to_string()),
        (header::ACCEPT_RANGES, "bytes".to_string()),
        (header::CONTENT_TYPE, content_type(file.role).to_string()),
    ];
    if file.role == FileRole::Model {
        fixed.push((header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")));
    }
    let size = file.bytes as u64;
    if lists_etag(&headers, &header::IF_NONE_MATCH, &etag) {
        return Ok(with_headers(StatusCode::NOT_MODIFIED.into_response(), fixed));
    }
    let wanted = if range_still_good(&headers, &etag) { parse_range(&headers, size) } else { Wanted::All };
    let (status, range) = match wanted {
        Wanted::All => (StatusCode::OK, 0..size),
        Wanted::Part(range) => {
            fixed.push((header::CONTENT_RANGE, format!("bytes {}-{}/{size}", range.start, range.end - 1)));
            (StatusCode::PARTIAL_CONTENT, range)
        }
        Wanted::Nothing => {
            let detail = format!("The file has {size} bytes; ask for a range inside.");
            let refusal =
                Error::refuse(StatusCode::RANGE_NOT_SATISFIABLE, "bad_range", detail).into_response();
            return Ok(with_headers(refusal, vec![(header::CONTENT_RANGE, format!("bytes */{size}"))]));
        }
    };
    fixed.push((header::CONTENT_LENGTH, (range.end - range.start).to_string()));
    let body = if method == Method::HEAD || range.is_empty() {
        Body::empty()
    } else {
        Body::from_stream(app.storage.read(&key, range).await?)
    };
    Ok(with_headers((status, body).into_response(), fixed))
}

fn with_headers(mut response: Response, headers: Vec<(header::HeaderName, String)>) -> Response {
    for (name, value) in headers {
        if let Ok(value) = HeaderValue::from_str(&value) {
            response.headers_mut().insert(name, value);
        }
    }
    response
}

fn content_type(role: FileRole) -> &'static str {
    match role {
        FileRole::Model | FileRole::Stream => "application/octet-stream",
        FileRole::Poster | FileRole::Thumb => "image/jpeg",
        FileRole::Report => "application/json",
    }
}

fn cache_control(status: Status) -> &'static str {
    match status {
        Status::Active => "public, max-age=31536000, immutable",
        Status::Draft | Status::Archived => "private, max-age=31536000, immutable",
    }
}

fn lists_etag(headers: &HeaderMap, name: &header::HeaderName, etag: &str) -> bool {
    let value = headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
    value.split(',').any(|one| one.trim() == "*" || one.trim().trim_start_matches("W/") == etag)
}

/// `If-Range` compares strongly; a date never matches, as no dates are sent.
fn range_still_good(headers: &HeaderMap, etag: &str) -> bool {
    headers.get(header::IF_RANGE).is_none_or(|value| value == etag)
}

/// One range of bytes; several, or what is no range of bytes, are answered with the whole file.
fn parse_range(headers: &HeaderMap, size: u64) -> Wanted {
    let value = headers.get(header::RANGE).and_then(|value| value.to_str().ok());
    let spec = value.and_then(|value| value.strip_prefix("bytes=")).filter(|spec| !spec.contains(','));
    let Some((first, last)) = spec.and_then(|spec| spec.trim().split_once('-')) else { return Wanted::All };
    let range = match (first.parse::<u64>(), last.parse::<u64>()) {
        (Ok(first), Ok(last)) if first <= last => first..last.saturating_add(1).min(size),
        (Ok(first), Err(_)) if last.is_empty() => first..size,
        (Err(_), Ok(count)) if first.is_empty() => size.saturating_sub(count)..size,
        _ => return Wanted::All,
    };
    if range.is_empty() { Wanted::Nothing } else { Wanted::Part(range) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(range: &str, expected: &Wanted) {
        let mut headers = HeaderMap::new();
        headers.insert(header::RANGE, range.parse().unwrap());
        assert_eq!(parse_range(&headers, 100), *expected, "{range}");
    }

    #[test]
    fn ranges() {
        check("bytes=0-9", &Wanted::Part(0..10));
        check("bytes=90-", &Wanted::Part(90..100));
        check("bytes=-10", &Wanted::Part(90..100));
        check("bytes=-1000", &Wanted::Part(0..100));
        check("bytes=50-18446744073709551615", &Wanted::Part(50..100));
        check("bytes=100-", &Wanted::Nothing);
        check("bytes=-0", &Wanted::Nothing);
        check("bytes=9-0", &Wanted::All);
        check("bytes=0-1,5-6", &Wanted::All);
        check("lines=0-1", &Wanted::All);
    }
}
