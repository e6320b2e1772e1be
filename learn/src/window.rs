//! Short spans of a run that predictions start in, with what was measured in them.
//!
//! A window begins in the measured state ([`identify::anchor`]), runs in, is anchored on the measured poses around the
//! end of the run-in and compared from there to its horizon. Spans with pauses of the telemetry or breaks of the track
//! are skipped. Memory is bounded: a [`Collection`] keeps every k-th window of the stream, and k doubles when it is full.

use identify::anchor::{Track, start_at};
use identify::bundle::{Bundle, LONG_PAUSE_S};
use identify::channel::Channel;
use identify::gap::{RobotClock, delayed_rows};
use identify::record::MEMORY_S;
use identify::steering_history::{SteeringHistory, Walk};
use twin::free::Start;
use twin::replay::{CommandRow, HeldCommand, merged};

use crate::problem::LearnError;

/// Time that a prediction runs before it is anchored, s; as in `identify::gap`.
pub const RUN_IN_S: f64 = identify::gap::RUN_IN_S;
/// Rate of the rows that predictions are read out at, Hz: the control's.
pub const ROW_HZ: f64 = 120.0;
/// Width of the bins of on-board channels and between measured twists, s.
const BIN_S: f64 = 0.1;
/// Longest pause between two rows inside a window, s.
const PAUSE_S: f64 = LONG_PAUSE_S;
/// Rows from one remembered set-point to the next.
const CHECKPOINT_ROWS: usize = 512;
/// Fewest poses around the anchor.
const MIN_ANCHOR_POSES: usize = 5;
/// Least share of the expected poses after the anchor, of those a second that the run has at best.
const MIN_POSES: f64 = 0.5;
/// Largest sizes that a robot's state can have at the start of a window: m/s, rad/s of the body, rad/s of a wheel, m.
const LARGEST: [(&str, f64); 4] = [
    ("speed_m_per_s", 30.0),
    ("yaw_rate_rad_per_s", 60.0),
    ("wheel_rad_per_s", 5000.0),
    ("pose_m", 1e5),
];

/// What is cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// Compared time after the anchor, s.
    pub horizon_s: f64,
    /// From one window to the next, s.
    pub period_s: f64,
}

/// A pose with its time since the window's start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseSample {
    pub time_s: f64,
    pub x_m: f64,
    pub y_m: f64,
    /// Not wrapped.
    pub yaw_rad: f64,
}

/// What a bin was measured of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reading {
    Wheel(usize),
    Gyro,
    /// From the poses.
    Forward,
    Left,
    YawRate,
}

/// Mean of a channel over a bin, or a twist at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    pub reading: Reading,
    pub time_s: f64,
    pub value: f64,
}

/// One span. Times count from its start.
#[derive(Debug, Clone)]
pub struct Window {
    /// Position of its run among those collected.
    pub run: usize,
    /// In the run's time.
    pub start_s: f64,
    pub start: Start,
    /// In force before `earlier`.
    pub before: HeldCommand,
    pub earlier: Vec<CommandRow>,
    /// Commands and the times at which a prediction is read out.
    pub rows: Vec<CommandRow>,
    pub horizon_s: f64,
    /// Poses within this of the anchor lay the prediction on the measurement, s.
    pub half_window_s: f64,
    pub poses: Vec<PoseSample>,
    pub samples: Vec<Sample>,
}

impl Window {
    /// Where it is anchored, s.
    pub fn anchor_s(&self) -> f64 {
        RUN_IN_S
    }

    /// Its end, s.
    pub fn end_s(&self) -> f64 {
        RUN_IN_S + self.horizon_s
    }
}

/// Windows of a role, few enough for memory.
#[derive(Debug, Clone)]
pub struct Collection {
    pub cut: Cut,
    pub windows: Vec<Window>,
    /// Windows that the runs had, those left out for memory included.
    pub seen: usize,
    /// Windows that the measurements did not carry.
    pub skipped: usize,
    /// Every which window is kept.
    pub stride: usize,
    most: usize,
}

impl Collection {
    /// Empty.
    ///
    /// - `most`: windows kept; beyond it every second one goes and the stride doubles.
    pub fn new(cut: Cut, most: usize) -> Collection {
        Collection {
            cut,
            windows: Vec::new(),
            seen: 0,
            skipped: 0,
            stride: 1,
            most: most.max(2),
        }
    }

    /// Cuts a run and keeps its share.
    ///
    /// - `run`: its position; `path`: its name in errors.
    /// - `clock`: the robot's clock less the tracker's, by the model.
    /// - Errors: a state that no robot can have.
    pub fn add(&mut self, run: usize, path: &str, bundle: &Bundle, clock: RobotClock) -> Result<(), LearnError> {
        let source = Source::of(bundle, clock);
        let (Some(first_s), Some(last_s)) = (source.track.time_s.first(), source.track.time_s.last()) else {
            return Ok(());
        };
        let margin_s = source.track.half_window_s;
        let count = ((last_s - first_s - margin_s - RUN_IN_S - self.cut.horizon_s) / self.cut.period_s).floor();
        if count < 0.0 {
            return Ok(());
        }
        let steering = SteeringHistory::of(bundle);
        let mut steered = steering.walk();
        for number in 0..=count as usize {
            let begin_s = first_s + margin_s + number as f64 * self.cut.period_s;
            if !self.seen.is_multiple_of(self.stride) {
                self.seen += 1;
                continue;
            }
            let Some(window) = source.window(run, begin_s, self.cut.horizon_s, &mut steered) else {
                self.skipped += 1;
                continue;
            };
            check(path, &window)?;
            self.seen += 1;
            self.windows.push(window);
            if self.windows.len() > self.most {
                let mut position = 0;
                self.windows.retain(|_| {
                    position += 1;
                    position % 2 == 1
                });
                self.stride *= 2;
            }
        }
        Ok(())
    }
}

struct Source<'a> {
    bundle: &'a Bundle,
    track: Track,
    breaks: Vec<f64>,
    rows: Vec<CommandRow>,
    /// Set-points in force before every [`CHECKPOINT_ROWS`]-th row.
    checkpoints: Vec<HeldCommand>,
    channels: Vec<(Reading, &'a identify::bundle::Series)>,
    /// Most poses a second.
    pose_hz: f64,
    clock: RobotClock,
}

impl<'a> Source<'a> {
    fn of(bundle: &'a Bundle, clock: RobotClock) -> Source<'a> {
        let track = Track::of(bundle);
        let mut channels = Vec::new();
        let wheels = (0..bundle.run.robot.wheels.len()).map(|k| (Reading::Wheel(k), Channel::WheelSpeed(k)));
        for (reading, channel) in wheels.chain([(Reading::Gyro, Channel::Gyro)]) {
            let series = bundle.telemetry.series(channel);
            channels.extend(
                series
                    .filter(|series| !series.is_constant())
                    .map(|series| (reading, series)),
            );
        }
        let mut periods: Vec<f64> = track.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        periods.sort_by(f64::total_cmp);
        let period_s = periods.get(periods.len() / 2).copied().unwrap_or(1.0);
        let rows = delayed_rows(bundle);
        let mut held = HeldCommand::default();
        if let Some(first) = rows.first() {
            held.apply(&bundle.robot, first);
        }
        let mut checkpoints = Vec::with_capacity(rows.len() / CHECKPOINT_ROWS + 1);
        for chunk in rows.chunks(CHECKPOINT_ROWS) {
            checkpoints.push(held);
            chunk.iter().for_each(|row| held.apply(&bundle.robot, row));
        }
        Source {
            breaks: track.breaks(),
            rows,
            checkpoints,
            pose_hz: 1.0 / period_s.max(1e-3),
            bundle,
            track,
            channels,
            clock,
        }
    }

    /// `None` where the measurements do not carry it.
    fn window(&self, run: usize, begin_s: f64, horizon_s: f64, steered: &mut Walk) -> Option<Window> {
        let times = &self.bundle.telemetry.time_s;
        let row = times.partition_point(|t| *t < begin_s);
        let start_s = *times.get(row)?;
        let end_s = start_s + RUN_IN_S + horizon_s;
        if start_s - begin_s > PAUSE_S || self.interrupted(row, start_s, end_s) {
            return None;
        }
        let board_row = self.board_row(row, start_s);
        let start = start_at(self.bundle, &self.track, (row, board_row), steered)?;
        let (before, earlier, rows) = self.commands(start_s, end_s)?;
        let mut window = Window {
            run,
            start_s,
            start,
            before,
            earlier,
            rows,
            horizon_s,
            half_window_s: self.track.half_window_s,
            poses: self.poses(start_s, end_s),
            samples: Vec::new(),
        };
        let anchor_s = window.anchor_s();
        let near = |pose: &&PoseSample| (pose.time_s - anchor_s).abs() <= window.half_window_s;
        let after = window.poses.iter().filter(|pose| pose.time_s > anchor_s).count();
        if window.poses.iter().filter(near).count() < MIN_ANCHOR_POSES
            || (after as f64) < MIN_POSES * self.pose_hz * horizon_s
        {
            return None;
        }
        window.samples = self.samples(start_s, anchor_s, anchor_s + horizon_s);
        Some(window)
    }

    /// A pause of the rows, or a step of the track that no robot makes.
    fn interrupted(&self, row: usize, start_s: f64, end_s: f64) -> bool {
        let times = &self.bundle.telemetry.time_s;
        let last = times.partition_point(|t| *t <= end_s);
        let paused = times[row..last].windows(2).any(|pair| pair[1] - pair[0] > PAUSE_S);
        let short = times[row..last].last().is_none_or(|t| end_s - t > PAUSE_S);
        let from = start_s - self.track.half_window_s;
        paused || short || self.breaks.iter().any(|at| *at >= from && *at <= end_s)
    }

    fn board_row(&self, row: usize, at_s: f64) -> usize {
        if self.clock == RobotClock::default() {
            return row;
        }
        let times = &self.bundle.telemetry.time_s;
        let board_s = at_s + self.clock.offset_s + self.clock.drift * (at_s - times[0]);
        times.partition_point(|t| *t <= board_s).saturating_sub(1)
    }

    /// What was in force, set-points remembered, and rows of the window; times from its start.
    fn commands(&self, start_s: f64, end_s: f64) -> Option<(HeldCommand, Vec<CommandRow>, Vec<CommandRow>)> {
        let is_set = |row: &&CommandRow| {
            **row
                != CommandRow {
                    time_s: row.time_s,
                    ..CommandRow::default()
                }
        };
        let shifted = |row: &CommandRow| CommandRow {
            time_s: row.time_s - start_s,
            ..*row
        };
        let applied = self.rows.partition_point(|row| row.time_s <= start_s);
        let forgotten = self.rows.partition_point(|row| row.time_s <= start_s - MEMORY_S);
        let checkpoint = (forgotten / CHECKPOINT_ROWS).min(self.checkpoints.len().checked_sub(1)?);
        let mut before = self.checkpoints[checkpoint];
        for row in &self.rows[(checkpoint * CHECKPOINT_ROWS).min(forgotten)..forgotten] {
            before.apply(&self.bundle.robot, row);
        }
        let earlier = self.rows[forgotten..applied]
            .iter()
            .filter(is_set)
            .map(shifted)
            .collect();
        let last = self.rows.partition_point(|row| row.time_s < end_s);
        let mut rows: Vec<CommandRow> = self.rows[applied..last].iter().filter(is_set).map(shifted).collect();
        let count = ((end_s - start_s) * ROW_HZ) as usize + 1;
        rows.extend((0..=count).map(|k| CommandRow {
            time_s: k as f64 / ROW_HZ,
            ..CommandRow::default()
        }));
        Some((before, earlier, merged(rows)))
    }

    fn poses(&self, start_s: f64, end_s: f64) -> Vec<PoseSample> {
        let from = self.track.time_s.partition_point(|t| *t < start_s);
        let to = self.track.time_s.partition_point(|t| *t <= end_s);
        let pairs = self.track.time_s[from..to].iter().zip(&self.track.poses[from..to]);
        pairs
            .map(|(time_s, pose)| PoseSample {
                time_s: time_s - start_s,
                x_m: pose.x_m,
                y_m: pose.y_m,
                yaw_rad: pose.yaw_rad,
            })
            .collect()
    }

    /// Means over bins from the anchor on, and twists of the poses at their middles.
    fn samples(&self, start_s: f64, from_s: f64, to_s: f64) -> Vec<Sample> {
        let mut samples = Vec::new();
        let bins = ((to_s - from_s) / BIN_S + 0.5) as usize;
        let times = &self.bundle.telemetry.time_s;
        for bin in 0..bins {
            let begin_s = start_s + from_s + bin as f64 * BIN_S;
            let rows =
                times.partition_point(|t| *t < begin_s) as u32..times.partition_point(|t| *t < begin_s + BIN_S) as u32;
            for (reading, series) in &self.channels {
                let from = series.rows.partition_point(|row| *row < rows.start);
                let to = series.rows.partition_point(|row| *row < rows.end);
                if from == to {
                    continue;
                }
                let count = (to - from) as f64;
                let time_s = series.rows[from..to]
                    .iter()
                    .map(|row| times[*row as usize])
                    .sum::<f64>()
                    / count;
                samples.push(Sample {
                    reading: *reading,
                    time_s: time_s - start_s,
                    value: series.values[from..to].iter().sum::<f64>() / count,
                });
            }
            let middle_s = begin_s + 0.5 * BIN_S;
            let Some((pose, [vx, vy, yaw_rate])) = self.track.fitted(middle_s) else {
                continue;
            };
            let (sin, cos) = libm::sincos(pose.yaw_rad);
            let twist = [
                (Reading::Forward, vx * cos + vy * sin),
                (Reading::Left, vy * cos - vx * sin),
                (Reading::YawRate, yaw_rate),
            ];
            samples.extend(twist.map(|(reading, value)| Sample {
                reading,
                time_s: middle_s - start_s,
                value,
            }));
        }
        samples
    }
}

fn check(path: &str, window: &Window) -> Result<(), LearnError> {
    let start = &window.start;
    let twist = &start.twist;
    let wheel = start.wheel_rad_per_s.iter().fold(0.0_f64, |m, w| m.max(w.abs()));
    let sizes = [
        twist.forward_m_per_s.abs().max(twist.left_m_per_s.abs()),
        twist.yaw_rate_rad_per_s.abs(),
        wheel,
        start.pose.x_m.abs().max(start.pose.y_m.abs()),
    ];
    for ((quantity, limit), value) in LARGEST.into_iter().zip(sizes) {
        if value.is_nan() || value > limit {
            return Err(LearnError::Absurd {
                path: path.to_owned(),
                quantity,
                value,
                time_s: window.start_s,
                limit,
            });
        }
    }
    Ok(())
}
