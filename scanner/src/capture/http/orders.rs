//! One handler an order: JSON in, the new state out.

use std::sync::Arc;

use axum::Json;
use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{FromRequest, Path, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use kinect::source::Control;
use reconstruct::board::Family;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::Daemon;
use super::problem::Problem;
use crate::board_sheet::{draw, to_pdf};
use crate::capture::refusal::Refusal;
use crate::capture::session::{BoardChoice, Session};
use crate::capture::state::{self, AutoMode, Step};
use crate::simulate::{Paper, ring};
use crate::upload::Listing;

type Answer = Result<Json<state::State>, Problem>;

/// A JSON body, refused in words.
pub(super) struct Body<T>(T);

impl<T: DeserializeOwned> FromRequest<Daemon> for Body<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, daemon: &Daemon) -> Result<Self, Problem> {
        let Json(body) = Json::from_request(request, daemon).await?;
        Ok(Self(body))
    }
}

#[derive(Deserialize)]
pub(super) struct SensorOrder {
    address: String,
}

#[derive(Deserialize)]
pub(super) struct BoardOrder {
    paper: Option<Paper>,
    file: Option<Value>,
}

#[derive(Deserialize)]
pub(super) struct AutoOrder {
    mode: AutoMode,
    #[serde(default = "usual_seconds")]
    seconds: f64,
}

fn usual_seconds() -> f64 {
    3.0
}

#[derive(Deserialize)]
pub(super) struct StepOrder {
    step: Step,
}

/// Never printed: it has the token.
#[derive(Deserialize)]
pub(super) struct PublishOrder {
    server: String,
    token: String,
    title: String,
    description: Option<String>,
    price_minor: Option<i64>,
    currency: Option<String>,
    category: Option<String>,
    condition: Option<String>,
}

/// Carries an order out on a thread that may block.
async fn order<T, F>(daemon: Daemon, order: F) -> Result<T, Problem>
where
    T: Send + 'static,
    F: FnOnce(&Arc<Session>) -> Result<T, Refusal> + Send + 'static,
{
    let done = tokio::task::spawn_blocking(move || order(&daemon.session)).await;
    Ok(done.map_err(|_panicked| Problem::broken())??)
}

/// As [`order`], answered with the new state.
async fn change(
    daemon: Daemon,
    work: impl FnOnce(&Arc<Session>) -> Result<(), Refusal> + Send + 'static,
) -> Answer {
    order(daemon, move |session| work(session).map(|()| Json(session.state()))).await
}

pub(super) async fn state(State(daemon): State<Daemon>) -> Answer {
    change(daemon, |_| Ok(())).await
}

pub(super) async fn look_for_sensors(State(daemon): State<Daemon>) -> Answer {
    change(daemon, |session| session.look_for_sensors()).await
}

pub(super) async fn choose_sensor(State(daemon): State<Daemon>, Body(body): Body<SensorOrder>) -> Answer {
    change(daemon, move |session| session.choose_sensor(&body.address)).await
}

pub(super) async fn control(State(daemon): State<Daemon>, Body(control): Body<Control>) -> Answer {
    change(daemon, move |session| session.control(control)).await
}

pub(super) async fn choose_board(State(daemon): State<Daemon>, Body(body): Body<BoardOrder>) -> Answer {
    let choice = match (body.paper, body.file) {
        (Some(paper), None) => BoardChoice::Paper(paper),
        (None, Some(file)) => BoardChoice::File(file.to_string().into_bytes()),
        _ => return Err(Problem::wrong("Name the paper (a4, a3, a2) or give the board's file.")),
    };
    change(daemon, move |session| session.choose_board(&choice)).await
}

pub(super) async fn take_view(State(daemon): State<Daemon>) -> Answer {
    change(daemon, |session| session.take_view()).await
}

pub(super) async fn undo_view(State(daemon): State<Daemon>, Path(name): Path<String>) -> Answer {
    change(daemon, move |session| session.undo_view(&name)).await
}

pub(super) async fn set_auto(State(daemon): State<Daemon>, Body(body): Body<AutoOrder>) -> Answer {
    change(daemon, move |session| session.set_auto(body.mode, body.seconds)).await
}

pub(super) async fn build(State(daemon): State<Daemon>) -> Answer {
    change(daemon, Session::build).await
}

pub(super) async fn cancel_build(State(daemon): State<Daemon>) -> Answer {
    change(daemon, |session| session.cancel_build()).await
}

pub(super) async fn undo_removal(State(daemon): State<Daemon>) -> Answer {
    change(daemon, Session::undo_removal).await
}

pub(super) async fn go_to(State(daemon): State<Daemon>, Body(body): Body<StepOrder>) -> Answer {
    change(daemon, move |session| session.go_to(body.step)).await
}

pub(super) async fn begin_another(State(daemon): State<Daemon>) -> Answer {
    change(daemon, |session| session.begin_another()).await
}

pub(super) async fn quit(State(daemon): State<Daemon>) -> Answer {
    let answer = change(daemon.clone(), |_| Ok(())).await;
    daemon.stop.send_replace(true);
    answer
}

pub(super) async fn remove_points(
    State(daemon): State<Daemon>,
    body: Result<Bytes, BytesRejection>,
) -> Answer {
    let body = body.map_err(|_cut| Problem::wrong("The list of points is too long or was cut off."))?;
    if body.len() % 4 != 0 {
        return Err(Problem::wrong("The list of points is cut off: it needs four bytes a point."));
    }
    let number = |bytes: &[u8]| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let places: Vec<u32> = body.chunks_exact(4).map(number).collect();
    change(daemon, move |session| session.remove_points(&places)).await
}

pub(super) async fn publish(State(daemon): State<Daemon>, Body(body): Body<PublishOrder>) -> Answer {
    let text = |text: Option<String>| text.filter(|text| !text.trim().is_empty());
    let price = match (body.price_minor, text(body.currency)) {
        (Some(minor), Some(currency)) if minor >= 0 => Some((minor, currency)),
        (None, _) => None,
        _ => return Err(Problem::wrong("A price is a number that is not negative, with a currency as EUR.")),
    };
    let listing = Listing {
        title: body.title,
        description: text(body.description),
        price,
        category: text(body.category),
        condition: text(body.condition),
    };
    change(daemon, move |session| session.publish(&body.server, &body.token, listing)).await
}

pub(super) async fn leaving(State(daemon): State<Daemon>) -> Result<Response, Problem> {
    Ok(Json(order(daemon, |session| session.leaving()).await?).into_response())
}

pub(super) async fn preview(State(daemon): State<Daemon>, headers: HeaderMap) -> Result<Response, Problem> {
    let (version, stream) = order(daemon, |session| session.preview()).await?;
    Ok(versioned(&headers, "preview", version, || stream.to_vec()))
}

pub(super) async fn model(State(daemon): State<Daemon>, headers: HeaderMap) -> Result<Response, Problem> {
    let (version, shape) = order(daemon, |session| session.model()).await?;
    Ok(versioned(&headers, "model", version, || shape.stream.clone()))
}

/// Bytes of a version, or only that the page has it already.
fn versioned(headers: &HeaderMap, kind: &str, version: u64, bytes: impl FnOnce() -> Vec<u8>) -> Response {
    let etag = format!("\"{kind}-{version}\"");
    let known = headers.get(header::IF_NONE_MATCH).is_some_and(|value| value.as_bytes() == etag.as_bytes());
    let fixed = [(header::ETAG, etag), (header::CACHE_CONTROL, "no-cache".to_owned())];
    if known {
        return (StatusCode::NOT_MODIFIED, fixed).into_response();
    }
    (fixed, [(header::CONTENT_TYPE, "application/octet-stream")], bytes()).into_response()
}

pub(super) async fn poster(State(daemon): State<Daemon>) -> Result<Response, Problem> {
    let picture = order(daemon, |session| session.poster()).await?;
    Ok(([(header::CONTENT_TYPE, "image/png")], picture).into_response())
}

pub(super) async fn board_sheet(Path(file): Path<String>) -> Result<Response, Problem> {
    let papers = [("a4.pdf", Paper::A4), ("a3.pdf", Paper::A3), ("a2.pdf", Paper::A2)];
    let paper = papers.into_iter().find(|(name, _)| *name == file).map(|(_, paper)| paper);
    let paper = paper.ok_or_else(|| Problem::absent("There are boards for a4.pdf, a3.pdf and a2.pdf."))?;
    let name = format!("{paper:?}").to_lowercase();
    let pdf = to_pdf(&draw(&ring(paper, Family::Aruco4x4_50), paper.size(), &name));
    let attachment = format!("inline; filename=\"allround-board-{file}\"");
    let fixed =
        [(header::CONTENT_TYPE, "application/pdf".to_owned()), (header::CONTENT_DISPOSITION, attachment)];
    Ok((fixed, pdf).into_response())
}
