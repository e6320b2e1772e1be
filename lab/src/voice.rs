//! The robot link of one run: a frame for each robot, or groups of commands in one broadcast frame where the laboratory has an
//! address for them and all robots read them.

use crate::commander::{CommandPart, Order, Sent, Still};
use crate::link::HeldPort;
use crate::pilot::Outlet;
use control::safety::SafeCommand;
use robot::frame::GROUP_MAX_ROBOTS;

/// See the module.
#[derive(Debug)]
pub struct Voice {
    /// In the order of the experiment.
    ports: Vec<HeldPort>,
    /// Groups reach all robots, which read them and share an epoch.
    grouped: bool,
    /// Sequence of this tick's groups; chosen with its first part.
    sequence: Option<u32>,
    parts: Vec<CommandPart>,
}

impl Voice {
    /// - `ports`: in the order of the experiment.
    pub fn new(ports: Vec<HeldPort>) -> Self {
        let epoch = |port: &HeldPort| port.next_place().0;
        let same_epoch = ports.windows(2).all(|pair| match pair {
            [one, other] => epoch(one) == epoch(other),
            _ => true,
        });
        let grouped = ports.len() > 1 && same_epoch && ports.iter().all(|port| port.takes_groups());
        Self {
            parts: Vec::with_capacity(ports.len()),
            ports,
            grouped,
            sequence: None,
        }
    }

    pub(crate) fn into_ports(self) -> Vec<HeldPort> {
        self.ports
    }

    fn say(&mut self, place: usize, order: Order<'_>, tick: u32) -> Sent {
        if !self.grouped {
            let port = self.ports.get_mut(place);
            return port.map_or_else(Sent::nothing, |port| match order {
                Order::Drive(command) => port.drive(command, tick),
                Order::Still(still) => port.still(still, tick),
            });
        }
        // A group's sequence must be new to every robot in it.
        let newest = || self.ports.iter().map(|port| port.next_place().1).max().unwrap_or(1);
        let sequence = self.sequence.unwrap_or_else(newest);
        self.sequence = Some(sequence);
        let Some(port) = self.ports.get_mut(place) else {
            return Sent::nothing();
        };
        let (part, sent) = port.part(order, sequence);
        self.parts.push(part);
        sent
    }
}

impl Outlet for Voice {
    fn drive(&mut self, place: usize, command: &SafeCommand, tick: u32) -> Sent {
        self.say(place, Order::Drive(command), tick)
    }

    fn still(&mut self, place: usize, still: Still, tick: u32) -> Sent {
        self.say(place, Order::Still(still), tick)
    }

    fn finish(&mut self, tick: u32) {
        let (Some(sequence), Some(port)) = (self.sequence.take(), self.ports.first()) else {
            return;
        };
        self.parts.sort_unstable_by_key(CommandPart::robot);
        // Every robot is in one group, so all groups of a tick may have the same sequence.
        for parts in self.parts.chunks(GROUP_MAX_ROBOTS) {
            if port.send_group(sequence, tick, parts) {
                continue;
            }
            let is_in = |number: u8| parts.iter().any(|part| part.robot() == number);
            for port in self.ports.iter().filter(|port| is_in(port.robot().number)) {
                port.note_unsent();
            }
        }
        self.parts.clear();
    }
}
