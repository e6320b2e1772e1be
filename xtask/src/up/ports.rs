//! Ports of one running system.

use std::net::{Ipv4Addr, TcpListener, UdpSocket};

/// Robots n = 1.. listen on base + n; room for as many as an experiment may have.
const ROBOTS_MAX: u16 = 50;
/// Port above the base that is held to reserve the block.
const RESERVATION: u16 = 99;
const DEFAULT_ROBOT_UDP_BASE: u16 = 9000;
const DEFAULT_LAB_STOP: u16 = 8081;
/// Bases tried when the default is busy; below the range the kernel hands out by itself.
const OTHER_BASES: std::ops::Range<u16> = 100..300;

/// Ports of one running system.
#[derive(Debug)]
pub struct Ports {
    pub server: u16,
    pub lab_stop: u16,
    pub robot_udp_base: u16,
    /// A port above all robots: holding it keeps other systems away from the whole block.
    _reservation: Option<UdpSocket>,
}

impl Ports {
    /// The wanted port for the server, or words why not; free ones near the defaults for the rest.
    pub fn choose(wanted: u16) -> Result<Self, String> {
        let server = if wanted == 0 { any_tcp()? } else { wanted };
        if !tcp_is_free(server) {
            return Err(format!(
                "Port {server} is taken by another program: stop that one, or choose with --port N (--port 0 takes any free one)."
            ));
        }
        let default_stop = wanted != 0 && DEFAULT_LAB_STOP != server && tcp_is_free(DEFAULT_LAB_STOP);
        let lab_stop = if default_stop { DEFAULT_LAB_STOP } else { any_tcp()? };
        let first = (wanted != 0).then_some(DEFAULT_ROBOT_UDP_BASE);
        let (robot_udp_base, reservation) = robot_block(first)?;
        Ok(Self {
            server,
            lab_stop,
            robot_udp_base,
            _reservation: Some(reservation),
        })
    }
}

fn tcp_is_free(port: u16) -> bool {
    TcpListener::bind((Ipv4Addr::LOCALHOST, port)).is_ok()
}

fn any_tcp() -> Result<u16, String> {
    let address = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|listener| listener.local_addr());
    address
        .map(|address| address.port())
        .map_err(|error| format!("No free port on 127.0.0.1: {error}."))
}

/// A base with all its robots' ports free, and the socket that reserves it.
fn robot_block(first: Option<u16>) -> Result<(u16, UdpSocket), String> {
    // Systems started at the same moment begin at different places.
    let offset = (std::process::id() % u32::from(OTHER_BASES.end - OTHER_BASES.start)) as u16;
    let others = OTHER_BASES.map(|step| {
        let turned = OTHER_BASES.start + (step - OTHER_BASES.start + offset) % (OTHER_BASES.end - OTHER_BASES.start);
        turned * 100
    });
    let found = first
        .into_iter()
        .chain(others)
        .find_map(|base| reserve(base).map(|socket| (base, socket)));
    found.ok_or_else(|| "No block of free UDP ports for the robots on 127.0.0.1.".to_owned())
}

fn reserve(base: u16) -> Option<UdpSocket> {
    let bind = |port: u16| UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).ok();
    let reservation = bind(base + RESERVATION)?;
    // Groups of commands go to the base itself.
    (0..=ROBOTS_MAX)
        .all(|robot| bind(base + robot).is_some())
        .then_some(reservation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_busy_port_is_said_in_words() {
        let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = taken.local_addr().unwrap().port();
        let words = Ports::choose(port).unwrap_err();
        assert!(
            words.contains(&port.to_string()) && words.contains("--port 0"),
            "{words}"
        );
    }

    #[test]
    fn two_systems_get_ports_of_their_own() {
        let (first, second) = (Ports::choose(0).unwrap(), Ports::choose(0).unwrap());
        assert_ne!(first.robot_udp_base, second.robot_udp_base);
        assert_ne!(first.server, second.server);
        assert_ne!(first.server, first.lab_stop);
    }

    #[test]
    fn one_busy_robot_port_makes_the_whole_block_unusable() {
        let free = Ports::choose(0).unwrap();
        let base = free.robot_udp_base;
        drop(free);
        let _taken = UdpSocket::bind((Ipv4Addr::LOCALHOST, base + 7)).unwrap();
        assert!(reserve(base).is_none());
    }
}
