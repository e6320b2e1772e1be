//! Live frames on their way from the laboratory to whoever watches. In memory, bounded, lossy for slow readers.

use axum::extract::ws::Utf8Bytes;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::broadcast;
use uuid::Uuid;

/// Frames kept for a reader that falls behind; older ones are dropped.
pub const FRAMES_KEPT: usize = 32;
/// Runs with a channel at the same time; the one that was silent longest makes room.
pub const RUNS_KEPT: usize = 64;
/// Largest text message of the laboratory's stream.
pub const FRAME_LIMIT_BYTES: usize = 64 * 1024;

/// One channel per run.
#[derive(Debug, Default)]
pub struct LiveHub {
    runs: Mutex<Runs>,
}

#[derive(Debug, Default)]
struct Runs {
    channels: BTreeMap<Uuid, Channel>,
    clock: u64,
}

#[derive(Debug)]
struct Channel {
    sender: broadcast::Sender<Utf8Bytes>,
    latest: Option<Utf8Bytes>,
    epoch: i64,
    used_at: u64,
}

/// A watcher's end: the newest frame at once, then everything that follows.
#[derive(Debug)]
pub struct Watch {
    pub latest: Option<Utf8Bytes>,
    pub frames: broadcast::Receiver<Utf8Bytes>,
}

impl LiveHub {
    /// Hands a frame to the watchers of its run. `false`: it came from an attempt that has been replaced.
    pub fn publish(&self, run: Uuid, epoch: i64, text: Utf8Bytes) -> bool {
        let mut runs = self.lock();
        let channel = runs.channel(run);
        if epoch < channel.epoch {
            return false;
        }
        channel.epoch = epoch;
        channel.latest = Some(text.clone());
        let _nobody_watches = channel.sender.send(text);
        true
    }

    pub fn watch(&self, run: Uuid) -> Watch {
        let mut runs = self.lock();
        let channel = runs.channel(run);
        Watch {
            latest: channel.latest.clone(),
            frames: channel.sender.subscribe(),
        }
    }

    /// Ends the channel of a run: its watchers see the end of the stream.
    pub fn close(&self, run: Uuid) {
        self.lock().channels.remove(&run);
    }

    fn lock(&self) -> MutexGuard<'_, Runs> {
        self.runs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Runs {
    fn channel(&mut self, run: Uuid) -> &mut Channel {
        self.clock += 1;
        if !self.channels.contains_key(&run) && self.channels.len() >= RUNS_KEPT {
            let idle = self
                .channels
                .iter()
                .min_by_key(|(_, channel)| channel.used_at)
                .map(|(run, _)| *run);
            idle.and_then(|run| self.channels.remove(&run));
        }
        let channel = self.channels.entry(run).or_insert_with(|| Channel {
            sender: broadcast::Sender::new(FRAMES_KEPT),
            latest: None,
            epoch: 0,
            used_at: 0,
        });
        channel.used_at = self.clock;
        channel
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::sync::broadcast::error::{RecvError, TryRecvError};

    #[tokio::test]
    async fn a_slow_reader_loses_the_oldest_frames_and_nobody_waits() {
        let hub = LiveHub::default();
        let run = Uuid::now_v7();
        let mut watch = hub.watch(run);
        for tick in 0..100 {
            assert!(hub.publish(run, 1, format!("{tick}").into()));
        }
        assert!(matches!(watch.frames.recv().await, Err(RecvError::Lagged(68))));
        assert_eq!(
            watch.frames.recv().await.map(|text| text.to_string()),
            Ok("68".to_owned())
        );
        assert_eq!(
            hub.watch(run).latest.map(|text| text.to_string()),
            Some("99".to_owned())
        );
    }

    #[tokio::test]
    async fn frames_of_a_replaced_attempt_are_dropped() {
        let hub = LiveHub::default();
        let run = Uuid::now_v7();
        let mut watch = hub.watch(run);
        assert!(hub.publish(run, 7, "new".into()));
        assert!(!hub.publish(run, 6, "old".into()));
        assert_eq!(
            watch.frames.try_recv().map(|text| text.to_string()),
            Ok("new".to_owned())
        );
        assert!(matches!(watch.frames.try_recv(), Err(TryRecvError::Empty)));
        hub.close(run);
        assert!(matches!(watch.frames.try_recv(), Err(TryRecvError::Closed)));
    }

    #[test]
    fn the_number_of_channels_is_bounded() {
        let hub = LiveHub::default();
        for _ in 0..1000 {
            hub.publish(Uuid::now_v7(), 1, "x".into());
        }
        assert_eq!(hub.lock().channels.len(), RUNS_KEPT);
    }
}
