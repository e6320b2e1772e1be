//! The laboratory's outlet, audited: every frame on its way to a robot is read as that robot reads it, and must say what was
//! ordered for it in that tick.

use crate::Rig;
use crate::rig::{Said, SaidWhat};
use anyhow::{Context, Result};
use lab::commander::Still;
use robot::frame::{Command, Frame, Payload, decode_for};
use robot::key::Key;
use std::collections::VecDeque;

/// Largest difference of a set-point to the order: half the resolution of the link, and rounding.
const WHEEL_RAD_PER_S: f64 = 0.005 + 1e-9;
const STEERING_RAD: f64 = 0.000_05 + 1e-9;

/// What an audit counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    pub frames: u64,
    /// Of them: commands of the safety filter, orders to rest or to clear a latch, protective stops.
    pub drive: u64,
    pub rest: u64,
    pub stop: u64,
    /// Frames that the robot cannot read, or whose MAC is not its own.
    pub untagged: u64,
    /// Frames that nobody ordered.
    pub unordered: u64,
    /// Frames that say something else than what was ordered, or are out of their order.
    pub different: u64,
    /// Orders that no frame came of.
    pub unsent: u64,
}

impl Counts {
    pub fn is_clean(&self) -> bool {
        self.untagged + self.unordered + self.different + self.unsent == 0
    }

    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            drive: self.drive + other.drive,
            rest: self.rest + other.rest,
            stop: self.stop + other.stop,
            untagged: self.untagged + other.untagged,
            unordered: self.unordered + other.unordered,
            different: self.different + other.different,
            unsent: self.unsent + other.unsent,
        }
    }
}

/// One robot in the books.
#[derive(Debug, Clone)]
struct Page {
    number: u8,
    /// Positions in the description's `wheels` of the driven wheels.
    driven: Vec<usize>,
    orders: VecDeque<Said>,
    /// Epoch and sequence of its last frame.
    last: (u32, u32),
}

/// See the module.
#[derive(Debug, Clone)]
pub struct Ledger {
    key: Key,
    pages: Vec<Page>,
    counts: Counts,
}

impl Ledger {
    /// - `robots`: number and driven wheels of each, in the order of the experiment.
    pub fn new(key: Key, robots: impl IntoIterator<Item = (u8, Vec<usize>)>) -> Self {
        let page = |(number, driven)| Page {
            number,
            driven,
            orders: VecDeque::new(),
            last: (0, 0),
        };
        Self {
            key,
            pages: robots.into_iter().map(page).collect(),
            counts: Counts::default(),
        }
    }

    /// Takes what the rig noted since the last time.
    ///
    /// - Errors: a rig that notes nothing.
    pub fn take(&mut self, rig: &mut Rig) -> Result<()> {
        let said = std::mem::take(rig.said.as_mut().context("the rig notes no orders")?);
        let frames = std::mem::take(rig.up.overheard.as_mut().context("the air notes no frames")?);
        self.compare(&said, &frames);
        Ok(())
    }

    /// Orders, and the frames that went to each robot, both in their order.
    fn compare(&mut self, said: &[Said], frames: &[(usize, Vec<u8>)]) {
        for order in said {
            match self.pages.get_mut(order.place) {
                Some(page) => page.orders.push_back(*order),
                None => self.counts.unsent += 1,
            }
        }
        for (place, bytes) in frames {
            self.counts.frames += 1;
            let Some(page) = self.pages.get_mut(*place) else {
                self.counts.unordered += 1;
                continue;
            };
            let Ok(frame) = decode_for(bytes, page.number, &self.key) else {
                self.counts.untagged += 1;
                continue;
            };
            let Some(order) = page.orders.pop_front() else {
                self.counts.unordered += 1;
                continue;
            };
            if page.agrees(&order, &frame) {
                match order.what {
                    SaidWhat::Drive(_) => self.counts.drive += 1,
                    SaidWhat::Still(Still::Rest | Still::Release) => self.counts.rest += 1,
                    SaidWhat::Still(Still::Latch) => self.counts.stop += 1,
                }
            } else {
                self.counts.different += 1;
            }
        }
        // A tick is whole: what is not sent by now never will be.
        for page in &mut self.pages {
            self.counts.unsent += page.orders.drain(..).count() as u64;
        }
    }

    pub fn counts(&self) -> Counts {
        self.counts
    }
}

impl Page {
    fn agrees(&mut self, order: &Said, frame: &Frame) -> bool {
        let Payload::Command(command) = &frame.payload else {
            return false;
        };
        let header = &frame.header;
        let place = (header.epoch, header.sequence);
        let in_order = place > self.last;
        self.last = place;
        in_order
            && header.robot == self.number
            && header.epoch == order.epoch
            && header.tick == order.tick
            && self.says(order.what, command)
    }

    fn says(&self, what: SaidWhat, command: &Command) -> bool {
        let wheels = command.wheel_rad_per_s;
        match what {
            SaidWhat::Drive(wanted) => {
                let told = wheels.iter().enumerate().all(|(k, told)| {
                    let wheel = self.driven.get(k).and_then(|wheel| wanted.wheel_rad_per_s.get(*wheel));
                    (told - wheel.copied().unwrap_or(0.0)).abs() <= WHEEL_RAD_PER_S
                });
                let flags = command.enable && !command.stop && !command.clear;
                told && flags && (command.steering_rad - wanted.steering_rad).abs() <= STEERING_RAD
            }
            SaidWhat::Still(still) => {
                let rests = !command.enable && command.steering_rad == 0.0 && wheels.iter().all(|speed| *speed == 0.0);
                rests && command.stop == (still == Still::Latch) && command.clear == (still == Still::Release)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lab::commander::{Commander, Order};
    use twin::command::WheelCommand;

    const KEY_HEX: &str = "000102030405060708090a0b0c0d0e0f";

    fn said(tick: u32, what: SaidWhat) -> Said {
        Said {
            place: 0,
            tick,
            epoch: 1,
            what,
        }
    }

    /// The audit finds what it is there for: every way in which a frame could go past the filter or past the order.
    #[test]
    fn frames_that_nobody_ordered_and_frames_that_differ_are_found() {
        let key = Key::from_hex(KEY_HEX).expect("a key");
        let rest = SaidWhat::Still(Still::Rest);
        let mut honest = Commander::new(3, key, vec![0, 1], 1, 1);
        let mut frame = |still, tick| {
            let (frame, _) = honest.frame(Order::Still(still), tick, 1_000_000, 0);
            (0, frame.as_bytes().to_vec())
        };
        let audited = |said: &[Said], frames: &[(usize, Vec<u8>)]| {
            let mut ledger = Ledger::new(key, [(3, vec![0, 1])]);
            ledger.compare(said, frames);
            ledger.counts()
        };
        let (first, second) = (frame(Still::Rest, 4), frame(Still::Rest, 5));
        let orders = [said(4, rest), said(5, rest)];
        assert!(audited(&orders, &[first.clone(), second.clone()]).is_clean());
        // A frame too many, one too few, an older one after a newer one.
        assert_eq!(audited(&orders[..1], &[first.clone(), second.clone()]).unordered, 1);
        assert_eq!(audited(&orders, std::slice::from_ref(&first)).unsent, 1);
        assert_eq!(
            audited(&[said(5, rest), said(4, rest)], &[second.clone(), first.clone()]).different,
            1
        );
        // Another tick, another order, a command instead of rest.
        assert_eq!(audited(&[said(5, rest)], std::slice::from_ref(&first)).different, 1);
        assert_eq!(
            audited(&[said(4, SaidWhat::Still(Still::Latch))], std::slice::from_ref(&first)).different,
            1
        );
        let drive = SaidWhat::Drive(WheelCommand::default());
        assert_eq!(audited(&[said(4, drive)], std::slice::from_ref(&first)).different, 1);
        // One digit, and another key.
        let mut damaged = first.clone();
        damaged.1[20] ^= 1;
        assert_eq!(audited(&orders[..1], &[damaged]).untagged, 1);
        let stranger = Key::from_hex("ffeeddccbbaa99887766554433221100").expect("a key");
        let mut forger = Commander::new(3, stranger, vec![0, 1], 1, 9);
        let (forged, _) = forger.frame(Order::Still(Still::Rest), 4, 1_000_000, 0);
        assert_eq!(audited(&orders[..1], &[(0, forged.as_bytes().to_vec())]).untagged, 1);
    }
}
