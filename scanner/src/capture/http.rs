//! The daemon's HTTP side: every address of the contract with the page, guarded by token, origin and host.

mod guard;
mod live;
mod orders;
mod pages;
mod problem;

use std::sync::Arc;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware;
use axum::routing::{any, delete, get, post};
use tokio::sync::watch;

pub use guard::{Gate, Token};
use problem::Problem;

use super::session::Session;

/// Largest order that is read, bytes.
const ORDER_BYTES: usize = 64 << 10;
/// Largest board description.
const BOARD_BYTES: usize = 2 << 20;
/// Largest list of points: four bytes each.
const REMOVE_BYTES: usize = 64 << 20;

/// How long orders under way may take once the program is told to end.
const GRACE: std::time::Duration = std::time::Duration::from_secs(5);

/// What the handlers work with.
#[derive(Clone)]
pub struct Daemon {
    pub session: Arc<Session>,
    pub gate: Arc<Gate>,
    /// Set to end the program.
    pub stop: watch::Sender<bool>,
}

/// Everything the daemon answers.
pub fn router(daemon: Daemon) -> Router {
    let api = Router::new()
        .route("/state", get(orders::state))
        .route("/live", get(live::live))
        .route("/sensors", post(orders::look_for_sensors))
        .route("/sensor", post(orders::choose_sensor))
        .route("/control", post(orders::control))
        .route("/boards/{file}", get(orders::board_sheet))
        .route("/board", post(orders::choose_board).layer(DefaultBodyLimit::max(BOARD_BYTES)))
        .route("/views", post(orders::take_view))
        .route("/views/{name}", delete(orders::undo_view))
        .route("/auto", post(orders::set_auto))
        .route("/preview", get(orders::preview))
        .route("/build", post(orders::build))
        .route("/build/cancel", post(orders::cancel_build))
        .route("/model", get(orders::model))
        .route("/poster", get(orders::poster))
        .route("/model/remove", post(orders::remove_points).layer(DefaultBodyLimit::max(REMOVE_BYTES)))
        .route("/model/undo", post(orders::undo_removal))
        .route("/leaving", get(orders::leaving))
        .route("/publish", post(orders::publish))
        .route("/step", post(orders::go_to))
        .route("/new", post(orders::begin_another))
        .route("/quit", post(orders::quit))
        .route("/{*rest}", any(async || Problem::absent("There is nothing at this address.")))
        .method_not_allowed_fallback(async || Problem::wrong_method())
        .layer(DefaultBodyLimit::max(ORDER_BYTES))
        .layer(middleware::from_fn_with_state(daemon.clone(), guard::require_token));
    Router::new()
        .nest("/api", api)
        .fallback(pages::page)
        .layer(middleware::from_fn_with_state(daemon.clone(), guard::require_own_page))
        .with_state(daemon)
}

/// Serves until `stop` is set, then lets orders under way finish.
pub async fn serve(listener: tokio::net::TcpListener, daemon: Daemon) -> std::io::Result<()> {
    let (mut stopped, late) = (daemon.stop.subscribe(), daemon.stop.subscribe());
    let stop = async move { drop(stopped.wait_for(|stop| *stop).await) };
    let served = axum::serve(listener, router(daemon)).with_graceful_shutdown(stop);
    tokio::select! {
        served = served => served,
        // Who does not finish asking is not waited for.
        () = grace_after(late) => Ok(()),
    }
}

async fn grace_after(mut stop: watch::Receiver<bool>) {
    let _ = stop.wait_for(|stop| *stop).await;
    tokio::time::sleep(GRACE).await;
}
