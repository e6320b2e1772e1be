//! Robots that no run holds: told to rest ten times a second so that their health is known, and told to stop within
//! milliseconds of the protective stop.

use crate::commander::Still;
use crate::epochs::EpochBook;
use crate::link::Link;
use crate::stop_latch::StopLatch;
use std::io;
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Between two rounds.
const PERIOD: Duration = Duration::from_millis(100);
/// While the stop is pressed.
const STOP_PERIOD: Duration = Duration::from_millis(20);

/// Starts the thread; it ends with the process.
pub fn start(link: Arc<Link>, latch: Arc<StopLatch>, book: Arc<Mutex<EpochBook>>) -> io::Result<()> {
    let (wake, woken) = sync_channel(1);
    latch.wake_on_change(wake);
    std::thread::Builder::new()
        .name("idle-robots".to_owned())
        .spawn(move || {
            loop {
                let (still, period) = if latch.is_pressed() {
                    (Still::Latch, STOP_PERIOD)
                } else {
                    (Still::Rest, PERIOD)
                };
                for robot in link.robots() {
                    robot.send_idle(still, &book);
                }
                // Time over or woken: the next round is due either way.
                let _woken = woken.recv_timeout(period);
            }
        })?;
    Ok(())
}
