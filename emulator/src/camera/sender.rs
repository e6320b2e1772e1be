//! Frames to every reader of a local stream socket, in order; a slow reader loses frames and delays nobody.

use super::faults::Damage;
use super::frame::{FrameError, FrameHeader, encode};
use crate::socket::SocketFile;
use std::io::Write;
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

/// Most readers of one camera; further ones are hung up on.
pub const MAX_READERS: usize = 4;
/// Frames that wait for a reader besides the one being written.
pub const MAX_WAITING_FRAMES: usize = 1;

/// What happened on a camera's socket so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SenderCounts {
    /// Readers that are connected.
    pub readers: usize,
    /// Frames written whole, over all readers.
    pub written: u64,
    /// Frames that a reader lost because it was slow, over all readers.
    pub dropped: u64,
}

/// The listening socket of one camera.
#[derive(Debug)]
pub struct FrameSender {
    socket: SocketFile,
    readers: Vec<Reader>,
    /// Buffers to use again once no reader holds them.
    buffers: Vec<Arc<Vec<u8>>>,
    written: Arc<AtomicU64>,
    dropped: u64,
}

impl FrameSender {
    pub fn listen(path: &Path) -> std::io::Result<Self> {
        Ok(Self {
            socket: SocketFile::listen(path)?,
            readers: Vec::new(),
            buffers: Vec::new(),
            written: Arc::new(AtomicU64::new(0)),
            dropped: 0,
        })
    }

    /// Lets waiting readers in and ends those that are gone. [`Self::send`] does it too.
    pub fn poll(&mut self) {
        self.readers.retain(|reader| !reader.is_gone());
        while let Some(stream) = self.socket.accept() {
            if self.readers.len() == MAX_READERS {
                tracing::warn!(MAX_READERS, "a camera has too many readers; one more is hung up on");
                continue;
            }
            match Reader::start(stream, Arc::clone(&self.written)) {
                Ok(reader) => self.readers.push(reader),
                Err(error) => tracing::warn!(%error, "cannot serve a reader of a camera"),
            }
        }
    }

    /// Hands a frame to every reader, without waiting for any.
    ///
    /// - Errors: pixels that do not fit the header; then nothing is sent.
    pub fn send(&mut self, header: &FrameHeader, pixels: &[u8]) -> Result<(), FrameError> {
        self.send_with(header, pixels, None)
    }

    /// As [`Self::send`], with the frame damaged on its way.
    pub fn send_with(&mut self, header: &FrameHeader, pixels: &[u8], damage: Option<Damage>) -> Result<(), FrameError> {
        self.poll();
        if self.readers.is_empty() {
            return Ok(());
        }
        let frame = self.encoded(header, pixels, damage)?;
        for reader in &self.readers {
            if reader
                .queue
                .try_send(Arc::clone(&frame))
                .is_err_and(|error| matches!(error, TrySendError::Full(_)))
            {
                self.dropped += 1;
            }
        }
        Ok(())
    }

    pub fn counts(&self) -> SenderCounts {
        SenderCounts {
            readers: self.readers.len(),
            written: self.written.load(Ordering::Relaxed),
            dropped: self.dropped,
        }
    }

    /// The frame in a buffer that nobody reads any more, or in a new one.
    fn encoded(
        &mut self,
        header: &FrameHeader,
        pixels: &[u8],
        damage: Option<Damage>,
    ) -> Result<Arc<Vec<u8>>, FrameError> {
        let write = |bytes: &mut Vec<u8>| -> Result<(), FrameError> {
            encode(header, pixels, bytes)?;
            if let Some(damage) = damage {
                damage.spoil(bytes);
            }
            Ok(())
        };
        for buffer in &mut self.buffers {
            if let Some(bytes) = Arc::get_mut(buffer) {
                write(bytes)?;
                return Ok(Arc::clone(buffer));
            }
        }
        let mut bytes = Vec::new();
        write(&mut bytes)?;
        let buffer = Arc::new(bytes);
        // each reader holds at most the frame it writes and those that wait
        if self.buffers.len() <= MAX_READERS * (MAX_WAITING_FRAMES + 1) {
            self.buffers.push(Arc::clone(&buffer));
        }
        Ok(buffer)
    }
}

/// A thread that writes to one reader, and so waits for that one alone.
#[derive(Debug)]
struct Reader {
    stream: UnixStream,
    queue: SyncSender<Arc<Vec<u8>>>,
    thread: Option<JoinHandle<()>>,
}

impl Reader {
    fn start(stream: UnixStream, written: Arc<AtomicU64>) -> std::io::Result<Self> {
        stream.set_nonblocking(false)?;
        let (queue, frames) = sync_channel(MAX_WAITING_FRAMES);
        let outlet = stream.try_clone()?;
        let thread = std::thread::Builder::new()
            .name("camera-reader".to_owned())
            .spawn(move || write_all(outlet, &frames, &written))?;
        Ok(Self {
            stream,
            queue,
            thread: Some(thread),
        })
    }

    fn is_gone(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // wakes a thread that waits in a write
        self.stream.shutdown(Shutdown::Both).ok();
        let (closed, _) = sync_channel(0);
        self.queue = closed;
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("a camera's writer thread panicked");
        }
    }
}

fn write_all(mut stream: UnixStream, frames: &Receiver<Arc<Vec<u8>>>, written: &AtomicU64) {
    while let Ok(frame) = frames.recv() {
        if let Err(error) = stream.write_all(&frame) {
            tracing::debug!(%error, "a reader of a camera is gone");
            return;
        }
        written.fetch_add(1, Ordering::Relaxed);
    }
}
