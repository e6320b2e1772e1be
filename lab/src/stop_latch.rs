//! The protective stop: pressed at once, latched over restarts, cleared only on request.

use crate::durable;
use chrono::Utc;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use tokio::sync::watch;

/// The latch of one laboratory.
#[derive(Debug)]
pub struct StopLatch {
    pressed: AtomicBool,
    changed: watch::Sender<bool>,
    wake: Mutex<Vec<SyncSender<()>>>,
    mark: PathBuf,
    audit: PathBuf,
}

impl StopLatch {
    /// Reads the mark left in `folder`, which exists.
    pub fn open(folder: &Path) -> Self {
        let mark = folder.join("stop-pressed");
        // A folder that cannot be read counts as pressed.
        let pressed = mark.try_exists().unwrap_or(true);
        Self {
            pressed: AtomicBool::new(pressed),
            changed: watch::Sender::new(pressed),
            wake: Mutex::default(),
            mark,
            audit: folder.join("stop-audit.log"),
        }
    }

    /// Pressed and not cleared.
    pub fn is_pressed(&self) -> bool {
        self.pressed.load(Ordering::Acquire)
    }

    /// For async code that wants to know at once.
    pub fn subscribe(&self) -> watch::Receiver<bool> {
        self.changed.subscribe()
    }

    /// `wake` gets a message whenever the latch changes; a full channel is left alone.
    pub fn wake_on_change(&self, wake: SyncSender<()>) {
        self.wake
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .push(wake);
    }

    /// Stops first and writes the mark second. An error means: stopped, but a restart would forget it.
    pub fn press(&self, by: &str) -> io::Result<()> {
        self.set(true);
        durable::write(&self.mark, format!("{} {by}\n", Utc::now().to_rfc3339()).as_bytes())?;
        self.audit("pressed", by)
    }

    /// Clears only when the mark is gone for good.
    pub fn clear(&self, by: &str) -> io::Result<()> {
        self.audit("cleared", by)?;
        match fs::remove_file(&self.mark) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => durable::sync_parent(&self.mark)?,
        }
        self.set(false);
        Ok(())
    }

    fn set(&self, pressed: bool) {
        self.pressed.store(pressed, Ordering::Release);
        for wake in self
            .wake
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .iter()
        {
            // Full means that a wake-up is on its way.
            let _pending = wake.try_send(());
        }
        self.changed.send_replace(pressed);
        tracing::warn!(pressed, "protective stop");
    }

    fn audit(&self, what: &str, by: &str) -> io::Result<()> {
        let mut file = OpenOptions::new().append(true).create(true).open(&self.audit)?;
        writeln!(file, "{} {what} {by}", Utc::now().to_rfc3339())?;
        file.sync_data()
    }
}
