//! Resumable uploads: tus 1.0.0 with creation, checksum (sha256), termination and expiration.
//!
//! The bytes so far are a file in the spool folder, and its length is the offset. When the last byte has come, the whole is
//! verified, read and attached to its product before the answer is sent.

use std::path::PathBuf;

use axum::Json as Answer;
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;
use sha2::{Digest, Sha256};
use time::OffsetDateTime;
use tokio::io::AsyncWriteExt;
use utoipa::ToSchema;

use super::text::file_name;
use crate::auth::Caller;
use crate::body::{Incoming, SpoolFile, digest_of};
use crate::db::session::micros;
use crate::db::{now_micros, upload::Upload};
use crate::error::{Error, Problem, Result};
use crate::ingest;
use crate::model::{Scope, UploadKind, UploadState, Word, hex, new_id, rfc3339};
use crate::state::{App, UploadGuard};
use crate::storage::Key;

const EXTENSIONS: &str = "creation,checksum,termination,expiration";

/// How far an upload is.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct UploadStatus {
    id: String,
    product_id: String,
    kind: UploadKind,
    length: i64,
    offset: u64,
    state: UploadState,
    /// Why it failed.
    #[schema(required)]
    detail: Option<String>,
    created_at: String,
    expires_at: String,
}

/// What `Upload-Metadata` says.
#[derive(Debug, Default, PartialEq)]
struct Metadata {
    product: String,
    kind: String,
    filename: String,
    sha256: Option<String>,
}

fn part_file(app: &App, id: &str) -> PathBuf {
    app.spool().join(format!("{id}.upload"))
}

/// Says it is tus, and when the upload runs out.
fn tus(mut response: Response, upload: Option<&Upload>) -> Response {
    let headers = response.headers_mut();
    headers.insert("tus-resumable", HeaderValue::from_static("1.0.0"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if let Some(expires) = upload.and_then(|upload| HeaderValue::from_str(&http_date(upload.expires_at)).ok())
    {
        headers.insert("upload-expires", expires);
    }
    response
}

fn http_date(at: i64) -> String {
    let format = time::macros::format_description!(
        "[weekday repr:short], [day] [month repr:short] [year] [hour]:[minute]:[second] GMT"
    );
    let time = OffsetDateTime::from_unix_timestamp(at / 1_000_000);
    time.ok().and_then(|t| t.format(&format).ok()).unwrap_or_default()
}

fn with_offset(mut response: Response, offset: u64) -> Response {
    response.headers_mut().insert("upload-offset", HeaderValue::from(offset));
    response
}

fn require_version(headers: &HeaderMap) -> Result<()> {
    if headers.get("tus-resumable").is_none_or(|version| version == "1.0.0") {
        return Ok(());
    }
    let detail = "This server speaks tus 1.0.0; send Tus-Resumable: 1.0.0.";
    Err(Error::refuse(StatusCode::PRECONDITION_FAILED, "tus_version", detail))
}

fn number(headers: &HeaderMap, name: &str) -> Result<u64> {
    let value = headers.get(name).and_then(|value| value.to_str().ok()?.parse().ok());
    value.ok_or_else(|| Error::bad_request("bad_header", format!("Send {name} with a number of bytes.")))
}

/// What this server can of tus.
pub(super) async fn options(State(app): State<App>) -> Response {
    let size = app.config.limits.model_bytes.to_string();
    let headers = [
        ("tus-version", "1.0.0"),
        ("tus-extension", EXTENSIONS),
        ("tus-max-size", size.as_str()),
        ("tus-checksum-algorithm", "sha256"),
    ];
    tus((StatusCode::NO_CONTENT, headers).into_response(), None)
}

/// Begin an upload. `Upload-Metadata` names `product`, `kind` (model, poster, report), `filename`, `sha256` (hex), each in base64.
#[utoipa::path(post, path = "/api/uploads", tag = "uploads",
    params(("Upload-Length" = u64, Header), ("Upload-Metadata" = String, Header)),
    responses((status = 201), (status = 400, body = Problem), (status = 404, body = Problem), (status = 413, body = Problem)))]
pub(super) async fn create(State(app): State<App>, caller: Caller, headers: HeaderMap) -> Result<Response> {
    caller.require(Scope::Upload)?;
    require_version(&headers)?;
    let metadata = headers.get("upload-metadata").and_then(|value| value.to_str().ok()).unwrap_or_default();
    let metadata = parse_metadata(metadata)?;
    let product = caller.own_product(&app, &metadata.product).await?;
    let bad = |detail: &str| Error::bad_request("bad_metadata", detail);
    let kind =
        UploadKind::from_word(&metadata.kind).ok_or_else(|| bad("kind is model, poster or report."))?;
    if metadata.sha256.as_deref().is_some_and(|sha| Key::parse(sha).is_none()) {
        return Err(bad("sha256 is 64 lower-case hexadecimal digits."));
    }
    let length = number(&headers, "Upload-Length")?;
    let limit = ingest::byte_limit(&app.config.limits, kind);
    if length > limit {
        return Err(Error::too_large(limit));
    }
    if app.db.uploads_under_way(&caller.account.id).await? >= app.config.limits.uploads_under_way {
        let detail = "Too many uploads are under way; finish or delete some (DELETE on their address).";
        return Err(Error::conflict("too_many_uploads", detail));
    }
    let now = now_micros();
    let upload = Upload {
        id: new_id(),
        account_id: caller.account.id,
        product_id: product.id,
        kind,
        filename: file_name(&metadata.filename, ingest::default_name(kind)),
        sha256: metadata.sha256,
        length: length as i64,
        state: UploadState::Receiving,
        detail: None,
        created_at: now,
        expires_at: now + micros(app.config.times.upload_lifetime),
    };
    tokio::fs::File::create(part_file(&app, &upload.id)).await?;
    app.db.insert_upload(&upload).await?;
    let location = [(header::LOCATION, format!("/api/uploads/{}", upload.id))];
    Ok(tus((StatusCode::CREATED, location).into_response(), Some(&upload)))
}

/// `key base64,key base64`: keys that mean nothing here are passed over.
fn parse_metadata(text: &str) -> Result<Metadata> {
    let bad =
        || Error::bad_request("bad_metadata", "Upload-Metadata is pairs of a key and a value in base64.");
    let mut metadata = Metadata::default();
    for pair in text.split(',').map(str::trim).filter(|pair| !pair.is_empty()) {
        let (key, value) = pair.split_once(' ').unwrap_or((pair, ""));
        let decoded = STANDARD.decode(value.trim()).map_err(|_error| bad())?;
        let value = String::from_utf8(decoded).map_err(|_error| bad())?;
        match key {
            "product" => metadata.product = value,
            "kind" => metadata.kind = value,
            "filename" => metadata.filename = value,
            "sha256" => metadata.sha256 = Some(value),
            _ => {}
        }
    }
    Ok(metadata)
}

async fn find(app: &App, caller: &Caller, id: &str) -> Result<Upload> {
    caller.require(Scope::Upload)?;
    let missing = || Error::not_found("upload (uploads run out after a day)");
    let id = crate::model::parse_id(id).ok_or_else(missing)?;
    let upload = app.db.upload(&id).await?.ok_or_else(missing)?;
    if upload.account_id == caller.account.id { Ok(upload) } else { Err(missing()) }
}

async fn offset_of(app: &App, upload: &Upload) -> Result<u64> {
    match upload.state {
        UploadState::Receiving => Ok(tokio::fs::metadata(part_file(app, &upload.id)).await?.len()),
        UploadState::Done | UploadState::Failed => Ok(upload.length as u64),
    }
}

/// How many bytes have come.
#[utoipa::path(head, path = "/api/uploads/{id}", tag = "uploads", params(("id" = String, Path)),
    responses((status = 200), (status = 404)))]
pub(super) async fn offset(
    State(app): State<App>,
    caller: Caller,
    Path(id): Path<String>,
) -> Result<Response> {
    let upload = find(&app, &caller, &id).await?;
    let offset = offset_of(&app, &upload).await?;
    let length = [("upload-length", upload.length.to_string())];
    Ok(with_offset(tus(length.into_response(), Some(&upload)), offset))
}

/// How far the upload is, as JSON.
#[utoipa::path(get, path = "/api/uploads/{id}", tag = "uploads", params(("id" = String, Path)),
    responses((status = 200, body = UploadStatus), (status = 404, body = Problem)))]
pub(super) async fn show(State(app): State<App>, caller: Caller, Path(id): Path<String>) -> Result<Response> {
    let upload = find(&app, &caller, &id).await?;
    let status = UploadStatus {
        offset: offset_of(&app, &upload).await?,
        id: upload.id.clone(),
        product_id: upload.product_id.clone(),
        kind: upload.kind,
        length: upload.length,
        state: upload.state,
        detail: upload.detail.clone(),
        created_at: rfc3339(upload.created_at),
        expires_at: rfc3339(upload.expires_at),
    };
    Ok(tus(Answer(status).into_response(), Some(&upload)))
}

/// Give an upload up.
#[utoipa::path(delete, path = "/api/uploads/{id}", tag = "uploads", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn delete(
    State(app): State<App>,
    caller: Caller,
    Path(id): Path<String>,
) -> Result<Response> {
    let upload = find(&app, &caller, &id).await?;
    let _guard = app.take_upload(&upload.id).ok_or_else(in_use)?;
    app.db.delete_upload(&upload.id).await?;
    remove_part(&app, &upload.id).await?;
    Ok(tus(StatusCode::NO_CONTENT.into_response(), None))
}

async fn remove_part(app: &App, id: &str) -> Result<()> {
    match tokio::fs::remove_file(part_file(app, id)).await {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error.into()),
        _ => Ok(()),
    }
}

fn in_use() -> Error {
    let detail = "Another request is writing to this upload; wait for its end.";
    Error::refuse(StatusCode::LOCKED, "upload_in_use", detail)
}

/// Send the next bytes. The last ones are answered when the file was verified, read and attached.
#[utoipa::path(patch, path = "/api/uploads/{id}", tag = "uploads",
    params(("id" = String, Path), ("Upload-Offset" = u64, Header), ("Upload-Checksum" = Option<String>, Header)),
    request_body(content = Vec<u8>, content_type = "application/offset+octet-stream"),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem), (status = 415, body = Problem),
        (status = 422, body = Problem), (status = 423, body = Problem), (status = 460, body = Problem)))]
pub(super) async fn append(
    State(app): State<App>,
    caller: Caller,
    Path(id): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    let upload = find(&app, &caller, &id).await?;
    require_version(&headers)?;
    if headers.get(header::CONTENT_TYPE).is_none_or(|t| t != "application/offset+octet-stream") {
        let detail = "Send Content-Type: application/offset+octet-stream.";
        return Err(Error::refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, "wrong_content_type", detail));
    }
    let guard = app.take_upload(&upload.id).ok_or_else(in_use)?;
    // Read again now that nobody else writes.
    let upload = find(&app, &caller, &id).await?;
    let have = offset_of(&app, &upload).await?;
    if number(&headers, "Upload-Offset")? != have {
        let detail = format!("The server has {have} bytes; go on from there (HEAD tells the offset).");
        return Err(Error::conflict("wrong_offset", detail));
    }
    if upload.state == UploadState::Failed {
        let detail = upload.detail.unwrap_or_default();
        return Err(Error::unprocessable("upload_failed", detail));
    }
    let length = upload.length as u64;
    let have = if upload.state == UploadState::Receiving {
        receive(&app, &upload, have, &headers, body).await?
    } else {
        have
    };
    if have == length && upload.state == UploadState::Receiving {
        // On a task of its own: a client that hangs up now does not undo what it has sent.
        let (app, upload) = (app.clone(), upload.clone());
        tokio::spawn(async move { finish(&app, &upload, guard).await }).await.map_err(Error::internal)??;
    }
    Ok(with_offset(tus(StatusCode::NO_CONTENT.into_response(), Some(&upload)), have))
}

/// Adds the body to the file; what came before the connection broke is kept, unless it was to be verified as a whole.
async fn receive(app: &App, upload: &Upload, have: u64, headers: &HeaderMap, body: Body) -> Result<u64> {
    let checksum = headers.get("upload-checksum").map(parse_checksum).transpose()?;
    let limit = upload.length as u64 - have;
    let mut incoming = Incoming::new(headers, body, limit, &app.config.times).await?;
    let mut file = tokio::fs::OpenOptions::new().append(true).open(part_file(app, &upload.id)).await?;
    let (mut digest, mut received) = (Sha256::new(), 0);
    let ended = loop {
        match incoming.next().await {
            Ok(Some(data)) => {
                if let Err(error) = file.write_all(&data).await {
                    incoming.drain().await;
                    break Err(error.into());
                }
                digest.update(&data);
                received += data.len() as u64;
            }
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    // A failed write may have left a part of the piece: only whole pieces count.
    let flushed = file.flush().await;
    let (keep, result) = match (ended.and(flushed.map_err(Error::from)), checksum) {
        (Err(error), Some(_)) => (have, Err(error)),
        (Err(error), None) => (have + received, Err(error)),
        (Ok(()), Some(sent)) if sent != digest.finalize().as_slice() => (have, Err(checksum_wrong())),
        (Ok(()), _) => (have + received, Ok(have + received)),
    };
    file.set_len(keep).await?;
    file.sync_data().await?;
    result
}

fn parse_checksum(value: &HeaderValue) -> Result<Vec<u8>> {
    let bad = || Error::bad_request("bad_checksum", "Upload-Checksum is `sha256` and the digest in base64.");
    let (algorithm, digest) = value.to_str().ok().and_then(|text| text.split_once(' ')).ok_or_else(bad)?;
    if algorithm != "sha256" {
        return Err(bad());
    }
    STANDARD.decode(digest.trim()).map_err(|_error| bad())
}

/// 460 is what tus calls "Checksum Mismatch".
fn checksum_wrong() -> Error {
    let status = StatusCode::from_u16(460).unwrap_or(StatusCode::BAD_REQUEST);
    Error::refuse(status, "checksum_mismatch", "The bytes were damaged on the way; send this piece again.")
}

/// Verifies and attaches; a refusal of the content is kept as the upload's end, a failure of the server leaves it to be tried again.
async fn finish(app: &App, upload: &Upload, _guard: UploadGuard) -> Result<()> {
    let path = part_file(app, &upload.id);
    let digest = digest_of(&path).await?;
    let result = if upload.sha256.as_ref().is_some_and(|expected| *expected != hex(&digest)) {
        let detail = "The file's sha256 is not the announced one: it was damaged or changed on the way. Upload it again.";
        Err(Error::unprocessable("hash_mismatch", detail))
    } else {
        // The upload's own file stays until its end is written down, so that a crash in between can be resumed.
        let copy = app.spool().join(format!("{}.body", new_id()));
        tokio::fs::hard_link(&path, &copy).await?;
        let file = SpoolFile { path: copy, bytes: upload.length as u64, key: Key::from_digest(&digest) };
        ingest::attach(app, &upload.product_id, upload.kind, file, &upload.filename).await
    };
    match &result {
        Ok(()) => app.db.end_upload(&upload.id, UploadState::Done, None).await?,
        Err(Error::Refused { detail, .. }) => {
            app.db.end_upload(&upload.id, UploadState::Failed, Some(detail)).await?;
        }
        Err(_) => return result,
    }
    remove_part(app, &upload.id).await?;
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_is_pairs_in_base64() {
        let metadata = parse_metadata("product YWJj,kind bW9kZWw=, empty ,filename bS5wbHk=").unwrap();
        assert_eq!((metadata.product.as_str(), metadata.kind.as_str()), ("abc", "model"));
        assert_eq!(metadata.filename, "m.ply");
        assert!(parse_metadata("product !!!").is_err());
        assert!(parse_metadata("product /w==").is_err(), "not UTF-8");
    }

    #[test]
    fn dates_as_http_writes_them() {
        assert_eq!(http_date(1_700_000_000_000_000), "Tue, 14 Nov 2023 22:13:20 GMT");
    }
}
