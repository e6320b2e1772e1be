//! What a robot's state asks of the laboratory: a pure table, and a memory that keeps it from flapping.
//!
//! | finding | consequence |
//! |---|---|
//! | battery low | no new run; carried to the rack, or home, after this one |
//! | battery critical | the run ends in order, then the rack |
//! | motor blocked, sensor faulty, battery empty | stop at once; the robot has latched itself already |
//!
//! The most severe finding wins; of several that ask for the same, the later in [`Finding`] is named.

use api::health::BatteryLevel;
use robot::battery::Level;
use robot::frame::Health;

/// A finding is over when it was not seen for this long: longer than the robot's own dwell and than a loss burst.
pub const RELEASE_US: i64 = 5_000_000;

/// What is wrong, in rising severity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Finding {
    #[default]
    Fine,
    BatteryLow,
    BatteryCritical,
    Stalled,
    SensorFault,
    BatteryEmpty,
}

/// What follows, in rising severity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Consequence {
    None,
    NoNewRun,
    /// The run ends in order; the robot charges.
    EndRun,
    /// The run ends at once.
    Stop,
}

/// All that a robot reports at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Findings {
    pub battery: Level,
    pub stalled: bool,
    pub sensor_fault: bool,
}

impl Findings {
    pub fn of(health: &Health) -> Self {
        Self {
            battery: health.battery,
            stalled: health.stalled,
            sensor_fault: health.sensor_fault,
        }
    }

    /// The one that decides.
    pub fn gravest(&self) -> Finding {
        let battery = match self.battery {
            Level::Good => Finding::Fine,
            Level::Low => Finding::BatteryLow,
            Level::Critical => Finding::BatteryCritical,
            Level::Empty => Finding::BatteryEmpty,
        };
        let stalled = if self.stalled { Finding::Stalled } else { Finding::Fine };
        let sensor = if self.sensor_fault {
            Finding::SensorFault
        } else {
            Finding::Fine
        };
        battery.max(stalled).max(sensor)
    }
}

impl Finding {
    const ALL: [Self; 6] = [
        Self::Fine,
        Self::BatteryLow,
        Self::BatteryCritical,
        Self::Stalled,
        Self::SensorFault,
        Self::BatteryEmpty,
    ];

    pub fn consequence(self) -> Consequence {
        match self {
            Self::Fine => Consequence::None,
            Self::BatteryLow => Consequence::NoNewRun,
            Self::BatteryCritical => Consequence::EndRun,
            Self::Stalled | Self::SensorFault | Self::BatteryEmpty => Consequence::Stop,
        }
    }

    /// Charging is the remedy.
    pub fn is_of_battery(self) -> bool {
        matches!(self, Self::BatteryLow | Self::BatteryCritical | Self::BatteryEmpty)
    }

    /// Of the fault that a run ends with.
    pub fn code(self) -> &'static str {
        match self {
            Self::Fine => "fine",
            Self::BatteryLow => "battery_low",
            Self::BatteryCritical => "battery_critical",
            Self::Stalled => "motor_stalled",
            Self::SensorFault => "sensor_fault",
            Self::BatteryEmpty => "battery_empty",
        }
    }

    /// Sentence about a robot, without the full stop.
    pub fn words(self, robot: &str) -> String {
        match self {
            Self::Fine => format!("Robot {robot} is well"),
            Self::BatteryLow => format!("The battery of {robot} is low"),
            Self::BatteryCritical => format!("The battery of {robot} is almost empty, so the run ended and it charges"),
            Self::Stalled => format!("A motor of {robot} was driven hard and did not turn, so it stopped itself"),
            Self::SensorFault => format!("A sensor of {robot} gave values that cannot be, so it stopped itself"),
            Self::BatteryEmpty => format!("The battery of {robot} is empty, so it stopped itself"),
        }
    }

    /// For one atomic byte.
    pub fn to_byte(self) -> u8 {
        self as u8
    }

    /// Bytes that mean nothing are the worst.
    pub fn from_byte(byte: u8) -> Self {
        Self::ALL.get(usize::from(byte)).copied().unwrap_or(Self::BatteryEmpty)
    }
}

/// Worse counts at once, better only after [`RELEASE_US`] without the worse: neither one good report between bad ones, nor
/// a robot that was switched off and on, makes a robot fit. Silence changes nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Ladder {
    /// When each finding, by its place in the order, was last reported.
    seen_us: [Option<i64>; Finding::ALL.len()],
}

impl Ladder {
    /// Takes a report; times do not go back.
    pub fn report(&mut self, findings: &Findings, at_us: i64) -> Held {
        let gravest = findings.gravest();
        let battery = Findings {
            stalled: false,
            sensor_fault: false,
            ..*findings
        };
        let mut note = |finding: Finding| {
            if let Some(seen_us) = self.seen_us.get_mut(usize::from(finding.to_byte())) {
                *seen_us = Some(at_us);
            }
        };
        note(gravest);
        note(battery.gravest());
        if findings.stalled {
            note(Finding::Stalled);
        }
        if findings.sensor_fault {
            note(Finding::SensorFault);
        }
        self.held(at_us)
    }

    fn held(&self, now_us: i64) -> Held {
        let recent = |finding: &Finding| {
            let seen_us = self.seen_us.get(usize::from(finding.to_byte())).copied().flatten();
            seen_us.is_some_and(|seen_us| now_us - seen_us < RELEASE_US)
        };
        let worst = |among: &[Finding]| among.iter().copied().filter(recent).max().unwrap_or_default();
        let battery = worst(&[Finding::BatteryLow, Finding::BatteryCritical, Finding::BatteryEmpty]);
        Held {
            gravest: worst(&Finding::ALL),
            battery: match battery {
                Finding::BatteryEmpty => BatteryLevel::Empty,
                Finding::BatteryCritical => BatteryLevel::Critical,
                Finding::BatteryLow => BatteryLevel::Low,
                _ => BatteryLevel::Good,
            },
            stalled: recent(&Finding::Stalled),
            sensor_fault: recent(&Finding::SensorFault),
        }
    }
}

/// What counts now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Held {
    pub gravest: Finding,
    pub battery: BatteryLevel,
    pub stalled: bool,
    pub sensor_fault: bool,
}

/// Place and finding of the robot in the gravest state; none while all are well.
pub fn gravest(robots: impl IntoIterator<Item = Finding>) -> Option<(usize, Finding)> {
    let unfit = robots
        .into_iter()
        .enumerate()
        .filter(|(_, finding)| *finding != Finding::Fine);
    // Of equals the first.
    unfit.reduce(|one, two| if two.1 > one.1 { two } else { one })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVELS: [Level; 4] = [Level::Good, Level::Low, Level::Critical, Level::Empty];

    fn all_findings() -> Vec<Findings> {
        let battery = LEVELS.into_iter();
        battery
            .flat_map(|battery| {
                [(false, false), (true, false), (false, true), (true, true)].map(|(stalled, sensor_fault)| Findings {
                    battery,
                    stalled,
                    sensor_fault,
                })
            })
            .collect()
    }

    #[test]
    fn every_pair_of_simultaneous_faults_gets_the_graver_consequence() {
        // One fault at a time, with the consequence that the ladder asks for, written down by hand.
        let single = [
            (Level::Good, false, false, Consequence::None),
            (Level::Low, false, false, Consequence::NoNewRun),
            (Level::Critical, false, false, Consequence::EndRun),
            (Level::Empty, false, false, Consequence::Stop),
            (Level::Good, true, false, Consequence::Stop),
            (Level::Good, false, true, Consequence::Stop),
        ];
        for one in single {
            for two in single {
                let both = Findings {
                    battery: one.0.max(two.0),
                    stalled: one.1 || two.1,
                    sensor_fault: one.2 || two.2,
                };
                let gravest = both.gravest();
                assert_eq!(gravest.consequence(), one.3.max(two.3), "{both:?}");
                // What is named is one of the two.
                let alone = [one, two].map(|(battery, stalled, sensor_fault, _)| {
                    Findings {
                        battery,
                        stalled,
                        sensor_fault,
                    }
                    .gravest()
                });
                assert!(alone.contains(&gravest), "{both:?}: {gravest:?}");
            }
        }
    }

    #[test]
    fn the_laboratory_agrees_with_the_robot() {
        use robot::health::Action;
        for findings in all_findings() {
            let robot = robot::health::Findings {
                battery: findings.battery,
                stalled: findings.stalled,
                sensor_fault: findings.sensor_fault,
            };
            let wanted = match robot.action() {
                Action::None => Consequence::None,
                Action::NoNewRun => Consequence::NoNewRun,
                Action::Dock => Consequence::EndRun,
                Action::Stop => Consequence::Stop,
            };
            assert_eq!(findings.gravest().consequence(), wanted);
        }
    }

    #[test]
    fn the_gravest_robot_is_named_and_of_equals_the_first() {
        assert_eq!(gravest([Finding::Fine; 3]), None);
        let robots = [Finding::Fine, Finding::BatteryLow, Finding::Stalled, Finding::Stalled];
        assert_eq!(gravest(robots), Some((2, Finding::Stalled)));
    }

    #[test]
    fn bytes_come_back() {
        for finding in Finding::ALL {
            assert_eq!(Finding::from_byte(finding.to_byte()), finding);
        }
        assert_eq!(Finding::from_byte(200), Finding::BatteryEmpty);
    }

    /// 100 traces of 600 reports at 10 Hz with faults that come, go and flicker, against a second implementation that looks
    /// at the whole trace.
    #[test]
    fn a_hundred_random_traces_never_flap_and_never_hide_what_is_there() {
        let mut state = 0x5eed_1234_u64;
        let mut random = move |below: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let mut got_worse = 0;
        for _ in 0..100 {
            let mut ladder = Ladder::default();
            let mut reports: Vec<(i64, Findings)> = Vec::new();
            let mut last = Finding::Fine;
            let mut at_us = 0;
            let mut now = all_findings()[0];
            for _ in 0..600 {
                // Frames get lost: reports are 0.1 s to 0.4 s apart.
                at_us += 100_000 * (1 + random(4) as i64);
                match random(12) {
                    0 => now.battery = LEVELS[random(4) as usize],
                    1 => now.stalled = random(3) == 0,
                    2 => now.sensor_fault = random(3) == 0,
                    _ => {}
                }
                reports.push((at_us, now));
                let held = ladder.report(&now, at_us);
                let recent = reports.iter().filter(|(seen_us, _)| at_us - seen_us < RELEASE_US);
                let worst = recent.map(|(_, findings)| findings.gravest()).max().unwrap();
                assert_eq!(held.gravest, worst);
                assert!(held.gravest >= now.gravest());
                if held.gravest < last {
                    let quiet = reports
                        .iter()
                        .rev()
                        .take_while(|(_, findings)| findings.gravest() < last);
                    assert!(
                        at_us - quiet.last().unwrap().0 >= RELEASE_US - 400_000,
                        "left {:?} too soon",
                        last
                    );
                } else if held.gravest > last {
                    got_worse += 1;
                }
                last = held.gravest;
            }
        }
        assert!(got_worse > 300, "{got_worse}");
    }
}
