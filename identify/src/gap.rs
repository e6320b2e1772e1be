//! Residual r5, end to end: commands replayed through the twin against measured poses.
//!
//! Every 2 s the twin's path is laid on the measured one (the anchor) and driven on by the recorded commands alone; the
//! gap is the distance between its pose and the measured one 0.5, 1, 2 and 5 s later. The twin starts 0.3 s before the
//! anchor in the measured state, so that its speed loops have settled, and is anchored by the rigid motion that best
//! takes its poses to the measured ones within 0.1 s of the anchor. Where the run has no set-points of the driven wheels, their
//! measured speeds are taken instead: the gap is then that of the contact and the steering alone. Nothing is predicted over a pause of the
//! rows or a place at which the tracker took up the robot elsewhere. The gap shows everything and names nothing.

use serde::Serialize;
use twin::effect::Effect;
use twin::pose::{Pose, wrapped_rad};
use twin::replay::{CommandRow, HeldCommand, ReplayError, ReplayRow, replay_after};
use twin::robot::Robot;

use crate::anchor::{Track, start_at};
use crate::bundle::Bundle;
use crate::record::{BEYOND_THE_LINE_M, MEMORY_S, RollingInput};
use crate::steering_history::SteeringHistory;
use crate::stretch::Stretch;

/// Horizons, s.
pub const HORIZONS_S: [f64; 4] = [0.5, 1.0, 2.0, 5.0];
/// Time from one anchor to the next, s.
pub const ANCHOR_PERIOD_S: f64 = 2.0;
/// The same where few runs must give a steady figure: spans overlap.
pub const CLOSE_ANCHOR_PERIOD_S: f64 = 0.5;
/// Time that the twin runs before it is anchored, s.
pub const RUN_IN_S: f64 = 0.3;
/// Fewest poses in that window.
const MIN_ANCHOR_POSES: usize = 5;
/// Rate at which measured wheel speeds stand for set-points, Hz.
const CONTROL_HZ: f64 = 120.0;
/// A measured pose this close to a horizon stands for it, s.
const HORIZON_TOLERANCE_S: f64 = 0.05;

/// RMS prediction gap at one horizon.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct HorizonGap {
    pub horizon_s: f64,
    /// RMS distance of the positions; 0 when `samples` is 0.
    pub position_m: f64,
    /// RMS difference of the yaw, wrapped.
    pub yaw_rad: f64,
    /// Anchors that had a measured pose at this horizon.
    pub samples: u32,
}

/// One prediction against one measured pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GapSample {
    /// `time_s` of the anchor.
    pub anchor_s: f64,
    pub horizon_s: f64,
    /// Predicted less measured, in the measured body frame: positive = the twin is ahead.
    pub forward_m: f64,
    /// Positive = the twin is to the left.
    pub left_m: f64,
    pub yaw_rad: f64,
}

/// Residual r5 of one run.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct EndToEndGap {
    /// In the order of [`HORIZONS_S`].
    pub horizons: Vec<HorizonGap>,
    /// In order of anchor, then horizon.
    pub samples: Vec<GapSample>,
    /// Anchors where the measurements did not carry a start.
    pub anchors_skipped: u32,
    /// Poses left out as flips or jumps of the tracker.
    pub pose_outliers: u32,
}

/// Why a run has no end-to-end gap.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GapError {
    #[error("the run has no measured poses (pose_x_m, pose_y_m and pose_yaw_rad in one row)")]
    NoPoses,
    #[error("the run has no commands")]
    NoCommands,
    #[error("the run is shorter than {0} s after its first usable anchor")]
    TooShort(f64),
    #[error("prediction from {anchor_s} s: {source}")]
    Replay { anchor_s: f64, source: ReplayError },
}

/// End-to-end gap of a run under its own robot description.
pub fn end_to_end(bundle: &Bundle) -> Result<EndToEndGap, GapError> {
    end_to_end_with(bundle, &bundle.robot, RobotClock::default(), ANCHOR_PERIOD_S)
}

/// What the robot's clock shows less what the tracker's clock shows: the effect `clock_offset`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RobotClock {
    /// At the run's first row, s.
    pub offset_s: f64,
    /// Per second.
    pub drift: f64,
}

impl RobotClock {
    /// As the effects of a model say.
    pub fn of(effects: &[Effect]) -> Self {
        let clocks = effects.iter().filter(|effect| effect.name == "clock_offset");
        clocks.fold(Self::default(), |sum, effect| Self {
            offset_s: sum.offset_s + effect.value("offset"),
            drift: sum.drift + effect.value("drift"),
        })
    }
}

/// End-to-end gap of a run when `robot` predicts it; predictions start from what the robot measured at the moment, by its clock.
///
/// - `anchor_period_s`: time from one anchor to the next, positive.
pub fn end_to_end_with(
    bundle: &Bundle,
    robot: &Robot,
    clock: RobotClock,
    anchor_period_s: f64,
) -> Result<EndToEndGap, GapError> {
    let track = Track::of(bundle);
    let (Some(first_s), Some(last_s)) = (track.time_s.first(), track.time_s.last()) else {
        return Err(GapError::NoPoses);
    };
    if !bundle.telemetry.channels.keys().any(|channel| channel.is_command()) {
        return Err(GapError::NoCommands);
    }
    let rows = delayed_rows(bundle);
    let mut gap = EndToEndGap {
        pose_outliers: track.outliers,
        ..EndToEndGap::default()
    };
    let steering = SteeringHistory::of(bundle);
    let mut steered = steering.walk();
    let mut begin_s = *first_s;
    let mut before = HeldCommand::default();
    if let Some(first) = rows.first() {
        before.apply(robot, first);
    }
    let (mut forgotten, mut applied) = (0, 0);
    let (stretches, times) = (Stretch::of(bundle, &track), &bundle.telemetry.time_s);
    while begin_s + RUN_IN_S + HORIZONS_S[0] <= *last_s {
        let row = times.partition_point(|t| *t < begin_s);
        let stretch = times
            .get(row)
            .and_then(|at_s| stretch_at(&stretches, *at_s, track.half_window_s));
        let start = stretch.and_then(|_| {
            let at_s = times[row];
            let board_s = at_s + clock.offset_s + clock.drift * (at_s - times[0]);
            let board_row = times.partition_point(|t| *t <= board_s).saturating_sub(1);
            let board_row = if clock == RobotClock::default() { row } else { board_row };
            start_at(bundle, &track, (row, board_row), &mut steered)
        });
        let done = match start.zip(stretch) {
            None => false,
            Some((mut start, stretch)) => {
                let start_s = times[row];
                applied += rows[applied..].partition_point(|row| row.time_s <= start_s);
                while forgotten < applied && rows[forgotten].time_s <= start_s - MEMORY_S {
                    before.apply(robot, &rows[forgotten]);
                    forgotten += 1;
                }
                let earlier = &rows[forgotten..applied];
                let anchor = Anchor::at(&track, start_s + RUN_IN_S, stretch.to_s);
                let plan = anchor.plan(&rows[applied..], start_s, &track);
                // Which camera saw the robot nobody tells: the one with which the prediction is nearer.
                let mut best: Option<(f64, Vec<GapSample>)> = None;
                for pose in robot.poses_seen_at(start.pose, BEYOND_THE_LINE_M) {
                    start.pose = pose;
                    let out =
                        replay_after(robot, &start, before, earlier, &plan).map_err(|source| GapError::Replay {
                            anchor_s: anchor.time_s,
                            source,
                        })?;
                    let Some(samples) = anchor.samples(&track, &out) else {
                        continue;
                    };
                    let off = |sample: &GapSample| sample.forward_m * sample.forward_m + sample.left_m * sample.left_m;
                    let off_m2: f64 = samples.iter().map(off).sum();
                    if best.as_ref().is_none_or(|best| off_m2 < best.0) {
                        best = Some((off_m2, samples));
                    }
                }
                let done = best.is_some();
                gap.samples.extend(best.into_iter().flat_map(|best| best.1));
                done
            }
        };
        gap.anchors_skipped += u32::from(!done);
        begin_s += anchor_period_s;
    }
    if gap.samples.is_empty() {
        return Err(GapError::TooShort(RUN_IN_S + HORIZONS_S[0]));
    }
    gap.summarise();
    Ok(gap)
}

/// The stretch in which a start at a time has all the poses that it is fitted to.
fn stretch_at(stretches: &[Stretch], start_s: f64, half_window_s: f64) -> Option<&Stretch> {
    let k = stretches
        .iter()
        .position(|stretch| stretch.from_s <= start_s && start_s <= stretch.to_s)?;
    // Nothing was before the first one that poses could be taken from.
    (k == 0 || start_s - half_window_s >= stretches[k].from_s).then(|| &stretches[k])
}

/// What drives the twin: command rows at the time they take effect; measured wheel speeds at the rate of the control where there are no set-points.
pub fn delayed_rows(bundle: &Bundle) -> Vec<CommandRow> {
    let mut rows = bundle.command_rows();
    for row in &mut rows {
        row.time_s += bundle.run.command_delay_s;
    }
    let input = RollingInput::of(bundle).filter(|_| !bundle.commands_wheels());
    let (Some(input), Some(first), Some(last)) = (input, rows.first(), rows.last()) else {
        return rows;
    };
    let (first_s, count) = (first.time_s, ((last.time_s - first.time_s) * CONTROL_HZ) as usize);
    rows.retain(|row| row.steering_rad.is_some());
    let steering = rows;
    let mut rows = Vec::with_capacity(count + 1);
    let (mut next, mut held) = (0, None);
    let tick_s = |k: usize| first_s + k as f64 / CONTROL_HZ;
    let spans = || (0..=count).map(|k| (tick_s(k), tick_s(k) + 1.0 / CONTROL_HZ));
    let speeds: Vec<Option<Vec<f64>>> = input
        .wheels
        .iter()
        .map(|wheel| Some(wheel.as_ref()?.speeds(spans())))
        .collect();
    for k in 0..=count {
        let from_s = tick_s(k);
        let mut row = CommandRow {
            time_s: from_s,
            ..CommandRow::default()
        };
        for (slot, speeds) in row.wheel_rad_per_s.iter_mut().zip(&speeds) {
            *slot = speeds.as_ref().map(|speeds| speeds[k]);
        }
        while next < steering.len() && steering[next].time_s <= from_s {
            held = steering[next].steering_rad;
            next += 1;
        }
        row.steering_rad = held;
        rows.push(row);
    }
    rows
}

/// A moment of the track: the measured poses around it and those at the horizons, as positions in the track.
struct Anchor {
    time_s: f64,
    window: core::ops::Range<usize>,
    goals: Vec<(f64, usize)>,
}

impl Anchor {
    /// - `until_s`: end of the stretch that the moment is in.
    fn at(track: &Track, time_s: f64, until_s: f64) -> Anchor {
        let last = track.time_s.partition_point(|t| *t <= until_s);
        let from = track.time_s.partition_point(|t| *t < time_s - track.half_window_s);
        let to = track
            .time_s
            .partition_point(|t| *t <= time_s + track.half_window_s)
            .min(last);
        let mut goals = Vec::new();
        for horizon_s in HORIZONS_S {
            let wanted_s = time_s + horizon_s;
            let after = track.time_s.partition_point(|t| *t < wanted_s);
            let sides = [after.checked_sub(1), Some(after)]
                .into_iter()
                .flatten()
                .filter(|index| *index < last);
            let distance_s = |index: &usize| (track.time_s[*index] - wanted_s).abs();
            let nearest = sides.min_by(|a, b| distance_s(a).total_cmp(&distance_s(b)));
            goals.extend(
                nearest
                    .filter(|index| distance_s(index) <= HORIZON_TOLERANCE_S)
                    .map(|index| (horizon_s, index)),
            );
        }
        Anchor {
            time_s,
            window: from..to,
            goals,
        }
    }

    /// Rows for the replay: the start, the commands up to the last goal, and the times where poses are compared.
    fn plan(&self, rows: &[CommandRow], start_s: f64, track: &Track) -> Vec<CommandRow> {
        let mut plan = vec![CommandRow {
            time_s: start_s,
            ..CommandRow::default()
        }];
        let compared = || {
            self.window
                .clone()
                .chain(self.goals.iter().map(|(_, index)| *index))
                .map(|index| track.time_s[index])
        };
        let end_s = compared().fold(start_s, f64::max);
        plan.extend(rows.iter().take_while(|row| row.time_s <= end_s));
        for time_s in compared().filter(|time_s| *time_s > start_s) {
            let at = plan.partition_point(|row| row.time_s < time_s);
            if plan.get(at).is_none_or(|row| row.time_s != time_s) {
                plan.insert(
                    at,
                    CommandRow {
                        time_s,
                        ..CommandRow::default()
                    },
                );
            }
        }
        plan
    }

    /// The rigid motion that takes the twin's poses in the window to the measured ones; `None` with too few poses.
    fn measured_from_twin(&self, track: &Track, out: &[ReplayRow]) -> Option<RigidMotion> {
        let pairs: Vec<(Pose, Pose)> = self
            .window
            .clone()
            .filter_map(|index| Some((pose_at(out, track.time_s[index])?, track.poses[index])))
            .collect();
        if pairs.len() < MIN_ANCHOR_POSES {
            return None;
        }
        let count = pairs.len() as f64;
        let mean = |value: &dyn Fn(&(Pose, Pose)) -> f64| pairs.iter().map(value).sum::<f64>() / count;
        // Around the first pair, so that the mean of wrapped angles is one.
        let base_rad = pairs[0].1.yaw_rad - pairs[0].0.yaw_rad;
        let turn_rad = base_rad + mean(&|(twin, measured)| wrapped_rad(measured.yaw_rad - twin.yaw_rad - base_rad));
        let (sin, cos) = libm::sincos(turn_rad);
        let (x, y) = (mean(&|(twin, _)| twin.x_m), mean(&|(twin, _)| twin.y_m));
        let x_m = mean(&|(_, measured)| measured.x_m) - (cos * x - sin * y);
        let y_m = mean(&|(_, measured)| measured.y_m) - (sin * x + cos * y);
        Some(RigidMotion {
            cos,
            sin,
            turn_rad,
            x_m,
            y_m,
        })
    }

    /// How far off predictions are at the anchor's goals; `None` when the anchor has too few poses.
    fn samples(&self, track: &Track, out: &[ReplayRow]) -> Option<Vec<GapSample>> {
        let motion = self.measured_from_twin(track, out)?;
        let mut samples = Vec::with_capacity(self.goals.len());
        for (horizon_s, index) in &self.goals {
            let measured = &track.poses[*index];
            let Some(predicted) = pose_at(out, track.time_s[*index]).map(|pose| motion.apply(&pose)) else {
                continue;
            };
            let (dx, dy) = (predicted.x_m - measured.x_m, predicted.y_m - measured.y_m);
            let (sin, cos) = libm::sincos(measured.yaw_rad);
            samples.push(GapSample {
                anchor_s: self.time_s,
                horizon_s: *horizon_s,
                forward_m: dx * cos + dy * sin,
                left_m: dy * cos - dx * sin,
                yaw_rad: wrapped_rad(predicted.yaw_rad - measured.yaw_rad),
            });
        }
        Some(samples)
    }
}

struct RigidMotion {
    cos: f64,
    sin: f64,
    turn_rad: f64,
    x_m: f64,
    y_m: f64,
}

impl RigidMotion {
    fn apply(&self, pose: &Pose) -> Pose {
        Pose {
            x_m: self.x_m + self.cos * pose.x_m - self.sin * pose.y_m,
            y_m: self.y_m + self.sin * pose.x_m + self.cos * pose.y_m,
            yaw_rad: pose.yaw_rad + self.turn_rad,
        }
    }
}

/// The twin's pose at a time that the replay was asked for.
fn pose_at(out: &[ReplayRow], time_s: f64) -> Option<Pose> {
    out.binary_search_by(|row| row.time_s.total_cmp(&time_s))
        .ok()
        .map(|found| out[found].state.pose)
}

impl EndToEndGap {
    fn summarise(&mut self) {
        for horizon_s in HORIZONS_S {
            let mut gap = HorizonGap {
                horizon_s,
                ..HorizonGap::default()
            };
            let (mut position, mut yaw) = (0.0, 0.0);
            for sample in self.samples.iter().filter(|sample| sample.horizon_s == horizon_s) {
                position += sample.forward_m * sample.forward_m + sample.left_m * sample.left_m;
                yaw += sample.yaw_rad * sample.yaw_rad;
                gap.samples += 1;
            }
            if gap.samples > 0 {
                gap.position_m = (position / f64::from(gap.samples)).sqrt();
                gap.yaw_rad = (yaw / f64::from(gap.samples)).sqrt();
            }
            self.horizons.push(gap);
        }
    }
}
