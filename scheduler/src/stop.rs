//! The wish to stop, handed to every loop.

use std::time::Duration;
use tokio::sync::watch;

/// Cloneable; every wait in this process ends when it is requested.
#[derive(Debug, Clone)]
pub struct Stop(watch::Receiver<bool>);

/// Asks everybody to stop; so does dropping it.
#[derive(Debug)]
pub struct StopHandle(watch::Sender<bool>);

impl StopHandle {
    /// Asks everybody to stop.
    pub fn stop(&self) {
        self.0.send_replace(true);
    }
}

/// A handle and what it stops.
pub fn stop_pair() -> (StopHandle, Stop) {
    let (sender, receiver) = watch::channel(false);
    (StopHandle(sender), Stop(receiver))
}

impl Stop {
    /// True once stopping was requested.
    pub fn is_requested(&self) -> bool {
        *self.0.borrow() || self.0.has_changed().is_err()
    }

    /// Waits for the request.
    pub async fn requested(&mut self) {
        // An error means that the handle is gone, which asks for the same.
        let _ = self.0.wait_for(|requested| *requested).await;
    }

    /// Waits for the request and then a grace.
    pub async fn requested_since(&self, grace: Duration) {
        self.clone().requested().await;
        tokio::time::sleep(grace).await;
    }

    /// Waits; true when stopping was requested meanwhile.
    pub async fn sleep(&mut self, duration: Duration) -> bool {
        tokio::time::timeout(duration, self.requested()).await.is_ok()
    }
}
