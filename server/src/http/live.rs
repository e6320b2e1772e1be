//! WebSocket `/runs/{id}/live`: LiveFrame texts; a slow reader loses the oldest.

use super::params::Id;
use super::problem::ApiError;
use crate::access::{PROTOCOL, Principal};
use crate::app::runs;
use crate::live::Watch;
use crate::state::AppState;
use api::problem::Problem;
use axum::Extension;
use axum::extract::State;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::timeout;
use uuid::Uuid;

/// Watchers have nothing to say that is longer.
const MESSAGE_LIMIT_BYTES: usize = 1024;
const WRITE_BUFFER_BYTES: usize = 8 * 1024;
const WRITE_BUFFER_LIMIT_BYTES: usize = 192 * 1024;
/// A reader that takes nothing for so long is let go.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);
/// How often a ping is sent and the run's state looked at.
const PING: Duration = Duration::from_secs(5);
const CLOSE_NORMAL: u16 = 1000;
const CLOSE_GOING_AWAY: u16 = 1001;

/// Live poses of a run that is being carried out. Closes with code 1000 when the run has ended.
#[utoipa::path(get, path = "/api/v1/runs/{id}/live", tag = "runs", params(("id" = Uuid, Path)),
    responses((status = 101, description = "WebSocket; every text message is a LiveFrame"),
        (status = 404, body = Problem, content_type = "application/problem+json"), (status = 426, body = Problem, content_type = "application/problem+json")))]
pub async fn live(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
    upgrade: WebSocketUpgrade,
) -> Result<Response, ApiError> {
    let watch = state.live().watch(id); // before the look at the run: its end is not missed
    let run = runs::get(state.store(), &principal, id).await?;
    let place = state.watcher().ok_or_else(ApiError::too_many_watchers)?;
    let ended = run.state.is_terminal();
    Ok(upgrade
        .protocols([PROTOCOL])
        .max_message_size(MESSAGE_LIMIT_BYTES)
        .max_frame_size(MESSAGE_LIMIT_BYTES)
        .write_buffer_size(WRITE_BUFFER_BYTES)
        .max_write_buffer_size(WRITE_BUFFER_LIMIT_BYTES)
        .on_upgrade(move |mut socket| async move {
            let _place = place;
            let reason = if ended {
                CLOSE_NORMAL
            } else {
                forward(&state, id, watch, &mut socket).await
            };
            let frame = CloseFrame {
                code: reason,
                reason: Utf8Bytes::from_static(""),
            };
            let _gone_already = timeout(SEND_TIMEOUT, socket.send(Message::Close(Some(frame)))).await;
        }))
}

/// Hands frames on until somebody ends; returns the close code.
async fn forward(state: &AppState, id: Uuid, mut watch: Watch, socket: &mut WebSocket) -> u16 {
    let mut ping = tokio::time::interval(PING);
    if let Some(latest) = watch.latest.take()
        && !send(socket, Message::Text(latest)).await
    {
        return CLOSE_GOING_AWAY;
    }
    loop {
        tokio::select! {
            frame = watch.frames.recv() => match frame {
                Ok(text) => {
                    if !send(socket, Message::Text(text)).await {
                        return CLOSE_GOING_AWAY;
                    }
                }
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return CLOSE_NORMAL,
            },
            said = socket.recv() => match said {
                Some(Ok(Message::Close(_)) | Err(_)) | None => return CLOSE_NORMAL,
                Some(Ok(_)) => {}
            },
            _ = ping.tick() => {
                // A run that somebody else ended (the scheduler's reaper, another server) closes no channel here.
                let ended = matches!(state.store().run_get(id).await, Ok(Some(run)) if run.state.is_terminal());
                if ended {
                    return CLOSE_NORMAL;
                }
                if !send(socket, Message::Ping(Default::default())).await {
                    return CLOSE_GOING_AWAY;
                }
            }
            () = state.shutdown().cancelled() => return CLOSE_GOING_AWAY,
        }
    }
}

async fn send(socket: &mut WebSocket, message: Message) -> bool {
    matches!(timeout(SEND_TIMEOUT, socket.send(message)).await, Ok(Ok(())))
}
