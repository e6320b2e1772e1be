//! Bad descriptions are refused by field, with limit and remedy; bad worlds by reason.

mod support;

use support::{car, diff2, omni4, robot, wheels};
use twin::motor_control::MotorController;
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
    for wheel in &mut folded.wheels {
        wheel.x_m = if wheel.steered { 0.1 } else { 0.105 };
    }
    assert_eq!(folded.check()[0].field, "wheels");
}

#[test]
fn what_no_robot_can_be_is_refused_with_field_and_reason() {
    let first = |change: &dyn Fn(&mut RobotDescription)| {
        let mut description = omni4();
        change(&mut description);
        description
            .check()
            .into_iter()
            .next()
            .unwrap_or_else(|| panic!("accepted"))
    };
    let missing = first(&|d| drop(d.wheels.pop()));
    assert_eq!(missing.field, "wheels");
    assert!(missing.message.contains("3 omni wheels"), "{missing}");
    let one_spot = first(&|d| (d.wheels[2].x_m, d.wheels[2].y_m) = (0.12, 0.1205));
    assert_eq!(one_spot.field, "wheels[2]");
    assert!(one_spot.message.contains("like wheels[0]"), "{one_spot}");
    assert_eq!(
        refused(|d| d
            .wheels
            .iter_mut()
            .for_each(|wheel| (wheel.x_m, wheel.y_m) = (0.1, 0.1)))
        .len(),
        3
    );
    // r_b = 0.12 sqrt 2 + 0.05 m: at most 12 kg (2 r_b)^2 = 2.315 kg m^2; a paraboloid of osmium with h = r_b has 2.06e-3.
    let heavy = first(&|d| d.yaw_inertia_kg_m2 = 2.32);
    assert_eq!(heavy.field, "yaw_inertia_kg_m2");
    assert!(heavy.message.contains("more than 12 kg can have"), "{heavy}");
    let light = first(&|d| d.yaw_inertia_kg_m2 = 2.0e-3);
    assert_eq!(light.field, "yaw_inertia_kg_m2");
    assert!(light.message.contains("densest"), "{light}");
    for possible in [2.31, 2.1e-3] {
        let mut description = omni4();
        description.yaw_inertia_kg_m2 = possible;
        assert_eq!(description.check(), []);
    }
}

#[test]
fn a_million_bad_wheels_are_one_problem() {
    let mut description = omni4();
    description.wheels[0].x_m = f64::NAN;
    description.wheels[0].radius_m = Some(0.0);
    description.wheels = vec![description.wheels[0].clone(); 1_000_000];
    // Looks at as many wheels as a robot may have, in pairs too.
    let problems = description.check();
    assert_eq!(problems[0].field, "wheels");
    assert_eq!(problems[0].message, "1000000 wheels");
    assert!(problems.len() <= 1 + 6 * 2, "{}", problems.len());
}

#[test]
fn controllers_are_refused_by_field() {
    let refused = |change: &dyn Fn(&mut MotorController)| {
        let mut description = omni4();
        let mut controller = MotorController::reference_cascade();
        change(&mut controller);
        set_motor(&mut description, |motor| motor.controller = Some(controller.clone()));
        let problems = description.check();
        assert!(
            problems
                .iter()
                .all(|problem| !problem.limit.is_empty() && !problem.remedy.is_empty())
        );
        let fields = problems.into_iter().map(|problem| problem.field);
        fields
            .map(|field| field.strip_prefix("motor.controller.").unwrap_or("").to_owned())
            .collect::<Vec<String>>()
    };
    assert!(refused(&|_| {}).is_empty());
    for good in [10, 15, 120, 160, 240, 480, 960, 1440, 9600] {
        assert!(refused(&|c| c.sample_rate_hz = good).is_empty(), "{good}");
    }
    for bad in [0, 9, 100, 500, 720, 1000, 9599, 10_080, u32::MAX] {
        assert_eq!(refused(&|c| c.sample_rate_hz = bad), ["sample_rate_hz"], "{bad}");
    }
    assert_eq!(refused(&|c| c.kind = "pid".to_owned()), ["kind"]);
    assert_eq!(
        refused(&|c| c.computation_delay_samples = 9),
        ["computation_delay_samples"]
    );
    assert_eq!(
        refused(&|c| c.encoder_ticks_per_rev = Some(0)),
        ["encoder_ticks_per_rev"]
    );
    assert_eq!(refused(&|c| c.encoder_ticks_per_rev = None), ["speed_window_samples"]);
    assert_eq!(refused(&|c| c.speed_window_samples = None), ["speed_window_samples"]);
    assert_eq!(
        refused(&|c| c.speed_window_samples = Some(65)),
        ["speed_window_samples"]
    );
    assert_eq!(
        refused(&|c| c.speed_kp_a_s_per_rad = Some(f64::NAN)),
        ["speed_kp_a_s_per_rad"]
    );
    assert_eq!(refused(&|c| c.current_ki_v_per_a_s = None), ["current_ki_v_per_a_s"]);
    assert_eq!(refused(&|c| c.current_limit_a = Some(9.1)), ["current_limit_a"]);
    assert_eq!(refused(&|c| c.current_limit_a = Some(0.0)), ["current_limit_a"]);
    assert_eq!(
        refused(&|c| c.kind = "speed_pi".to_owned()),
        [
            "speed_kp_a_s_per_rad",
            "speed_ki_a_per_rad",
            "current_kp_v_per_a",
            "current_ki_v_per_a_s"
        ]
    );
}

#[test]
fn the_document_round_trips_and_refuses_unknown_fields() {
    let mut with_cascade = omni4();
    set_motor(&mut with_cascade, |motor| {
        motor.controller = Some(MotorController::reference_cascade());
    });
    let mut descriptions = support::all();
    descriptions.push(with_cascade);
    for description in descriptions {
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
