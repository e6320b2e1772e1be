//! The lease of a run: kept alive by heartbeats, given up in time when they stop getting through.

use crate::clock::monotonic_us;
use crate::safety::LEASE_MARGIN_US;
use crate::service::{Service, ServiceError};
use api::lab::Heartbeat;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::time::Duration;
use tokio::task::JoinHandle;
use uuid::Uuid;

/// Between two heartbeats; the service allows 15 s of silence.
const PERIOD: Duration = Duration::from_secs(1);

/// What the control loop reads; written by the heartbeat task.
#[derive(Debug)]
pub struct Lease {
    until_us: AtomicI64,
    cancel: AtomicBool,
    stale: AtomicBool,
    confirmed: AtomicBool,
}

/// The moment up to which the lab may act on a lease that was confirmed for a request sent at `sent_us`.
pub fn usable_until_us(sent_us: i64, lease_s: f64) -> i64 {
    sent_us + (lease_s * 1e6) as i64 - LEASE_MARGIN_US
}

impl Lease {
    /// A lease just claimed. Counted from the reply: nothing may move before [`Lease::is_confirmed`] anyway.
    pub fn claimed(lease_s: f64) -> Self {
        Self {
            until_us: AtomicI64::new(usable_until_us(monotonic_us(), lease_s)),
            cancel: AtomicBool::new(false),
            stale: AtomicBool::new(false),
            confirmed: AtomicBool::new(false),
        }
    }

    /// The lab must be still from here on.
    pub fn until_us(&self) -> i64 {
        self.until_us.load(Ordering::Acquire)
    }

    /// Someone wants this run to stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.load(Ordering::Acquire)
    }

    /// Asks for the end from within this process.
    pub fn cancel(&self) {
        self.cancel.store(true, Ordering::Release);
    }

    /// Another one has the right to act.
    pub fn set_stale(&self) {
        self.stale.store(true, Ordering::Release);
    }

    /// The service says that another attempt is current.
    pub fn is_stale(&self) -> bool {
        self.stale.load(Ordering::Acquire)
    }

    /// At least one heartbeat got through.
    pub fn is_confirmed(&self) -> bool {
        self.confirmed.load(Ordering::Acquire)
    }

    /// Takes the outcome of a heartbeat sent at `sent_us`.
    pub fn take(&self, sent_us: i64, outcome: Result<api::lab::HeartbeatReply, ServiceError>) {
        match outcome {
            Ok(reply) => {
                self.until_us
                    .fetch_max(usable_until_us(sent_us, reply.lease_s), Ordering::AcqRel);
                self.confirmed.store(true, Ordering::Release);
                if reply.cancel_requested {
                    self.cancel.store(true, Ordering::Release);
                }
            }
            Err(error) if error.is_stale_epoch() => {
                tracing::warn!("heartbeat: the attempt is stale");
                self.stale.store(true, Ordering::Release);
            }
            Err(error) => tracing::warn!(%error, "heartbeat"),
        }
    }
}

/// The heartbeat task; ends with this value.
#[derive(Debug)]
pub struct Heart(JoinHandle<()>);

impl Heart {
    /// Beats at once and then every second.
    pub fn start(service: Service, run_id: Uuid, beat: Heartbeat, lease: Arc<Lease>) -> Self {
        Self(tokio::spawn(async move {
            let mut ticks = tokio::time::interval(PERIOD);
            ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
            while !lease.is_stale() {
                ticks.tick().await;
                let sent_us = monotonic_us();
                lease.take(sent_us, service.heartbeat(run_id, &beat).await);
            }
        }))
    }
}

impl Drop for Heart {
    fn drop(&mut self) {
        self.0.abort();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use api::lab::HeartbeatReply;

    #[test]
    fn counts_from_the_sending_time_and_never_backwards() {
        let lease = Lease::claimed(15.0);
        let start_us = monotonic_us();
        assert!(!lease.is_confirmed());
        lease.take(
            start_us + 5_000_000,
            Ok(HeartbeatReply {
                lease_s: 15.0,
                cancel_requested: false,
            }),
        );
        assert_eq!(lease.until_us(), start_us + 19_000_000);
        lease.take(
            start_us + 4_000_000,
            Ok(HeartbeatReply {
                lease_s: 15.0,
                cancel_requested: true,
            }),
        );
        assert_eq!(lease.until_us(), start_us + 19_000_000);
        assert!(lease.is_confirmed() && lease.is_cancelled() && !lease.is_stale());
    }

    #[test]
    fn a_stale_epoch_is_told_apart_from_other_refusals() {
        let refused = |status: u16, code: &str| ServiceError::Refused {
            status: status.try_into().expect("a status"),
            code: code.to_owned(),
            detail: String::new(),
        };
        let lease = Lease::claimed(15.0);
        lease.take(0, Err(refused(503, "database_down")));
        assert!(!lease.is_stale());
        lease.take(0, Err(refused(409, "stale_epoch")));
        assert!(lease.is_stale());
    }
}
