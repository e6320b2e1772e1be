//! Residuals of a run under a hypothesis: measured less simulated.

use twin::effect::Effect;
use twin::effect::library::{Hook, Needs, find};
use twin::free::Start;
use twin::pose::wrapped_rad;
use twin::replay::{CommandRow, ReplayRow, replay_after};
use twin::robot::Robot;

use super::build::rolling_rows;
use super::touch::Added;
use super::{BEYOND_THE_LINE_M, Chain, PoseCell, Record, SamplePlace, Window};
use crate::gap::RobotClock;
use crate::hypothesis::Hypothesis;

/// Which chains are simulated; the other's residuals are taken from the base.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stages {
    pub drive: bool,
    pub rolling: bool,
}

impl Stages {
    pub const BOTH: Stages = Stages {
        drive: true,
        rolling: true,
    };
}

/// Position noise that weighs the alignment of paths, m, and the yaw's, rad: only their ratio counts.
const ALIGN_M: f64 = 0.001;
const ALIGN_RAD: f64 = 0.003;
/// Fewest poses that lay a path.
const FEWEST_ALIGNED: usize = 3;
/// Actuator effects that act between the measured wheel or steering angle and the floor.
const BEHIND_THE_ENCODER: [&str; 5] = [
    PLAY,
    "encoder_scale",
    "steering_offset",
    "steering_scale",
    "steering_backlash",
];
/// The one of them that needs motors: currents tell on which side of their play wheels begin.
const PLAY: &str = "gear_backlash";
/// Servo that follows the measured steering angle at once, s.
const INSTANT_S: f64 = 1e-4;
/// Seconds of load history that warm a motor, in time constants.
const SUPPLY_LEFT: f64 = 0.5;

/// Residuals of a run, in the order of [`Record::places`]; `None` when the hypothesis cannot be simulated.
pub fn residuals(record: &Record, hypothesis: &Hypothesis, stages: Stages, base: Option<&[f64]>) -> Option<Vec<f64>> {
    residuals_where(record, hypothesis, stages, base, |_| true)
}

/// The same with the base's residuals in the windows that the last `added` effects of the hypothesis cannot touch.
pub fn residuals_with(
    record: &Record,
    hypothesis: &Hypothesis,
    added: usize,
    stages: Stages,
    base: &[f64],
) -> Option<Vec<f64>> {
    let added = Added::last(hypothesis, added);
    residuals_where(record, hypothesis, stages, Some(base), |window| added.may_touch(window))
}

fn residuals_where(
    record: &Record,
    hypothesis: &Hypothesis,
    stages: Stages,
    base: Option<&[f64]>,
    is_touched: impl Fn(&Window) -> bool,
) -> Option<Vec<f64>> {
    let mut out = Vec::with_capacity(record.len());
    let mut charged = hypothesis.clone();
    if let Some(motor) = &mut charged.description.motor {
        motor.supply_v *= record.supply_ratio;
    }
    let drive = Cached::new(charged, false);
    let steering_is_measured = record.input.as_ref().is_some_and(|input| input.steering.is_some());
    let rolling = Cached::new(hypothesis.rolling(steering_is_measured), true);
    for window in &record.windows {
        let is_touched = is_touched(window);
        for (chain, cached, wanted, is_rolling) in [
            (Some(&window.drive), &drive, stages.drive, false),
            (window.rolling.as_ref(), &rolling, stages.rolling, true),
        ] {
            let Some(chain) = chain else { continue };
            if let (false, Some(base)) = (wanted && is_touched, base) {
                out.extend_from_slice(&base[out.len()..out.len() + chain.len()]);
                continue;
            }
            if !chain.is_empty() {
                simulate(record, window, chain, cached, is_rolling, &mut out)?;
            }
        }
    }
    out.iter().all(|value| value.is_finite()).then_some(out)
}

/// A hypothesis with its robot, where no window needs its own.
struct Cached {
    hypothesis: Hypothesis,
    robot: Option<Robot>,
}

impl Cached {
    fn new(hypothesis: Hypothesis, is_rolling: bool) -> Cached {
        let robot = (!hypothesis.remembers())
            .then(|| robot_of(&hypothesis, is_rolling))
            .flatten();
        Cached { hypothesis, robot }
    }
}

/// The twin of a chain: motors that are left in the rolling one turn as their encoders said.
fn robot_of(hypothesis: &Hypothesis, is_rolling: bool) -> Option<Robot> {
    if is_rolling && hypothesis.description.motor.is_some() {
        Robot::with_told_rotors(hypothesis.description.clone(), &hypothesis.effects).ok()
    } else {
        hypothesis.robot()
    }
}

fn simulate(
    record: &Record,
    window: &Window,
    chain: &Chain,
    cached: &Cached,
    is_rolling: bool,
    out: &mut Vec<f64>,
) -> Option<()> {
    let own;
    let robot = match &cached.robot {
        Some(robot) => robot,
        None => {
            own = robot_of(&cached.hypothesis.at(window), is_rolling)?;
            &own
        }
    };
    let mut start: Start = window.start;
    let shifted: Vec<CommandRow>;
    let shift_s = if is_rolling {
        cached.hypothesis.clock_shift_s(window)
    } else {
        0.0
    };
    let rows = match (&record.input, shift_s != 0.0) {
        (Some(input), true) => {
            let end_s = chain.rows.last().map_or(window.to_s, |row| row.time_s) - 1.0 / super::GRID_HZ;
            shifted = rolling_rows(input, window.start_s, end_s, shift_s, chain.held, &chain.rows, robot);
            &shifted
        }
        _ => &chain.rows,
    };
    let before = if chain.earlier.is_empty() {
        chain.held
    } else {
        chain.before
    };
    // Which camera saw the start nobody tells: the path does.
    let mut best: Option<(f64, Vec<f64>)> = None;
    let poses = robot.poses_seen_at(window.start.pose, BEYOND_THE_LINE_M);
    let is_open = poses.len() > 1;
    for pose in poses {
        start.pose = pose;
        let mut states = replay_after(robot, &start, before, &chain.earlier, rows).ok()?;
        if let Some(lag_s) = robot.description().accelerometer_lag_s.filter(|lag_s| *lag_s > 0.0) {
            filter_accelerations(&mut states, lag_s);
        }
        let mut values = Vec::with_capacity(chain.len());
        compare(chain, &states, &mut values);
        let off = if is_open { off_the_path(chain, &values) } else { 0.0 };
        if best.as_ref().is_none_or(|best| off < best.0) {
            best = Some((off, values));
        }
    }
    out.extend(best?.1);
    Some(())
}

/// Sum of the squared errors of the positions that are compared, m^2.
fn off_the_path(chain: &Chain, values: &[f64]) -> f64 {
    let errors = values[chain.cells.len()..].chunks_exact(3);
    let pairs = chain.poses.iter().zip(errors).filter(|(pose, _)| !pose.is_near_seam());
    pairs.map(|(_, error)| error[0] * error[0] + error[1] * error[1]).sum()
}

/// As an accelerometer with a low-pass filter of first order shows them.
fn filter_accelerations(states: &mut [ReplayRow], lag_s: f64) {
    let Some(first) = states.first() else { return };
    let mut shown = [first.state.accel_x_m_per_s2, first.state.accel_y_m_per_s2];
    let mut before_s = first.time_s;
    for row in states {
        let share = 1.0 - libm::exp(-(row.time_s - before_s) / lag_s);
        before_s = row.time_s;
        let state = &mut row.state;
        for (shown, felt) in shown
            .iter_mut()
            .zip([&mut state.accel_x_m_per_s2, &mut state.accel_y_m_per_s2])
        {
            *shown += share * (*felt - *shown);
            *felt = *shown;
        }
    }
}

fn compare(chain: &Chain, states: &[ReplayRow], out: &mut Vec<f64>) {
    let last = states.len().saturating_sub(2);
    for cell in &chain.cells {
        let samples = &chain.samples[cell.samples.0 as usize..cell.samples.1 as usize];
        let mut sum = 0.0;
        for place in samples {
            let row = (place.row as usize).min(last);
            let (a, b) = (
                cell.quantity.of(&states[row].state),
                cell.quantity.of(&states[row + 1].state),
            );
            sum += place.weight * (a + place.part * (b - a));
        }
        out.push(cell.measured - sum);
    }
    if !chain.poses.is_empty() {
        aligned(chain, states, out);
    }
}

/// Lays the twin's path on the measured one (rigid motion, least squares over the window) and compares.
fn aligned(chain: &Chain, states: &[ReplayRow], out: &mut Vec<f64>) {
    let last = states.len().saturating_sub(2);
    // Poses that are not compared do not lay the path either, unless there are no others.
    let is_open = |cell: &&PoseCell| !cell.is_near_seam();
    let few = chain.poses.iter().filter(is_open).count() < FEWEST_ALIGNED;
    let shares: Vec<f64> = chain
        .poses
        .iter()
        .map(|cell| f64::from(u8::from(few || is_open(&cell))))
        .collect();
    let n: f64 = shares.iter().sum();
    let mut twin: Vec<[f64; 3]> = Vec::with_capacity(chain.poses.len());
    for cell in &chain.poses {
        let samples = &chain.samples[cell.samples.0 as usize..cell.samples.1 as usize];
        let mut sums = [0.0; 3];
        for SamplePlace { row, part, .. } in samples {
            let row = (*row as usize).min(last);
            let (a, b) = (&states[row].state.pose, &states[row + 1].state.pose);
            sums[0] += a.x_m + part * (b.x_m - a.x_m);
            sums[1] += a.y_m + part * (b.y_m - a.y_m);
            let yaw = a.yaw_rad + part * wrapped_rad(b.yaw_rad - a.yaw_rad);
            sums[2] += wrapped_rad(yaw - cell.yaw_rad);
        }
        let count = samples.len() as f64;
        twin.push(sums.map(|sum| sum / count));
    }
    // The yaw difference of the first cell may be near half a turn: relative to it the others do not wrap.
    let base = twin[0][2];
    let turns = twin
        .iter()
        .zip(&shares)
        .map(|(pose, share)| share * wrapped_rad(pose[2] - base));
    let mean_yaw = base + turns.sum::<f64>() / n;
    let (mut centre, mut measured_centre) = ([0.0; 2], [0.0; 2]);
    for ((cell, pose), share) in chain.poses.iter().zip(&twin).zip(&shares) {
        let share = share / n;
        centre = [centre[0] + share * pose[0], centre[1] + share * pose[1]];
        measured_centre = [
            measured_centre[0] + share * cell.x_m,
            measured_centre[1] + share * cell.y_m,
        ];
    }
    let turned = |turn_rad: f64| -> Vec<[f64; 3]> {
        let (sin, cos) = libm::sincos(turn_rad);
        let pairs = chain.poses.iter().zip(&twin);
        pairs
            .map(|(cell, pose)| {
                let (x, y) = (pose[0] - centre[0], pose[1] - centre[1]);
                [
                    cell.x_m - measured_centre[0] - (cos * x - sin * y),
                    cell.y_m - measured_centre[1] - (sin * x + cos * y),
                    -wrapped_rad(pose[2] + turn_rad),
                ]
            })
            .collect()
    };
    let first = turned(-mean_yaw);
    let (weight_m, weight_rad) = (1.0 / (ALIGN_M * ALIGN_M), 1.0 / (ALIGN_RAD * ALIGN_RAD));
    let (sin, cos) = libm::sincos(-mean_yaw);
    let (mut moment, mut arm) = (0.0, 0.0);
    for ((error, pose), share) in first.iter().zip(&twin).zip(&shares) {
        let (x, y) = (pose[0] - centre[0], pose[1] - centre[1]);
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        moment += share * (weight_m * (x * error[1] - y * error[0]) + weight_rad * error[2]);
        arm += share * (weight_m * (x * x + y * y) + weight_rad);
    }
    for (error, cell) in turned(-mean_yaw + moment / arm).iter().zip(&chain.poses) {
        let (sin, cos) = libm::sincos(cell.yaw_rad);
        out.push(error[0] * cos + error[1] * sin);
        out.push(error[1] * cos - error[0] * sin);
        out.push(error[2]);
    }
}

impl Hypothesis {
    /// What drives the rolling chain: no motors (but for play, behind rotors as measured), wheels and servo as measured, and the effects behind the encoders.
    fn rolling(&self, steering_is_measured: bool) -> Hypothesis {
        let mut description = self.description.clone();
        let has_play = |effect: &Effect| effect.name == PLAY && effect.value("play") >= self.least_play_rad();
        if !self.effects.iter().any(has_play) {
            description.motor = None;
        }
        let has_motor = description.motor.is_some();
        if let (Some(steering), true) = (&mut description.steering, steering_is_measured) {
            steering.lag_s = INSTANT_S;
            steering.filter_s = None;
            steering.rate_limit_rad_per_s = None;
        }
        let kept = |effect: &&Effect| {
            let Some(entry) = find(&effect.name) else { return false };
            let lag = effect.name == "steering_lag" && !steering_is_measured;
            let acts = match entry.hook {
                Hook::Command => false,
                Hook::Actuator => BEHIND_THE_ENCODER.contains(&entry.name) || lag,
                Hook::Contact | Hook::Body | Hook::Sensor => true,
            };
            acts && (entry.needs != Needs::Motor || (entry.name == PLAY && has_motor))
        };
        Hypothesis {
            description,
            effects: self.effects.iter().filter(kept).cloned().collect(),
            residual: None,
        }
    }

    /// Every robot has some play: smaller ones move wheels by next to nothing, and cost more than they tell.
    fn least_play_rad(&self) -> f64 {
        let play = find(PLAY).and_then(|entry| entry.parameter("play"));
        play.map_or(f64::INFINITY, |play| play.size.values(&self.description).0)
    }

    /// True when an effect depends on what happened before a window.
    fn remembers(&self) -> bool {
        const REMEMBERING: [&str; 4] = ["battery_droop", "thermal_drift", "wheel_eccentricity", "clock_offset"];
        self.effects
            .iter()
            .any(|effect| REMEMBERING.contains(&effect.name.as_str()))
    }

    /// The same as it stands at the start of a window: battery, heat, wheel angles and clock.
    fn at(&self, window: &Window) -> Hypothesis {
        let mut now = self.clone();
        for effect in &mut now.effects {
            match effect.name.as_str() {
                "battery_droop" => {
                    if let Some(motor) = &mut now.description.motor {
                        let lost_v = effect.value("rate") * window.elapsed_s;
                        motor.supply_v = (motor.supply_v - lost_v).max(SUPPLY_LEFT * motor.supply_v);
                    }
                }
                "thermal_drift" => {
                    let heat = heat(&window.load, effect.value("time_constant"));
                    if let Some(motor) = &mut now.description.motor {
                        motor.resistance_ohm *= 1.0 + effect.value("relative") * heat;
                    }
                    effect.parameters.insert("relative".to_owned(), Some(0.0));
                }
                "wheel_eccentricity" => {
                    let angle = effect
                        .index
                        .and_then(|wheel| window.wheel_angle_rad.get(wheel))
                        .copied()
                        .unwrap_or(0.0);
                    let phase = wrapped_rad(effect.value("phase") + wrapped_rad(angle));
                    effect.parameters.insert("phase".to_owned(), Some(phase));
                }
                "clock_offset" => {
                    let offset = effect.value("offset") + effect.value("drift") * window.elapsed_s;
                    effect.parameters.insert("offset".to_owned(), Some(offset));
                }
                _ => {}
            }
        }
        now
    }

    /// Robot's clock less tracker's clock at a window, s.
    fn clock_shift_s(&self, window: &Window) -> f64 {
        let clock = RobotClock::of(&self.effects);
        clock.offset_s + clock.drift * window.elapsed_s
    }
}

/// First-order heating from the load history, one value a second.
fn heat(load: &[f64], time_constant_s: f64) -> f64 {
    let share = 1.0 - libm::exp(-1.0 / time_constant_s);
    load.iter().fold(0.0, |heat, load| heat + share * (load - heat))
}
