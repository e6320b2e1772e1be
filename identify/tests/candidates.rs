//! Sizes of candidates as the library states them.

use identify::hypothesis::{Candidate, Excitation, candidates};
use twin::MAX_WHEELS;
use twin::golden::reference_robot;
use twin::pose::Pose;
use twin::replay::{CommandRow, replay};
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;

fn of(chassis: &str) -> (RobotDescription, Vec<Candidate>) {
    let robot = reference_robot(chassis);
    let driven = Excitation {
        wheel_rad_per_s: 20.0,
        twist: [0.8, 0.6, 2.0],
        extent_m: [-1.0, 1.0, -1.0, 1.0],
    };
    let found = candidates(&robot, &driven);
    (robot, found)
}

fn named<'a>(all: &'a [Candidate], name: &str) -> &'a Candidate {
    all.iter()
        .find(|candidate| candidate.entry.name == name)
        .unwrap_or_else(|| panic!("{name} is no candidate"))
}

#[test]
fn large_sizes_are_those_of_the_library_in_practical_sizes() {
    let (robot, all) = of("omni4");
    // 0.2 % to 3 % of the radius.
    assert!((named(&all, "wheel_radius_one").large_size(&robot) - 15.0).abs() < 1e-9);
    for candidate in &all {
        let large = candidate.large_size(&robot);
        let has_size = candidate
            .axes
            .iter()
            .any(|axis| axis.carries_size && axis.neutral.is_finite());
        assert!(large >= 1.0, "{}: {large}", candidate.label());
        assert_eq!(large.is_finite(), has_size, "{}: {large}", candidate.label());
    }
    assert_eq!(named(&all, "wheel_speed_saturation").large_size(&robot), f64::INFINITY);
}

#[test]
fn the_choice_of_a_wheel_is_a_choice() {
    let (_, all) = of("omni4");
    assert_eq!(named(&all, "wheel_radius").choices(&[0.01]), 1);
    assert_eq!(named(&all, "wheel_radius_one").choices(&[0.01]), 2);
    let limits = named(&all, "body_speed_saturation");
    assert_eq!(limits.choices(&[0.5, f64::INFINITY, f64::INFINITY]), 1);
    assert_eq!(limits.choices(&[0.5, f64::INFINITY, 1.0]), 2);
}

/// The body origin of others goes sideways in turns, but no drive's firmware limits that.
#[test]
fn sideways_limits_are_looked_for_on_robots_that_go_sideways() {
    let looked_for = |chassis: &str| {
        let (_, all) = of(chassis);
        let columns = &named(&all, "body_speed_saturation").columns;
        assert!(
            columns
                .iter()
                .any(|column| column.values[0].is_finite() && column.values[2].is_finite())
        );
        columns.iter().any(|column| column.values[1].is_finite())
    };
    for (chassis, sideways) in [
        ("omni4", true),
        ("diff2", false),
        ("diff4", false),
        ("rwd", false),
        ("awd", false),
    ] {
        assert_eq!(looked_for(chassis), sideways, "{chassis}");
    }
}

/// An arc with a stop in it, so that every motor works against the floor.
fn arc(robot: &Robot) -> Vec<CommandRow> {
    (0..180)
        .map(|tick| {
            let share = if (60..90).contains(&tick) { 0.0 } else { 1.0 };
            let mut row = CommandRow {
                time_s: f64::from(tick) / 120.0,
                steering_rad: robot.description().steering.as_ref().map(|_| 0.2),
                ..CommandRow::default()
            };
            let twist = BodyTwist {
                forward_m_per_s: 0.7 * share,
                left_m_per_s: if robot.chassis() == "omni4" { 0.3 * share } else { 0.0 },
                yaw_rate_rad_per_s: 0.5 * share,
            };
            let wheels = robot.wheel_speeds_holding(twist, 0.2).wheel_rad_per_s;
            for (k, wheel) in robot.description().wheels.iter().enumerate() {
                row.wheel_rad_per_s[k] = wheel.driven.then_some(wheels[k]);
            }
            row
        })
        .collect()
}

/// What a candidate says that it does not touch is not simulated, so it must not touch it: the motors of a drive that is left out.
#[test]
fn effects_that_leave_the_drive_out_change_nothing_on_board() {
    for chassis in ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"] {
        let (description, all) = of(chassis);
        let nominal = Robot::new(description.clone()).unwrap_or_else(|problem| panic!("{}", problem.message));
        let rows = arc(&nominal);
        let driven = |robot: &Robot| -> Vec<([f64; MAX_WHEELS], [f64; MAX_WHEELS], f64)> {
            let states = replay(robot, Pose::default(), &rows).unwrap_or_else(|error| panic!("{error}"));
            states
                .iter()
                .map(|row| (row.state.wheel_rad_per_s, row.state.current_a, row.state.steering_rad))
                .collect()
        };
        let usual = driven(&nominal);
        let mut left_out = 0;
        for candidate in all.iter().filter(|candidate| !candidate.stages.drive) {
            left_out += 1;
            let effect = candidate.effect(&candidate.columns[0].values);
            let changed = Robot::with_model(description.clone(), &[effect], None)
                .unwrap_or_else(|problem| panic!("{}", problem.message));
            assert_eq!(driven(&changed), usual, "{chassis}: {}", candidate.label());
        }
        assert!(left_out >= 5, "{chassis}");
    }
}

#[test]
fn half_of_a_size_leaves_places_and_limits() {
    let (_, all) = of("omni4");
    assert_eq!(named(&all, "payload").halved(&[3.0, 0.1]), [1.5, 0.05]);
    assert_eq!(named(&all, "wheel_speed_saturation").halved(&[12.0]), [12.0]);
    let patch = named(&all, "low_friction_patch").halved(&[0.4, -0.2, 0.3, 0.5]);
    assert_eq!(patch, [0.4, -0.2, 0.3, 0.75]);
}
