//! When a robot was driven by set-points, and when it came to rest by itself.

use crate::channel::Channel;
use crate::telemetry::{Series, Telemetry};

/// Share of the frames before the last set-points that hold some, in logs that write them with every frame and not with every change.
const EVERY_FRAME: f64 = 0.9;

impl Telemetry {
    /// The same without the rows at its end in which frames were sent and no set-points, and how long these are, s: a robot whose run has ended brakes by a
    /// ramp of its own, which no set-point shows.
    ///
    /// Nothing is left out where frames without set-points stand between others: set-points may be written when they change.
    pub fn while_driven(mut self) -> (Telemetry, f64) {
        let Some(end) = self.first_row_after_set_points() else {
            return (self, 0.0);
        };
        let last_s = self.time_s.last().copied().unwrap_or(0.0);
        let left_out_s = last_s - self.time_s[end];
        self.truncate(end);
        (self, left_out_s)
    }

    /// The first frame after all set-points.
    fn first_row_after_set_points(&self) -> Option<usize> {
        let frames = &self.series(Channel::SequenceSent)?.rows;
        let commands: Vec<&Series> = self
            .channels
            .iter()
            .filter(|(channel, _)| channel.is_command())
            .map(|(_, series)| series)
            .collect();
        let last = commands.iter().filter_map(|series| series.rows.last()).max()?;
        let before = frames.partition_point(|row| row <= last);
        let end = *frames.get(before)?;
        let holds = |row: &&u32| commands.iter().any(|series| series.rows.binary_search(row).is_ok());
        let with = frames[..before].iter().filter(holds).count();
        (with as f64 >= EVERY_FRAME * before as f64 && with > 0).then_some(end as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(rows: &str) -> Telemetry {
        let csv = format!("time_s,command_wheel_0_rad_per_s,wheel_0_rad_per_s,command_seq_sent\n{rows}");
        match Telemetry::from_csv(csv.as_bytes()) {
            Ok(telemetry) => telemetry,
            Err(error) => panic!("{error}"),
        }
    }

    #[test]
    fn rows_after_the_last_set_points_are_left_out_while_frames_go_on() {
        let rows = "0,1,,1\n0.1,,0.9,\n0.2,2,,2\n0.3,,1.8,\n0.4,,,3\n0.5,,1.2,\n0.6,,,4\n0.7,,0.1,\n";
        let (driven, left_out_s) = read(rows).while_driven();
        assert_eq!(driven.time_s, [0.0, 0.1, 0.2, 0.3]);
        assert!((left_out_s - 0.3).abs() < 1e-12);
        let speeds = driven
            .series(Channel::WheelSpeed(0))
            .map(|series| series.values.clone());
        assert_eq!(speeds, Some(vec![0.9, 1.8]));
        let frames = driven.series(Channel::SequenceSent).map(|series| series.rows.clone());
        assert_eq!(frames, Some(vec![0, 2]));
    }

    #[test]
    fn logs_without_such_an_end_stay_whole() {
        let whole = |rows: &str| {
            let read = read(rows);
            assert_eq!(read.clone().while_driven(), (read, 0.0), "{rows}");
        };
        whole("0,1,,1\n0.1,,0.9,\n0.2,2,,2\n0.3,,1.8,\n");
        // Set-points in rows of their own, or none at all, or no frames.
        whole("0,1,,\n0.1,,0.9,1\n0.2,2,,\n0.3,,1.8,2\n");
        whole("0,,0,1\n0.1,,1,2\n0.2,,1,3\n");
        whole("0,1,,\n0.1,,0.9,\n0.2,,1.0,\n0.3,,1.0,\n");
        // Frames before the first set-points, and one that was lost between others.
        whole("0,,0,1\n0.1,1,,2\n0.2,1,,3\n0.3,,0.5,\n");
        // Set-points that are written when they change.
        whole("0,1,,1\n0.1,,0.9,2\n0.2,2,,3\n0.3,,1.8,4\n0.4,3,,5\n0.5,,2.9,6\n");
    }
}
