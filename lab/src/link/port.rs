//! The right to send to a robot.

use super::{RobotLink, lock};
use crate::chorus::GroupFrame;
use crate::clock::monotonic_us;
use crate::commander::{CommandPart, Commander, Order, Sent, Still};
use crate::epochs::RESERVED_FRAMES;
use crate::mouth::Mouth;
use control::safety::SafeCommand;
use std::net::SocketAddr;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// The right to send to one robot under one epoch. Exists once per robot.
#[derive(Debug)]
pub struct RobotPort {
    pub(super) robot: Arc<RobotLink>,
    pub(super) mouth: Arc<Mouth>,
    pub(super) address: SocketAddr,
    pub(super) commander: Commander,
    pub(super) last_sequence: u32,
}

/// A [`RobotPort`] that a run holds; it goes back when this is dropped, even by a panic.
#[derive(Debug)]
pub struct HeldPort(pub(super) RobotPort);

impl Deref for HeldPort {
    type Target = RobotPort;

    fn deref(&self) -> &RobotPort {
        &self.0
    }
}

impl DerefMut for HeldPort {
    fn deref_mut(&mut self) -> &mut RobotPort {
        &mut self.0
    }
}

impl Drop for HeldPort {
    fn drop(&mut self) {
        let port = &self.0;
        port.robot.put_port(RobotPort {
            robot: port.robot.clone(),
            mouth: port.mouth.clone(),
            commander: port.commander.clone(),
            ..*port
        });
    }
}

impl RobotPort {
    /// The robot behind it.
    pub fn robot(&self) -> &Arc<RobotLink> {
        &self.robot
    }

    /// From now on frames carry this epoch, which [`crate::epochs::EpochBook::begin`] opened for this robot.
    pub fn begin_epoch(&mut self, epoch: u32) {
        self.commander.begin_epoch(epoch, 1);
        self.last_sequence = RESERVED_FRAMES;
    }

    /// Sends a command of the safety filter.
    pub fn drive(&mut self, command: &SafeCommand, tick: u32) -> Sent {
        self.send(Order::Drive(command), tick)
    }

    /// Sends a frame without motion.
    pub fn still(&mut self, still: Still, tick: u32) -> Sent {
        self.send(Order::Still(still), tick)
    }

    /// Groups reach the robot, and it reads them: it has sent a frame of a type that came with them.
    pub fn takes_groups(&self) -> bool {
        self.mouth.sends_groups() && lock(&self.robot.health).is_some()
    }

    /// Epoch and sequence of the next frame.
    pub fn next_place(&self) -> (u32, u32) {
        (self.commander.epoch(), self.commander.next_sequence())
    }

    /// This robot's part of the group with `sequence`.
    pub fn part(&mut self, order: Order<'_>, sequence: u32) -> (CommandPart, Sent) {
        let heard_ms = self.robot.heard_clock_ms.load(Ordering::Relaxed);
        self.commander.part(order, sequence, monotonic_us(), heard_ms)
    }

    /// Sends a group to all robots at once; false when it could not be sent.
    pub fn send_group(&self, group: &GroupFrame) -> bool {
        self.mouth.say_to_all(group.as_bytes())
    }

    /// A frame to this robot could not be sent.
    pub fn note_unsent(&self) {
        self.robot.unsent.fetch_add(1, Ordering::Relaxed);
    }

    fn send(&mut self, order: Order<'_>, tick: u32) -> Sent {
        let heard_ms = self.robot.heard_clock_ms.load(Ordering::Relaxed);
        let (frame, sent) = self.commander.frame(order, tick, monotonic_us(), heard_ms);
        // A frame that cannot be sent is a lost frame: the robot's watchdog and the silence limits deal with those.
        if !self.mouth.say(frame.as_bytes(), self.address) {
            self.note_unsent();
        }
        sent
    }
}
