//! Where robots listen: a host with one port after the other, places of their own, and an address for groups.

use std::collections::BTreeMap;
use std::io;
use std::net::{SocketAddr, ToSocketAddrs};
use std::str::FromStr;

/// Place of one robot, `NUMBER=HOST` or `NUMBER=HOST:PORT`, as a flag has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnPlace {
    number: u8,
    place: Place,
}

/// `HOST` or `HOST:PORT`; IPv6 with a port in brackets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    host: String,
    port: Option<u16>,
}

/// Where every robot of the laboratory is reached.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotAddresses {
    base: SocketAddr,
    own: BTreeMap<u8, SocketAddr>,
    groups: Option<SocketAddr>,
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(address) = text.parse::<SocketAddr>() {
            return Ok(Self {
                host: address.ip().to_string(),
                port: Some(address.port()),
            });
        }
        // An IPv6 address without a port has colons of its own.
        let (host, port) = match text.rsplit_once(':') {
            Some((host, port)) if !host.contains(':') => {
                let number = port.parse().ok().filter(|port| *port > 0);
                (host, Some(number.ok_or_else(|| format!("{port:?} is no UDP port"))?))
            }
            _ => (text, None),
        };
        if host.is_empty() {
            return Err("the host is missing".to_owned());
        }
        Ok(Self {
            host: host.to_owned(),
            port,
        })
    }
}

impl FromStr for OwnPlace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, place) = text.split_once('=').ok_or("write NUMBER=HOST or NUMBER=HOST:PORT")?;
        let number = number.trim().parse().ok().filter(|number| (1..=250).contains(number));
        Ok(Self {
            number: number.ok_or("robots have numbers from 1 to 250")?,
            place: place.trim().parse()?,
        })
    }
}

impl Place {
    /// First address of the host that is of the wanted kind.
    fn resolve(&self, port: u16, ipv4: Option<bool>) -> io::Result<SocketAddr> {
        let mut found = (self.host.as_str(), self.port.unwrap_or(port))
            .to_socket_addrs()
            .map_err(|error| io::Error::new(error.kind(), format!("host {}: {error}", self.host)))?;
        found
            .find(|address| ipv4.is_none_or(|ipv4| address.is_ipv4() == ipv4))
            .ok_or_else(|| {
                let kind = match ipv4 {
                    Some(true) => "IPv4 ",
                    Some(false) => "IPv6 ",
                    None => "",
                };
                io::Error::other(format!("host {} has no {kind}address", self.host))
            })
    }
}

impl RobotAddresses {
    /// Robot `n` listens on port `base + n` of the base's host; groups are not sent.
    pub const fn at(base: SocketAddr) -> Self {
        Self {
            base,
            own: BTreeMap::new(),
            groups: None,
        }
    }

    /// - `host`, `base`: of robots without a place of their own.
    /// - `groups`: where frames for several robots go, most often a broadcast address; port `base` unless it says another.
    /// - Errors: a host without an address, or with none of the kind (IPv4, IPv6) of `host`: one socket sends to all.
    pub fn resolve(host: &str, base: u16, own: &[OwnPlace], groups: Option<&Place>) -> io::Result<Self> {
        let all = Place {
            host: host.to_owned(),
            port: None,
        };
        let base = all.resolve(base, None)?;
        let ipv4 = Some(base.is_ipv4());
        let mut addresses = Self::at(base);
        for OwnPlace { number, place } in own {
            let address = place.resolve(addresses.usual_port(*number)?, ipv4)?;
            if addresses.own.insert(*number, address).is_some() {
                return Err(io::Error::other(format!("robot {number} has two addresses")));
            }
        }
        addresses.groups = groups.map(|place| place.resolve(base.port(), ipv4)).transpose()?;
        Ok(addresses)
    }

    fn usual_port(&self, number: u8) -> io::Result<u16> {
        let port = self.base.port().checked_add(u16::from(number));
        port.ok_or_else(|| io::Error::other("robot port beyond 65535"))
    }

    /// Where this robot listens.
    pub fn of(&self, number: u8) -> io::Result<SocketAddr> {
        match self.own.get(&number) {
            Some(address) => Ok(*address),
            None => Ok(SocketAddr::new(self.base.ip(), self.usual_port(number)?)),
        }
    }

    /// Robots with a place of their own.
    pub fn own(&self) -> impl Iterator<Item = u8> {
        self.own.keys().copied()
    }

    /// Where groups go; none = every robot gets frames of its own.
    pub const fn groups(&self) -> Option<SocketAddr> {
        self.groups
    }

    pub const fn is_ipv4(&self) -> bool {
        self.base.is_ipv4()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_without_a_place_of_their_own_stand_at_the_base_and_the_others_where_they_say() {
        let own: Vec<OwnPlace> = ["3=10.0.0.3", "4=10.0.0.4:7000"]
            .map(|text| text.parse().expect("a place"))
            .into();
        let groups: Place = "10.0.0.255".parse().expect("a place");
        let addresses = RobotAddresses::resolve("127.0.0.1", 9000, &own, Some(&groups)).expect("addresses");
        let of = |number| addresses.of(number).expect("an address").to_string();
        assert_eq!(
            [of(1), of(3), of(4)],
            ["127.0.0.1:9001", "10.0.0.3:9003", "10.0.0.4:7000"]
        );
        assert_eq!(
            addresses.groups().map(|address| address.to_string()).as_deref(),
            Some("10.0.0.255:9000")
        );
        assert_eq!(addresses.own().collect::<Vec<_>>(), [3, 4]);
        let without = RobotAddresses::resolve("127.0.0.1", 9000, &[], None).expect("addresses");
        assert_eq!(without.groups(), None);
    }

    #[test]
    fn a_wrong_flag_is_told_in_words() {
        for wrong in [
            "10.0.0.3",
            "0=10.0.0.3",
            "251=h",
            "x=h",
            "3=",
            "3=h:0",
            "3=h:70000",
            "3=:9003",
        ] {
            assert!(wrong.parse::<OwnPlace>().is_err(), "{wrong}");
        }
        let six: OwnPlace = "3=[::1]:9003".parse().expect("IPv6 with a port");
        assert_eq!(six.place.port, Some(9003));
        let bare: Place = "fe80::1".parse().expect("IPv6 without a port");
        assert_eq!((bare.host.as_str(), bare.port), ("fe80::1", None));
        let mixed = RobotAddresses::resolve("127.0.0.1", 9000, &[six], None).expect_err("one socket");
        assert!(mixed.to_string().contains("no IPv4 address"), "{mixed}");
        let twice = [
            "3=10.0.0.3".parse().expect("a place"),
            "3=10.0.0.4".parse().expect("a place"),
        ];
        assert!(RobotAddresses::resolve("127.0.0.1", 9000, &twice, None).is_err());
        assert!(RobotAddresses::at(([127, 0, 0, 1], 65_530).into()).of(6).is_err());
    }
}
