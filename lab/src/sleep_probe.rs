//! How punctual this machine is for anybody: plain sleeps of one tick on an ordinary thread, for comparison with the
//! control loop's lateness.

use crate::record::Record;
use crate::recorder::RecorderHandle;
use crate::schedule::TICK_HZ;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What is measured: one tick.
const SLEEP: Duration = Duration::from_nanos(1_000_000_000 / TICK_HZ as u64);
/// Between two measurements, so that the probe itself costs nothing.
const PAUSE: Duration = Duration::from_millis(42);

/// Measures until it is dropped.
#[derive(Debug)]
pub struct SleepProbe {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl SleepProbe {
    /// Starts measuring about twenty times a second.
    pub fn start(recorder: RecorderHandle) -> std::io::Result<Self> {
        let over = Arc::new(AtomicBool::new(false));
        let seen = over.clone();
        let thread = std::thread::Builder::new()
            .name("sleep-probe".to_owned())
            .spawn(move || {
                while !seen.load(Ordering::Relaxed) {
                    let before = Instant::now();
                    std::thread::sleep(SLEEP);
                    let late = before.elapsed().saturating_sub(SLEEP);
                    recorder.push(Record::SleepLate(i64::try_from(late.as_micros()).unwrap_or(i64::MAX)));
                    std::thread::sleep(PAUSE);
                }
            })?;
        Ok(Self {
            over,
            thread: Some(thread),
        })
    }
}

impl Drop for SleepProbe {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // It ends within 51 ms; a panic in it costs nothing but samples.
            let _ended = thread.join();
        }
    }
}
