//! The sending end of the robot link. A frame that cannot be sent is a lost frame, which robots and laboratory are made for;
//! that it happens is counted and said.

use crate::clock::monotonic_us;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};

/// Between two lines in the log.
const TOLD_PERIOD_US: i64 = 10_000_000;

/// One socket for all robots; takes no lock, as the control loop sends with it.
#[derive(Debug)]
pub(crate) struct Mouth {
    socket: Arc<UdpSocket>,
    groups: Option<SocketAddr>,
    failures: AtomicU64,
    /// When a failure was last in the log; least before the first.
    told_us: AtomicI64,
}

impl Mouth {
    /// - `groups`: where frames for several robots go; may be a broadcast address.
    pub(crate) fn new(socket: Arc<UdpSocket>, groups: Option<SocketAddr>) -> io::Result<Self> {
        if groups.is_some() {
            socket.set_broadcast(true)?;
        }
        Ok(Self {
            socket,
            groups,
            failures: AtomicU64::new(0),
            told_us: AtomicI64::new(i64::MIN),
        })
    }

    pub(crate) const fn sends_groups(&self) -> bool {
        self.groups.is_some()
    }

    /// False when the frame did not get out.
    pub(crate) fn say(&self, bytes: &[u8], to: SocketAddr) -> bool {
        match self.socket.send_to(bytes, to) {
            Ok(_) => true,
            Err(error) => {
                self.note(&error, to);
                false
            }
        }
    }

    /// False when the frame did not get out, or there is nowhere to send groups to.
    pub(crate) fn say_to_all(&self, bytes: &[u8]) -> bool {
        self.groups.is_some_and(|to| self.say(bytes, to))
    }

    fn note(&self, error: &io::Error, to: SocketAddr) {
        let failures = 1 + self.failures.fetch_add(1, Ordering::Relaxed);
        let (now_us, told_us) = (monotonic_us(), self.told_us.load(Ordering::Relaxed));
        let is_due = now_us.saturating_sub(told_us) >= TOLD_PERIOD_US;
        let exchanged = || {
            self.told_us
                .compare_exchange(told_us, now_us, Ordering::Relaxed, Ordering::Relaxed)
        };
        if is_due && exchanged().is_ok() {
            tracing::warn!(%error, %to, failures, "frames to robots cannot be sent");
        }
    }
}
