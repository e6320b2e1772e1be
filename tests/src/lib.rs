//! A whole Robopheus system in a temporary folder, for tests that look at it from outside.

mod archive;
mod bare_loop;
mod browser;
pub mod circle;
mod laboratory;
mod live_reader;
mod pose_watch;
mod system;

pub use archive::{Archive, ParquetSummary};
pub use bare_loop::{BareLoop, BareTicks};
pub use browser::Browser;
pub use laboratory::{ask_hand, ask_stop_port};
pub use live_reader::{LiveReader, Seen};
pub use pose_watch::{PoseWatch, instant_of};
pub use system::{System, repository};

use std::time::{Duration, Instant};

/// Asks until `look` gives a value; fails with `what` after `limit`.
pub async fn wait_for<T, F: Future<Output = anyhow::Result<Option<T>>>>(
    what: &str,
    limit: Duration,
    mut look: impl FnMut() -> F,
) -> anyhow::Result<T> {
    let start = Instant::now();
    loop {
        if let Some(value) = look().await? {
            return Ok(value);
        }
        anyhow::ensure!(start.elapsed() < limit, "waited {limit:?} in vain for {what}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}
