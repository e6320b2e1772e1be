//! Bundle semantics of replays.

mod support;

use support::{car, diff2, robot};
use twin::effect::Effect;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::replay::{CommandRow, ReplayError, replay};
use twin::robot::Robot;
use twin::twist::BodyTwist;

fn row(time_s: f64) -> CommandRow {
    CommandRow {
        time_s,
        ..CommandRow::default()
    }
}

fn wheel_row(time_s: f64, left: f64, right: f64) -> CommandRow {
    let mut row = row(time_s);
    row.wheel_rad_per_s[..2].copy_from_slice(&[Some(left), Some(right)]);
    row
}

#[test]
fn rows_on_the_grid_are_the_free_robot() {
    let robot = robot(diff2());
    // Microsecond text, some of it rounded up: the set-point still counts at its sampling instant.
    let stamp = |tick: u32| (f64::from(tick) / 120.0 * 1e6).round() / 1e6;
    let rows: Vec<CommandRow> = (0..240)
        .map(|tick| wheel_row(stamp(tick), 0.05 * f64::from(tick), 6.0))
        .collect();
    let start = Pose {
        x_m: 0.5,
        y_m: 0.2,
        yaw_rad: 1.0,
    };
    let Ok(out) = replay(&robot, start, &rows) else {
        panic!("refused")
    };
    assert_eq!(out.len(), rows.len());
    assert_eq!(out[0].state.pose, start);
    let mut free = FreeRobot::at_rest(&robot, start);
    for (tick, got) in out.iter().enumerate() {
        assert!(free.state().pose.distance_m(&got.state.pose) < 1e-5, "tick {tick}");
        let command = support::wheels(&[0.05 * tick as f64, 6.0]);
        (0..4).for_each(|_| free.step(&command));
    }
}

/// Lag and filter of 40 ms each: 1 - (1 + w t) exp(-w t), w = 25/s, to half a physics step of the fastest motion.
#[test]
fn a_filter_as_slow_as_the_steering_makes_it_critically_damped() {
    let mut description = car("rwd");
    if let Some(steering) = &mut description.steering {
        (steering.lag_s, steering.filter_s, steering.rate_limit_rad_per_s) = (0.04, Some(0.04), None);
    }
    let robot = robot(description);
    let mut rows: Vec<CommandRow> = (0..60).map(|tick| row(f64::from(tick) / 120.0)).collect();
    rows[0].steering_rad = Some(0.0);
    rows[12].steering_rad = Some(0.3);
    let Ok(out) = replay(&robot, Pose::default(), &rows) else {
        panic!("refused")
    };
    for at in &out[12..] {
        let q = 25.0 * (at.time_s - 0.1);
        let exact = 0.3 * (1.0 - (1.0 + q) * libm::exp(-q));
        assert!(
            (at.state.steering_rad - exact).abs() < 0.003,
            "{} s: {} {exact}",
            at.time_s,
            at.state.steering_rad
        );
    }
}

/// A filter of no length changes no bit.
#[test]
fn no_filter_is_none() {
    let with = |filter_s: Option<f64>| {
        let mut description = car("fwd");
        if let Some(steering) = &mut description.steering {
            steering.filter_s = filter_s;
        }
        let mut rows: Vec<CommandRow> = (0..60).map(|tick| row(f64::from(tick) / 120.0)).collect();
        rows[3].steering_rad = Some(0.2);
        match replay(&robot(description), Pose::default(), &rows) {
            Ok(out) => out
                .iter()
                .map(|row| row.state.steering_rad.to_bits())
                .collect::<Vec<u64>>(),
            Err(error) => panic!("{error}"),
        }
    };
    assert_eq!(with(None), with(Some(0.0)));
}

#[test]
fn set_points_hold_and_rows_without_commands_only_read() {
    let robot = robot(diff2());
    let mut rows = vec![wheel_row(10.0, 5.0, 5.0)];
    rows.extend((1..=500).map(|i| row(10.0 + 0.01 * f64::from(i))));
    let Ok(out) = replay(&robot, Pose::default(), &rows) else {
        panic!("refused")
    };
    let last = out[out.len() - 1].state;
    assert!((last.twist.forward_m_per_s - 0.25).abs() < 1e-3);
    let travelled = out[500].state.pose.x_m - out[400].state.pose.x_m;
    assert!((travelled - 0.25).abs() < 1e-3, "{travelled}");
}

#[test]
fn body_twist_columns_become_wheel_set_points() {
    let (diff, awd) = (robot(diff2()), robot(car("awd")));
    for robot in [diff, awd] {
        let mut first = row(0.0);
        (first.forward_m_per_s, first.left_m_per_s, first.yaw_rate_rad_per_s) = (Some(0.4), Some(0.0), Some(0.2));
        let mut stop = row(3.0);
        stop.forward_m_per_s = Some(0.0);
        let rows = [first, row(2.9), stop, row(6.0)];
        let Ok(out) = replay(&robot, Pose::default(), &rows) else {
            panic!("refused")
        };
        let twist: BodyTwist = out[1].state.twist;
        assert!(
            (twist.forward_m_per_s - 0.4).abs() < 0.01 && (twist.yaw_rate_rad_per_s - 0.2).abs() < 0.01,
            "{twist:?}"
        );
        // At u = 0 a car keeps its steering angle and stands; a diff2 goes on turning.
        assert!(out[3].state.twist.forward_m_per_s.abs() < 0.06);
        assert_eq!(out[3].state.steering_rad.abs() > 0.1, robot.chassis() == "awd");
    }
}

#[test]
fn bad_rows_are_refused() {
    let robot = robot(diff2());
    let got = |rows: &[CommandRow]| replay(&robot, Pose::default(), rows).err();
    assert_eq!(got(&[]), None);
    assert_eq!(
        got(&[row(0.0), row(0.0)]),
        Some(ReplayError::Time { row: 1, time_s: 0.0 })
    );
    assert!(matches!(got(&[row(f64::NAN)]), Some(ReplayError::Time { row: 0, .. })));
    assert_eq!(
        got(&[wheel_row(0.0, f64::INFINITY, 0.0)]),
        Some(ReplayError::Command { row: 0 })
    );
    assert!(matches!(got(&[row(0.0), row(1e9)]), Some(ReplayError::Duration { .. })));
}

#[test]
fn fewer_readings_are_the_same_readings() {
    let latency = Effect::new("localization_latency", &[("latency", 0.043)]);
    let clock = Effect::new("clock_offset", &[("offset", -0.031), ("drift", 0.002)]);
    let shutter = Effect::new("rolling_shutter", &[("readout", 0.017)]);
    let cases = [
        vec![],
        vec![latency.clone()],
        vec![clock.clone()],
        vec![shutter.clone()],
        vec![latency, clock, shutter],
    ];
    let start = Pose {
        x_m: 0.4,
        y_m: 0.7,
        yaw_rad: 1.0,
    };
    // Two readings in a physics step, so that no step goes by unread; commands in the first second.
    let dense: Vec<CommandRow> = (0..=2880)
        .map(|k| match f64::from(k) / 960.0 {
            time_s if k % 8 == 0 && k < 960 => wheel_row(time_s, 6.0 * libm::sin(3.0 * time_s), 5.0),
            time_s => row(time_s),
        })
        .collect();
    for effects in &cases {
        let Ok(robot) = Robot::with_effects(diff2(), effects) else {
            panic!("refused: {effects:?}")
        };
        let Ok(exact) = replay(&robot, start, &dense) else {
            panic!("refused: {effects:?}")
        };
        for every in [8, 360, 1440] {
            let kept = |k: &usize| k.is_multiple_of(8) && *k < 960 || k.is_multiple_of(every);
            let places: Vec<usize> = (0..dense.len()).filter(kept).collect();
            let rows: Vec<CommandRow> = places.iter().map(|&k| dense[k]).collect();
            let Ok(sparse) = replay(&robot, start, &rows) else {
                panic!("refused: {effects:?}")
            };
            for (place, got) in places.iter().zip(&sparse) {
                assert_eq!(
                    got.state, exact[*place].state,
                    "{effects:?}, every {every}, reading {place}"
                );
            }
        }
    }
}
