//! The robots' end of the link: one UDP port per robot.

use crate::laboratory::Laboratory;
use crate::unit::Reception;
use robot::frame::TELEMETRY_MAX_CHARACTERS;
use std::io::{self, ErrorKind};
use std::net::{IpAddr, SocketAddr, UdpSocket};

/// Frames that a robot reads at a time; the rest waits in the socket's buffer.
const MAX_FRAMES_PER_POLL: usize = 16;

/// All ports, in the order of the laboratory's robots.
#[derive(Debug)]
pub struct Link {
    ports: Vec<Port>,
}

#[derive(Debug)]
struct Port {
    socket: UdpSocket,
    commander: Option<SocketAddr>,
}

impl Link {
    /// Robot n listens on `base_port` + n.
    pub fn bind(address: IpAddr, base_port: u16, laboratory: &Laboratory) -> io::Result<Self> {
        let bind = |number: u8| {
            let port = base_port
                .checked_add(u16::from(number))
                .ok_or_else(|| io::Error::other(format!("no UDP port {base_port} + {number}")))?;
            let place = SocketAddr::new(address, port);
            let socket = UdpSocket::bind(place)
                .map_err(|error| io::Error::new(error.kind(), format!("robot {number} on {place}: {error}")))?;
            socket.set_nonblocking(true)?;
            Ok(Port {
                socket,
                commander: None,
            })
        };
        let ports = laboratory
            .units()
            .iter()
            .map(|unit| bind(unit.robot().number))
            .collect::<io::Result<_>>()?;
        Ok(Self { ports })
    }

    /// Hands waiting frames to the firmware. `clock_us` is read anew for every frame.
    pub fn receive(&mut self, laboratory: &mut Laboratory, clock_us: impl Fn() -> i64) {
        let mut buffer = [0; 512];
        for (index, port) in self.ports.iter_mut().enumerate() {
            let Some(unit) = laboratory.unit_mut(index) else {
                continue;
            };
            for _ in 0..MAX_FRAMES_PER_POLL {
                let (length, sender) = match port.socket.recv_from(&mut buffer) {
                    Ok(received) => received,
                    Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                    // A port unreachable message for an earlier answer: the laboratory has gone.
                    Err(error) => {
                        tracing::debug!(%error, robot.number = unit.robot().number, "receive");
                        continue;
                    }
                };
                let frame = buffer.get(..length).unwrap_or_default();
                match unit.receive(frame, clock_us()) {
                    Reception::Commander => port.commander = Some(sender),
                    Reception::Probe => {
                        let mut out = [0; TELEMETRY_MAX_CHARACTERS];
                        let length = unit.probe_reply(clock_us(), &mut out);
                        port.send(out.get(..length).unwrap_or_default(), sender);
                    }
                    Reception::Nothing => {}
                }
            }
        }
    }

    /// Sends one telemetry frame of every robot that has a commander.
    pub fn send_telemetry(&mut self, laboratory: &mut Laboratory, clock_us: impl Fn() -> i64) {
        for (index, port) in self.ports.iter().enumerate() {
            if let (Some(commander), Some(unit)) = (port.commander, laboratory.unit_mut(index)) {
                let mut out = [0; TELEMETRY_MAX_CHARACTERS];
                let length = unit.telemetry(clock_us(), &mut out);
                port.send(out.get(..length).unwrap_or_default(), commander);
            }
        }
    }
}

impl Port {
    fn send(&self, characters: &[u8], to: SocketAddr) {
        if !characters.is_empty()
            && let Err(error) = self.socket.send_to(characters, to)
        {
            tracing::debug!(%error, %to, "telemetry not sent");
        }
    }
}
