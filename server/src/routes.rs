//! All addresses. A module a resource, with its routes, bodies and handlers.

mod files;
mod health;
mod manage;
mod models;
mod products;
mod session;
mod text;
mod tokens;
mod uploads;
mod users;
mod web;

use axum::Router;
use axum::middleware;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::error::{Error, Problem};

use crate::state::App;
pub use text::account_name;

#[derive(Debug, OpenApi)]
#[openapi(
    info(
        title = "Allround",
        description = "Stores, lists and streams 3D listings. Errors are `application/problem+json`."
    ),
    components(schemas(Problem))
)]
struct Api;

fn api() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(Api::openapi())
        .routes(routes!(session::show, session::log_in, session::log_out))
        .routes(routes!(session::set_up))
        .routes(routes!(session::change_password))
        .routes(routes!(users::list, users::create))
        .routes(routes!(users::change))
        .routes(routes!(tokens::list, tokens::create))
        .routes(routes!(tokens::revoke))
        .routes(routes!(products::list, products::create))
        .routes(routes!(products::show, products::edit, products::delete))
        .routes(routes!(products::set_status))
        .routes(routes!(manage::list))
        .routes(routes!(models::put_model))
        .routes(routes!(models::put_poster))
        .routes(routes!(models::put_report))
        .routes(routes!(models::create_with_model))
        .routes(routes!(files::show))
        .routes(routes!(uploads::create))
        .routes(routes!(uploads::show, uploads::offset, uploads::append, uploads::delete))
        .routes(routes!(health::live))
        .routes(routes!(health::ready))
        .routes(routes!(health::metrics))
}

/// The description of the API, as it is served and committed.
pub fn openapi_json() -> String {
    let mut api = api().into_openapi();
    name_operations(&mut api);
    let mut text = api.to_pretty_json().unwrap_or_default();
    text.push('\n');
    text
}

/// Handlers of two resources may share a name, operations may not: `list` of the products becomes `products_list`.
fn name_operations(api: &mut utoipa::openapi::OpenApi) {
    for item in api.paths.paths.values_mut() {
        let methods =
            [&mut item.get, &mut item.put, &mut item.post, &mut item.delete, &mut item.head, &mut item.patch];
        for operation in methods.into_iter().flatten() {
            let tag = operation.tags.as_ref().and_then(|tags| tags.first()).cloned().unwrap_or_default();
            let name = operation.operation_id.take().unwrap_or_default();
            operation.operation_id = Some(format!("{tag}_{name}"));
        }
    }
}

/// Everything the server answers.
pub fn router(app: App) -> Router {
    let (router, _) = api().split_for_parts();
    router
        .route("/api/openapi.json", axum::routing::get(health::openapi))
        .route("/api/uploads", axum::routing::options(uploads::options))
        .route("/api/{*rest}", axum::routing::any(async || Error::not_found("address in this API")))
        .fallback(web::page)
        .layer(CatchPanicLayer::new())
        .layer(middleware::from_fn(crate::observe::observe))
        .with_state(app)
}
