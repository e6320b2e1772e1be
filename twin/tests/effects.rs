//! The effect library: neutral values, liveness, signs, list order, snapshot.
#![allow(clippy::disallowed_methods, reason = "tests may use the platform's mathematics")]

mod support;

use std::f64::consts::PI;
use support::{car, diff2, omni4};
use twin::command::WheelCommand;
use twin::effect::Effect;
use twin::effect::library::{EffectEntry, LIBRARY, Needs};
use twin::free::Start;
use twin::pose::Pose;
use twin::replay::{CommandRow, HeldCommand, ReplayRow, replay, replay_from};
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;
use twin::world::{Arena, RobotState, World};

/// Reference noise, one standard deviation.
const CHANNELS: [&str; 8] = ["pose", "yaw", "wheel", "current", "gyro", "accel", "bus", "steering"];
const NOISE: [f64; 8] = [0.001, 0.003, 0.05, 0.03, 0.006, 0.05, 0.03, 0.002];

fn robot_for(entry: &EffectEntry) -> RobotDescription {
    match entry.needs {
        Needs::Steering | Needs::StandardWheel => car("rwd"),
        Needs::Caster => diff2(),
        _ => omni4(),
    }
}

/// The effect at its practical size, places chosen so that the manoeuvre meets them.
fn practical(entry: &EffectEntry, robot: &RobotDescription) -> Effect {
    let mut effect = Effect::sized(entry, robot, |(practical, _)| practical);
    if entry.name == "low_friction_patch" {
        effect.parameters.insert("x".to_owned(), Some(0.3));
    }
    effect
}

/// Manoeuvres of twenty seconds, set-points 120 times a second.
const MANOEUVRES: [&str; 5] = ["mixed", "steady", "slow", "bursts", "field"];

fn excitation(robot: &RobotDescription, manoeuvre: &str) -> Vec<CommandRow> {
    let nominal = Robot::new(robot.clone()).expect("a robot");
    let sideways = robot.chassis == "omni4";
    let steered = robot.steering.is_some();
    let mut steering_rad = 0.0;
    (0..2400)
        .map(|tick| {
            let t = f64::from(tick) / 120.0;
            let sign = |on: bool| if on { 1.0 } else { -1.0 };
            let (u, v, r) = match manoeuvre {
                "mixed" => mixed(t),
                "steady" => (1.6 * sign(t % 5.0 < 2.5) * if t < 10.0 { 1.0 } else { 0.5 }, 0.0, 0.0),
                "slow" => (0.05 * (2.0 * t).sin(), 0.0, 0.03 * (3.0 * t).cos()),
                "bursts" => (2.0 * sign(((t * 1.5) as u32).is_multiple_of(2)), 0.0, 0.0),
                _ => (0.7 * (0.7 * t).cos(), 0.6 * (0.9 * t).sin(), 2.5 * (0.4 * t).sin()),
            };
            let u = if steered && u == 0.0 { 0.4 } else { u };
            let twist = BodyTwist {
                forward_m_per_s: u,
                left_m_per_s: if sideways { v } else { 0.0 },
                yaw_rate_rad_per_s: r,
            };
            let command = nominal.wheel_speeds_holding(twist, steering_rad);
            steering_rad = command.steering_rad;
            row(t, &command)
        })
        .collect()
}

/// Steps, spins, weaving, reversals, rest.
fn mixed(t: f64) -> (f64, f64, f64) {
    match (t / 2.0) as u32 {
        0 => (0.8, 0.0, 0.0),
        1 => (-0.8, 0.0, 0.0),
        2 => (0.04 * (4.0 * t).sin(), 0.0, 0.0),
        3 => (0.0, 0.5, 1.5),
        4 => (0.5, 0.0, 1.5 * (3.0 * t).sin()),
        5 => (-0.3, -0.4, -2.0),
        6 => (
            if ((t * 4.0) as u32).is_multiple_of(2) {
                1.2
            } else {
                -1.2
            },
            0.0,
            0.0,
        ),
        7 => (0.7, 0.3, 1.2),
        8 => (0.1, 0.0, -0.4),
        _ => (0.0, 0.0, 0.0),
    }
}

fn row(time_s: f64, command: &WheelCommand) -> CommandRow {
    CommandRow {
        time_s,
        wheel_rad_per_s: command.wheel_rad_per_s.map(Some),
        steering_rad: Some(command.steering_rad),
        ..CommandRow::default()
    }
}

fn run(robot: &RobotDescription, effects: &[Effect], rows: &[CommandRow]) -> Vec<ReplayRow> {
    let robot = Robot::with_effects(robot.clone(), effects).expect("effects");
    replay(&robot, Pose::default(), rows).expect("finite")
}

/// Change of each channel over its noise, as a matched filter sees it: root of the sum of squares over the samples of the
/// whole run. The pose counts by its change since the start of its two-second window, as the
/// identification anchors its windows.
fn strength(a: &[ReplayRow], b: &[ReplayRow], wheels: usize) -> [f64; 8] {
    let mut sums = [0.0_f64; 8];
    for (k, (one, two)) in a.iter().zip(b).enumerate() {
        let (p, q) = (&one.state, &two.state);
        let anchor = k - k % 240;
        let (p0, q0) = (&a[anchor].state, &b[anchor].state);
        let moved = |s: &RobotState, s0: &RobotState| {
            let (sin, cos) = s0.pose.yaw_rad.sin_cos();
            let (dx, dy) = (s.pose.x_m - s0.pose.x_m, s.pose.y_m - s0.pose.y_m);
            [cos * dx + sin * dy, cos * dy - sin * dx]
        };
        let (m, n) = (moved(p, p0), moved(q, q0));
        let turned = (p.pose.yaw_rad - p0.pose.yaw_rad) - (q.pose.yaw_rad - q0.pose.yaw_rad);
        let yaw = (turned + 9.0 * PI).rem_euclid(2.0 * PI) - PI;
        let square = |f: &dyn Fn(usize) -> f64| (0..wheels).map(|wheel| f(wheel).powi(2)).sum::<f64>();
        let changes = [
            (m[0] - n[0]).powi(2) + (m[1] - n[1]).powi(2),
            yaw * yaw,
            square(&|i| p.wheel_rad_per_s[i] - q.wheel_rad_per_s[i]),
            square(&|i| p.current_a[i] - q.current_a[i]),
            (p.gyro_z_rad_per_s - q.gyro_z_rad_per_s).powi(2),
            (p.accel_x_m_per_s2 - q.accel_x_m_per_s2).powi(2) + (p.accel_y_m_per_s2 - q.accel_y_m_per_s2).powi(2),
            (p.bus_v - q.bus_v).powi(2),
            (p.steering_rad - q.steering_rad).powi(2),
        ];
        for (sum, (change, noise)) in sums.iter_mut().zip(changes.iter().zip(NOISE)) {
            *sum += change / (noise * noise);
        }
    }
    sums.map(f64::sqrt)
}

#[test]
fn every_effect_moves_a_channel_at_its_practical_size() {
    let mut dead = Vec::new();
    for entry in LIBRARY {
        let robot = robot_for(entry);
        let effect = practical(entry, &robot);
        let seen = MANOEUVRES.map(|manoeuvre| {
            let rows = excitation(&robot, manoeuvre);
            let changed = run(&robot, std::slice::from_ref(&effect), &rows);
            let strength = strength(&run(&robot, &[], &rows), &changed, robot.wheels.len());
            let (channel, best) = (0..8).fold(
                (0, 0.0),
                |most, k| if strength[k] > most.1 { (k, strength[k]) } else { most },
            );
            (best, manoeuvre, CHANNELS[channel])
        });
        let best = seen
            .iter()
            .fold(seen[0], |most, one| if one.0 > most.0 { *one } else { most });
        println!(
            "{:<24} {:>9.1} sigma in {:<8} during {}",
            entry.name, best.0, best.2, best.1
        );
        if best.0 < 5.0 {
            dead.push((entry.name, best));
        }
    }
    assert!(dead.is_empty(), "{dead:?}");
}

#[test]
fn neutral_values_give_the_unmodified_bits() {
    for entry in LIBRARY {
        let robot = robot_for(entry);
        let rows = &excitation(&robot, "mixed")[..600];
        let mut neutral = Effect::new(entry.name, &[]);
        for parameter in entry.parameters {
            let value = parameter.neutral;
            neutral
                .parameters
                .insert(parameter.name.to_owned(), value.is_finite().then_some(value));
        }
        let neutral = if entry.indexed { neutral.at(0) } else { neutral };
        assert!(neutral.is_neutral(), "{}", entry.name);
        assert_eq!(run(&robot, &[], rows), run(&robot, &[neutral], rows), "{}", entry.name);
    }
}

#[test]
fn tiny_sizes_change_little() {
    for entry in LIBRARY {
        let robot = robot_for(entry);
        let rows = &excitation(&robot, "mixed")[..960];
        let mut effect = practical(entry, &robot);
        for parameter in entry.parameters.iter().filter(|parameter| parameter.carries_size) {
            let size = effect.value(parameter.name);
            let value = if parameter.neutral.is_finite() {
                parameter.neutral + 1e-6 * (size - parameter.neutral)
            } else {
                1e6 // far above anything that is commanded; side friction is compared with the floor's below
            };
            effect.parameters.insert(parameter.name.to_owned(), Some(value));
        }
        if entry.name == "lateral_slip" {
            effect
                .parameters
                .insert("side_friction".to_owned(), Some(robot.floor_friction * (1.0 - 1e-6)));
        }
        let strength = strength(
            &run(&robot, &[], rows),
            &run(&robot, &[effect], rows),
            robot.wheels.len(),
        );
        // A held burst and a backlash of the steering keep a rest of their own: the first draws, the second waits.
        if !["command_hold"].contains(&entry.name) {
            assert!(strength.iter().all(|s| *s < 1.0), "{}: {strength:?}", entry.name);
        }
    }
}

#[test]
fn a_run_with_effects_continues_from_its_snapshot_bit_for_bit() {
    for entry in LIBRARY {
        let robot = robot_for(entry);
        let effect = practical(entry, &robot);
        let robot = Robot::with_effects(robot.clone(), &[effect]).expect("effects");
        let arena = Arena {
            width_m: 20.0,
            height_m: 20.0,
        };
        let world = || World::new(arena, vec![(robot.clone(), Pose::default(), 0.25)]).expect("a world");
        let command = |tick: u64| {
            let mut command = WheelCommand::default();
            for (k, speed) in command.wheel_rad_per_s.iter_mut().enumerate() {
                *speed = 8.0 * (0.07 * tick as f64 + k as f64).sin();
            }
            command.steering_rad = 0.3 * (0.05 * tick as f64).sin();
            command
        };
        let mut whole = world();
        let mut snapshot = None;
        for tick in 0..240 {
            if tick == 97 {
                snapshot = Some((whole.snapshot(), whole.state(0)));
            }
            whole.step(&[command(tick)]).expect("finite");
        }
        let mut again = world();
        let (snapshot, state) = snapshot.expect("taken");
        again.restore(&snapshot).expect("fits");
        assert_eq!(again.state(0), state, "{}: what is seen right after", entry.name);
        for tick in 97..240 {
            again.step(&[command(tick)]).expect("finite");
        }
        assert_eq!(whole.digest(), again.digest(), "{}", entry.name);
        assert_eq!(whole.snapshot(), again.snapshot(), "{}", entry.name);
    }
}

#[test]
fn bad_effects_are_refused_with_field_and_limit() {
    let refused = |effect: Effect| Robot::with_effects(omni4(), &[effect]).expect_err("refused");
    let unknown = refused(Effect::new("flux_capacitor", &[]));
    assert_eq!(unknown.field, "effects[0].name");
    let parameter = refused(Effect::new("floor_friction", &[("size", 0.5)]));
    assert_eq!(parameter.field, "effects[0].parameters.size");
    assert_eq!(parameter.limit, "scale");
    let range = refused(Effect::new("floor_friction", &[("scale", -1.0)]));
    assert_eq!(range.field, "effects[0].parameters.scale");
    let nan = refused(Effect {
        parameters: [("scale".to_owned(), Some(f64::NAN))].into(),
        ..Effect::new("floor_friction", &[])
    });
    assert_eq!(nan.field, "effects[0].parameters.scale");
    assert_eq!(
        refused(Effect::new("weak_motor", &[("gain", 0.9)])).field,
        "effects[0].index"
    );
    assert_eq!(
        refused(Effect::new("weak_motor", &[("gain", 0.9)]).at(4)).field,
        "effects[0].index"
    );
    assert_eq!(
        refused(Effect::new("floor_tilt", &[("x", 0.01)]).at(0)).field,
        "effects[0].index"
    );
    assert_eq!(
        refused(Effect::new("steering_lag", &[("time_constant", 0.1)])).field,
        "effects[0].name"
    );
}

#[test]
fn a_start_in_motion_remembers_the_set_point_in_force() {
    let robot = diff2();
    let mut cruise = WheelCommand::default();
    cruise.wheel_rad_per_s[..2].fill(8.0);
    for effect in [
        Effect::new("command_delay", &[("delay", 0.2)]),
        Effect::new("motor_lag", &[("time_constant", 0.2)]),
        Effect::new("acceleration_limit", &[("limit", 1.0)]),
        Effect::new("command_hold", &[("loss_rate", 0.5), ("burst", 0.1)]),
    ] {
        let robot = Robot::with_effects(robot.clone(), std::slice::from_ref(&effect)).expect("effects");
        let rows: Vec<CommandRow> = (0..240).map(|tick| row(f64::from(tick) / 120.0, &cruise)).collect();
        let settled = replay(&robot, Pose::default(), &rows).expect("finite")[239].state;
        let start = Start {
            pose: settled.pose,
            twist: settled.twist,
            wheel_rad_per_s: settled.wheel_rad_per_s,
            current_a: settled.current_a,
            ..Start::default()
        };
        let mut held = HeldCommand::default();
        held.apply(&robot, &rows[0]);
        let on = replay_from(&robot, &start, held, &rows[..60]).expect("finite")[59].state;
        let speed = on.twist.forward_m_per_s / settled.twist.forward_m_per_s;
        assert!(
            (speed - 1.0).abs() < 0.01,
            "{}: it drives on at the same speed, {speed}",
            effect.name
        );
    }
}
