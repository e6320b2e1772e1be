//! Robots at rest stay where they are.

mod support;

use support::drive::run;
use support::{all, robot};
use twin::command::WheelCommand;
use twin::effect::Effect;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::Robot;

/// A floor that rises by 3 degrees along a direction.
fn slope(direction_rad: f64) -> Effect {
    let (sin, cos) = libm::sincos(direction_rad);
    let tilt = libm::sin(3.0_f64.to_radians());
    let text = format!(
        r#"{{"name":"floor_tilt","index":null,"parameters":{{"x":{},"y":{}}}}}"#,
        tilt * cos,
        tilt * sin
    );
    match serde_json::from_str(&text) {
        Ok(effect) => effect,
        Err(problem) => panic!("{problem}"),
    }
}

#[test]
fn a_minute_on_a_slope_of_three_degrees_drifts_less_than_a_millimetre() {
    for description in all() {
        for eighth in 0..8 {
            let direction_rad = f64::from(eighth) * core::f64::consts::FRAC_PI_4;
            let tilted = match Robot::with_effects(description.clone(), &[slope(direction_rad)]) {
                Ok(robot) => robot,
                Err(problem) => panic!("{problem}"),
            };
            let mut free = FreeRobot::at_rest(&tilted, Pose::default());
            // Motors that hold their wheels give way until their integral carries the slope; that is no drift.
            run(&mut free, &WheelCommand::default(), 5.0);
            let before = free.state().pose;
            run(&mut free, &WheelCommand::default(), 60.0);
            let after = free.state();
            let drift_m = before.distance_m(&after.pose);
            println!("{} towards {eighth}/8: {drift_m:.1e} m in a minute", tilted.name());
            assert!(drift_m < 1e-3, "{} towards {eighth}/8 turn: {drift_m} m", tilted.name());
        }
    }
}

#[test]
fn what_rests_on_an_even_floor_does_not_move_at_all() {
    for description in all() {
        let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
        run(&mut free, &WheelCommand::default(), 10.0);
        assert_eq!(free.state().pose, Pose::default());
    }
}
