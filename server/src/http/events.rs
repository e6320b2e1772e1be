//! Server-sent events `/runs/{id}/events`: the RunView, now and on each change.

use super::params::Id;
use super::problem::ApiError;
use crate::access::Principal;
use crate::app::runs;
use crate::state::AppState;
use api::problem::Problem;
use api::run::RunView;
use axum::Extension;
use axum::extract::State;
use axum::response::sse::{Event, KeepAlive, Sse};
use futures_util::stream::{self, Stream};
use std::convert::Infallible;
use std::time::Duration;
use store::Change;
use tokio::sync::OwnedSemaphorePermit;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{Instant, sleep_until};
use uuid::Uuid;

/// The truth is looked at this often; a notification only makes it sooner.
const POLL: Duration = Duration::from_secs(1);
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// State changes of a run as they happen.
#[utoipa::path(get, path = "/api/v1/runs/{id}/events", tag = "runs", params(("id" = Uuid, Path)),
    responses((status = 200, content_type = "text/event-stream", body = RunView, description = "`data:` of each event is a RunView"),
        (status = 404, body = Problem, content_type = "application/problem+json")))]
pub async fn events(
    State(state): State<AppState>,
    Extension(principal): Extension<Principal>,
    Id(id): Id,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    let changes = state.store().listen();
    let run = runs::get(state.store(), &principal, id).await?;
    let place = state.watcher().ok_or_else(ApiError::too_many_watchers)?;
    let watcher = Watcher {
        state,
        principal,
        id,
        changes,
        next: Some(run),
        sent: None,
        _place: place,
    };
    let stream = stream::unfold(watcher, |mut watcher| async move {
        let text = watcher.changed().await?;
        Some((Ok(Event::default().data(text)), watcher))
    });
    Ok(Sse::new(stream).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)))
}

struct Watcher {
    state: AppState,
    principal: Principal,
    id: Uuid,
    changes: Receiver<Change>,
    next: Option<RunView>,
    sent: Option<String>,
    _place: OwnedSemaphorePermit,
}

impl Watcher {
    /// The next text that differs from the last; nothing when the service ends or the run may no longer be seen.
    async fn changed(&mut self) -> Option<String> {
        loop {
            if let Some(run) = self.next.take() {
                let text = serde_json::to_string(&run).ok()?;
                if self.sent.as_ref() != Some(&text) {
                    self.sent = Some(text.clone());
                    return Some(text);
                }
            }
            let poll = Instant::now() + POLL;
            tokio::select! {
                () = sleep_until(poll) => {}
                () = hint(&mut self.changes, self.id) => {}
                () = self.state.shutdown().cancelled() => return None,
            }
            self.next = match runs::get(self.state.store(), &self.principal, self.id).await {
                Ok(run) => Some(run),
                Err(crate::app::error::AppError::NotFound { .. }) => return None,
                Err(_) => None, // the database is away: the next look may succeed
            };
        }
    }
}

/// Returns when this run may have changed.
async fn hint(changes: &mut Receiver<Change>, id: Uuid) {
    loop {
        match changes.recv().await {
            Ok(Change::Run(run)) if run == id => return,
            Ok(Change::Reconnected) | Err(RecvError::Lagged(_)) => return,
            Ok(_) => {}
            Err(RecvError::Closed) => std::future::pending().await,
        }
    }
}
