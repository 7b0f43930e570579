//! Files in one request: a model, a picture or a report as the raw body.

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::Response;
use serde::Deserialize;
use utoipa::IntoParams;

use super::products::{answer_now, create_titled};
use super::text::file_name;
use crate::auth::Caller;
use crate::body::{Incoming, to_spool};
use crate::error::{Error, Problem, Result};
use crate::extract::Query;
use crate::ingest;
use crate::model::{Scope, UploadKind};
use crate::state::App;
use crate::views::Product;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct NewModel {
    title: String,
    filename: Option<String>,
}

/// Upload the model: `.asc`, `.ply` or `.glb`. `X-Filename` names it.
#[utoipa::path(put, path = "/api/products/{id}/model", tag = "files", params(("id" = String, Path)),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = 200, body = Product), (status = 413, body = Problem), (status = 415, body = Problem),
        (status = 422, body = Problem), (status = 507, body = Problem)))]
pub(super) async fn put_model(
    app: State<App>,
    caller: Caller,
    id: Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    put(app, caller, id, UploadKind::Model, headers, body).await
}

/// Upload the picture for the listing: PNG or JPEG.
#[utoipa::path(put, path = "/api/products/{id}/poster", tag = "files", params(("id" = String, Path)),
    request_body(content = Vec<u8>, content_type = "image/png"),
    responses((status = 200, body = Product), (status = 413, body = Problem), (status = 415, body = Problem),
        (status = 422, body = Problem), (status = 507, body = Problem)))]
pub(super) async fn put_poster(
    app: State<App>,
    caller: Caller,
    id: Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    put(app, caller, id, UploadKind::Poster, headers, body).await
}

/// Upload the scanner's `report.json`.
#[utoipa::path(put, path = "/api/products/{id}/report", tag = "files", params(("id" = String, Path)),
    request_body(content = Object, content_type = "application/json"),
    responses((status = 200, body = Product), (status = 413, body = Problem), (status = 415, body = Problem),
        (status = 422, body = Problem), (status = 507, body = Problem)))]
pub(super) async fn put_report(
    app: State<App>,
    caller: Caller,
    id: Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    put(app, caller, id, UploadKind::Report, headers, body).await
}

async fn put(
    State(app): State<App>,
    caller: Caller,
    Path(id): Path<String>,
    kind: UploadKind,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    caller.require(Scope::Upload)?;
    let product = caller.own_product(&app, &id).await?;
    let name = headers.get("x-filename").and_then(|name| name.to_str().ok()).unwrap_or_default();
    receive(&app, &product.id, kind, name, &headers, body).await?;
    answer_now(&app, StatusCode::OK, &product.id).await
}

/// A new draft with this model, for `curl --data-binary @model.asc`.
#[utoipa::path(post, path = "/api/models", tag = "files", params(NewModel),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = 201, body = Product), (status = 413, body = Problem), (status = 415, body = Problem),
        (status = 422, body = Problem), (status = 507, body = Problem)))]
pub(super) async fn create_with_model(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<NewModel>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response> {
    caller.require(Scope::Upload)?;
    let id = create_titled(&app, &caller, &query.title).await?;
    let name = query.filename.unwrap_or_default();
    if let Err(error) = receive(&app, &id, UploadKind::Model, &name, &headers, body).await {
        app.db.delete_product(&id).await?;
        return Err(error);
    }
    let mut response = answer_now(&app, StatusCode::CREATED, &id).await?;
    let location = HeaderValue::from_str(&format!("/api/products/{id}")).map_err(Error::internal)?;
    response.headers_mut().insert(header::LOCATION, location);
    Ok(response)
}

async fn receive(
    app: &App,
    product_id: &str,
    kind: UploadKind,
    name: &str,
    headers: &HeaderMap,
    body: Body,
) -> Result<()> {
    let limit = ingest::byte_limit(&app.config.limits, kind);
    let mut incoming = Incoming::new(headers, body, limit, &app.config.times).await?;
    if let Err(error) = ingest::check_content_type(kind, headers) {
        incoming.refuse(headers).await;
        return Err(error);
    }
    let spooled = to_spool(app, incoming).await?;
    let name = file_name(name, ingest::default_name(kind));
    // On a task of its own: a client that hangs up now does not undo what it has sent.
    let (app, product_id) = (app.clone(), product_id.to_string());
    let job = tokio::spawn(async move { ingest::attach(&app, &product_id, kind, spooled, &name).await });
    job.await.map_err(Error::internal)?
}
