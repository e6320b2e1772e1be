//! Replays the commands of a run bundle through the twin.
//!
//! Starts at rest at the first pose (or from a given state), holds every set-point until the next one, adds no noise
//! and gives one row per input time stamp: what the model's sensors report then.

use crate::command::WheelCommand;
use crate::effect::History;
use crate::free::{FreeRobot, RobotState, Start};
use crate::pose::Pose;
use crate::residual::AXES;
use crate::robot::Robot;
use crate::told::Told;
use crate::twist::BodyTwist;
use crate::{MAX_WHEELS, PHYSICS_RATE_HZ, SUBSTEPS};

/// Time stamps are text with microseconds: a command counts at a sampling instant it misses by this much, s.
const STAMP_TOLERANCE_S: f64 = 1e-5;

/// Set-points longer ago than this are not worked out, steps (20 s).
const LONGEST_MEMORY_STEPS: u64 = 20 * PHYSICS_RATE_HZ as u64;

/// One row of the command columns; `None` = no sample at this time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CommandRow {
    pub time_s: f64,
    /// `command_wheel_<k>_rad_per_s` by position in `wheels`.
    pub wheel_rad_per_s: [Option<f64>; MAX_WHEELS],
    pub steering_rad: Option<f64>,
    /// `command_forward_m_per_s`, `command_left_m_per_s`, `command_yaw_rate_rad_per_s`: become wheel set-points by the
    /// slip-free inverse kinematics of the nominal geometry.
    pub forward_m_per_s: Option<f64>,
    pub left_m_per_s: Option<f64>,
    pub yaw_rate_rad_per_s: Option<f64>,
}

impl CommandRow {
    /// Takes over what a later row sets.
    fn take_over(&mut self, later: &CommandRow) {
        for (slot, new) in self.wheel_rad_per_s.iter_mut().zip(later.wheel_rad_per_s) {
            *slot = new.or(*slot);
        }
        self.steering_rad = later.steering_rad.or(self.steering_rad);
        self.forward_m_per_s = later.forward_m_per_s.or(self.forward_m_per_s);
        self.left_m_per_s = later.left_m_per_s.or(self.left_m_per_s);
        self.yaw_rate_rad_per_s = later.yaw_rate_rad_per_s.or(self.yaw_rate_rad_per_s);
    }
}

/// Rows in the order of time; those of one time stamp, to 10 us, are one row that has what the last of them sets.
pub fn merged(mut rows: Vec<CommandRow>) -> Vec<CommandRow> {
    rows.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let mut merged: Vec<CommandRow> = Vec::with_capacity(rows.len());
    for row in rows {
        match merged.last_mut() {
            Some(last) if row.time_s - last.time_s < STAMP_TOLERANCE_S => last.take_over(&row),
            _ => merged.push(row),
        }
    }
    merged
}

/// State of the twin at one input time stamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReplayRow {
    pub time_s: f64,
    pub state: RobotState,
}

/// Why rows cannot be replayed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReplayError {
    #[error("row {row}: time {time_s} s is not finite or not after the row before")]
    Time { row: usize, time_s: f64 },
    #[error("row {row}: a command is not finite")]
    Command { row: usize },
    #[error("the run lasts {duration_s} s; at most {MAX_DURATION_S} s are possible")]
    Duration { duration_s: f64 },
    #[error("state left the finite range before {time_s} s")]
    NotFinite { time_s: f64 },
}

/// Longest replay, s.
pub const MAX_DURATION_S: f64 = 24.0 * 3600.0;

/// The set-points in force, built up row by row.
#[derive(Debug, Clone, Copy, Default)]
pub struct HeldCommand {
    command: WheelCommand,
    twist: BodyTwist,
}

impl HeldCommand {
    /// Takes over what a row sets; the rest holds.
    pub fn apply(&mut self, robot: &Robot, row: &CommandRow) {
        if row.forward_m_per_s.is_some() || row.left_m_per_s.is_some() || row.yaw_rate_rad_per_s.is_some() {
            self.twist.forward_m_per_s = row.forward_m_per_s.unwrap_or(self.twist.forward_m_per_s);
            self.twist.left_m_per_s = row.left_m_per_s.unwrap_or(self.twist.left_m_per_s);
            self.twist.yaw_rate_rad_per_s = row.yaw_rate_rad_per_s.unwrap_or(self.twist.yaw_rate_rad_per_s);
            self.command = robot.wheel_speeds_holding(self.twist, self.command.steering_rad);
        }
        for (held, new) in self.command.wheel_rad_per_s.iter_mut().zip(row.wheel_rad_per_s) {
            *held = new.unwrap_or(*held);
        }
        self.command.steering_rad = row.steering_rad.unwrap_or(self.command.steering_rad);
    }

    /// The set-points in force.
    pub fn command(&self) -> WheelCommand {
        self.command
    }
}

/// Replays all rows from rest at `first_pose`.
pub fn replay(robot: &Robot, first_pose: Pose, rows: &[CommandRow]) -> Result<Vec<ReplayRow>, ReplayError> {
    let start = Start {
        pose: first_pose,
        ..Start::default()
    };
    replay_from(robot, &start, HeldCommand::default(), rows)
}

/// Replays rows from a state in motion and the set-points then in force, taken as in force for long. The first row's time is the start.
///
/// - Rows between two physics steps are interpolated linearly.
/// - Errors: time that does not grow, numbers that are not finite, more than [`MAX_DURATION_S`].
pub fn replay_from(
    robot: &Robot,
    start: &Start,
    held: HeldCommand,
    rows: &[CommandRow],
) -> Result<Vec<ReplayRow>, ReplayError> {
    replay_after(robot, start, held, &[], rows)
}

/// The same when set-points changed shortly before the start: what delay, lag and slew remember of them is worked out.
///
/// - `held`: in force before the first of `earlier`; `earlier` ends before the first of `rows`.
/// - Errors: as [`replay_from`].
pub fn replay_after(
    robot: &Robot,
    start: &Start,
    held: HeldCommand,
    earlier: &[CommandRow],
    rows: &[CommandRow],
) -> Result<Vec<ReplayRow>, ReplayError> {
    replay_with(robot, start, held, earlier, rows, None)
}

/// What is known at the start of a control tick of a replay, before it is taken.
#[derive(Debug, Clone, Copy)]
pub struct Tick {
    /// Control ticks since the start.
    pub number: u64,
    /// As the sensors' models report it.
    pub state: RobotState,
    /// Set-points of the tick, as sent.
    pub command: WheelCommand,
}

/// The same with further accelerations on the body, as if the learned residual gave them besides its own.
///
/// - `push`: called at the start of every control tick; accelerations of the centre of mass, `[m/s^2, m/s^2, rad/s^2]` in
///   the body frame, then set-points besides those told, `[m/s, m/s, rad/s]`, as the residual's outputs; held for the tick;
///   `None` keeps the ones before (none at the start).
/// - Errors: as [`replay_from`].
pub fn replay_pushed(
    robot: &Robot,
    start: &Start,
    held: HeldCommand,
    earlier: &[CommandRow],
    rows: &[CommandRow],
    push: &mut dyn FnMut(&Tick) -> Option<[f64; AXES]>,
) -> Result<Vec<ReplayRow>, ReplayError> {
    replay_with(robot, start, held, earlier, rows, Some(push))
}

/// What is asked at the start of every control tick.
type Push<'a> = &'a mut dyn FnMut(&Tick) -> Option<[f64; AXES]>;

fn replay_with(
    robot: &Robot,
    start: &Start,
    held: HeldCommand,
    earlier: &[CommandRow],
    rows: &[CommandRow],
    mut push: Option<Push>,
) -> Result<Vec<ReplayRow>, ReplayError> {
    check_rows(earlier)?;
    check_rows(rows)?;
    let Some(first) = rows.first() else {
        return Ok(Vec::new());
    };
    let mut free = FreeRobot::moving(robot, start).after_holding(&held.command());
    let (mut held, told) = remembered(robot, &mut free, held, earlier, first.time_s);
    if let Some(told) = told {
        free.settle_loops(robot, &told);
    }
    let mut next = 0;
    let duration_s = rows.last().map_or(0.0, |last| last.time_s - first.time_s);
    let mut history = History::new(robot.sensors(), duration_s, free.state());
    let mut out = Vec::with_capacity(rows.len());
    for row in rows {
        let elapsed_s = row.time_s - first.time_s;
        let position = elapsed_s * f64::from(PHYSICS_RATE_HZ);
        while (free.steps() as f64) < position + history.ahead_s * f64::from(PHYSICS_RATE_HZ) {
            let now_s = free.steps() as f64 / f64::from(PHYSICS_RATE_HZ);
            while next < rows.len() && rows[next].time_s - first.time_s <= now_s + STAMP_TOLERANCE_S {
                held.apply(robot, &rows[next]);
                next += 1;
            }
            if let Some(push) = &mut push
                && free.steps().is_multiple_of(u64::from(SUBSTEPS))
            {
                let tick = Tick {
                    number: free.steps() / u64::from(SUBSTEPS),
                    state: free.state(),
                    command: held.command(),
                };
                if let Some([x, y, turn, shift @ ..]) = push(&tick) {
                    free.push(robot, [x, y, turn]);
                    if robot.description().motor.is_none() {
                        free.shift(robot, shift);
                    }
                }
            }
            free.step(&held.command);
            if history.needs(free.steps(), position) {
                free.write_state(history.next());
            } else {
                history.skip();
            }
            // What is not finite makes pose and wheel angles so, and these stay.
            if free.steps().is_multiple_of(u64::from(SUBSTEPS)) && !free.is_finite() {
                return Err(ReplayError::NotFinite { time_s: now_s });
            }
        }
        if !free.is_finite() {
            let time_s = free.steps() as f64 / f64::from(PHYSICS_RATE_HZ);
            return Err(ReplayError::NotFinite { time_s });
        }
        out.push(ReplayRow {
            time_s: row.time_s,
            state: RobotState::ZERO,
        });
        if let Some(last) = out.last_mut() {
            history.measure(robot.sensors(), position, &mut last.state);
        }
    }
    Ok(out)
}

/// Runs the effects of commands through what was sent before `start_s`; the set-points then in force, and what the speed loops were told, if
/// it is known for long enough.
fn remembered(
    robot: &Robot,
    free: &mut FreeRobot,
    mut held: HeldCommand,
    earlier: &[CommandRow],
    start_s: f64,
) -> (HeldCommand, Option<Told>) {
    let Some(oldest) = earlier.first() else {
        return (held, None);
    };
    let reach = if free.remembers_commands() {
        LONGEST_MEMORY_STEPS
    } else {
        Told::ANSWERED_STEPS
    };
    let steps = (((start_s - oldest.time_s) * f64::from(PHYSICS_RATE_HZ)) as u64).min(reach);
    let mut next = 0;
    let (mut now, mut told) = (held.command(), None);
    for to_go in (1..=steps).rev() {
        let now_s = start_s - to_go as f64 / f64::from(PHYSICS_RATE_HZ);
        while next < earlier.len() && earlier[next].time_s <= now_s + STAMP_TOLERANCE_S {
            held.apply(robot, &earlier[next]);
            next += 1;
        }
        let seen = free.remember(&held.command(), to_go);
        if to_go == Told::ANSWERED_STEPS {
            told = Some(seen);
        }
        now = seen;
    }
    earlier[next..].iter().for_each(|row| held.apply(robot, row));
    (held, told.map(|before| Told { now, before }))
}

fn check_rows(rows: &[CommandRow]) -> Result<(), ReplayError> {
    for (index, row) in rows.iter().enumerate() {
        let grows = index == 0 || row.time_s > rows[index - 1].time_s;
        if !row.time_s.is_finite() || !grows {
            return Err(ReplayError::Time {
                row: index,
                time_s: row.time_s,
            });
        }
        let others = [
            row.steering_rad,
            row.forward_m_per_s,
            row.left_m_per_s,
            row.yaw_rate_rad_per_s,
        ];
        if row
            .wheel_rad_per_s
            .iter()
            .chain(&others)
            .flatten()
            .any(|value| !value.is_finite())
        {
            return Err(ReplayError::Command { row: index });
        }
    }
    if let (Some(first), Some(last)) = (rows.first(), rows.last()) {
        let duration_s = last.time_s - first.time_s;
        if duration_s > MAX_DURATION_S {
            return Err(ReplayError::Duration { duration_s });
        }
    }
    Ok(())
}
