//! S4: frames that must not move a robot, against the firmware's rules of acceptance.

use crate::fan::fan;
use crate::table::Row;
use crate::{Scene, SceneRobot};
use anyhow::{Result, anyhow};
use emulator::hidden::HiddenRobot;
use emulator::noise::Noise;
use lab::commander::{Commander, Order, Still};
use robot::firmware::{Firmware, Received, Sensors};
use robot::frame::{self, TELEMETRY_MAX_CHARACTERS};
use robot::key::Key;

const TICK_US: i64 = 8333;
/// Longest that a frame may be on its way.
const OLDEST_US: i64 = 50_000;
/// A laboratory's process lives for so many ticks, then another one takes over.
const LIFE_TICKS: u64 = 3000;
/// Attacks of one world; worlds are independent.
const ATTACKS_PER_WORLD: u64 = 20_000;
const KINDS: [&str; 6] = [
    "replayed",
    "overtaken",
    "forged",
    "old epoch",
    "too late",
    "after a restart",
];

#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    attacks: [u64; KINDS.len()],
    moved: [u64; KINDS.len()],
    honest: u64,
    accepted: u64,
}

/// A robot with a clock that drifts, its laboratory, and somebody who keeps all frames.
struct World {
    random: Noise,
    firmware: Firmware,
    commander: Commander,
    stranger: Commander,
    key: Key,
    now_us: i64,
    drift_ppm: f64,
    offset_us: i64,
    up_us: i64,
    down_us: i64,
    heard_ms: u32,
    /// Telemetry on its way: when it arrives, the robot's clock in it.
    answers: Vec<(i64, u32)>,
    kept: Vec<(u32, Vec<u8>)>,
    counts: Counts,
}

impl World {
    fn new(seed: u64, number: u64) -> Result<Self> {
        let mut random = Noise::new(seed, 0x57A1E ^ (number << 24));
        let key = Key::from_hex("000102030405060708090a0b0c0d0e0f").ok_or_else(|| anyhow!("no key"))?;
        let other = Key::from_hex("100102030405060708090a0b0c0d0e0f").ok_or_else(|| anyhow!("no key"))?;
        let scene = Scene::new(
            "omni4",
            &[SceneRobot {
                start: [0.0; 3],
                goal: [0.0; 2],
            }],
            1.0,
        )?;
        let robots = scene.robots()?;
        let robot = robots.first().ok_or_else(|| anyhow!("no robot"))?;
        let settings = emulator::commissioning::settings(robot, key, &HiddenRobot::default())?;
        // Even worlds have a link that is slow one way, 12 and 2 ms; the others a quick one.
        let [up_us, down_us] = [[12_000, 2000], [2000, 12_000], [2000, 2000]][(number % 3) as usize];
        Ok(Self {
            drift_ppm: if number.is_multiple_of(2) { 100.0 } else { -100.0 },
            offset_us: (random.uniform() * 3.6e9) as i64,
            random,
            firmware: Firmware::new(settings),
            commander: Commander::new(1, key, vec![0, 1, 2, 3], 10, 1),
            stranger: Commander::new(1, other, vec![0, 1, 2, 3], 10, 1),
            key,
            now_us: 50_000_000,
            up_us,
            down_us,
            heard_ms: 0,
            answers: Vec::new(),
            kept: Vec::new(),
            counts: Counts::default(),
        })
    }

    fn robot_ms(&self, at_us: i64) -> u32 {
        let drifted_us = at_us + (at_us as f64 * self.drift_ppm * 1e-6) as i64 + self.offset_us;
        (drifted_us / 1000) as u32
    }

    fn make(&mut self) -> Vec<u8> {
        let now_us = self.now_us;
        let heard = self.answers.iter().filter(|(due_us, _)| *due_us <= now_us);
        if let Some((_, clock_ms)) = heard.max_by_key(|(due_us, _)| *due_us) {
            self.heard_ms = *clock_ms;
            self.answers.retain(|(due_us, _)| *due_us > now_us);
        }
        let (frame, _) = self
            .commander
            .frame(Order::Still(Still::Rest), 0, self.now_us, self.heard_ms);
        frame.as_bytes().to_vec()
    }

    /// An honest frame on its way, and the robot's answer.
    fn tick(&mut self) {
        let bytes = self.make();
        self.deliver_honest(bytes);
        self.now_us += TICK_US;
    }

    fn deliver_honest(&mut self, bytes: Vec<u8>) {
        let arrival_us = self.now_us + self.up_us + (2000.0 * self.random.uniform()) as i64;
        self.counts.honest += 1;
        if self.firmware.on_datagram(&bytes, self.robot_ms(arrival_us)) == Received::Accepted {
            self.counts.accepted += 1;
        }
        self.firmware.step(self.robot_ms(arrival_us), &Sensors::default());
        let mut out = [0; TELEMETRY_MAX_CHARACTERS];
        let length = self.firmware.telemetry(self.robot_ms(arrival_us), &mut out);
        if let Ok(telemetry) = frame::decode(out.get(..length).unwrap_or_default(), &self.key) {
            let clock_ms = telemetry.header.clock_ms;
            self.answers.push((arrival_us + self.down_us, clock_ms));
        }
        self.kept.push((self.commander.epoch(), bytes));
        if self.kept.len() > 5000 {
            self.kept.drain(..2500);
        }
    }

    fn attack(&mut self, kind: usize, bytes: &[u8], at_us: i64) {
        self.counts.attacks[kind] += 1;
        if self.firmware.on_datagram(bytes, self.robot_ms(at_us)) == Received::Accepted {
            self.counts.moved[kind] += 1;
        }
    }

    fn any_kept(&mut self) -> Option<(u32, Vec<u8>)> {
        let place = (self.random.uniform() * self.kept.len() as f64) as usize;
        self.kept.get(place).cloned()
    }

    /// One attack of the kinds that need no time.
    fn strike(&mut self) {
        let now_us = self.now_us;
        let Some((epoch, mut bytes)) = self.any_kept() else {
            return;
        };
        let kind = (3.0 * self.random.uniform()) as usize;
        match kind {
            0 => {
                let old = epoch < self.commander.epoch();
                self.attack(if old { 3 } else { 0 }, &bytes, now_us);
            }
            1 => {
                // A new frame is overtaken by the one after it, and arrives then.
                let (first, second) = (self.make(), self.make());
                self.deliver_honest(second);
                self.attack(1, &first, now_us + self.up_us + 2000);
                self.now_us += TICK_US;
            }
            _ => {
                if self.random.uniform() < 0.5 {
                    // One digit of a frame that would be next.
                    bytes = self.make();
                    let place = 1 + (self.random.uniform() * (bytes.len() as f64 - 3.0)) as usize;
                    if let Some(digit) = bytes.get_mut(place) {
                        *digit = if *digit == b'7' { b'8' } else { b'7' };
                    }
                } else {
                    let (frame, _) = self
                        .stranger
                        .frame(Order::Still(Still::Release), 0, now_us, self.heard_ms);
                    bytes = frame.as_bytes().to_vec();
                }
                self.attack(2, &bytes, now_us + self.up_us);
            }
        }
    }

    /// The newest frame is held back for too long, and nothing else comes meanwhile.
    fn hold_back(&mut self) {
        let bytes = self.make();
        let late_us = OLDEST_US + 1000 + (200_000.0 * self.random.uniform()) as i64;
        self.attack(4, &bytes, self.now_us + late_us);
        self.now_us += late_us;
    }

    /// Another process takes over with a new epoch; the old one goes on for a while.
    fn take_over(&mut self) {
        let mut old = self.commander.clone();
        let (epoch, sequence) = (old.epoch() + 1, 1);
        self.commander.begin_epoch(epoch, sequence);
        self.heard_ms = 0;
        self.answers.clear();
        for _ in 0..60 {
            self.tick();
            let (frame, _) = old.frame(Order::Still(Still::Release), 0, self.now_us, self.heard_ms);
            self.attack(5, frame.as_bytes(), self.now_us + 1000);
        }
    }

    fn run(mut self, attacks: u64) -> Counts {
        for _ in 0..100 {
            self.tick();
        }
        self.counts.honest = 0;
        self.counts.accepted = 0;
        let mut ticks = 0;
        while self.counts.attacks.iter().sum::<u64>() < attacks {
            self.tick();
            ticks += 1;
            for _ in 0..6 {
                self.strike();
            }
            if self.random.uniform() < 0.1 {
                self.hold_back();
            }
            if ticks % LIFE_TICKS == 500 {
                self.take_over();
            }
        }
        self.counts
    }
}

/// `count` hostile frames.
pub fn run(count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let worlds = count.div_ceil(ATTACKS_PER_WORLD);
    let each = count.div_ceil(worlds.max(1));
    let found = fan(
        worlds,
        threads,
        |number| Ok(World::new(seed, number)?.run(each)),
        |_| {},
    )?;
    let mut rows: Vec<Row> = KINDS
        .iter()
        .enumerate()
        .map(|(kind, name)| {
            let attacks: u64 = found.iter().map(|counts| counts.attacks[kind]).sum();
            let moved: u64 = found.iter().map(|counts| counts.moved[kind]).sum();
            Row {
                name: "S4",
                what: format!("frames {name}: accepted"),
                count: attacks,
                seed,
                figure: moved.to_string(),
                asked: "0".to_owned(),
                holds: moved == 0 && attacks > 0,
            }
        })
        .collect();
    let honest: u64 = found.iter().map(|counts| counts.honest).sum();
    let accepted: u64 = found.iter().map(|counts| counts.accepted).sum();
    let share = accepted as f64 / honest.max(1) as f64;
    rows.push(Row {
        name: "S4",
        what: "honest frames between them: accepted".to_owned(),
        count: honest,
        seed,
        figure: format!("{:.2} %", 100.0 * share),
        asked: ">= 95 %".to_owned(),
        holds: share >= 0.95,
    });
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table;

    #[test]
    fn no_hostile_frame_of_sixty_thousand_is_accepted() {
        assert!(table::print(&run(60_000, 1, 2).expect("frames")));
    }
}
