//! WebSocket `/lab/stream`: live frames from a laboratory.

use super::problem::ApiError;
use crate::access::PROTOCOL;
use crate::live::FRAME_LIMIT_BYTES;
use crate::state::AppState;
use api::live::LiveFrame;
use api::problem::Problem;
use axum::extract::State;
use axum::extract::ws::{Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use std::time::Duration;
use tokio::time::timeout;

/// A laboratory that is silent for so long gets a ping; one that does not take it is let go.
const PING: Duration = Duration::from_secs(10);
/// Frames with an error before the connection is ended: the laboratory speaks another language.
const BAD_FRAMES_LIMIT: u32 = 100;

/// Live frames in; nothing is answered.
#[utoipa::path(get, path = "/api/v1/lab/stream", tag = "lab",
    responses((status = 101, description = "WebSocket; every text message is a LiveFrame"), (status = 426, body = Problem, content_type = "application/problem+json")))]
pub async fn stream(State(state): State<AppState>, upgrade: WebSocketUpgrade) -> Result<Response, ApiError> {
    Ok(upgrade
        .protocols([PROTOCOL])
        .max_message_size(FRAME_LIMIT_BYTES)
        .max_frame_size(FRAME_LIMIT_BYTES)
        .on_upgrade(move |socket| receive(state, socket)))
}

async fn receive(state: AppState, mut socket: WebSocket) {
    let mut bad_frames = 0;
    let mut stale_frames: u64 = 0;
    while bad_frames < BAD_FRAMES_LIMIT {
        let message = tokio::select! {
            message = timeout(PING, socket.recv()) => message,
            () = state.shutdown().cancelled() => break,
        };
        match message {
            Ok(Some(Ok(Message::Text(text)))) => match take(&state, text) {
                Ok(true) => {}
                Ok(false) => stale_frames += 1,
                Err(error) => {
                    bad_frames += 1;
                    tracing::debug!(%error, "live frame refused");
                }
            },
            Ok(Some(Ok(Message::Close(_)) | Err(_)) | None) => break,
            Ok(Some(Ok(_))) => {}
            Err(_) => {
                if !matches!(
                    timeout(PING, socket.send(Message::Ping(Default::default()))).await,
                    Ok(Ok(()))
                ) {
                    break;
                }
            }
        }
    }
    tracing::info!(
        frames.bad = bad_frames,
        frames.stale = stale_frames,
        "laboratory stream ended"
    );
}

/// Checks a frame's form and hands its text on as it is.
fn take(state: &AppState, text: Utf8Bytes) -> Result<bool, serde_json::Error> {
    let frame: LiveFrame = serde_json::from_str(&text)?;
    Ok(state.live().publish(frame.run_id, frame.epoch, text))
}
