//! From a bundle to windows.

use twin::free::Start;
use twin::replay::{CommandRow, HeldCommand, merged};

use super::cell_shares::cell_shares;
use super::{
    Cell, Chain, GRID_HZ, Line, MEMORY_S, POSE_CELL_S, PoseCell, Quantity, RUN_IN_S, Record, RollingInput, SamplePlace,
    WINDOW_S, WheelLine, Window,
};
use crate::anchor::{Track, start_at};
use crate::bundle::Bundle;
use crate::channel::Channel;
use crate::steering_history::{SteeringHistory, Walk};
use crate::stretch::Stretch;

/// Shortest compared part of the last window, s.
const SHORTEST_WINDOW_S: f64 = 0.8;
/// Start of a run over which the battery is read, s, and the share of the current limit that counts as rest.
const SETTLED_S: f64 = 0.5;
const RESTING: f64 = 0.05;
/// A sample further from its neighbours' median than this many median deviations is a fault of the recorder.
const SPIKE: f64 = 12.0;

/// Set-points around the start of a window.
struct Sent<'a> {
    /// In force before `earlier`, and at the start.
    before: HeldCommand,
    held: HeldCommand,
    earlier: &'a [CommandRow],
    later: &'a [CommandRow],
}

struct Source<'a> {
    bundle: &'a Bundle,
    track: Track,
    commands: Vec<CommandRow>,
    lines: Vec<(Quantity, Line)>,
    input: Option<RollingInput>,
}

pub(super) fn record(name: &str, bundle: &Bundle) -> Record {
    let mut commands = bundle.command_rows();
    commands.retain(|row| {
        *row != (CommandRow {
            time_s: row.time_s,
            ..CommandRow::default()
        })
    });
    for row in &mut commands {
        row.time_s += bundle.run.command_delay_s;
    }
    let source = Source {
        track: Track::of(bundle),
        commands,
        lines: lines(bundle),
        input: RollingInput::of(bundle),
        bundle,
    };
    let mut record = Record {
        name: name.to_owned(),
        windows: Vec::new(),
        input: source.input.clone(),
        supply_ratio: supply_ratio(&source).unwrap_or(1.0),
        largest_command_rad_per_s: largest_command(&source),
        outliers: source.track.outliers,
        skipped: 0,
    };
    let mut held = HeldCommand::default();
    let mut applied = 0;
    // What was in force before the run is not known: what it begins with.
    let mut before = HeldCommand::default();
    if let Some(first) = source.commands.first() {
        before.apply(&bundle.robot, first);
    }
    let mut forgotten = 0;
    let steering = SteeringHistory::of(bundle);
    let mut steered = steering.walk();
    let margin_s = if source.track.poses.is_empty() {
        0.1
    } else {
        source.track.half_window_s
    };
    for stretch in Stretch::of(bundle, &source.track) {
        let mut start_s = stretch.from_s + margin_s;
        while start_s + RUN_IN_S + SHORTEST_WINDOW_S <= stretch.to_s {
            while applied < source.commands.len() && source.commands[applied].time_s <= start_s {
                held.apply(&bundle.robot, &source.commands[applied]);
                applied += 1;
            }
            while forgotten < applied && source.commands[forgotten].time_s <= start_s - MEMORY_S {
                before.apply(&bundle.robot, &source.commands[forgotten]);
                forgotten += 1;
            }
            let to_s = (start_s + RUN_IN_S + WINDOW_S).min(stretch.to_s);
            let sent = Sent {
                before,
                earlier: &source.commands[forgotten..applied],
                held,
                later: &source.commands[applied..],
            };
            match window(&source, start_s, to_s, &sent, &mut steered) {
                Some(window) => record.windows.push(window),
                None => record.skipped += 1,
            }
            start_s += WINDOW_S;
        }
    }
    record
}

/// On-board channels that are compared.
fn lines(bundle: &Bundle) -> Vec<(Quantity, Line)> {
    let mut wanted: Vec<(Quantity, Channel)> = Vec::new();
    for (k, wheel) in bundle.run.robot.wheels.iter().enumerate() {
        if wheel.kind != "caster" {
            wanted.push((Quantity::Wheel(k), Channel::WheelSpeed(k)));
        }
        if wheel.driven && bundle.run.robot.motor.is_some() {
            wanted.push((Quantity::Current(k), Channel::Current(k)));
        }
    }
    if bundle.run.robot.steering.is_some() {
        wanted.push((Quantity::Steering, Channel::Steering));
    }
    if bundle.run.robot.motor.is_some() {
        wanted.push((Quantity::Bus, Channel::Bus));
    }
    wanted.extend([
        (Quantity::Gyro, Channel::Gyro),
        (Quantity::AccelX, Channel::AccelX),
        (Quantity::AccelY, Channel::AccelY),
    ]);
    // Without set-points of the wheels nothing says what they, the motors and the body should have done.
    if !bundle.commands_wheels() {
        wanted.retain(|(quantity, _)| matches!(quantity, Quantity::Steering | Quantity::Gyro));
    }
    let mut lines = Vec::new();
    for (quantity, channel) in wanted {
        let dead = bundle
            .telemetry
            .series(channel)
            .is_none_or(crate::bundle::Series::is_constant);
        if let (false, Some(line)) = (dead, Line::of(bundle, channel)) {
            lines.push((quantity, without_spikes(line)));
        }
    }
    lines
}

/// Drops single samples that lie far from the median of their neighbours.
fn without_spikes(line: Line) -> Line {
    let n = line.values.len();
    let mut jumps: Vec<f64> = line.values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    jumps.sort_by(f64::total_cmp);
    let usual = jumps[jumps.len() * 9 / 10].max(1e-9);
    let mut kept = Line::default();
    for i in 0..n {
        let inside = i > 0 && i + 1 < n;
        let spike = inside && {
            let (before, after) = (line.values[i] - line.values[i - 1], line.values[i] - line.values[i + 1]);
            before.signum() == after.signum() && before.abs().min(after.abs()) > SPIKE * usual
        };
        if !spike {
            kept.time_s.push(line.time_s[i]);
            kept.values.push(line.values[i]);
        }
    }
    kept
}

/// Over the first 0.5 s, if the motors rest then; `None` without a bus channel or when it says something impossible.
fn supply_ratio(source: &Source) -> Option<f64> {
    let motor = source.bundle.run.robot.motor.as_ref()?;
    let until_s = source.bundle.telemetry.time_s.first()? + SETTLED_S;
    let mean = |line: &Line| {
        let count = line.time_s.partition_point(|t| *t < until_s);
        (count > 4).then(|| line.values[..count].iter().sum::<f64>() / count as f64)
    };
    let limit_a = motor.current_limit_a.unwrap_or(motor.supply_v / motor.resistance_ohm);
    let mut bus_v = None;
    for (quantity, line) in &source.lines {
        match quantity {
            Quantity::Current(_) if mean(line).is_some_and(|a| a.abs() > RESTING * limit_a) => return None,
            Quantity::Bus => bus_v = mean(line),
            _ => {}
        }
    }
    bus_v
        .map(|bus_v| bus_v / motor.supply_v)
        .filter(|ratio| (0.7..1.3).contains(ratio))
}

fn largest_command(source: &Source) -> f64 {
    let mut held = HeldCommand::default();
    let mut largest = 0.0_f64;
    for row in &source.commands {
        held.apply(&source.bundle.robot, row);
        largest = held
            .command()
            .wheel_rad_per_s
            .iter()
            .fold(largest, |m, w| m.max(w.abs()));
    }
    largest
}

fn window(source: &Source, start_s: f64, to_s: f64, sent: &Sent, steered: &mut Walk) -> Option<Window> {
    let (held, later) = (sent.held, sent.later);
    let bundle = source.bundle;
    let times = &bundle.telemetry.time_s;
    let row = times.partition_point(|t| *t < start_s).min(times.len() - 1);
    let poses = !source.track.poses.is_empty();
    let mut start = if poses {
        start_at(bundle, &source.track, (row, row), steered)?
    } else {
        start_without_poses(source, start_s, steered)
    };
    if times[row] - start_s > 0.05 {
        return None;
    }
    // The fit belongs to the row's time; the window begins there.
    let start_s = times[row];
    let from_s = start_s + RUN_IN_S;
    if bundle.run.robot.motor.is_none() {
        start.current_a = Default::default();
    }
    let mut drive = Chain {
        rows: drive_rows(start_s, to_s, later),
        held,
        earlier: sent.earlier.to_vec(),
        before: sent.before,
        ..Chain::default()
    };
    let rolling_input = source.input.as_ref().filter(|input| input.covers(start_s, to_s));
    let mut rolling = rolling_input.map(|input| Chain {
        rows: rolling_rows(input, start_s, to_s, 0.0, held, later, &bundle.robot),
        held,
        ..Chain::default()
    });
    for (quantity, line) in &source.lines {
        let chain = match (quantity, &mut rolling) {
            (Quantity::Gyro, Some(rolling)) => rolling,
            // Without set-points nothing drives this chain.
            _ if source.commands.is_empty() => continue,
            (Quantity::Gyro, None) if !bundle.commands_wheels() => continue,
            _ => &mut drive,
        };
        add_cells(chain, *quantity, line, from_s, to_s);
    }
    if rolling.is_some() || bundle.commands_wheels() {
        let chain = rolling.as_mut().unwrap_or(&mut drive);
        add_poses(chain, &source.track, from_s, to_s);
    }
    let window = Window {
        start_s,
        from_s,
        to_s,
        elapsed_s: start_s - times[0],
        start,
        wheel_angle_rad: wheel_angles(source, start_s),
        load: loads(source, start_s),
        trust: 1.0,
        drive,
        rolling: rolling.filter(|chain| !chain.is_empty()),
    };
    (!window.drive.is_empty() || window.rolling.is_some()).then_some(window)
}

/// Without poses: wheel speeds as measured, the twist by slip-free rolling.
fn start_without_poses(source: &Source, start_s: f64, steered: &mut Walk) -> Start {
    let mut start = Start {
        steering_history: steered.until(start_s),
        ..Start::default()
    };
    for (quantity, line) in &source.lines {
        match quantity {
            Quantity::Wheel(k) => start.wheel_rad_per_s[*k] = line.at(start_s),
            Quantity::Current(k) => start.current_a[*k] = line.at(start_s),
            Quantity::Steering => start.steering_rad = line.at(start_s),
            _ => {}
        }
    }
    let command = twin::command::WheelCommand {
        wheel_rad_per_s: start.wheel_rad_per_s,
        steering_rad: start.steering_rad,
    };
    start.twist = source.bundle.robot.twist_of_wheels(&command);
    start
}

fn grid(start_s: f64, to_s: f64) -> Vec<CommandRow> {
    let count = ((to_s - start_s) * GRID_HZ) as usize + 1;
    (0..=count)
        .map(|k| CommandRow {
            time_s: start_s + k as f64 / GRID_HZ,
            ..CommandRow::default()
        })
        .collect()
}

fn drive_rows(start_s: f64, to_s: f64, later: &[CommandRow]) -> Vec<CommandRow> {
    let mut rows = grid(start_s, to_s);
    let end_s = rows.last().map_or(to_s, |row| row.time_s);
    let commands = later.iter().take_while(|row| row.time_s < end_s);
    rows.extend(commands.copied());
    merged(rows)
}

/// Measured wheel speeds and steering as commands. At a time t the input is what the robot's clock stamped t + `shift_s`.
pub(super) fn rolling_rows(
    input: &RollingInput,
    start_s: f64,
    to_s: f64,
    shift_s: f64,
    held: HeldCommand,
    later: &[CommandRow],
    robot: &twin::robot::Robot,
) -> Vec<CommandRow> {
    let mut rows = grid(start_s, to_s);
    let span = |time_s: f64| (time_s + shift_s, time_s + shift_s + 1.0 / GRID_HZ);
    for (k, wheel) in input.wheels.iter().enumerate() {
        let Some(wheel) = wheel else { continue };
        let speeds = wheel.speeds(rows.iter().map(|row| span(row.time_s)));
        for (row, speed) in rows.iter_mut().zip(speeds) {
            row.wheel_rad_per_s[k] = Some(speed);
        }
    }
    let mut held = held;
    let mut next = 0;
    let mut sample = 0;
    for row in &mut rows {
        let (a, b) = span(row.time_s);
        while next < later.len() && later[next].time_s <= row.time_s {
            held.apply(robot, &later[next]);
            next += 1;
        }
        let steering = input.steering.as_ref();
        let measured = steering.map(|line| line.next_at(0.5 * (a + b), &mut sample));
        row.steering_rad = Some(measured.unwrap_or(held.command().steering_rad));
    }
    rows
}

fn sample_place(rows: &[CommandRow], time_s: f64, weight: f64) -> SamplePlace {
    let after = rows
        .partition_point(|row| row.time_s <= time_s)
        .clamp(1, rows.len() - 1);
    let (a, b) = (rows[after - 1].time_s, rows[after].time_s);
    SamplePlace {
        row: (after - 1) as u32,
        part: ((time_s - a) / (b - a)).clamp(0.0, 1.0),
        weight,
    }
}

fn add_cells(chain: &mut Chain, quantity: Quantity, line: &Line, from_s: f64, to_s: f64) {
    let first = chain.cells.len();
    for cell in cell_shares(&line.time_s, from_s, to_s) {
        let begin = chain.samples.len() as u32;
        let (mut measured, mut time_s) = (0.0, 0.0);
        for (sample, share) in cell.samples.zip(cell.shares) {
            measured += share * line.values[sample];
            time_s += share * line.time_s[sample];
            chain
                .samples
                .push(sample_place(&chain.rows, line.time_s[sample], share));
        }
        chain.cells.push(Cell {
            quantity,
            time_s,
            measured,
            activity: 0.0,
            samples: (begin, chain.samples.len() as u32),
        });
    }
    let values: Vec<f64> = chain.cells[first..].iter().map(|cell| cell.measured).collect();
    for (i, cell) in chain.cells[first..].iter_mut().enumerate() {
        let near = &values[i.saturating_sub(2)..(i + 2).min(values.len())];
        let (low, high) = near
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        cell.activity = high - low;
    }
}

fn add_poses(chain: &mut Chain, track: &Track, from_s: f64, to_s: f64) {
    let mut sample = track.time_s.partition_point(|t| *t < from_s);
    let mut cell_from_s = from_s;
    while cell_from_s < to_s {
        let end_s = cell_from_s + POSE_CELL_S;
        let begin = chain.samples.len() as u32;
        let (mut sums, mut time_sum, mut count) = ([0.0; 3], 0.0, 0.0);
        while sample < track.time_s.len() && track.time_s[sample] < end_s.min(to_s) {
            let pose = &track.poses[sample];
            chain.samples.push(sample_place(&chain.rows, track.time_s[sample], 1.0));
            for (sum, value) in sums.iter_mut().zip([pose.x_m, pose.y_m, pose.yaw_rad]) {
                *sum += value;
            }
            time_sum += track.time_s[sample];
            count += 1.0;
            sample += 1;
        }
        if count > 0.0 {
            chain.poses.push(PoseCell {
                time_s: time_sum / count,
                x_m: sums[0] / count,
                y_m: sums[1] / count,
                yaw_rad: sums[2] / count,
                samples: (begin, chain.samples.len() as u32),
            });
        }
        cell_from_s = end_s;
    }
}

/// Wheel angles at a time; integrated from the speeds where the run has no angles.
fn wheel_angles(source: &Source, time_s: f64) -> Vec<f64> {
    let Some(input) = &source.input else {
        return Vec::new();
    };
    let angle = |wheel: &Option<WheelLine>| match wheel {
        Some(WheelLine::Angle(line)) => line.at(time_s),
        Some(WheelLine::Speed(line)) => {
            let end = line.time_s.partition_point(|t| *t < time_s);
            (1..end)
                .map(|i| 0.5 * (line.values[i] + line.values[i - 1]) * (line.time_s[i] - line.time_s[i - 1]))
                .sum()
        }
        None => 0.0,
    };
    input.wheels.iter().map(angle).collect()
}

/// Mean squared current over the limit, per second of the run up to a time.
fn loads(source: &Source, time_s: f64) -> Vec<f64> {
    let Some(motor) = &source.bundle.run.robot.motor else {
        return Vec::new();
    };
    let stall_a = motor.supply_v / motor.resistance_ohm;
    let limit_a = motor.current_limit_a.map_or(stall_a, |limit| limit.min(stall_a));
    let first_s = source.bundle.telemetry.time_s[0];
    let mut loads = vec![(0.0, 0.0); (time_s - first_s).max(0.0) as usize];
    for (quantity, line) in &source.lines {
        let Quantity::Current(_) = quantity else { continue };
        for (t, value) in line.time_s.iter().zip(&line.values) {
            if let Some((sum, count)) = loads.get_mut((t - first_s) as usize) {
                let share = value / limit_a;
                *sum += share * share;
                *count += 1.0;
            }
        }
    }
    loads
        .into_iter()
        .map(|(sum, count): (f64, f64)| if count > 0.0 { sum / count } else { 0.0 })
        .collect()
}
