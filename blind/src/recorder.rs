//! The same runs as other laboratories would have recorded them: other rates, fewer channels, coarser digits.

use anyhow::{Result, anyhow};
use clap::ValueEnum;
use identify::bundle::{Series, Telemetry};
use identify::channel::Channel;
use identify::diagnose::Run;

/// Every so many samples are left of what is measured: poses at 30 Hz of 120, on-board channels at 24 of 96.
const SLOW: usize = 4;
/// Length of runs that are cut short, s.
const SHORT_S: f64 = 8.0;
/// Seconds since 1970 at which a run of 2025 began.
const EPOCH_S: f64 = 1.764e9;

/// A way to record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Recorder {
    /// As the bench records
    AsIs,
    /// A quarter of the samples of everything that is measured
    Slow,
    /// Set-points, wheels, steering and poses: no currents, voltages, gyro and accelerometer
    Bare,
    /// Set-points and poses
    Poses,
    /// Digits of cheap parts: wheels 0.1 rad/s and 0.003 rad, steering 0.003 rad, currents 0.05 A, bus 0.05 V, gyro 0.005 rad/s, accelerometer 0.05 m/s2, poses 1 mm and 2 mrad
    Coarse,
    /// The first 8 s of each run
    Short,
    /// A description without the noise of its sensors
    Untold,
    /// Time stamps that count from 1970
    Epoch,
}

impl Recorder {
    /// A run as it would be recorded so.
    pub fn of(self, run: &Run) -> Result<Run> {
        let mut run = run.clone();
        let telemetry = &mut run.bundle.telemetry;
        match self {
            Recorder::AsIs => {}
            Recorder::Slow => telemetry
                .channels
                .iter_mut()
                .filter(|(channel, _)| !channel.is_command())
                .for_each(|(_, series)| *series = thinned(series)),
            Recorder::Bare => telemetry.channels.retain(|channel, _| !is_on_board_extra(*channel)),
            Recorder::Poses => telemetry
                .channels
                .retain(|channel, _| channel.is_command() || is_pose(*channel)),
            Recorder::Coarse => {
                for (channel, series) in &mut telemetry.channels {
                    if let Some(digit) = digit(*channel) {
                        series
                            .values
                            .iter_mut()
                            .for_each(|value| *value = (*value / digit).round() * digit);
                    }
                }
            }
            Recorder::Short => cut(telemetry),
            Recorder::Untold => {
                run.bundle.run.robot.noise = Default::default();
                run.bundle.robot = twin::robot::Robot::new(run.bundle.run.robot.clone())
                    .map_err(|problem| anyhow!("{}: {}", problem.field, problem.message))?;
            }
            Recorder::Epoch => {
                telemetry.time_s.iter_mut().for_each(|time_s| *time_s += EPOCH_S);
                // As the reader of bundles does.
                *telemetry = core::mem::take(telemetry).from_start();
            }
        }
        Ok(run)
    }
}

fn is_pose(channel: Channel) -> bool {
    matches!(
        channel,
        Channel::PoseX | Channel::PoseY | Channel::PoseYaw | Channel::CameraId
    )
}

fn is_on_board_extra(channel: Channel) -> bool {
    matches!(
        channel,
        Channel::Current(_) | Channel::Voltage(_) | Channel::Bus | Channel::Gyro | Channel::AccelX | Channel::AccelY
    )
}

/// Smallest step of a channel, in its unit.
fn digit(channel: Channel) -> Option<f64> {
    match channel {
        Channel::WheelSpeed(_) => Some(0.1),
        Channel::WheelAngle(_) | Channel::Steering => Some(0.003),
        Channel::Current(_) | Channel::AccelX | Channel::AccelY | Channel::Bus => Some(0.05),
        Channel::Gyro => Some(0.005),
        Channel::PoseX | Channel::PoseY => Some(0.001),
        Channel::PoseYaw => Some(0.002),
        _ => None,
    }
}

fn thinned(series: &Series) -> Series {
    Series {
        rows: series.rows.iter().copied().step_by(SLOW).collect(),
        values: series.values.iter().copied().step_by(SLOW).collect(),
    }
}

fn cut(telemetry: &mut Telemetry) {
    let Some(first) = telemetry.time_s.first().copied() else {
        return;
    };
    let rows = telemetry.time_s.partition_point(|time_s| *time_s < first + SHORT_S);
    telemetry.truncate(rows);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kind::Kind;
    use crate::set::{Set, Wish};

    #[test]
    fn recorders_leave_what_they_say() {
        let wish = Wish {
            kind: Some(Kind::None),
            chassis: Some("diff2".to_owned()),
            seconds: 12,
            references: 1,
            runs: 1,
            ..Wish::default()
        };
        let set = Set::new(1, 0, &wish).unwrap_or_else(|error| panic!("{error}"));
        let driven = set.driven(0).unwrap_or_else(|error| panic!("{error}"));
        let run = &driven.runs[0];
        let recorded = |recorder: Recorder| recorder.of(run).unwrap_or_else(|error| panic!("{error}"));
        let of = |recorder: Recorder| recorded(recorder).bundle.telemetry;
        let whole = of(Recorder::AsIs);
        assert_eq!(whole, run.bundle.telemetry);
        let count = |telemetry: &Telemetry, channel| telemetry.series(channel).map_or(0, |series| series.rows.len());
        let slow = of(Recorder::Slow);
        assert_eq!(
            count(&slow, Channel::PoseX),
            count(&whole, Channel::PoseX).div_ceil(SLOW)
        );
        assert_eq!(
            count(&slow, Channel::CommandWheel(0)),
            count(&whole, Channel::CommandWheel(0))
        );
        assert!(count(&whole, Channel::Gyro) > 0 && count(&whole, Channel::Current(0)) > 0);
        let bare = of(Recorder::Bare);
        assert_eq!((count(&bare, Channel::Gyro), count(&bare, Channel::Current(0))), (0, 0));
        assert!(count(&bare, Channel::WheelSpeed(0)) > 0);
        let poses = of(Recorder::Poses);
        assert_eq!(count(&poses, Channel::WheelSpeed(0)), 0);
        assert!(count(&poses, Channel::PoseYaw) > 0 && count(&poses, Channel::CommandWheel(0)) > 0);
        let coarse = of(Recorder::Coarse);
        assert!(coarse != whole);
        for (channel, step) in [
            (Channel::Gyro, 0.005),
            (Channel::WheelSpeed(0), 0.1),
            (Channel::PoseX, 0.001),
        ] {
            let values = &coarse.channels[&channel].values;
            assert!(!values.is_empty());
            assert!(
                values
                    .iter()
                    .all(|value| (value / step - (value / step).round()).abs() < 1e-9)
            );
        }
        let short = of(Recorder::Short);
        assert!(short.time_s[short.time_s.len() - 1] - short.time_s[0] < SHORT_S);
        assert!(
            short
                .channels
                .values()
                .flat_map(|series| &series.rows)
                .all(|row| (*row as usize) < short.time_s.len())
        );
        assert!(recorded(Recorder::Untold).bundle.run.robot.noise != run.bundle.run.robot.noise);
        assert_eq!(of(Recorder::Epoch), whole, "nothing depends on where a clock begins");
    }
}
