//! From a file in the spool folder to files of a product: checked, read under limits, converted, stored, named in the
//! database. Everything or nothing is attached.

mod model;
mod picture;
mod report;

use axum::http::{HeaderMap, StatusCode, header};
use bytes::Bytes;

use crate::body::SpoolFile;
use crate::config::Limits;
use crate::db::product::{FileRow, NewInfo};
use crate::error::{Error, Result};
use crate::model::{FileRole, UploadKind};
use crate::state::App;
use crate::storage::Key;

/// Most bytes of an upload of that kind.
pub fn byte_limit(limits: &Limits, kind: UploadKind) -> u64 {
    match kind {
        UploadKind::Model => limits.model_bytes,
        UploadKind::Poster => limits.poster_bytes,
        UploadKind::Report => limits.report_bytes,
    }
}

/// What a file is called whose sender did not say.
pub fn default_name(kind: UploadKind) -> &'static str {
    match kind {
        UploadKind::Model => "model",
        UploadKind::Poster => "poster",
        UploadKind::Report => "report.json",
    }
}

/// Refuses what is announced as something else. What `curl --data-binary` announces by itself is taken for a model, and
/// nothing said is taken for the right thing: the content decides anyway.
pub fn check_content_type(kind: UploadKind, headers: &HeaderMap) -> Result<()> {
    const ANY: &str = "application/octet-stream";
    const MODEL: &[&str] = &[
        ANY,
        "text/plain",
        "model/gltf-binary",
        "model/ply",
        "application/ply",
        "application/x-ply",
        "application/x-www-form-urlencoded",
    ];
    let allowed: &[&str] = match kind {
        UploadKind::Model => MODEL,
        UploadKind::Poster => &["image/png", "image/jpeg", ANY],
        UploadKind::Report => &["application/json", ANY],
    };
    let Some(value) = headers.get(header::CONTENT_TYPE) else { return Ok(()) };
    let essence = value.to_str().unwrap_or_default().split(';').next().unwrap_or_default().trim();
    if allowed.contains(&essence.to_ascii_lowercase().as_str()) {
        return Ok(());
    }
    let detail = format!("Content-Type {essence:?} is not taken here. Send one of: {}.", allowed.join(", "));
    Err(Error::refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, "wrong_content_type", detail))
}

/// A file made here, to be stored.
struct Made {
    role: FileRole,
    name: String,
    bytes: Bytes,
    generated: bool,
}

/// Reads the file and attaches what it gives to the product.
pub async fn attach(
    app: &App,
    product_id: &str,
    kind: UploadKind,
    file: SpoolFile,
    name: &str,
) -> Result<()> {
    if file.bytes == 0 {
        return Err(Error::unprocessable("empty_body", "The file is empty. Send its bytes as the body."));
    }
    match kind {
        UploadKind::Model => attach_model(app, product_id, file, name).await,
        UploadKind::Poster => attach_poster(app, product_id, file).await,
        UploadKind::Report => attach_report(app, product_id, file).await,
    }
}

async fn attach_model(app: &App, product_id: &str, file: SpoolFile, name: &str) -> Result<()> {
    let limits = app.config.limits.clone();
    let keeps_poster =
        app.db.files(product_id).await?.iter().any(|f| f.role == FileRole::Poster && !f.generated);
    let path = file.path.clone();
    let name = name.to_string();
    let read = parse(app, move || model::read(&path, &name, !keeps_poster, &limits)).await?;
    let mut made = vec![made(FileRole::Stream, "model.ars1", read.stream, false)];
    if let Some(pictures) = read.pictures {
        made.extend(picture_files(pictures, true));
    }
    let original = FileRow {
        role: FileRole::Model,
        sha256: file.key.as_str().to_string(),
        name: read.name,
        bytes: file.bytes as i64,
        generated: false,
    };
    store(app, product_id, Some((&file, original)), made, NewInfo::Model(read.info)).await
}

async fn attach_poster(app: &App, product_id: &str, file: SpoolFile) -> Result<()> {
    let (path, most_pixels) = (file.path.clone(), app.config.limits.picture_pixels);
    let pictures = parse(app, move || picture::read(&path, most_pixels)).await?;
    store(app, product_id, None, picture_files(pictures, false), NewInfo::Picture).await
}

async fn attach_report(app: &App, product_id: &str, file: SpoolFile) -> Result<()> {
    let path = file.path.clone();
    let (info, bytes) = parse(app, move || report::read(&path)).await?;
    let made = vec![made(FileRole::Report, "report.json", bytes, false)];
    store(app, product_id, None, made, NewInfo::Scan(info)).await
}

fn made(role: FileRole, name: &str, bytes: Vec<u8>, generated: bool) -> Made {
    Made { role, name: name.to_string(), bytes: bytes.into(), generated }
}

fn picture_files(pictures: picture::Pictures, generated: bool) -> Vec<Made> {
    vec![
        made(FileRole::Poster, "poster.jpg", pictures.poster, generated),
        made(FileRole::Thumb, "thumb.jpg", pictures.thumb, generated),
    ]
}

/// Runs a reader on a thread that may block, a few at a time.
async fn parse<T: Send + 'static>(app: &App, job: impl FnOnce() -> Result<T> + Send + 'static) -> Result<T> {
    let _permit = app.parsers.acquire().await.map_err(Error::internal)?;
    let started = std::time::Instant::now();
    let read = tokio::task::spawn_blocking(job).await.map_err(Error::internal)?;
    metrics::histogram!("ingest_duration_seconds").record(started.elapsed().as_secs_f64());
    metrics::counter!("ingest_total", "result" => if read.is_ok() { "read" } else { "refused" }).increment(1);
    read
}

async fn store(
    app: &App,
    product_id: &str,
    original: Option<(&SpoolFile, FileRow)>,
    made: Vec<Made>,
    info: NewInfo,
) -> Result<()> {
    let shared = app.files_lock.read().await;
    let mut stored = Vec::new();
    let attached = put_all(app, original, made, &mut stored).await;
    let attached = match attached {
        Ok(rows) => app.db.attach(product_id, &rows, &info).await.map_err(Error::from),
        Err(error) => Err(error),
    };
    drop(shared);
    match attached {
        Ok(Some(unused)) => {
            app.delete_unused(unused).await;
            Ok(())
        }
        Ok(None) => {
            app.delete_unused(stored).await;
            Err(Error::not_found("product"))
        }
        Err(error) => {
            app.delete_unused(stored).await;
            Err(error)
        }
    }
}

/// Stores all bytes; `stored` names what was stored, also where a later one fails.
async fn put_all(
    app: &App,
    original: Option<(&SpoolFile, FileRow)>,
    made: Vec<Made>,
    stored: &mut Vec<String>,
) -> Result<Vec<FileRow>> {
    let mut rows = Vec::new();
    if let Some((file, row)) = original {
        stored.push(row.sha256.clone());
        app.storage.put_file(&file.key, &file.path, file.bytes).await?;
        rows.push(row);
    }
    for Made { role, name, bytes, generated } in made {
        let length = bytes.len() as i64;
        stored.push(Key::of(&bytes).as_str().to_string());
        let sha256 = app.storage.put(bytes).await?.as_str().to_string();
        rows.push(FileRow { role, sha256, name, bytes: length, generated });
    }
    Ok(rows)
}
