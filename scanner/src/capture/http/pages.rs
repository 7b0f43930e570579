//! The page: what `web/dist-capture` held when the program was built. It needs no token, it holds no secret.

use axum::http::{Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use rust_embed::RustEmbed;

use crate::upload::hex;

#[derive(Debug, RustEmbed)]
#[folder = "../web/dist-capture"]
struct Dist;

/// Shown where the page was not built.
const NOT_BUILT: &str = "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Allround</title></head><body>\
    <main><h1>Allround</h1><p>The capture runs, but its page was not built. Run <code>npm ci &amp;&amp; npm run build</code> in \
    <code>web/</code> and build scan-product again.</p></main></body></html>";

/// A file of the page.
pub(super) async fn page(method: Method, uri: Uri) -> Response {
    if !method.is_safe() {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    let path = match uri.path().trim_start_matches('/') {
        "" => "index.html",
        path => path,
    };
    match Dist::get(path) {
        Some(file) => {
            let etag = hex(&file.metadata.sha256_hash()[..12]);
            let fixed = [
                (header::CONTENT_TYPE, content_type(path).to_owned()),
                (header::CACHE_CONTROL, "no-cache".to_owned()),
                (header::ETAG, format!("\"{etag}\"")),
            ];
            (fixed, file.data.into_owned()).into_response()
        }
        None if path == "index.html" => {
            ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], NOT_BUILT).into_response()
        }
        None => (StatusCode::NOT_FOUND, "There is nothing at this address.\n").into_response(),
    }
}

fn content_type(path: &str) -> &'static str {
    match path.rsplit('.').next().unwrap_or_default() {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" | "map" | "webmanifest" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "woff2" => "font/woff2",
        "wasm" => "application/wasm",
        _ => "application/octet-stream",
    }
}
