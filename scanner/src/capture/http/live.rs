//! The WebSocket: the state as text whenever it changes, live pictures as bytes, newest only.

use std::time::Duration;

use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use tokio::time::{Instant, sleep_until, timeout};

use super::Daemon;

/// Between two states.
const STATE_PAUSE: Duration = Duration::from_millis(100);
/// A page that takes nothing for this long is gone.
const STALL: Duration = Duration::from_secs(20);
/// Pages send nothing; what they send is not kept.
const MAX_MESSAGE: usize = 4096;

pub(super) async fn live(State(daemon): State<Daemon>, upgrade: WebSocketUpgrade) -> Response {
    let upgrade = upgrade.max_message_size(MAX_MESSAGE).max_frame_size(MAX_MESSAGE);
    upgrade.on_upgrade(move |socket| follow(socket, daemon))
}

/// Sends until the page leaves or the program ends.
async fn follow(mut socket: WebSocket, daemon: Daemon) {
    let mut stopped = Box::pin(stopped(daemon.stop.subscribe()));
    let (mut changes, mut pictures) = (daemon.session.changes(), daemon.session.pictures());
    changes.mark_changed();
    let mut next_state = Instant::now();
    loop {
        let message = tokio::select! {
            biased;
            () = &mut stopped => break,
            received = socket.recv() => match received {
                Some(Ok(Message::Close(_)) | Err(_)) | None => break,
                // Pings are answered by the library.
                Some(Ok(_)) => continue,
            },
            () = due(&mut changes, next_state) => {
                changes.mark_unchanged();
                next_state = Instant::now() + STATE_PAUSE;
                let session = daemon.session.clone();
                let state = tokio::task::spawn_blocking(move || serde_json::to_string(&session.state())).await;
                let Ok(Ok(state)) = state else { break };
                Message::text(state)
            }
            changed = pictures.changed() => {
                let picture = pictures.borrow_and_update().clone();
                match (changed, picture) {
                    (Err(_), _) => break,
                    (Ok(()), None) => continue,
                    (Ok(()), Some(picture)) => Message::binary(picture.as_ref().clone()),
                }
            }
        };
        if !matches!(timeout(STALL, socket.send(message)).await, Ok(Ok(()))) {
            break;
        }
    }
    let _ = timeout(Duration::from_secs(1), socket.send(Message::Close(None))).await;
}

async fn stopped(mut stop: tokio::sync::watch::Receiver<bool>) {
    let _ = stop.wait_for(|stop| *stop).await;
}

/// Waits for a change and for the time at which it may be told.
async fn due(changes: &mut tokio::sync::watch::Receiver<u64>, earliest: Instant) {
    // The sender lives as long as the session, which the daemon holds.
    let _ = changes.changed().await;
    changes.mark_changed();
    sleep_until(earliest).await;
}
