//! The pages: what `web/dist` held when the server was built. Every page's address is answered with the same file.

use std::collections::HashMap;
use std::io::Write;
use std::sync::LazyLock;

use axum::http::{HeaderMap, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use rust_embed::RustEmbed;

use crate::model::hex;

#[derive(Debug, RustEmbed)]
#[folder = "../web/dist"]
struct Dist;

/// A file as it is sent.
struct Asset {
    content_type: &'static str,
    etag: String,
    plain: Bytes,
    /// Where that is smaller.
    gzip: Option<Bytes>,
}

/// Shown where the web part was not built.
const NOT_BUILT: &str = "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Allround</title></head><body>\
    <main><h1>Allround</h1><p>The server runs, but its pages were not built. Run <code>npm ci &amp;&amp; npm run build</code> in \
    <code>web/</code> and build the server again. The <a href=\"/api/openapi.json\">API</a> works.</p></main></body></html>";

/// Files whose name carries a hash never change.
const HASHED_FOLDER: &str = "assets/";

static ASSETS: LazyLock<HashMap<String, Asset>> = LazyLock::new(|| {
    Dist::iter()
        .filter_map(|path| {
            let file = Dist::get(&path)?;
            let plain = Bytes::from(file.data.into_owned());
            let etag = format!("\"{}\"", hex(&file.metadata.sha256_hash()[..16]));
            let (content_type, packs) = content_type(&path);
            let gzip = packs.then(|| gzip(&plain)).flatten().filter(|packed| packed.len() < plain.len());
            Some((path.to_string(), Asset { content_type, etag, plain, gzip }))
        })
        .collect()
});

/// A file of the web part, or the page for all addresses that are no file.
pub(super) async fn page(method: Method, uri: Uri, headers: HeaderMap) -> Response {
    if method != Method::GET && method != Method::HEAD {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    let path = uri.path().trim_start_matches('/');
    if let Some(asset) = ASSETS.get(path).filter(|_| path != "index.html") {
        return send(asset, &headers, path.starts_with(HASHED_FOLDER));
    }
    let is_file = path.starts_with(HASHED_FOLDER) || path.rsplit('/').next().is_some_and(|n| n.contains('.'));
    if is_file && !path.is_empty() {
        return (StatusCode::NOT_FOUND, "There is nothing at this address.\n").into_response();
    }
    match ASSETS.get("index.html") {
        Some(index) => send(index, &headers, false),
        None => ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], NOT_BUILT).into_response(),
    }
}

fn send(asset: &Asset, headers: &HeaderMap, unchanging: bool) -> Response {
    let cache = if unchanging { "public, max-age=31536000, immutable" } else { "no-cache" };
    let fixed = [
        (header::CONTENT_TYPE, asset.content_type.to_string()),
        (header::CACHE_CONTROL, cache.to_string()),
        (header::ETAG, format!("W/{}", asset.etag)),
        (header::VARY, "accept-encoding".to_string()),
    ];
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
    if text(header::IF_NONE_MATCH).split(',').any(|e| e.trim().trim_start_matches("W/") == asset.etag) {
        return (StatusCode::NOT_MODIFIED, fixed).into_response();
    }
    let takes_gzip = text(header::ACCEPT_ENCODING).split(',').any(|coding| {
        let mut parts = coding.split(';').map(str::trim);
        parts.next() == Some("gzip") && parts.next() != Some("q=0")
    });
    match asset.gzip.as_ref().filter(|_| takes_gzip) {
        Some(packed) => (fixed, [(header::CONTENT_ENCODING, "gzip")], packed.clone()).into_response(),
        None => (fixed, asset.plain.clone()).into_response(),
    }
}

fn gzip(plain: &[u8]) -> Option<Bytes> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(plain).ok()?;
    encoder.finish().ok().map(Bytes::from)
}

/// Content type by ending, and whether such files are worth packing.
fn content_type(path: &str) -> (&'static str, bool) {
    match path.rsplit('.').next().unwrap_or_default() {
        "html" => ("text/html; charset=utf-8", true),
        "js" | "mjs" => ("text/javascript; charset=utf-8", true),
        "css" => ("text/css; charset=utf-8", true),
        "json" | "webmanifest" | "map" => ("application/json", true),
        "svg" => ("image/svg+xml", true),
        "wasm" => ("application/wasm", true),
        "txt" => ("text/plain; charset=utf-8", true),
        "png" => ("image/png", false),
        "jpg" | "jpeg" => ("image/jpeg", false),
        "webp" => ("image/webp", false),
        "ico" => ("image/x-icon", false),
        "woff2" => ("font/woff2", false),
        _ => ("application/octet-stream", false),
    }
}
