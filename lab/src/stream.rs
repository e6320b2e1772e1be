//! Live frames to the service. A slow or missing service costs watchers frames and nobody else anything.

use crate::backoff::Backoff;
use crate::service::Service;
use api::live::LiveFrame;
use futures_util::{SinkExt, StreamExt};
use std::time::Duration;
use tokio::sync::broadcast::{Receiver, error::RecvError};
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::HeaderValue;

/// A frame that cannot be handed to the kernel within this time breaks the connection.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// Connects again and again until the sender of `frames` is gone.
pub async fn keep(service: Service, mut frames: Receiver<LiveFrame>) {
    let mut backoff = Backoff::default();
    loop {
        match connect(&service, &mut frames, &mut backoff).await {
            Ok(()) => return,
            Err(error) => tracing::debug!(%error, "live stream"),
        }
        tokio::time::sleep(backoff.next_wait()).await;
        // What was said meanwhile is old.
        frames = frames.resubscribe();
    }
}

/// `Ok` when there will be no more frames.
async fn connect(service: &Service, frames: &mut Receiver<LiveFrame>, backoff: &mut Backoff) -> anyhow::Result<()> {
    let mut request = service.stream_address().into_client_request()?;
    request.headers_mut().insert(
        "authorization",
        HeaderValue::from_str(&format!("Bearer {}", service.token()))?,
    );
    let (socket, _) = connect_async(request).await?;
    let (mut sink, mut stream) = socket.split();
    backoff.reset();
    loop {
        tokio::select! {
            frame = frames.recv() => {
                let frame = match frame {
                    Ok(frame) => frame,
                    Err(RecvError::Lagged(_)) => continue,
                    Err(RecvError::Closed) => return Ok(()),
                };
                let text = serde_json::to_string(&frame)?;
                tokio::time::timeout(SEND_TIMEOUT, sink.send(Message::text(text))).await??;
            }
            // Reading answers the service's pings and notices its end.
            incoming = stream.next() => match incoming {
                Some(message) => { message?; }
                None => anyhow::bail!("the service closed the stream"),
            },
        }
    }
}
