//! The robots' end of the link: one UDP port per robot, one for groups, and the medium in front of the firmware.

use crate::clock;
use crate::laboratory::Laboratory;
use crate::medium::{Arrival, Hop, Medium, Way};
use crate::receiver::{Datagram, DatagramReceiver};
use crate::unit::{Reception, Unit};
use robot::frame::TELEMETRY_MAX_CHARACTERS;
use robot::medium::MediumKind;
use std::io;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::Arc;

/// Arrivals are dealt with in a batch at least this often.
const BATCH_US: i64 = 500;
/// Telemetry frames from one health frame to the next, and to the next counters.
const HEALTH_EVERY: u64 = 12;
const COUNTERS_EVERY: u64 = 120;

/// All ports, in the order of the laboratory's robots.
#[derive(Debug)]
pub struct Link {
    ports: Vec<Port>,
    receiver: DatagramReceiver,
    medium: Medium<SocketAddr>,
    rounds: u64,
}

#[derive(Debug)]
struct Port {
    socket: Arc<UdpSocket>,
    commander: Option<SocketAddr>,
}

impl Link {
    /// Robot n listens on `base_port` + n; groups come in on `base_port` itself.
    pub fn bind(
        address: IpAddr,
        base_port: u16,
        laboratory: &Laboratory,
        medium: MediumKind,
        seed: u64,
    ) -> io::Result<Self> {
        let bind = |number: u8| {
            let port = base_port
                .checked_add(u16::from(number))
                .ok_or_else(|| io::Error::other(format!("no UDP port {base_port} + {number}")))?;
            let place = SocketAddr::new(address, port);
            let socket = UdpSocket::bind(place)
                .map_err(|error| io::Error::new(error.kind(), format!("robot {number} on {place}: {error}")))?;
            socket.set_nonblocking(true)?;
            Ok(Arc::new(socket))
        };
        let sockets = laboratory
            .units()
            .iter()
            .map(|unit| bind(unit.robot().number))
            .collect::<io::Result<Vec<_>>>()?;
        let mut heard = sockets.clone();
        match bind(0) {
            Ok(socket) => heard.push(socket),
            Err(error) => tracing::warn!(%error, "groups cannot be heard"),
        }
        Ok(Self {
            ports: sockets
                .into_iter()
                .map(|socket| Port {
                    socket,
                    commander: None,
                })
                .collect(),
            receiver: DatagramReceiver::start(heard)?,
            medium: Medium::new(medium, seed),
            rounds: 0,
        })
    }

    /// Deals with frames until `deadline_us` of the host's clock.
    pub fn run_until(&mut self, deadline_us: i64, laboratory: &mut Laboratory) {
        loop {
            let now_us = clock::monotonic_us();
            self.carry(now_us, laboratory);
            if now_us >= deadline_us {
                return;
            }
            let next_us = self
                .medium
                .next_us()
                .map_or(deadline_us, |next_us| next_us.max(now_us + BATCH_US));
            clock::sleep_until(next_us.min(deadline_us));
            if clock::end_requested() {
                return;
            }
        }
    }

    /// Takes what has come in and delivers what has arrived.
    pub fn carry(&mut self, now_us: i64, laboratory: &mut Laboratory) {
        while let Some(datagram) = self.receiver.take() {
            self.put_on_air(&datagram, laboratory);
        }
        while let Some(arrival) = self.medium.arrived(now_us) {
            match arrival.way {
                Way::Down => self.deliver(&arrival, laboratory),
                Way::Up => self.send(&arrival),
            }
        }
    }

    fn put_on_air(&mut self, datagram: &Datagram, laboratory: &Laboratory) {
        let hop = |(robot, unit): (usize, &Unit)| Hop {
            robot,
            way: Way::Down,
            impairment: unit.faults().impairment,
        };
        let units = || laboratory.units().iter().enumerate();
        let hops: Vec<_> = if datagram.port < self.ports.len() {
            units().filter(|(robot, _)| *robot == datagram.port).map(hop).collect()
        } else {
            units().map(hop).collect()
        };
        self.medium
            .send(datagram.at_us, &datagram.characters, &datagram.sender, &hops);
    }

    fn deliver(&mut self, arrival: &Arrival<SocketAddr>, laboratory: &mut Laboratory) {
        let (Some(unit), Some(port)) = (laboratory.unit_mut(arrival.robot), self.ports.get_mut(arrival.robot)) else {
            return;
        };
        match unit.receive(&arrival.characters, arrival.at_us) {
            Reception::Commander => port.commander = Some(arrival.peer),
            Reception::Probe => {
                let mut out = [0; TELEMETRY_MAX_CHARACTERS];
                let length = unit.probe_reply(arrival.at_us, &mut out);
                let hop = answer(arrival.robot, unit);
                let characters = out.get(..length).unwrap_or_default();
                if !characters.is_empty() {
                    self.medium.send(arrival.at_us, characters, &arrival.peer, &[hop]);
                }
            }
            Reception::Nothing => {}
        }
    }

    /// Sends telemetry of every robot that has a commander: motion each time, health and counters less often.
    pub fn send_telemetry(&mut self, laboratory: &mut Laboratory, clock_us: impl Fn() -> i64) {
        self.rounds += 1;
        for (index, port) in self.ports.iter().enumerate() {
            let (Some(commander), Some(unit)) = (port.commander, laboratory.unit_mut(index)) else {
                continue;
            };
            let hop = answer(index, unit);
            let mut out = [0; TELEMETRY_MAX_CHARACTERS];
            let round = self.rounds + index as u64;
            let mut put = |length: usize, out: &[u8; TELEMETRY_MAX_CHARACTERS]| {
                let characters = out.get(..length).unwrap_or_default();
                if !characters.is_empty() {
                    self.medium.send(clock_us(), characters, &commander, &[hop]);
                }
            };
            let length = unit.telemetry(clock_us(), &mut out);
            put(length, &out);
            if round.is_multiple_of(HEALTH_EVERY) {
                let length = unit.health_report(clock_us(), &mut out);
                put(length, &out);
            }
            if round.is_multiple_of(COUNTERS_EVERY) {
                let length = unit.counters_report(clock_us(), &mut out);
                put(length, &out);
            }
        }
    }

    fn send(&self, arrival: &Arrival<SocketAddr>) {
        if let Some(port) = self.ports.get(arrival.robot)
            && let Err(error) = port.socket.send_to(&arrival.characters, arrival.peer)
        {
            tracing::debug!(%error, to = %arrival.peer, "telemetry not sent");
        }
    }
}

fn answer(robot: usize, unit: &Unit) -> Hop {
    Hop {
        robot,
        way: Way::Up,
        impairment: unit.faults().impairment,
    }
}
