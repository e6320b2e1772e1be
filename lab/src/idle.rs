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
/// After a press, until every robot that is there obeys, and for [`STOP_ROUNDS`] at least: a control tick.
const PRESS_PERIOD: Duration = Duration::from_micros(8_333);
const STOP_ROUNDS: u32 = 12;
/// While the stop stays pressed.
const STOP_PERIOD: Duration = Duration::from_millis(20);

/// Starts the thread; it ends with the process.
pub fn start(link: Arc<Link>, latch: Arc<StopLatch>, book: Arc<Mutex<EpochBook>>) -> io::Result<()> {
    let (wake, woken) = sync_channel(1);
    latch.wake_on_change(wake);
    std::thread::Builder::new()
        .name("idle-robots".to_owned())
        .spawn(move || {
            let mut stop_rounds = 0_u32;
            loop {
                stop_rounds = if latch.is_pressed() {
                    u32::saturating_add(stop_rounds, 1)
                } else {
                    0
                };
                let obeyed = || link.robots().all(|robot| robot.has_stopped() || !robot.is_online());
                let (still, period) = match stop_rounds {
                    0 => (Still::Rest, PERIOD),
                    1..=STOP_ROUNDS => (Still::Latch, PRESS_PERIOD),
                    _ if !obeyed() => (Still::Latch, PRESS_PERIOD),
                    _ => (Still::Latch, STOP_PERIOD),
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
