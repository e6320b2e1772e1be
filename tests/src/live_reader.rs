//! An open reader of a run's live stream, as a page in a browser is one.

use anyhow::Context;
use api::live::LiveFrame;
use futures_util::StreamExt;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::task::JoinHandle;
use tokio_tungstenite::connect_async;
use uuid::Uuid;

/// Reads until it is dropped.
pub struct LiveReader {
    seen: Arc<Mutex<Seen>>,
    task: JoinHandle<()>,
}

/// What came so far.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    pub frames: u64,
    pub newest: Option<LiveFrame>,
}

impl LiveReader {
    /// - `base`: address of the service, `http://host:port`.
    pub async fn open(base: &str, run: Uuid) -> anyhow::Result<Self> {
        let address = format!("{}/api/v1/runs/{run}/live", base.replacen("http", "ws", 1));
        let (mut stream, _) = connect_async(&address).await.context(address)?;
        let seen = Arc::new(Mutex::new(Seen::default()));
        let to = seen.clone();
        let task = tokio::spawn(async move {
            while let Some(Ok(message)) = stream.next().await {
                let frame = message.to_text().ok().and_then(|text| serde_json::from_str(text).ok());
                if let Some(frame) = frame {
                    let mut seen = to.lock().unwrap_or_else(PoisonError::into_inner);
                    seen.frames += 1;
                    seen.newest = Some(frame);
                }
            }
        });
        Ok(Self { seen, task })
    }

    pub fn seen(&self) -> Seen {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for LiveReader {
    fn drop(&mut self) {
        self.task.abort();
    }
}
