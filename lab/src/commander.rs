//! What the laboratory says to one robot: frames in order under one epoch, without socket and clock.

use crate::clock_map::link_clock_ms;
use crate::record::LINK_WHEELS;
use control::safety::SafeCommand;
use robot::frame::{self, COMMAND_MAX_CHARACTERS, Header, Payload};
use robot::key::Key;

/// What a frame tells the robot. Only the safety filter makes the command of a [`Order::Drive`].
#[derive(Debug, Clone, Copy)]
pub enum Order<'a> {
    Drive(&'a SafeCommand),
    Still(Still),
}

/// A frame without motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Still {
    /// Ramp to zero and stay awake.
    Rest,
    /// As `Rest`, and clear a latch.
    Release,
    /// Ramp to zero and latch: the protective stop.
    Latch,
}

/// What went out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sent {
    pub at_us: i64,
    pub sequence: u32,
    pub enable: bool,
    /// In the resolution of the link.
    pub wheel_rad_per_s: [f64; LINK_WHEELS],
    pub steering_rad: f64,
}

impl Sent {
    /// A frame that never was: for a robot that is not there.
    pub const fn nothing() -> Self {
        Self {
            at_us: 0,
            sequence: 0,
            enable: false,
            wheel_rad_per_s: [0.0; LINK_WHEELS],
            steering_rad: 0.0,
        }
    }
}

/// Characters of one command frame.
#[derive(Debug, Clone, Copy)]
pub struct CommandFrame {
    characters: [u8; COMMAND_MAX_CHARACTERS],
    length: usize,
}

impl CommandFrame {
    /// The frame as it goes on the link.
    pub fn as_bytes(&self) -> &[u8] {
        self.characters.get(..self.length).unwrap_or_default()
    }
}

/// Makes the frames for one robot.
#[derive(Debug, Clone)]
pub struct Commander {
    number: u8,
    key: Key,
    /// Positions in `wheels` of the driven wheels: the order of the link.
    driven: Vec<usize>,
    epoch: u32,
    next_sequence: u32,
}

impl Commander {
    /// - `driven`: positions in the description's `wheels` of the driven wheels.
    /// - `epoch`, `sequence`: of the first frame.
    pub const fn new(number: u8, key: Key, driven: Vec<usize>, epoch: u32, sequence: u32) -> Self {
        Self {
            number,
            key,
            driven,
            epoch,
            next_sequence: sequence,
        }
    }

    /// Number of the robot.
    pub const fn number(&self) -> u8 {
        self.number
    }

    pub const fn epoch(&self) -> u32 {
        self.epoch
    }

    pub const fn next_sequence(&self) -> u32 {
        self.next_sequence
    }

    /// From now on frames carry this epoch.
    pub const fn begin_epoch(&mut self, epoch: u32, sequence: u32) {
        self.epoch = epoch;
        self.next_sequence = sequence;
    }

    /// The next frame.
    ///
    /// - `heard_ms`: the robot's clock in its newest frame, to be echoed; 0 before the first.
    pub fn frame(&mut self, order: Order<'_>, tick: u32, now_us: i64, heard_ms: u32) -> (CommandFrame, Sent) {
        let command = self.command(order);
        let sequence = self.next_sequence;
        self.next_sequence = sequence.saturating_add(1);
        let header = Header {
            robot: self.number,
            epoch: self.epoch,
            sequence,
            tick,
            clock_ms: link_clock_ms(now_us),
            echo_ms: heard_ms,
        };
        let mut characters = [0; COMMAND_MAX_CHARACTERS];
        let length = frame::encode_command(&header, &command, &self.key, &mut characters);
        let frame = CommandFrame { characters, length };
        // What the robot will read, in the resolution of the link.
        let sent = match frame::decode(frame.as_bytes(), &self.key) {
            Ok(frame::Frame {
                payload: Payload::Command(sent),
                ..
            }) => sent,
            _ => command,
        };
        let sent = Sent {
            at_us: now_us,
            sequence,
            enable: command.enable,
            wheel_rad_per_s: sent.wheel_rad_per_s,
            steering_rad: sent.steering_rad,
        };
        (frame, sent)
    }

    fn command(&self, order: Order<'_>) -> frame::Command {
        match order {
            Order::Drive(command) => {
                let wheels = command.wheel_command();
                let mut wheel_rad_per_s = [0.0; LINK_WHEELS];
                for (place, wheel) in wheel_rad_per_s.iter_mut().zip(&self.driven) {
                    *place = wheels.wheel_rad_per_s.get(*wheel).copied().unwrap_or(0.0);
                }
                frame::Command {
                    enable: true,
                    stop: false,
                    clear: false,
                    wheel_rad_per_s,
                    steering_rad: wheels.steering_rad,
                }
            }
            Order::Still(still) => frame::Command {
                stop: still == Still::Latch,
                clear: still == Still::Release,
                ..frame::Command::default()
            },
        }
    }
}
