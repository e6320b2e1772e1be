//! The robot link: command frames out, telemetry in. Only a [`SafeCommand`] can make a robot move.

use crate::chorus::GroupFrame;
use crate::clock::monotonic_us;
use crate::commander::{CommandPart, Commander, Order, Sent, Still};
use crate::ear::{Ear, Heard, STATUS_STOPPED};
use crate::epochs::{EpochBook, RESERVED_FRAMES};
use crate::feed::Feed;
use crate::ladder::{Finding, Findings, Held, Ladder};
use crate::link_statistics::LinkStatistics;
use crate::record::Telemetry;
use api::robot::LabRobot;
use control::safety::SafeCommand;
use robot::frame::Health;
use robot::key::Key;
use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A robot that was silent for longer is offline.
pub const ONLINE_US: i64 = 500_000;
/// Where the robot number stands in a frame: after `:`, version and type.
const NUMBER_DIGITS: std::ops::Range<usize> = 5..7;

/// The link to all robots of the laboratory.
#[derive(Debug)]
pub struct Link {
    robots: BTreeMap<u8, Arc<RobotLink>>,
    feed: Feed<Telemetry>,
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
    statistics: Mutex<LinkStatistics>,
    /// The gravest finding that counts now, for the control loop, which takes no lock.
    finding: AtomicU8,
    held: Mutex<Option<Held>>,
    /// Right to send; a run takes it out.
    port: Mutex<Option<RobotPort>>,
}

/// The right to send to one robot under one epoch. Exists once per robot.
#[derive(Debug)]
pub struct RobotPort {
    robot: Arc<RobotLink>,
    socket: Arc<UdpSocket>,
    address: SocketAddr,
    commander: Commander,
    last_sequence: u32,
}

impl Link {
    /// Binds one socket for all robots and starts receiving.
    ///
    /// - `base`: robot `n` listens on UDP port `base + n`.
    pub fn start(
        robots: &[LabRobot],
        keys: &BTreeMap<u8, Key>,
        base: SocketAddr,
        book: &mut EpochBook,
    ) -> io::Result<Arc<Self>> {
        let any = if base.is_ipv4() {
            IpAddr::from([0, 0, 0, 0])
        } else {
            IpAddr::from([0_u16; 8])
        };
        let socket = Arc::new(UdpSocket::bind(SocketAddr::new(any, 0))?);
        let mut links = BTreeMap::new();
        for lab_robot in robots {
            let number = lab_robot.number;
            let missing = || io::Error::other(format!("no link key for robot {number}"));
            let port = base
                .port()
                .checked_add(u16::from(number))
                .ok_or_else(|| io::Error::other("robot port beyond 65535"))?;
            let link = Arc::new(RobotLink {
                number,
                name: lab_robot.description.name.clone(),
                key: *keys.get(&number).ok_or_else(missing)?,
                heard_clock_ms: AtomicU32::new(0),
                newest: Mutex::default(),
                health: Mutex::default(),
                statistics: Mutex::default(),
                finding: AtomicU8::new(Finding::Fine.to_byte()),
                held: Mutex::default(),
                port: Mutex::default(),
            });
            let place = book.reserve(number)?;
            link.put_port(RobotPort {
                robot: link.clone(),
                socket: socket.clone(),
                address: SocketAddr::new(base.ip(), port),
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

    fn receive(&self, socket: &UdpSocket) {
        let mut buffer = [0; 512];
        let mut ears: BTreeMap<u8, Ear> = BTreeMap::new();
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
                continue;
            };
            let ear = ears.entry(robot.number).or_default();
            let sample = match ear.listen(bytes, &robot.key, arrival_us) {
                Ok(Heard::Motion(sample)) => sample,
                Ok(Heard::Health(health)) => {
                    *lock(&robot.health) = Some((health, arrival_us));
                    *lock(&robot.statistics) = ear.statistics();
                    let ladder = ladders.entry(robot.number).or_default();
                    robot.take_findings(ladder.report(&Findings::of(&health), arrival_us));
                    continue;
                }
                Ok(Heard::Counters(_)) => continue,
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

    /// How well its frames come through, at the last health frame.
    pub fn statistics(&self) -> LinkStatistics {
        *lock(&self.statistics)
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

/// A [`RobotPort`] that a run holds; it goes back when this is dropped, even by a panic.
#[derive(Debug)]
pub struct HeldPort(RobotPort);

impl Deref for HeldPort {
    type Target = RobotPort;

    fn deref(&self) -> &RobotPort {
        &self.0
    }
}

impl DerefMut for HeldPort {
    fn deref_mut(&mut self) -> &mut RobotPort {
        &mut self.0
    }
}

impl Drop for HeldPort {
    fn drop(&mut self) {
        let port = &self.0;
        port.robot.put_port(RobotPort {
            robot: port.robot.clone(),
            socket: port.socket.clone(),
            commander: port.commander.clone(),
            ..*port
        });
    }
}

impl RobotPort {
    /// The robot behind it.
    pub fn robot(&self) -> &Arc<RobotLink> {
        &self.robot
    }

    /// From now on frames carry this epoch, which [`EpochBook::begin`] opened for this robot.
    pub fn begin_epoch(&mut self, epoch: u32) {
        self.commander.begin_epoch(epoch, 1);
        self.last_sequence = RESERVED_FRAMES;
    }

    /// Sends a command of the safety filter.
    pub fn drive(&mut self, command: &SafeCommand, tick: u32) -> Sent {
        self.send(Order::Drive(command), tick)
    }

    /// Sends a frame without motion.
    pub fn still(&mut self, still: Still, tick: u32) -> Sent {
        self.send(Order::Still(still), tick)
    }

    /// The robot reads groups: it has sent a frame of a type that came with them.
    pub fn reads_groups(&self) -> bool {
        lock(&self.robot.health).is_some()
    }

    /// Epoch and sequence of the next frame.
    pub fn next_place(&self) -> (u32, u32) {
        (self.commander.epoch(), self.commander.next_sequence())
    }

    /// This robot's part of the group with `sequence`.
    pub fn part(&mut self, order: Order<'_>, sequence: u32) -> (CommandPart, Sent) {
        let heard_ms = self.robot.heard_clock_ms.load(Ordering::Relaxed);
        self.commander.part(order, sequence, monotonic_us(), heard_ms)
    }

    /// Sends a group to all robots at once.
    pub fn send_group(&self, group: &GroupFrame) {
        let base = SocketAddr::new(self.address.ip(), self.address.port() - u16::from(self.robot.number));
        let _lost = self.socket.send_to(group.as_bytes(), base);
    }

    fn send(&mut self, order: Order<'_>, tick: u32) -> Sent {
        let heard_ms = self.robot.heard_clock_ms.load(Ordering::Relaxed);
        let (frame, sent) = self.commander.frame(order, tick, monotonic_us(), heard_ms);
        // A frame that cannot be sent is a lost frame: the robot's watchdog and the silence limits deal with those.
        let _lost = self.socket.send_to(frame.as_bytes(), self.address);
        sent
    }
}
