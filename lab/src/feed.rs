//! Hands samples from a receiving thread to at most one control loop, without the loop ever taking a lock.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};

/// Samples that wait for the loop: at least half a second of fifty robots at 120 Hz.
const CAPACITY: usize = 4096;

/// The receiving thread's side.
#[derive(Debug)]
pub struct Feed<T>(Mutex<Option<SyncSender<T>>>);

impl<T> Default for Feed<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T> Feed<T> {
    /// A new listener; replaces the one before.
    pub fn listen(&self) -> Receiver<T> {
        let (sender, receiver) = sync_channel(CAPACITY);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(sender);
        receiver
    }

    /// Passes a sample on if someone listens. A listener that is half a second behind loses the sample.
    pub fn send(&self, sample: T) {
        let mut listener = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sender) = listener.as_ref()
            && let Err(std::sync::mpsc::TrySendError::Disconnected(_)) = sender.try_send(sample)
        {
            *listener = None;
        }
    }
}
