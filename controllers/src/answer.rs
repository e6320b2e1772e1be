//! What a program says in one tick: an order for each robot, log lines and drawings.

use control::law::{Fault, FaultKind, Note};
use serde::{Deserialize, Serialize};

use crate::limits::{LINE_BYTES, LOG_BYTES_PER_TICK, NOTES_PER_TICK};

/// Most wheels of an order.
pub const WHEELS: usize = 8;
/// Largest number in a command, in its unit; beyond it is a mistake and not a wish.
const LARGEST: f64 = 1e6;

/// How a robot is to move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// Body twist `[forward m/s, left m/s, yaw rate rad/s]`.
    Twist([f64; 3]),
    /// Velocity of the body origin in the world frame, m/s; the laboratory's driver finds what the chassis can do.
    Velocity([f64; 2]),
    /// Wheel speeds in the order of the robot's wheels, rad/s; undriven wheels are not looked at.
    Wheels([f64; WHEELS]),
}

/// What one robot is told.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    pub motion: Motion,
    /// Yaw to have (robots that move sideways: all the time) with [`Motion::Velocity`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw_rad: Option<f64>,
    /// Steering angle with [`Motion::Wheels`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steering_rad: Option<f64>,
}

/// What a program makes of one robot in one tick.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Say {
    pub order: Option<Order>,
    /// For display: where the robot is going, `[x_m, y_m]`.
    pub target_m: Option<[f64; 2]>,
    /// The robot has done what it is to do.
    pub finished: bool,
}

/// One tick's answer.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Answer {
    /// In the order of the experiment.
    pub robots: Vec<Say>,
    pub notes: Vec<Note>,
    #[serde(skip)]
    log_bytes: usize,
}

impl Answer {
    /// Begins a tick of so many robots.
    pub fn clear(&mut self, robots: usize) {
        self.robots.clear();
        self.robots.resize(robots, Say::default());
        self.notes.clear();
        self.log_bytes = 0;
    }

    /// Adds a log line; control characters, colour codes too, are left out, and what is beyond the tick's volume.
    pub fn log(&mut self, text: &str) {
        let text = printable(text);
        if self.log_bytes + text.len() <= LOG_BYTES_PER_TICK {
            self.log_bytes += text.len();
            self.note(Note::Log { text });
        }
    }

    /// Adds a drawing; those beyond the tick's number are left out, as are places that are no numbers.
    pub fn draw(&mut self, note: Note) {
        let note = match note {
            Note::Text { at_m, text, colour } => Note::Text {
                at_m,
                text: printable(&text),
                colour,
            },
            other => other,
        };
        let finite = |place: &[f64; 2]| place.iter().all(|value| value.is_finite());
        let drawable = match &note {
            Note::Log { .. } => false,
            Note::Point { at_m, .. } | Note::Text { at_m, .. } => finite(at_m),
            Note::Line { from_m, to_m, .. } => finite(from_m) && finite(to_m),
        };
        if drawable {
            self.note(note);
        }
    }

    fn note(&mut self, note: Note) {
        if self.notes.len() < NOTES_PER_TICK {
            self.notes.push(note);
        }
    }

    /// Holds an answer that came from elsewhere to the limits; the number of its robots must be right.
    pub fn admit(self, tick: u64, robots: usize) -> Result<Answer, Fault> {
        let bad = |reason: String| Fault::new(FaultKind::BadCommand, Some(tick), reason);
        if self.robots.len() != robots {
            return Err(bad(format!("{} commands for {robots} robots", self.robots.len())));
        }
        let mut admitted = Answer {
            robots: self.robots,
            ..Answer::default()
        };
        for note in self.notes {
            match note {
                Note::Log { text } => admitted.log(&text),
                drawing => admitted.draw(drawing),
            }
        }
        for (robot, say) in admitted.robots.iter().enumerate() {
            if let Some(order) = &say.order {
                order.check(robot).map_err(bad)?;
            }
        }
        Ok(admitted)
    }
}

impl Order {
    /// A body twist `[forward m/s, left m/s, yaw rate rad/s]`.
    pub fn twist(twist: [f64; 3]) -> Order {
        Order {
            motion: Motion::Twist(twist),
            yaw_rad: None,
            steering_rad: None,
        }
    }

    /// What is wrong with the command for the robot of this number, in words.
    pub fn check(&self, robot: usize) -> Result<(), String> {
        let numbers: &[f64] = match &self.motion {
            Motion::Twist(twist) => twist,
            Motion::Velocity(velocity) => velocity,
            Motion::Wheels(wheels) => wheels,
        };
        let further = self.yaw_rad.iter().chain(&self.steering_rad);
        match numbers
            .iter()
            .chain(further)
            .find(|number| !number.is_finite() || number.abs() > LARGEST)
        {
            Some(number) => Err(format!(
                "the command for robot {robot} holds {number}, which is no possible number"
            )),
            None => Ok(()),
        }
    }
}

/// A fault whose reason a program may have written: one line without control characters, never empty.
pub fn readable(fault: Fault) -> Fault {
    let reason = printable(&fault.reason);
    Fault {
        reason: if reason.trim().is_empty() {
            "an error without words".to_owned()
        } else {
            reason
        },
        ..fault
    }
}

/// The first [`LINE_BYTES`] of a text without escape sequences and control characters.
fn printable(text: &str) -> String {
    let mut kept = String::new();
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        if c == '\u{1b}' && rest.peek() == Some(&'[') {
            // A control sequence ends with a letter or one of @ [ \ ] ^ _ ` { | } ~.
            rest.next();
            while rest.next().is_some_and(|c| !('@'..='~').contains(&c)) {}
        } else if !c.is_control() {
            if kept.len() + c.len_utf8() > LINE_BYTES {
                break;
            }
            kept.push(c);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_codes_and_control_characters_are_left_out() {
        let fault = |reason: &str| readable(Fault::new(FaultKind::Failed, Some(3), reason));
        assert_eq!(fault("a\u{1b}[2Jb").reason, "ab");
        assert_eq!(fault("").reason, "an error without words");
        assert_eq!(
            (fault("\n ").reason.as_str(), fault(" ").tick),
            ("an error without words", Some(3))
        );
        assert_eq!(printable("a\u{1b}[31mred\u{1b}[0m\r\nb\u{7}c\u{9b}"), "aredbc");
        assert_eq!(printable(&"ä".repeat(LINE_BYTES)).len(), LINE_BYTES);
    }

    #[test]
    fn volume_and_number_of_a_tick_are_bounded() {
        let mut answer = Answer::default();
        answer.clear(1);
        for _ in 0..1000 {
            answer.log(&"x".repeat(5000));
            answer.draw(Note::Point {
                at_m: [f64::NAN, 0.0],
                colour: 0,
            });
        }
        let bytes: usize = answer
            .notes
            .iter()
            .map(|note| match note {
                Note::Log { text } => text.len(),
                _ => panic!("a drawing at no place"),
            })
            .sum();
        assert_eq!(bytes, LOG_BYTES_PER_TICK / LINE_BYTES * LINE_BYTES);
        answer.clear(1);
        for _ in 0..1000 {
            answer.draw(Note::Point {
                at_m: [0.0, 0.0],
                colour: 0,
            });
        }
        assert_eq!(answer.notes.len(), NOTES_PER_TICK);
    }
}
