//! The robot link: command frames out, telemetry in. Only a [`SafeCommand`] can make a robot move.

use crate::clock::monotonic_us;
use crate::clock_map::{ClockMap, link_clock_ms};
use crate::epochs::{EpochBook, RESERVED_FRAMES};
use crate::feed::Feed;
use crate::record::{LINK_WHEELS, Telemetry};
use api::robot::LabRobot;
use control::safety::SafeCommand;
use robot::frame::{self, COMMAND_MAX_CHARACTERS, Header, Payload, Status};
use robot::key::Key;
use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A robot that was silent for longer is offline.
pub const ONLINE_US: i64 = 500_000;
/// Telemetry that repeats or goes back by up to this many frames is a copy or was overtaken; more is a restart.
const REORDER_FRAMES: i32 = 1000;
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
    /// Positions in `wheels` of the driven wheels: the order of the link.
    driven: Vec<usize>,
    /// Robot's clock in its newest frame, to be echoed.
    heard_clock_ms: AtomicU32,
    newest: Mutex<Option<Telemetry>>,
    /// Right to send; a run takes it out.
    port: Mutex<Option<RobotPort>>,
}

/// The right to send to one robot under one epoch. Exists once per robot.
#[derive(Debug)]
pub struct RobotPort {
    robot: Arc<RobotLink>,
    socket: Arc<UdpSocket>,
    address: SocketAddr,
    epoch: u32,
    next_sequence: u32,
    last_sequence: u32,
}

/// A frame without motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Still {
    /// Ramp to zero and stay awake.
    Rest,
    /// As `Rest`, and clear a latch.
    Release,
    /// Ramp to zero and latch: the protective stop.
    Latch,
}

/// What went out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sent {
    pub at_us: i64,
    pub sequence: u32,
    pub enable: bool,
    /// In the resolution of the link.
    pub wheel_rad_per_s: [f64; LINK_WHEELS],
    pub steering_rad: f64,
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
                driven: crate::archive::parquet::driven_wheels(&lab_robot.description),
                heard_clock_ms: AtomicU32::new(0),
                newest: Mutex::default(),
                port: Mutex::default(),
            });
            let place = book.reserve(number)?;
            link.put_port(RobotPort {
                robot: link.clone(),
                socket: socket.clone(),
                address: SocketAddr::new(base.ip(), port),
                epoch: place.epoch,
                next_sequence: place.sequence,
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
        let mut clocks: BTreeMap<u8, (ClockMap, Option<u32>)> = BTreeMap::new();
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
            let (header, telemetry) = match frame::decode(bytes, &robot.key) {
                Ok(frame::Frame {
                    header,
                    payload: Payload::Telemetry(telemetry),
                }) => (header, telemetry),
                Ok(_) => continue,
                Err(error) => {
                    tracing::debug!(robot.id = %robot.name, %error, "frame refused");
                    continue;
                }
            };
            let (clock, last) = clocks.entry(robot.number).or_default();
            let step = last.map_or(1, |last| header.sequence.wrapping_sub(last).cast_signed());
            if step <= 0 && step > -REORDER_FRAMES {
                continue;
            }
            *last = Some(header.sequence);
            robot.heard_clock_ms.store(header.clock_ms, Ordering::Relaxed);
            let mapped = clock.observe(header.clock_ms, header.echo_ms, arrival_us);
            let sample = Telemetry {
                robot: robot.number,
                arrival_us,
                sample_us: mapped.at_us,
                sample_bound_us: mapped.bound_us,
                robot_clock_ms: header.clock_ms,
                status: status_bits(telemetry.status),
                applied_sequence: telemetry.applied_sequence,
                wheel_rad_per_s: telemetry.wheel_rad_per_s,
                wheel_rad: telemetry.wheel_rad,
                current_a: telemetry.current_a,
                bus_v: telemetry.bus_v,
                gyro_z_rad_per_s: telemetry.gyro_z_rad_per_s,
                accel_m_per_s2: telemetry.accel_m_per_s2,
                steering_rad: telemetry.steering_rad,
            };
            *lock(&robot.newest) = Some(sample);
            self.feed.send(sample);
        }
    }
}

/// Bit of the status byte: latched off.
pub const STATUS_LATCHED: u8 = 1 << 2;
/// Bit of the status byte: the robot knows the laboratory's clock and accepts commands.
pub const STATUS_CLOCK_KNOWN: u8 = 1 << 3;

fn status_bits(status: Status) -> u8 {
    let bits = [
        status.running,
        status.ramping,
        status.latched,
        status.clock_known,
        status.stopped,
        status.saturated,
    ];
    bits.iter()
        .enumerate()
        .fold(0, |byte, (place, set)| byte | u8::from(*set) << place)
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

    /// Heard within the last half second.
    pub fn is_online(&self) -> bool {
        self.newest()
            .is_some_and(|telemetry| monotonic_us() - telemetry.arrival_us < ONLINE_US)
    }

    /// Takes the right to send; `None` while someone else has it.
    pub fn take_port(&self) -> Option<HeldPort> {
        lock(&self.port).take().map(HeldPort)
    }

    fn put_port(&self, port: RobotPort) {
        *lock(&self.port) = Some(port);
    }

    /// Sends while nobody else has the right to; false when somebody has.
    pub fn send_idle(&self, still: Still, book: &Mutex<EpochBook>) -> bool {
        let mut port = lock(&self.port);
        let Some(port) = port.as_mut() else { return false };
        if port.next_sequence >= port.last_sequence {
            match lock(book).reserve(self.number) {
                Ok(place) if place.epoch == port.epoch => {
                    port.next_sequence = place.sequence;
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
        self.epoch = epoch;
        self.next_sequence = 1;
        self.last_sequence = RESERVED_FRAMES;
    }

    /// Sends a command of the safety filter.
    pub fn drive(&mut self, command: &SafeCommand, tick: u32) -> Sent {
        let wheels = command.wheel_command();
        let mut wheel_rad_per_s = [0.0; LINK_WHEELS];
        for (place, wheel) in wheel_rad_per_s.iter_mut().zip(&self.robot.driven) {
            *place = wheels.wheel_rad_per_s.get(*wheel).copied().unwrap_or(0.0);
        }
        self.send(
            frame::Command {
                enable: true,
                stop: false,
                clear: false,
                wheel_rad_per_s,
                steering_rad: wheels.steering_rad,
            },
            tick,
        )
    }

    /// Sends a frame without motion.
    pub fn still(&mut self, still: Still, tick: u32) -> Sent {
        let command = frame::Command {
            stop: still == Still::Latch,
            clear: still == Still::Release,
            ..frame::Command::default()
        };
        self.send(command, tick)
    }

    fn send(&mut self, command: frame::Command, tick: u32) -> Sent {
        let sequence = self.next_sequence;
        self.next_sequence = sequence.saturating_add(1);
        let at_us = monotonic_us();
        let header = Header {
            robot: self.robot.number,
            epoch: self.epoch,
            sequence,
            tick,
            clock_ms: link_clock_ms(at_us),
            echo_ms: self.robot.heard_clock_ms.load(Ordering::Relaxed),
        };
        let mut buffer = [0; COMMAND_MAX_CHARACTERS];
        let length = frame::encode_command(&header, &command, &self.robot.key, &mut buffer);
        // A frame that cannot be sent is a lost frame: the robot's watchdog and the silence limits deal with those.
        let _lost = self
            .socket
            .send_to(buffer.get(..length).unwrap_or_default(), self.address);
        let sent = match frame::decode(buffer.get(..length).unwrap_or_default(), &self.robot.key) {
            Ok(frame::Frame {
                payload: Payload::Command(sent),
                ..
            }) => sent,
            _ => command,
        };
        Sent {
            at_us,
            sequence,
            enable: command.enable,
            wheel_rad_per_s: sent.wheel_rad_per_s,
            steering_rad: sent.steering_rad,
        }
    }
}
