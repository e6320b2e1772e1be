//! `track.json`: measured poses and moving targets at 30 Hz, in the form of the twin's replay, for the page.
//!
//! Made from the same records as the tables; it stands beside the archive, not in it.

use crate::notes::TrackNotes;
use crate::record::Record;
use api::robot::LabRobot;
use api::verdict::{Replay, ReplayRobot};

/// The file's name among the run's files.
pub const FILE_NAME: &str = "track.json";
const PERIOD_US: i64 = 33_333;

/// Samples records into frames; a frame holds the newest accepted pose at its time.
pub struct Track {
    numbers: Vec<u8>,
    newest: Vec<Option<([f64; 3], [f64; 2])>>,
    robots: Vec<ReplayRobot>,
    next_us: i64,
    notes: TrackNotes,
}

impl Track {
    /// - `start_us`: the moment of the first frame.
    pub fn new(robots: &[LabRobot], start_us: i64) -> Self {
        let track = |robot: &LabRobot| ReplayRobot {
            name: robot.description.name.clone(),
            poses: Vec::new(),
            targets: Vec::new(),
        };
        Self {
            numbers: robots.iter().map(|robot| robot.number).collect(),
            newest: vec![None; robots.len()],
            robots: robots.iter().map(track).collect(),
            next_us: start_us,
            notes: TrackNotes::default(),
        }
    }

    pub fn take(&mut self, record: &Record) {
        match record {
            Record::Pose(pose) if pose.accepted => {
                let measured = [pose.x_m, pose.y_m, pose.yaw_rad];
                if let Some(newest) = self.newest_of(pose.robot) {
                    let target = newest.map_or([pose.x_m, pose.y_m], |(_, target)| target);
                    *newest = Some((measured, target));
                }
            }
            Record::Command(command) => {
                let at_us = command.sent_us;
                if let (Some(target), Some(Some(newest))) = (command.target_m, self.newest_of(command.robot)) {
                    newest.1 = target;
                }
                self.advance(at_us);
            }
            Record::Notes(notes) => self.notes.take(notes),
            _ => {}
        }
    }

    /// The document, in the robots' order of the experiment.
    pub fn finish(self) -> Replay {
        Replay {
            format: "robopheus.replay/1".into(),
            period_s: PERIOD_US as f64 * 1e-6,
            robots: self.robots,
            notes: self.notes.finish(),
        }
    }

    fn newest_of(&mut self, number: u8) -> Option<&mut Option<([f64; 3], [f64; 2])>> {
        let index = self.numbers.iter().position(|known| *known == number)?;
        self.newest.get_mut(index)
    }

    /// Writes the frames that are due; none before every robot was seen.
    fn advance(&mut self, now_us: i64) {
        if self.newest.iter().any(Option::is_none) {
            self.next_us = self.next_us.max(now_us);
            return;
        }
        while self.next_us <= now_us {
            for (robot, newest) in self.robots.iter_mut().zip(&self.newest) {
                let Some((pose, target)) = newest else { continue };
                robot.poses.push(*pose);
                robot.targets.push(*target);
            }
            self.next_us += PERIOD_US;
        }
    }
}
