//! The in-memory hub: records of the run to whoever subscribes over TCP, and what the virtual and the learning side say back.
//!
//! One line of JSON a record, as in the journal. A subscriber that comes late gets the start of the run first. A slow one
//! loses lines, is told how many, and delays nobody. Only this machine can subscribe; others go through a tunnel.

use crate::durable;
use crate::record::Record;
use crate::recorder::RecorderHandle;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// File in the data folder with the real address of the laboratory's hub.
pub const ADDRESS_FILE: &str = "lab-hub.addr";
/// The same of the simulation server's own hub.
pub const VIRTUAL_ADDRESS_FILE: &str = "simulate-hub.addr";
/// Lines that wait for one subscriber: about half a second of fifty robots.
const WAITING_LINES: usize = 8192;
const SUBSCRIBERS_MAX: usize = 16;
/// Longest line a subscriber may send.
const LINE_LIMIT_BYTES: u64 = 64 << 10;

type Line = Arc<[u8]>;

/// See the module.
#[derive(Debug, Default)]
pub struct Hub {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    subscribers: Vec<Subscriber>,
    /// What a late subscriber needs: the first records of the run that goes on.
    beginning: Vec<Line>,
    recorder: Option<RecorderHandle>,
}

#[derive(Debug)]
struct Subscriber {
    queue: SyncSender<Line>,
    lost: u64,
}

impl Hub {
    /// Listens in the background until the process ends.
    ///
    /// - `listen`: an address of this machine; port 0 takes any, the real one stands in `address_file`.
    pub fn start(listen: SocketAddr, address_file: &Path) -> io::Result<Arc<Self>> {
        if !listen.ip().is_loopback() {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!(
                    "the hub listens on this machine only, not on {listen}; let others in through a tunnel (ssh -L)"
                ),
            ));
        }
        let listener = TcpListener::bind(listen)?;
        durable::write(address_file, listener.local_addr()?.to_string().as_bytes())?;
        let hub = Arc::new(Self::default());
        let accepting = hub.clone();
        std::thread::Builder::new().name("hub".to_owned()).spawn(move || {
            for stream in listener.incoming() {
                match stream.and_then(|stream| accepting.admit(stream)) {
                    Ok(()) => {}
                    Err(error) => tracing::warn!(%error, "hub: a subscriber is not served"),
                }
            }
        })?;
        Ok(hub)
    }

    /// A run begins: what subscribers publish goes into its record.
    pub fn begin(&self, recorder: RecorderHandle) {
        let mut state = self.state();
        state.recorder = Some(recorder);
        state.beginning.clear();
    }

    /// The run is over.
    pub fn end(&self) {
        let mut state = self.state();
        state.recorder = None;
        state.beginning.clear();
    }

    /// Hands a record to all subscribers. Never waits for one.
    pub fn publish(&self, record: &Record) {
        let mut state = self.state();
        let first = matches!(record, Record::Start(_) | Record::Motion(_));
        if state.subscribers.is_empty() && !first {
            return;
        }
        let Some(line) = line_of(record) else { return };
        if first {
            state.beginning.push(line.clone());
        }
        state.subscribers.retain_mut(|subscriber| subscriber.send(&line));
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn admit(self: &Arc<Self>, stream: TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        let (queue, lines) = sync_channel(WAITING_LINES);
        {
            let mut state = self.state();
            if state.subscribers.len() >= SUBSCRIBERS_MAX {
                return Err(io::Error::other("too many subscribers"));
            }
            for line in &state.beginning {
                // An empty queue of thousands takes a handful.
                let _full = queue.try_send(line.clone());
            }
            state.subscribers.push(Subscriber { queue, lost: 0 });
        }
        let outgoing = stream.try_clone()?;
        std::thread::Builder::new()
            .name("hub-out".to_owned())
            .spawn(move || write_lines(outgoing, &lines))?;
        let hub = self.clone();
        std::thread::Builder::new().name("hub-in".to_owned()).spawn(move || {
            let ended = hub.read_lines(&stream);
            tracing::debug!(?ended, "a subscriber of the hub is gone");
            // Wakes the writing thread as well.
            let _gone = stream.shutdown(std::net::Shutdown::Both);
        })?;
        Ok(())
    }

    fn read_lines(&self, stream: &TcpStream) -> io::Result<()> {
        let mut reader = BufReader::new(stream);
        let mut line = Vec::new();
        loop {
            line.clear();
            if reader.by_ref().take(LINE_LIMIT_BYTES).read_until(b'\n', &mut line)? == 0 {
                return Ok(());
            }
            match serde_json::from_slice(&line) {
                Ok(record @ (Record::Shadow(_) | Record::Learning(_))) => self.take(record),
                Ok(_) => return Err(io::Error::other("only shadow and learning records can be published")),
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// What other servers say of the run: into the record, which shows it live and publishes it to everybody.
    fn take(&self, record: Record) {
        let recorder = self.state().recorder.clone();
        if let Some(recorder) = recorder {
            recorder.push_spare(record);
        }
    }
}

impl Subscriber {
    /// `false` when it is gone.
    fn send(&mut self, line: &Line) -> bool {
        if self.lost > 0 {
            let told: Line = format!("{{\"lost\":{}}}\n", self.lost).into_bytes().into();
            if self.queue.try_send(told).is_ok() {
                self.lost = 0;
            }
        }
        match self.queue.try_send(line.clone()) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.lost += 1;
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }
}

fn line_of(record: &Record) -> Option<Line> {
    let mut bytes = serde_json::to_vec(record).ok()?;
    bytes.push(b'\n');
    Some(bytes.into())
}

fn write_lines(mut stream: TcpStream, lines: &Receiver<Line>) {
    while let Ok(line) = lines.recv() {
        if stream.write_all(&line).is_err() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Shadow, ShadowPose, Tick};
    use std::time::{Duration, Instant};

    fn tick(number: i64) -> Record {
        Record::Tick(Tick {
            tick: number,
            due_us: 0,
            woke_us: 0,
            done_us: 0,
            missed: 0,
            exposure_us: 0,
        })
    }

    fn hub(name: &str) -> (Arc<Hub>, SocketAddr) {
        let data = std::env::temp_dir().join(format!("robopheus-hub-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&data).expect("a folder");
        let hub = Hub::start("127.0.0.1:0".parse().expect("an address"), &data.join(ADDRESS_FILE)).expect("a hub");
        let address = std::fs::read_to_string(data.join(ADDRESS_FILE)).expect("the address");
        std::fs::remove_dir_all(&data).expect("removed");
        (hub, address.parse().expect("an address"))
    }

    fn wait_for(hub: &Hub, subscribers: usize) {
        let begin = Instant::now();
        while hub.state().subscribers.len() != subscribers {
            assert!(begin.elapsed() < Duration::from_secs(5));
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    #[test]
    fn a_reader_that_does_not_read_delays_nobody_and_is_told_what_it_lost() {
        let (hub, address) = hub("slow");
        let slow = TcpStream::connect(address).expect("connects");
        wait_for(&hub, 1);
        let begin = Instant::now();
        let count = 60_000;
        for number in 0..count {
            hub.publish(&tick(number));
        }
        assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
        slow.set_read_timeout(Some(Duration::from_millis(500)))
            .expect("a limit");
        let mut lines = BufReader::new(slow).lines();
        let (mut seen, mut lost) = (0, 0);
        // One more line makes room for the word about the loss.
        for round in 0..3 {
            while let Some(Ok(line)) = lines.next() {
                match line.strip_prefix("{\"lost\":") {
                    Some(rest) => lost += rest.trim_end_matches('}').parse::<i64>().expect("a number"),
                    None => seen += 1,
                }
            }
            if round < 2 {
                hub.publish(&tick(count + round));
            }
        }
        assert!(lost > 0, "the queue is finite");
        assert_eq!(seen + lost, count + 2);
    }

    #[test]
    fn only_words_of_other_servers_can_be_published() {
        let (hub, address) = hub("publish");
        let mut good = TcpStream::connect(address).expect("connects");
        let mut bad = TcpStream::connect(address).expect("connects");
        wait_for(&hub, 2);
        let shadow = Record::Shadow(Shadow {
            tick: 1,
            at_us: 1,
            robots: vec![ShadowPose {
                robot: 1,
                x_m: 0.0,
                y_m: 0.0,
                yaw_rad: 0.0,
                gap_m: None,
            }],
        });
        good.write_all(&line_of(&shadow).expect("a line")).expect("sent");
        bad.write_all(&line_of(&tick(1)).expect("a line")).expect("sent");
        let mut rest = Vec::new();
        assert_eq!(bad.read_to_end(&mut rest).expect("hung up on"), 0);
        good.set_read_timeout(Some(Duration::from_secs(2))).expect("a limit");
        hub.publish(&tick(2));
        let mut line = String::new();
        BufReader::new(&good).read_line(&mut line).expect("still served");
        assert!(line.contains("\"tick\""), "{line}");
    }

    #[test]
    fn other_machines_are_not_let_in() {
        let listen = "0.0.0.0:0".parse().expect("an address");
        let error = Hub::start(listen, &std::env::temp_dir()).expect_err("refused");
        assert!(error.to_string().contains("tunnel"));
    }
}
