//! The robot link: command frames out, telemetry in. Only a [`control::safety::SafeCommand`] can make a robot move.

mod port;

pub use port::{HeldPort, RobotPort};

use crate::clock::monotonic_us;
use crate::commander::{Commander, Still};
use crate::ear::{Ear, Heard, STATUS_STOPPED};
use crate::epochs::{EpochBook, RESERVED_FRAMES};
use crate::feed::Feed;
use crate::ladder::{Finding, Findings, Held, Ladder};
use crate::link_statistics::LinkStatistics;
use crate::mouth::Mouth;
use crate::record::Telemetry;
use crate::robot_addresses::RobotAddresses;
use api::robot::LabRobot;
use robot::frame::{Counters, Health};
use robot::key::Key;
use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A robot that was silent for longer is offline.
pub const ONLINE_US: i64 = 500_000;
/// Statistics of a robot that only sends motion telemetry are renewed this often.
const SHOWN_PERIOD_US: i64 = 100_000;
/// Where the robot number stands in a frame: after `:`, version and type.
const NUMBER_DIGITS: std::ops::Range<usize> = 5..7;

/// The link to all robots of the laboratory.
#[derive(Debug)]
pub struct Link {
    robots: BTreeMap<u8, Arc<RobotLink>>,
    feed: Feed<Telemetry>,
    /// Datagrams that are for no robot of this laboratory.
    strange: AtomicU64,
}

/// One robot as the receiving side knows it.
#[derive(Debug)]
pub struct RobotLink {
    pub number: u8,
    pub name: String,
    key: Key,
    /// Robot's clock in its newest frame, to be echoed.
    heard_clock_ms: AtomicU32,
    newest: Mutex<Option<Telemetry>>,
    /// Newest health with its arrival; robots that send it read groups, too.
    health: Mutex<Option<(Health, i64)>>,
    /// What it last said of the frames that it got.
    counters: Mutex<Option<Counters>>,
    statistics: Mutex<LinkStatistics>,
    /// The gravest finding that counts now, for the control loop, which takes no lock.
    finding: AtomicU8,
    held: Mutex<Option<Held>>,
    /// Frames to it that could not be sent.
    unsent: AtomicU64,
    /// Right to send; a run takes it out.
    port: Mutex<Option<RobotPort>>,
}

impl Link {
    /// Binds one socket for all robots and starts receiving.
    ///
    /// - Errors: no key or no port for a robot, or an address for a robot that is not there.
    pub fn start(
        robots: &[LabRobot],
        keys: &BTreeMap<u8, Key>,
        addresses: &RobotAddresses,
        book: &mut EpochBook,
    ) -> io::Result<Arc<Self>> {
        let is_known = |number: &u8| robots.iter().any(|robot| robot.number == *number);
        if let Some(number) = addresses.own().find(|number| !is_known(number)) {
            return Err(io::Error::other(format!(
                "an address for robot {number}, which this laboratory does not have"
            )));
        }
        let any = if addresses.is_ipv4() {
            IpAddr::from([0, 0, 0, 0])
        } else {
            IpAddr::from([0_u16; 8])
        };
        let socket = Arc::new(UdpSocket::bind(SocketAddr::new(any, 0))?);
        let mouth = Arc::new(Mouth::new(socket.clone(), addresses.groups())?);
        let mut links = BTreeMap::new();
        for lab_robot in robots {
            let number = lab_robot.number;
            let missing = || io::Error::other(format!("no link key for robot {number}"));
            let link = Arc::new(RobotLink {
                number,
                name: lab_robot.description.name.clone(),
                key: *keys.get(&number).ok_or_else(missing)?,
                heard_clock_ms: AtomicU32::new(0),
                newest: Mutex::default(),
                health: Mutex::default(),
                counters: Mutex::default(),
                statistics: Mutex::default(),
                finding: AtomicU8::new(Finding::Fine.to_byte()),
                held: Mutex::default(),
                unsent: AtomicU64::new(0),
                port: Mutex::default(),
            });
            let place = book.reserve(number)?;
            link.put_port(RobotPort {
                robot: link.clone(),
                mouth: mouth.clone(),
                address: addresses.of(number)?,
                commander: Commander::new(
                    number,
                    link.key,
                    crate::archive::parquet::driven_wheels(&lab_robot.description),
                    place.epoch,
                    place.sequence,
                ),
                last_sequence: place.sequence.saturating_add(RESERVED_FRAMES - 1),
            });
            links.insert(number, link);
        }
        let link = Arc::new(Self {
            robots: links,
            feed: Feed::default(),
            strange: AtomicU64::new(0),
        });
        let receiver = link.clone();
        std::thread::Builder::new()
            .name("link-receive".to_owned())
            .spawn(move || receiver.receive(&socket))?;
        Ok(link)
    }

    /// All robots, by number.
    pub fn robots(&self) -> impl Iterator<Item = &Arc<RobotLink>> {
        self.robots.values()
    }

    /// The robot with this number.
    pub fn robot(&self, number: u8) -> Option<&Arc<RobotLink>> {
        self.robots.get(&number)
    }

    /// Telemetry from now on, for one control loop.
    pub fn listen(&self) -> Receiver<Telemetry> {
        self.feed.listen()
    }

    /// Datagrams that are for no robot of this laboratory, since the start.
    pub fn strange_datagrams(&self) -> u64 {
        self.strange.load(Ordering::Relaxed)
    }

    fn receive(&self, socket: &UdpSocket) {
        let mut buffer = [0; 512];
        // Each with when its statistics were last shown.
        let mut ears: BTreeMap<u8, (Ear, i64)> = BTreeMap::new();
        let mut ladders: BTreeMap<u8, Ladder> = BTreeMap::new();
        loop {
            let length = match socket.recv_from(&mut buffer) {
                Ok((length, _)) => length,
                // A robot that is off answers with "port unreachable"; it shows as offline by its silence.
                Err(error) => {
                    tracing::trace!(%error, "robot link");
                    continue;
                }
            };
            let arrival_us = monotonic_us();
            let bytes = buffer.get(..length).unwrap_or_default();
            let Some(robot) = addressed(bytes).and_then(|number| self.robots.get(&number)) else {
                self.strange.fetch_add(1, Ordering::Relaxed);
                continue;
            };
            let (ear, shown_us) = ears.entry(robot.number).or_insert_with(|| (Ear::default(), i64::MIN));
            let heard = ear.listen(bytes, &robot.key, arrival_us);
            // Quantiles cost more than a frame: not at every one of 120 a second.
            let is_motion = matches!(heard, Ok(Heard::Motion(_)));
            if !is_motion || arrival_us.saturating_sub(*shown_us) >= SHOWN_PERIOD_US {
                *shown_us = arrival_us;
                *lock(&robot.statistics) = ear.statistics();
            }
            let sample = match heard {
                Ok(Heard::Motion(sample)) => sample,
                Ok(Heard::Health(health)) => {
                    *lock(&robot.health) = Some((health, arrival_us));
                    let ladder = ladders.entry(robot.number).or_default();
                    robot.take_findings(ladder.report(&Findings::of(&health), arrival_us));
                    continue;
                }
                Ok(Heard::Counters(counters)) => {
                    *lock(&robot.counters) = Some(counters);
                    continue;
                }
                Err(refusal) => {
                    tracing::debug!(robot.id = %robot.name, %refusal, "frame refused");
                    continue;
                }
            };
            robot.heard_clock_ms.store(sample.robot_clock_ms, Ordering::Relaxed);
            *lock(&robot.newest) = Some(sample);
            self.feed.send(sample);
        }
    }
}

/// Robot number of a frame that is not checked yet.
fn addressed(bytes: &[u8]) -> Option<u8> {
    u8::from_str_radix(std::str::from_utf8(bytes.get(NUMBER_DIGITS)?).ok()?, 16).ok()
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl RobotLink {
    /// Newest telemetry, however old.
    pub fn newest(&self) -> Option<Telemetry> {
        *lock(&self.newest)
    }

    /// Newest health and its age; none from robots that do not tell.
    pub fn health(&self) -> Option<(Health, i64)> {
        lock(&self.health).map(|(health, arrival_us)| (health, monotonic_us() - arrival_us))
    }

    /// The gravest finding that counts now.
    pub fn finding(&self) -> Finding {
        Finding::from_byte(self.finding.load(Ordering::Acquire))
    }

    /// All that counts now; none from robots that do not tell.
    pub fn held(&self) -> Option<Held> {
        *lock(&self.held)
    }

    fn take_findings(&self, held: Held) {
        let before = Finding::from_byte(self.finding.swap(held.gravest.to_byte(), Ordering::AcqRel));
        *lock(&self.held) = Some(held);
        if before != held.gravest {
            tracing::warn!(robot.id = %self.name, finding = held.gravest.code(), "health");
        }
    }

    /// What it last said of the frames that it got, since its power-on; none before.
    pub fn counters(&self) -> Option<Counters> {
        *lock(&self.counters)
    }

    /// How well its frames come through, up to 0.1 s ago.
    pub fn statistics(&self) -> LinkStatistics {
        *lock(&self.statistics)
    }

    /// Frames to it that could not be sent, since the start.
    pub fn unsent(&self) -> u64 {
        self.unsent.load(Ordering::Relaxed)
    }

    /// Heard within the last half second.
    pub fn is_online(&self) -> bool {
        self.newest()
            .is_some_and(|telemetry| monotonic_us() - telemetry.arrival_us < ONLINE_US)
    }

    /// Its newest telemetry says that it obeys a stop.
    pub fn has_stopped(&self) -> bool {
        self.newest()
            .is_some_and(|telemetry| telemetry.status & STATUS_STOPPED != 0)
    }

    /// Takes the right to send; `None` while someone else has it.
    pub fn take_port(&self) -> Option<HeldPort> {
        lock(&self.port).take().map(HeldPort)
    }

    /// A run, or the way home, has the right to send.
    pub fn is_held(&self) -> bool {
        lock(&self.port).is_none()
    }

    fn put_port(&self, port: RobotPort) {
        *lock(&self.port) = Some(port);
    }

    /// Sends while nobody else has the right to; false when somebody has.
    pub fn send_idle(&self, still: Still, book: &Mutex<EpochBook>) -> bool {
        let mut port = lock(&self.port);
        let Some(port) = port.as_mut() else { return false };
        if port.commander.next_sequence() >= port.last_sequence {
            match lock(book).reserve(self.number) {
                Ok(place) if place.epoch == port.commander.epoch() => {
                    port.commander.begin_epoch(place.epoch, place.sequence);
                    port.last_sequence = place.sequence.saturating_add(RESERVED_FRAMES - 1);
                }
                Ok(_) => {}
                Err(error) => {
                    tracing::error!(robot.id = %self.name, %error, "sequence numbers cannot be reserved");
                    return false;
                }
            }
        }
        port.still(still, 0);
        true
    }
}
