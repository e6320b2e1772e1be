//! Bad descriptions are refused by field, with limit and remedy; bad worlds by reason.

mod support;

use support::{car, diff2, omni4, robot, wheels};
use twin::pose::Pose;
use twin::robot::{Robot, RobotDescription};
use twin::world::{Arena, World, WorldError};

fn refused(change: impl Fn(&mut RobotDescription)) -> Vec<String> {
    let mut description = omni4();
    change(&mut description);
    let problems = description.check();
    for problem in &problems {
        assert!(
            !problem.limit.is_empty() && !problem.remedy.is_empty() && !problem.message.is_empty(),
            "{problem:?}"
        );
    }
    assert!(Robot::new(description).is_err());
    problems.into_iter().map(|problem| problem.field).collect()
}

fn set_motor(description: &mut RobotDescription, change: impl Fn(&mut twin::robot::Motor)) {
    if let Some(motor) = &mut description.motor {
        change(motor);
    }
}

#[test]
fn every_number_has_a_limit() {
    let nan = f64::NAN;
    assert_eq!(refused(|d| d.mass_kg = -1.0), ["mass_kg"]);
    assert_eq!(refused(|d| d.mass_kg = nan), ["mass_kg"]);
    assert_eq!(refused(|d| d.yaw_inertia_kg_m2 = 0.0), ["yaw_inertia_kg_m2"]);
    assert_eq!(refused(|d| d.com_height_m = -0.1), ["com_height_m"]);
    assert_eq!(refused(|d| d.floor_friction = f64::INFINITY), ["floor_friction"]);
    assert_eq!(refused(|d| d.wheels[2].radius_m = Some(0.0)), ["wheels[2].radius_m"]);
    assert_eq!(refused(|d| d.wheels[1].radius_m = None), ["wheels[1].radius_m"]);
    assert_eq!(
        refused(|d| d.wheels[1].spin_inertia_kg_m2 = Some(-1e-3)),
        ["wheels[1].spin_inertia_kg_m2"]
    );
    assert_eq!(refused(|d| d.wheels[3].x_m = nan), ["wheels[3].x_m"]);
    assert_eq!(
        refused(|d| d.wheels[0].rolling_direction_rad = 135.0),
        ["wheels[0].rolling_direction_rad"]
    );
    assert_eq!(
        refused(|d| set_motor(d, |m| m.resistance_ohm = 0.0)),
        ["motor.resistance_ohm"]
    );
    assert_eq!(refused(|d| set_motor(d, |m| m.supply_v = nan)), ["motor.supply_v"]);
    assert_eq!(
        refused(|d| set_motor(d, |m| m.current_limit_a = Some(-1.0))),
        ["motor.current_limit_a"]
    );
    assert_eq!(refused(|d| d.name = " ".to_owned()), ["name"]);
    assert_eq!(
        refused(|d| (d.mass_kg, d.floor_friction) = (0.0, nan)),
        ["mass_kg", "floor_friction"]
    );
}

#[test]
fn every_chassis_has_its_wheels() {
    assert_eq!(refused(|d| d.chassis = "hexapod".to_owned()), ["chassis"]);
    assert_eq!(refused(|d| d.chassis = "diff2".to_owned()), ["wheels"]);
    assert!(refused(|d| d.wheels.clear()).contains(&"wheels".to_owned()));
    assert!(refused(|d| d.wheels = vec![d.wheels[0].clone(); 7]).contains(&"wheels".to_owned()));
    assert!(refused(|d| d.wheels[0].kind = "track".to_owned()).contains(&"wheels[0].kind".to_owned()));
    assert!(refused(|d| d.wheels[0].steered = true).contains(&"wheels[0].steered".to_owned()));
    let mut without = car("rwd");
    without.steering = None;
    assert_eq!(without.check()[0].field, "steering");
    let mut folded = car("rwd");
    folded.wheels.iter_mut().for_each(|wheel| wheel.x_m = 0.1);
    assert_eq!(folded.check()[0].field, "wheels");
}

#[test]
fn the_document_round_trips_and_refuses_unknown_fields() {
    for description in support::all() {
        let text = serde_json::to_string(&description).unwrap_or_default();
        assert_eq!(serde_json::from_str::<RobotDescription>(&text).ok(), Some(description));
        let more = text.replacen('{', "{\"wings\":2,", 1);
        assert!(serde_json::from_str::<RobotDescription>(&more).is_err());
    }
}

#[test]
fn worlds_refuse_bad_starts_and_commands() {
    let arena = Arena {
        width_m: 4.0,
        height_m: 3.0,
    };
    let at = |x_m: f64, y_m: f64| Pose { x_m, y_m, yaw_rad: 0.0 };
    let world = |starts: &[Pose]| World::new(arena, starts.iter().map(|pose| (robot(diff2()), *pose, 0.25)).collect());
    assert!(matches!(world(&[]), Err(WorldError::RobotCount { count: 0 })));
    assert!(matches!(
        world(&[at(1.9, 0.0)]),
        Err(WorldError::StartOutside { robot: 0, .. })
    ));
    assert!(matches!(
        world(&[at(f64::NAN, 0.0)]),
        Err(WorldError::StartNotFinite { robot: 0, .. })
    ));
    assert!(matches!(
        world(&[at(0.0, 0.0), at(0.4, 0.0)]),
        Err(WorldError::StartOverlap { a: 0, b: 1, .. })
    ));
    let narrow = Arena {
        width_m: f64::NAN,
        height_m: 3.0,
    };
    assert!(matches!(
        World::new(narrow, vec![(robot(diff2()), at(0.0, 0.0), 0.25)]),
        Err(WorldError::Arena { .. })
    ));
    let Ok(mut good) = world(&[at(0.0, 0.0)]) else {
        panic!("refused a good world")
    };
    assert!(matches!(
        good.step(&[]),
        Err(WorldError::CommandCount { robots: 1, got: 0 })
    ));
    let bad = wheels(&[1.0, f64::NAN]);
    let Err(error) = good.step(&[bad]) else {
        panic!("took a NaN")
    };
    assert_eq!(
        error.to_string(),
        "tick 0: command wheel_rad_per_s[1] of robot 0 (diff2-test) is not finite"
    );
    assert!(good.step(&[wheels(&[1.0, 1.0])]).is_ok());
}

#[test]
fn a_state_that_leaves_the_finite_range_is_an_error_with_tick_robot_and_state() {
    let mut description = diff2();
    description.motor = None;
    let robot = robot(description);
    let Ok(mut world) = World::new(
        Arena {
            width_m: 4.0,
            height_m: 3.0,
        },
        vec![(robot, Pose::default(), 0.25)],
    ) else {
        panic!("refused")
    };
    let mut failure = None;
    for _ in 0..10 {
        if let Err(error) = world.step(&[wheels(&[f64::MAX, f64::MAX])]) {
            failure = Some(error);
            break;
        }
    }
    let Some(WorldError::NotFinite {
        tick, robot: 0, state, ..
    }) = &failure
    else {
        panic!("{failure:?}")
    };
    assert!(*tick >= 1 && !state.is_empty());
    assert_eq!(world.step(&[wheels(&[0.0, 0.0])]).err(), failure);
    assert!(world.state(0).pose.is_finite());
}
