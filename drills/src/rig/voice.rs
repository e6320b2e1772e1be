//! The link as the pilot sees it: the laboratory's own frames and groups, on their way through the air.

use crate::Air;
use control::safety::SafeCommand;
use lab::chorus::Chorus;
use lab::commander::{Commander, Order, Sent, Still};
use lab::pilot::Outlet;
use twin::command::WheelCommand;

/// An order of the pilot to one robot, as the audit of the outlet notes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Said {
    /// In the experiment.
    pub place: usize,
    pub tick: u32,
    pub epoch: u32,
    pub what: SaidWhat,
}

/// See [`Said`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SaidWhat {
    /// A command of the safety filter, by the description's wheels.
    Drive(WheelCommand),
    Still(Still),
}

pub(super) struct Voice<'a> {
    pub commanders: &'a mut [Commander],
    /// Robot's clock in its newest frame.
    pub heard_ms: &'a [u32],
    pub up: &'a mut Air,
    /// For robots that hear groups; a frame for each without.
    pub chorus: Option<&'a mut Chorus>,
    /// Notes every order.
    pub said: Option<&'a mut Vec<Said>>,
    pub now_us: i64,
}

impl Voice<'_> {
    fn say(&mut self, place: usize, order: Order<'_>, tick: u32) -> Sent {
        if let Some(said) = &mut self.said {
            let what = match order {
                Order::Drive(command) => SaidWhat::Drive(command.wheel_command()),
                Order::Still(still) => SaidWhat::Still(still),
            };
            let epoch = self.commanders.get(place).map_or(0, Commander::epoch);
            said.push(Said {
                place,
                tick,
                epoch,
                what,
            });
        }
        let heard_ms = self.heard_ms.get(place).copied().unwrap_or_default();
        let next = self.commanders.iter().map(Commander::next_sequence);
        let sequence = self.chorus.as_mut().map(|chorus| chorus.sequence(next));
        let Some(commander) = self.commanders.get_mut(place) else {
            return Sent::nothing();
        };
        match (&mut self.chorus, sequence) {
            (Some(chorus), Some(sequence)) => {
                let (part, sent) = commander.part(order, sequence, self.now_us, heard_ms);
                chorus.push(part);
                sent
            }
            _ => {
                let (frame, sent) = commander.frame(order, tick, self.now_us, heard_ms);
                self.up.send(place, frame.as_bytes(), self.now_us);
                sent
            }
        }
    }
}

impl Outlet for Voice<'_> {
    fn drive(&mut self, place: usize, command: &SafeCommand, tick: u32) -> Sent {
        self.say(place, Order::Drive(command), tick)
    }

    fn still(&mut self, place: usize, still: Still, tick: u32) -> Sent {
        self.say(place, Order::Still(still), tick)
    }

    /// Every robot of a group receives it for itself: one may miss what another hears.
    fn finish(&mut self, tick: u32) {
        let Self {
            commanders,
            up,
            chorus: Some(chorus),
            now_us,
            ..
        } = self
        else {
            return;
        };
        let epoch = commanders.first().map_or(0, Commander::epoch);
        chorus.finish(epoch, tick, *now_us, |group| {
            for (place, commander) in commanders.iter().enumerate() {
                if group.robots().contains(&commander.number()) {
                    up.send(place, group.as_bytes(), *now_us);
                }
            }
        });
    }
}
