//! The robot link of one run: a frame for each robot, or groups of commands in one broadcast frame where the laboratory has an
//! address for them and all robots read them.

use crate::chorus::{Chorus, hears_groups};
use crate::clock::monotonic_us;
use crate::commander::{Order, Sent, Still};
use crate::link::HeldPort;
use crate::pilot::Outlet;
use control::safety::SafeCommand;

/// See the module.
#[derive(Debug)]
pub struct Voice {
    /// In the order of the experiment.
    ports: Vec<HeldPort>,
    /// Groups reach all robots, which read them and share an epoch.
    grouped: bool,
    chorus: Chorus,
}

impl Voice {
    /// - `ports`: in the order of the experiment.
    pub fn new(ports: Vec<HeldPort>) -> Self {
        Self {
            grouped: hears_groups(ports.iter().map(|port| (port.next_place().0, port.takes_groups()))),
            chorus: Chorus::with_room_for(ports.len()),
            ports,
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
        let sequence = self.chorus.sequence(self.ports.iter().map(|port| port.next_place().1));
        let Some(port) = self.ports.get_mut(place) else {
            return Sent::nothing();
        };
        let (part, sent) = port.part(order, sequence);
        self.chorus.push(part);
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
        let Some(port) = self.ports.first() else { return };
        let (epoch, _) = port.next_place();
        self.chorus.finish(epoch, tick, monotonic_us(), |group| {
            if port.send_group(group) {
                return;
            }
            let is_in = |port: &&HeldPort| group.robots().contains(&port.robot().number);
            self.ports.iter().filter(is_in).for_each(|port| port.note_unsent());
        });
    }
}
