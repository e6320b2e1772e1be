//! Datagrams as they come in, with the time of their arrival: a thread of its own, so that no tick blurs that time.

use crate::clock;
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsRawFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Datagrams that wait for the next tick; more are lost, as from a full socket.
const MAX_WAITING: usize = 4096;
/// How long the thread sleeps at most, to see the end.
const WAKE_MS: i32 = 50;
/// Datagrams of one socket in a row.
const MAX_IN_A_ROW: usize = 64;
/// Longer datagrams are cut and thereby invalid.
const MAX_BYTES: usize = 1500;

/// One datagram.
#[derive(Debug)]
pub struct Datagram {
    /// Position of the socket it came to.
    pub port: usize,
    pub sender: SocketAddr,
    pub at_us: i64,
    pub characters: Vec<u8>,
}

/// The thread and what it hands over.
#[derive(Debug)]
pub struct DatagramReceiver {
    waiting: Receiver<Datagram>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl DatagramReceiver {
    /// Starts to read these sockets, which must not block.
    pub fn start(sockets: Vec<Arc<UdpSocket>>) -> std::io::Result<Self> {
        let (sender, waiting) = sync_channel(MAX_WAITING);
        let end = Arc::new(AtomicBool::new(false));
        let seen_end = end.clone();
        let thread = std::thread::Builder::new().name("receive".to_owned()).spawn(move || {
            while !seen_end.load(Ordering::Relaxed) {
                wait(&sockets);
                for (port, socket) in sockets.iter().enumerate() {
                    read(port, socket, &sender);
                }
            }
        })?;
        Ok(Self {
            waiting,
            end,
            thread: Some(thread),
        })
    }

    /// The next datagram, if one waits.
    pub fn take(&self) -> Option<Datagram> {
        self.waiting.try_recv().ok()
    }
}

impl Drop for DatagramReceiver {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the receiving thread has panicked");
        }
    }
}

#[allow(unsafe_code, reason = "the standard library cannot wait for several sockets")]
fn wait(sockets: &[Arc<UdpSocket>]) {
    let mut waits: Vec<libc::pollfd> = sockets
        .iter()
        .map(|socket| libc::pollfd {
            fd: socket.as_raw_fd(),
            events: libc::POLLIN,
            revents: 0,
        })
        .collect();
    let count = waits.len() as libc::nfds_t;
    // SAFETY: `waits` is a valid array of `count` entries for the whole call.
    unsafe { libc::poll(waits.as_mut_ptr(), count, WAKE_MS) };
}

fn read(port: usize, socket: &UdpSocket, sender: &SyncSender<Datagram>) {
    let mut buffer = [0; MAX_BYTES];
    for _ in 0..MAX_IN_A_ROW {
        let (length, from) = match socket.recv_from(&mut buffer) {
            Ok(received) => received,
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => return,
            // A port unreachable message for an earlier answer: the laboratory has gone.
            Err(error) => {
                tracing::debug!(%error, port, "receive");
                continue;
            }
        };
        let datagram = Datagram {
            port,
            sender: from,
            at_us: clock::monotonic_us(),
            characters: buffer.get(..length).unwrap_or_default().to_vec(),
        };
        if sender.try_send(datagram).is_err() {
            tracing::debug!(port, "too many datagrams wait");
        }
    }
}
