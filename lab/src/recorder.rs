//! Takes records from the control loop without ever making it wait, writes the journal, and shows every sixth tick
//! to whoever watches live.

use crate::clock;
use crate::hub::Hub;
use crate::journal::JournalWriter;
use crate::live::LivePicture;
use crate::record::{End, Log, LogLevel, Record};
use api::live::LiveFrame;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::broadcast;

/// Records on their way to the recorder: 1.8 s of fifty robots.
pub const QUEUE_RECORDS: usize = 32_768;
/// A crash loses no more than this.
const FLUSH_PERIOD: Duration = Duration::from_millis(200);
/// A chunk is written early at this size.
const FLUSH_BYTES: usize = 64 << 10;
/// Everything that waits goes into one chunk up to this size, so that a slow disk gets fewer, larger writes.
const CHUNK_BYTES: usize = 4 << 20;

/// Hands records over; cheap to clone.
#[derive(Debug, Clone)]
pub struct RecorderHandle {
    queue: SyncSender<Message>,
    dropped: Arc<AtomicU64>,
    failed: Arc<AtomicBool>,
}

#[derive(Debug)]
enum Message {
    Record(Record),
    Finish(Box<End>),
}

/// The recorder thread of one run.
#[derive(Debug)]
pub struct Recorder {
    handle: RecorderHandle,
    thread: JoinHandle<io::Result<()>>,
}

impl RecorderHandle {
    /// Queues a record; a full queue drops and counts it.
    pub fn push(&self, record: Record) {
        if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) = self.queue.try_send(Message::Record(record))
        {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Queues a record, and waits while the queue is full: for runs in virtual time, where nothing is late.
    pub fn push_waiting(&self, record: Record) {
        if self.queue.send(Message::Record(record)).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Queues a record that the run can do without: a full queue drops it and nothing more.
    pub fn push_spare(&self, record: Record) {
        let _full = self.queue.try_send(Message::Record(record));
    }

    /// Queues a line for the run's log and shows it in the process log.
    pub fn log(&self, level: LogLevel, message: impl Into<String>) {
        let message = message.into();
        match level {
            LogLevel::Info => tracing::info!("{message}"),
            LogLevel::Warning => tracing::warn!("{message}"),
            LogLevel::Error => tracing::error!("{message}"),
        }
        self.push(Record::Log(Log {
            at_us: clock::monotonic_us(),
            level,
            message,
        }));
    }

    /// The journal cannot be written, or records were lost.
    pub fn failed(&self) -> bool {
        self.failed.load(Ordering::Relaxed) || self.dropped.load(Ordering::Relaxed) > 0
    }

    /// A handle whose records are counted as dropped; for tests of code that records on the side.
    pub fn nowhere() -> Self {
        Self {
            queue: sync_channel(0).0,
            dropped: Arc::default(),
            failed: Arc::default(),
        }
    }
}

impl Recorder {
    /// Starts a journal in `folder` with `first` as its first record; that record is on disk on return.
    pub fn start(
        folder: &Path,
        first: Record,
        live: LivePicture,
        watchers: broadcast::Sender<LiveFrame>,
        hub: Arc<Hub>,
    ) -> io::Result<Self> {
        Self::start_with(folder, first, live, watchers, Some(hub))
    }

    /// As [`Self::start`], for motion that is no run: there is a journal, and nobody watches or follows.
    pub fn start_unwatched(folder: &Path, first: Record) -> io::Result<Self> {
        let nobody = LivePicture::new(uuid::Uuid::nil(), 0, &[]);
        Self::start_with(folder, first, nobody, broadcast::Sender::new(1), None)
    }

    fn start_with(
        folder: &Path,
        first: Record,
        live: LivePicture,
        watchers: broadcast::Sender<LiveFrame>,
        hub: Option<Arc<Hub>>,
    ) -> io::Result<Self> {
        let mut journal = JournalWriter::create(folder)?;
        journal.push(&first)?;
        journal.flush()?;
        let (queue, records) = sync_channel(QUEUE_RECORDS);
        let handle = RecorderHandle {
            queue,
            dropped: Arc::default(),
            failed: Arc::default(),
        };
        if let Some(hub) = &hub {
            hub.begin(handle.clone());
            hub.publish(&first);
        }
        let writer = Writer {
            journal,
            live,
            watchers,
            hub,
            dropped: handle.dropped.clone(),
        };
        let failed = handle.failed.clone();
        let thread = std::thread::Builder::new().name("recorder".to_owned()).spawn(move || {
            let result = writer.run(&records);
            failed.store(result.is_err(), Ordering::Relaxed);
            result
        })?;
        Ok(Self { handle, thread })
    }

    /// For handing records over.
    pub fn handle(&self) -> RecorderHandle {
        self.handle.clone()
    }

    /// Writes the last record and waits until all is on disk. Blocks: not for the loop or an async task.
    pub fn finish(self, end: End) -> io::Result<()> {
        // When the thread is gone already its error comes out of the join.
        let _gone = self.handle.queue.send(Message::Finish(Box::new(end)));
        self.thread
            .join()
            .unwrap_or_else(|_| Err(io::Error::other("the recorder thread panicked")))
    }
}

struct Writer {
    journal: JournalWriter,
    live: LivePicture,
    watchers: broadcast::Sender<LiveFrame>,
    /// None when nobody follows.
    hub: Option<Arc<Hub>>,
    dropped: Arc<AtomicU64>,
}

impl Writer {
    fn run(mut self, records: &Receiver<Message>) -> io::Result<()> {
        let mut flush_at = Instant::now() + FLUSH_PERIOD;
        loop {
            match records.recv_timeout(flush_at.saturating_duration_since(Instant::now())) {
                Ok(message) => {
                    let mut next = Some(message);
                    while let Some(message) = next {
                        if self.take(message)? {
                            return Ok(());
                        }
                        next = (self.journal.pending_bytes() < CHUNK_BYTES)
                            .then(|| records.try_recv().ok())
                            .flatten();
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return self.journal.flush(),
            }
            if Instant::now() >= flush_at || self.journal.pending_bytes() >= FLUSH_BYTES {
                self.journal.flush()?;
                flush_at = Instant::now() + FLUSH_PERIOD;
            }
        }
    }

    /// True after the last record.
    fn take(&mut self, message: Message) -> io::Result<bool> {
        match message {
            Message::Record(record) => {
                self.journal.push(&record)?;
                if let Some(hub) = &self.hub {
                    hub.publish(&record);
                }
                if let Some(frame) = self.live.take(&record) {
                    // No watcher is not an error.
                    let _watchers = self.watchers.send(frame);
                }
                Ok(false)
            }
            Message::Finish(mut end) => {
                end.records_dropped = self.dropped.load(Ordering::Relaxed);
                let end = Record::End(end);
                self.journal.push(&end)?;
                if let Some(hub) = &self.hub {
                    hub.publish(&end);
                    hub.end();
                }
                self.journal.flush()?;
                Ok(true)
            }
        }
    }
}
