//! What a medium carries: a pure table that laboratory and emulator share.
//!
//! Time on air of a frame of `n` characters is `overhead + n / rate`; all robots share the channel, both ways:
//! ```text
//! occupancy = sum over frames per second of time on air,   it fits while occupancy <= usable share
//! ```
//! The usable share leaves room for retries and for whoever else is on the air. `docs/link.md` has the table.

/// What carries the frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MediumKind {
    /// No loss, no delay, no limit.
    Ideal,
    /// A network of a laboratory's own at 5 GHz, frames in the voice class.
    Wifi,
    /// The same with interference: bursts of loss.
    WifiBursty,
    /// 868/900 MHz mesh modems, 200 kbit/s on air.
    Digimesh,
    /// One 115 200-baud line, 8N1, to a modem or a bus that all robots hear.
    Serial,
}

/// Rate and costs of a medium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MediumProfile {
    pub kind: MediumKind,
    /// As on the command line.
    pub name: &'static str,
    /// Characters a second while a frame is on air; infinite for `ideal`.
    pub bytes_per_s: f64,
    /// Time on air that every frame costs besides its characters.
    pub frame_overhead_s: f64,
    /// Longest frame that it carries in one piece.
    pub max_frame_characters: usize,
    /// Share of the time that may be used.
    pub usable_share: f64,
}

const PROFILES: [MediumProfile; 5] = [
    MediumProfile {
        kind: MediumKind::Ideal,
        name: "ideal",
        bytes_per_s: f64::INFINITY,
        frame_overhead_s: 0.0,
        max_frame_characters: 1400,
        usable_share: 1.0,
    },
    // 48 Mbit/s at 5 GHz in the voice class: waiting (34 + 14 us), preamble and headers (44 us), acknowledgement (28 us) a frame.
    MediumProfile {
        kind: MediumKind::Wifi,
        name: "wifi",
        bytes_per_s: 6.0e6,
        frame_overhead_s: 120e-6,
        max_frame_characters: 1400,
        usable_share: 0.6,
    },
    MediumProfile {
        kind: MediumKind::WifiBursty,
        name: "wifi-bursty",
        bytes_per_s: 6.0e6,
        frame_overhead_s: 120e-6,
        max_frame_characters: 1400,
        usable_share: 0.6,
    },
    // 200 kbit/s on air; preamble, 27 bytes of headers and the turn-around about 2 ms a frame.
    MediumProfile {
        kind: MediumKind::Digimesh,
        name: "digimesh",
        bytes_per_s: 25_000.0,
        frame_overhead_s: 2e-3,
        max_frame_characters: 256,
        usable_share: 0.7,
    },
    // Ten bits a character and nothing else.
    MediumProfile {
        kind: MediumKind::Serial,
        name: "serial",
        bytes_per_s: 11_520.0,
        frame_overhead_s: 0.0,
        max_frame_characters: crate::frame::MAX_CHARACTERS,
        usable_share: 0.9,
    },
];

/// Frames that a laboratory and its robots want to send.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traffic {
    pub robots: usize,
    /// Commands a second to every robot.
    pub command_hz: f64,
    /// Robots in a group frame; 1 = a frame of its own for every robot.
    pub group: usize,
    /// Motion telemetry a second from every robot.
    pub telemetry_hz: f64,
    /// Health frames a second from every robot.
    pub health_hz: f64,
    /// Counter frames a second from every robot.
    pub counters_hz: f64,
    /// Fixes a second to every robot.
    pub fix_hz: f64,
}

/// Why traffic does not fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MediumError {
    /// Longer than one piece of this medium.
    FrameTooLong { characters: usize, most: usize },
    /// More time on air than there is.
    Occupied { share: f64, usable: f64 },
}

impl core::fmt::Display for MediumError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::FrameTooLong { characters, most } => {
                write!(
                    f,
                    "a frame of {characters} characters is longer than {most}; group fewer robots"
                )
            }
            Self::Occupied { share, usable } => {
                let (share, usable) = (100.0 * share, 100.0 * usable);
                write!(
                    f,
                    "the medium would be busy {share:.0} % of the time, at most {usable:.0} %; use fewer robots, a lower rate or group frames"
                )
            }
        }
    }
}

impl core::error::Error for MediumError {}

const COMMAND_CHARACTERS: usize = 82;
const TELEMETRY_CHARACTERS: usize = 154;
const HEALTH_CHARACTERS: usize = 114;
const COUNTERS_CHARACTERS: usize = 156;
const FIX_CHARACTERS: usize = 92;

/// Characters of a group frame.
pub const fn group_characters(robots: usize) -> usize {
    44 + 40 * robots
}

impl MediumProfile {
    pub fn of(kind: MediumKind) -> &'static Self {
        match kind {
            MediumKind::Ideal => &PROFILES[0],
            MediumKind::Wifi => &PROFILES[1],
            MediumKind::WifiBursty => &PROFILES[2],
            MediumKind::Digimesh => &PROFILES[3],
            MediumKind::Serial => &PROFILES[4],
        }
    }

    /// By its name on the command line.
    pub fn named(name: &str) -> Option<&'static Self> {
        PROFILES.iter().find(|profile| profile.name == name)
    }

    /// All media.
    pub fn all() -> &'static [Self] {
        &PROFILES
    }

    /// Time on air of one frame.
    pub fn frame_s(&self, characters: usize) -> f64 {
        self.frame_overhead_s + characters as f64 / self.bytes_per_s
    }

    /// Largest group whose frame this medium carries in one piece.
    pub fn largest_group(&self) -> usize {
        let room = self.max_frame_characters.saturating_sub(44) / 40;
        room.min(crate::frame::GROUP_MAX_ROBOTS)
    }

    /// Share of the time that the channel is busy, 0 to more than 1.
    pub fn occupancy(&self, traffic: &Traffic) -> f64 {
        let robots = traffic.robots as f64;
        let group = traffic.group.clamp(1, crate::frame::GROUP_MAX_ROBOTS);
        let command_s = if group == 1 {
            robots * self.frame_s(COMMAND_CHARACTERS)
        } else {
            let (full, rest) = (traffic.robots / group, traffic.robots % group);
            let last_s = if rest > 0 {
                self.frame_s(group_characters(rest))
            } else {
                0.0
            };
            full as f64 * self.frame_s(group_characters(group)) + last_s
        };
        traffic.command_hz * command_s
            + robots
                * (traffic.telemetry_hz * self.frame_s(TELEMETRY_CHARACTERS)
                    + traffic.health_hz * self.frame_s(HEALTH_CHARACTERS)
                    + traffic.counters_hz * self.frame_s(COUNTERS_CHARACTERS)
                    + traffic.fix_hz * self.frame_s(FIX_CHARACTERS))
    }

    /// Bytes a second of this traffic, whatever the medium.
    pub fn bytes_per_s(traffic: &Traffic) -> f64 {
        let plain = Self {
            bytes_per_s: 1.0,
            frame_overhead_s: 0.0,
            ..PROFILES[0]
        };
        plain.occupancy(traffic)
    }

    /// Whether the medium carries this traffic. A laboratory asks before it takes a run.
    pub fn check(&self, traffic: &Traffic) -> Result<f64, MediumError> {
        let group = traffic
            .group
            .clamp(1, crate::frame::GROUP_MAX_ROBOTS)
            .min(traffic.robots.max(1));
        let longest = if group > 1 {
            group_characters(group)
        } else {
            COMMAND_CHARACTERS
        };
        let characters = longest.max(if traffic.telemetry_hz > 0.0 {
            TELEMETRY_CHARACTERS
        } else {
            0
        });
        if characters > self.max_frame_characters {
            return Err(MediumError::FrameTooLong {
                characters,
                most: self.max_frame_characters,
            });
        }
        let share = self.occupancy(traffic);
        if share > self.usable_share {
            Err(MediumError::Occupied {
                share,
                usable: self.usable_share,
            })
        } else {
            Ok(share)
        }
    }

    /// Most robots that fit with everything else of the traffic as it is, at most 250.
    pub fn most_robots(&self, traffic: &Traffic) -> usize {
        (1..=250)
            .take_while(|robots| {
                self.check(&Traffic {
                    robots: *robots,
                    ..*traffic
                })
                .is_ok()
            })
            .last()
            .unwrap_or(0)
    }
}

impl Traffic {
    /// What the reference laboratory sends at a control rate: commands and motion telemetry at that rate, health at 10 Hz.
    pub fn at_rate(robots: usize, rate_hz: f64, group: usize) -> Self {
        Self {
            robots,
            command_hz: rate_hz,
            group,
            telemetry_hz: rate_hz,
            health_hz: 10.0,
            counters_hz: 1.0,
            fix_hz: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_serial_line_by_hand() {
        let serial = MediumProfile::named("serial").unwrap();
        // One robot at 30 Hz: 30 (82 + 154) + 10 * 114 + 156 = 8376 bytes of 11 520.
        let traffic = Traffic::at_rate(1, 30.0, 1);
        assert!((MediumProfile::bytes_per_s(&traffic) - 8376.0).abs() < 1e-9);
        assert!((serial.occupancy(&traffic) - 8376.0 / 11_520.0).abs() < 1e-12);
        assert!(serial.check(&traffic).is_ok());
        assert!(matches!(
            serial.check(&Traffic::at_rate(1, 120.0, 1)),
            Err(MediumError::Occupied { share, .. }) if share > 2.0
        ));
    }

    #[test]
    fn groups_save_and_must_fit_in_one_piece() {
        let digimesh = MediumProfile::named("digimesh").unwrap();
        assert_eq!(digimesh.largest_group(), 5);
        assert!(matches!(
            digimesh.check(&Traffic::at_rate(6, 5.0, 6)),
            Err(MediumError::FrameTooLong {
                characters: 284,
                most: 256
            })
        ));
        // Five robots: one frame of 244 characters instead of five of 82; a sixth goes in a frame of its own.
        let (single, grouped) = (Traffic::at_rate(6, 10.0, 1), Traffic::at_rate(6, 10.0, 5));
        let saved_s = digimesh.occupancy(&single) - digimesh.occupancy(&grouped);
        let by_hand_s = 10.0 * (6.0 * (2e-3 + 82.0 / 25e3) - (2e-3 + 244.0 / 25e3) - (2e-3 + 84.0 / 25e3));
        assert!((saved_s - by_hand_s).abs() < 1e-12);
    }

    #[test]
    fn the_most_robots_fit_and_one_more_does_not() {
        for profile in MediumProfile::all() {
            for rate_hz in [10.0, 30.0, 60.0, 120.0] {
                for group in [1, profile.largest_group()] {
                    let traffic = Traffic::at_rate(0, rate_hz, group);
                    let most = profile.most_robots(&traffic);
                    assert!(
                        most == 0
                            || profile
                                .check(&Traffic {
                                    robots: most,
                                    ..traffic
                                })
                                .is_ok()
                    );
                    assert!(
                        most == 250
                            || profile
                                .check(&Traffic {
                                    robots: most + 1,
                                    ..traffic
                                })
                                .is_err()
                    );
                }
            }
        }
    }

    #[test]
    fn lengths_are_those_of_the_frames() {
        use crate::frame::{
            Command, Counters, Fix, Header, Health, Telemetry, encode_command, encode_counters, encode_fix,
            encode_health, encode_telemetry,
        };
        let (header, key) = (Header::default(), crate::key::Key::new([0; 16]));
        let (mut down, mut up) = ([0; 96], [0; 160]);
        assert_eq!(
            encode_command(&header, &Command::default(), &key, &mut down),
            COMMAND_CHARACTERS
        );
        assert_eq!(encode_fix(&header, &Fix::default(), &key, &mut down), FIX_CHARACTERS);
        assert_eq!(
            encode_telemetry(&header, &Telemetry::default(), &key, &mut up),
            TELEMETRY_CHARACTERS
        );
        assert_eq!(
            encode_health(&header, &Health::default(), &key, &mut up),
            HEALTH_CHARACTERS
        );
        assert_eq!(
            encode_counters(&header, &Counters::default(), &key, &mut up),
            COUNTERS_CHARACTERS
        );
    }
}
