//! When a robot was driven by set-points, and when it braked by itself.

use crate::channel::Channel;
use crate::telemetry::{Series, Telemetry};

impl Telemetry {
    /// The same without the rows in which frames were sent and no set-points, and these spans, s: the robot brakes by itself then, by a ramp that no set-point
    /// shows.
    ///
    /// Nothing is left out before the first set-points, nor where most frames stand in rows of their own.
    pub fn while_driven(mut self) -> (Telemetry, Vec<[f64; 2]>) {
        let spans = self.undriven_rows();
        let of = |[from, to]: &[usize; 2]| [self.time_s[*from], self.time_s[to - 1]];
        let times: Vec<[f64; 2]> = spans.iter().map(of).collect();
        if !spans.is_empty() {
            self.leave_out(&spans);
        }
        (self, times)
    }

    /// Rows from the first frame without set-points to the next one with some.
    fn undriven_rows(&self) -> Vec<[usize; 2]> {
        let Some(frames) = self.series(Channel::SequenceSent) else {
            return Vec::new();
        };
        let mut has_set_points = vec![false; self.time_s.len()];
        let commands = self.channels.iter().filter(|(channel, _)| channel.is_command());
        for row in commands.flat_map(|(_, series)| &series.rows) {
            has_set_points[*row as usize] = true;
        }
        let with = frames.rows.iter().filter(|row| has_set_points[**row as usize]).count();
        if 2 * with < frames.rows.len() {
            return Vec::new();
        }
        let first = has_set_points.iter().position(|has| *has).unwrap_or(self.time_s.len());
        let mut spans: Vec<[usize; 2]> = Vec::new();
        let mut is_open = false;
        for row in frames.rows.iter().map(|row| *row as usize).filter(|row| *row > first) {
            match (has_set_points[row], spans.last_mut()) {
                (true, Some(last)) if is_open => last[1] = row,
                (false, _) if !is_open => spans.push([row, self.time_s.len()]),
                _ => {}
            }
            is_open = !has_set_points[row];
        }
        spans
    }

    fn leave_out(&mut self, spans: &[[usize; 2]]) {
        let is_kept = |row: usize| !spans.iter().any(|[from, to]| (*from..*to).contains(&row));
        let mut next = 0;
        let numbers: Vec<Option<u32>> = (0..self.time_s.len())
            .map(|row| {
                is_kept(row).then(|| {
                    next += 1;
                    next - 1
                })
            })
            .collect();
        let mut row = 0;
        self.time_s.retain(|_| {
            row += 1;
            numbers[row - 1].is_some()
        });
        for series in self.channels.values_mut() {
            let pairs = series.rows.iter().zip(&series.values);
            let (rows, values) = pairs
                .filter_map(|(row, value)| Some((numbers[*row as usize]?, *value)))
                .unzip();
            *series = Series { rows, values };
        }
        let gone = self.channels.extract_if(.., |_, series| series.rows.is_empty());
        self.empty.extend(gone.map(|(channel, _)| channel));
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
        let (driven, spans) =
            read("0,1,,1\n0.1,,0.9,\n0.2,2,,2\n0.3,,1.8,\n0.4,,,3\n0.5,,1.2,\n0.6,,,4\n0.7,,0.1,\n").while_driven();
        assert_eq!(driven.time_s, [0.0, 0.1, 0.2, 0.3]);
        assert_eq!(spans, [[0.4, 0.7]]);
        let speeds = driven
            .series(Channel::WheelSpeed(0))
            .map(|series| series.values.clone());
        assert_eq!(speeds, Some(vec![0.9, 1.8]));
        let frames = driven.series(Channel::SequenceSent).map(|series| series.rows.clone());
        assert_eq!(frames, Some(vec![0, 2]));
    }

    #[test]
    fn a_pause_between_set_points_is_a_pause_of_the_rows() {
        let (driven, spans) = read("0,1,,1\n0.1,,0.9,\n0.2,,,2\n0.3,,0.4,\n0.4,1,,3\n0.5,,0.6,\n").while_driven();
        assert_eq!((driven.time_s, spans), (vec![0.0, 0.1, 0.4, 0.5], vec![[0.2, 0.3]]));
    }

    #[test]
    fn logs_whose_set_points_stand_elsewhere_and_those_without_frames_stay_whole() {
        let elsewhere = read("0,1,,\n0.1,,0.9,1\n0.2,2,,\n0.3,,1.8,2\n");
        assert_eq!(elsewhere.clone().while_driven(), (elsewhere, Vec::new()));
        let changes_only = read("0,1,,\n0.1,,0.9,\n0.2,,1.0,\n0.3,,1.0,\n");
        assert_eq!(changes_only.clone().while_driven(), (changes_only, Vec::new()));
        let starts_later = read("0,,0,1\n0.1,1,,2\n0.2,1,,3\n0.3,,0.5,\n");
        assert_eq!(starts_later.clone().while_driven(), (starts_later, Vec::new()));
    }
}
