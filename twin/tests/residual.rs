//! Learned residual: its arithmetic, its bounds, and what it does to a robot.

mod support;

use support::drive::{assert_close, rolling, run, torque_free, twist};
use support::{car, diff2, omni4, robot, wheels};
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::math::tanh;
use twin::pose::Pose;
use twin::residual::{Activation, Input, Layer, OUTPUTS, Output, Quantity, Residual, ResidualDocument, SHIFTS};
use twin::robot::{Robot, RobotDescription};
use twin::{CONTROL_PERIOD_S, GRAVITY_M_PER_S2};

const FORWARD: &str = OUTPUTS[0].0;
/// J_w/R^2 of one wheel of the test robots, kg.
const WHEEL_KG: f64 = 0.0008 / (0.05 * 0.05);

fn layer(weights: &[f64], bias: &[f64], activation: Activation) -> Layer {
    Layer {
        weights: weights.to_vec(),
        bias: bias.to_vec(),
        activation,
    }
}

fn output(name: &str, scale: f64, limit: f64) -> Output {
    Output {
        name: name.to_owned(),
        scale,
        limit,
    }
}

/// `output` = 1 whatever the input is.
fn constant(name: &str, acceleration: f64) -> ResidualDocument {
    ResidualDocument::new(
        vec![Input::new("forward_m_per_s", -100.0, 100.0)],
        0.25,
        vec![layer(&[0.0], &[1.0], Activation::Linear)],
        vec![output(name, acceleration, 10.0)],
    )
}

fn with_residual(description: RobotDescription, residual: &ResidualDocument) -> Robot {
    Robot::with_model(description, &[], Some(residual)).unwrap_or_else(|problem| panic!("{problem}"))
}

fn checked(residual: &ResidualDocument) -> Residual {
    Residual::new(&diff2(), residual).unwrap_or_else(|problem| panic!("{problem}"))
}

/// Two inputs, two tanh units, one output.
fn small() -> ResidualDocument {
    ResidualDocument::new(
        vec![
            Input::new("forward_m_per_s", -2.0, 2.0).normalised(0.25, 0.5),
            Input::new("yaw_rate_rad_per_s", -2.0, 2.0).normalised(0.0, 0.5),
        ],
        0.25,
        vec![
            layer(&[0.5, -0.25, 1.0, 2.0], &[0.125, -0.5], Activation::Tanh),
            layer(&[2.0, -3.0], &[0.25], Activation::Linear),
        ],
        vec![output(FORWARD, 0.5, 5.0)],
    )
}

#[test]
fn a_network_of_two_two_and_one_gives_the_value_computed_by_hand() {
    // x = ((0.5 - 0.25)/0.5, 0.25/0.5) = (0.5, 0.5); sums 0.125 + 0.25 - 0.125 = 0.25 and -0.5 + 0.5 + 1 = 1;
    // y = 0.25 + 2 tanh 0.25 - 3 tanh 1, a = y/2.
    let [forward, left, yaw] = checked(&small()).accelerations(&[0.5, 0.25]);
    let by_hand = 0.5 * ((0.25 + 2.0 * tanh(0.25)) + -3.0 * tanh(1.0));
    assert_eq!(forward.to_bits(), by_hand.to_bits());
    assert!((forward + 0.772_472_571_529_938_2).abs() < 1e-15, "{forward:.17}");
    assert_eq!((left, yaw), (0.0, 0.0));
}

#[test]
fn softsign_and_linear_units_are_exact_in_binary() {
    let mut residual = small();
    residual.layers[0].activation = Activation::Softsign;
    // 0.25/1.25 = 0.2, 1/2: y = 0.25 + 0.4 - 1.5.
    let [forward, ..] = checked(&residual).accelerations(&[0.5, 0.25]);
    assert_eq!(forward, 0.5 * ((0.25 + 2.0 * (0.25 / 1.25)) + -3.0 * 0.5));
    residual.layers[0].activation = Activation::Linear;
    let [forward, ..] = checked(&residual).accelerations(&[0.5, 0.25]);
    assert_eq!(forward, 0.5 * (0.25 + 0.5 - 3.0));
}

#[test]
fn a_network_that_is_a_linear_drag_coasts_down_as_derived() {
    // a = -c 100 tanh(u/100), which is -c u within u^2/3e4 = 3.4e-5. The two free wheels roll along:
    // (m + 2 J_w/R^2) du/dt = -c m u. Held over each tick: u_N = u_0 (1 - k T)^N with k = c m/(m + 2 J_w/R^2), which is
    // below u_0 exp(-k t) by the share k^2 T t/2 to first order.
    let drag = 0.5;
    let residual = ResidualDocument::new(
        vec![Input::new("forward_m_per_s", -2.0, 2.0)],
        0.25,
        vec![
            layer(&[0.01], &[0.0], Activation::Tanh),
            layer(&[100.0], &[0.0], Activation::Linear),
        ],
        vec![output(FORWARD, -drag, 2.0)],
    );
    let description = torque_free(diff2(), 0.0, 0.0);
    let start = rolling(&description, twist(1.0, 0.0, 0.0));
    let mut free = FreeRobot::moving(&with_residual(description, &residual), &start);
    let (ticks, rate) = (240, drag * 12.0 / (12.0 + 2.0 * WHEEL_KG));
    run(&mut free, &WheelCommand::default(), f64::from(ticks) * CONTROL_PERIOD_S);
    let got = free.state().twist.forward_m_per_s;
    let held = (0..ticks).fold(1.0, |speed, _| speed * (1.0 - rate * CONTROL_PERIOD_S));
    let time_s = f64::from(ticks) * CONTROL_PERIOD_S;
    assert_close("held over ticks, m/s", got, held, 5e-5);
    let share = 0.5 * rate * rate * CONTROL_PERIOD_S * time_s;
    assert_close("closed form, m/s", got, libm::exp(-rate * time_s), 1.05 * share + 5e-5);
    assert!(
        got < libm::exp(-rate * time_s) * (1.0 - 0.9 * share),
        "the hold is seen"
    );
}

#[test]
fn each_output_pushes_along_its_own_axis() {
    // Sideways and forward four free wheels at 45 degrees roll along with J_w/R^2 / 2 each; turning, with rho^2 J_w/R^2 each.
    let (time_s, squared_m2) = (0.5, 2.0 * 0.12 * 0.12);
    let mass = 12.0 / (12.0 + 2.0 * WHEEL_KG);
    let expected = [mass, mass, 0.25 / (0.25 + 4.0 * WHEEL_KG * squared_m2)];
    for (axis, (name, _, _)) in OUTPUTS.into_iter().enumerate() {
        let robot = with_residual(torque_free(omni4(), 0.0, 0.0), &constant(name, 0.8));
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        run(&mut free, &WheelCommand::default(), time_s);
        let moved = free.state().twist;
        let mut got = [moved.forward_m_per_s, moved.left_m_per_s, moved.yaw_rate_rad_per_s];
        assert_close(name, got[axis], 0.8 * time_s * expected[axis], 1e-4);
        got[axis] = 0.0;
        assert!(got.iter().all(|other| other.abs() < 1e-9), "{name}: {got:?}");
    }
}

#[test]
fn beyond_its_range_an_input_is_clamped_and_the_output_fades_out_smoothly() {
    let residual = ResidualDocument::new(
        vec![
            Input::new("forward_m_per_s", -1.0, 1.0),
            Input::new("left_m_per_s", 0.0, 4.0),
        ],
        0.5,
        vec![layer(&[1.0, 0.0], &[0.0], Activation::Linear)],
        vec![output(FORWARD, 2.0, 9.0)],
    );
    let residual = checked(&residual);
    let forward = |u: f64, v: f64| residual.accelerations(&[u, v])[0];
    // Inside and at the ends nothing fades; the zones are 1 m/s and 2 m/s wide.
    assert_eq!(
        (forward(0.75, 2.0), forward(1.0, 0.0), forward(-1.0, 4.0)),
        (1.5, 2.0, -2.0)
    );
    // e = 1/4: 1 - 3/16 + 2/64 = 0.84375; e = 1/2: 1/2; the value is that of the end of the range.
    assert_eq!((forward(1.25, 2.0), forward(-1.5, 2.0)), (2.0 * 0.84375, -1.0));
    assert_eq!(forward(1.5, 5.0), 0.5, "two inputs outside: the product");
    for beyond in [
        forward(2.0, 2.0),
        forward(-7.0, 2.0),
        forward(0.5, 6.0),
        forward(0.5, -1e9),
    ] {
        assert_eq!(beyond, 0.0);
    }
    // The slope of the fade, 6 e (1 - e) per zone, is at most 1.5: nowhere a step.
    let mut before = forward(0.0, 2.0);
    for k in 1..=4000 {
        let now = forward(f64::from(k) * 1e-3, 2.0);
        assert!((now - before).abs() <= 2.0 * 1.5e-3 + 1e-12, "at {k}");
        before = now;
    }
}

#[test]
fn no_weights_exceed_the_limit_and_the_speed_gained_is_bounded_by_it() {
    let wild = ResidualDocument::new(
        vec![
            Input::new("forward_m_per_s", -3.0, 3.0).normalised(0.0, 0.003),
            Input::new("yaw_rate_rad_per_s", -3.0, 3.0).normalised(0.0, 0.003),
        ],
        10.0,
        vec![
            layer(&[1e6, -1e6, 1e6, 1e6], &[1e6, -1e6], Activation::Linear),
            layer(&[1e6, 1e6, -1e6, 1e6], &[0.0, 0.0], Activation::Linear),
            layer(&[1e6, -1e6, 1e6, 1e6], &[0.0, 0.0], Activation::Linear),
            layer(&[1e6, 1e6, -1e6, 1e6, 1e6, 1e6], &[1e6, 1e6, 1e6], Activation::Linear),
        ],
        vec![
            output(OUTPUTS[0].0, 1e3, 0.7),
            output(OUTPUTS[1].0, -1e3, 0.6),
            output(OUTPUTS[2].0, 1e3, 2.0),
        ],
    );
    let residual = checked(&wild);
    let mut largest = [0.0_f64; 3];
    for k in -400..=400 {
        let x = f64::from(k) * 0.01;
        for value in [x, 1e300 * x, f64::INFINITY, f64::NAN] {
            for (bound, found) in largest.iter_mut().zip(residual.accelerations(&[value, 0.3 - x])) {
                assert!(found.is_finite());
                *bound = bound.max(found.abs());
            }
        }
    }
    assert_eq!(largest, [0.7, 0.6, 2.0]);
    // A robot without drive torque gains at most the limit times the time, in each axis of a body that may turn.
    let mut free = FreeRobot::at_rest(&with_residual(torque_free(omni4(), 0.0, 0.0), &wild), Pose::default());
    for step in 1..=960 {
        free.step(&WheelCommand::default());
        let time_s = f64::from(step) * twin::PHYSICS_PERIOD_S;
        let moved = free.state().twist;
        assert!(free.is_finite());
        assert!(moved.speed_m_per_s() <= libm::hypot(0.7, 0.6) * time_s + 1e-9);
        assert!(moved.yaw_rate_rad_per_s.abs() <= 2.0 * time_s + 1e-9);
    }
    assert!(free.state().twist.yaw_rate_rad_per_s.abs() > 0.1, "it did push");
}

#[test]
fn an_input_of_the_past_is_that_of_so_many_ticks_ago() {
    // a = commanded forward speed of 3 ticks ago; the motors cannot drive, so nothing else moves the robot. The wheels follow
    // with a slip of s0 x (J_w/R^2 a)/(mu N) = 1.6e-4 m/s, which leaves the body ahead by 0.64/12.64 of it: 8e-6 m/s.
    let residual = ResidualDocument::new(
        vec![Input::new("command_forward_m_per_s", -2.0, 2.0).ago(3)],
        0.25,
        vec![layer(&[1.0], &[0.0], Activation::Linear)],
        vec![output(FORWARD, 1.0, 2.0)],
    );
    let robot = with_residual(torque_free(diff2(), 0.0, 0.0), &residual);
    let go = robot.wheel_speeds(twist(0.6, 0.0, 0.0));
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    for tick in 0..12 {
        let command = if tick < 5 { WheelCommand::default() } else { go };
        run(&mut free, &command, CONTROL_PERIOD_S);
        let pushed = (tick + 1_i32 - 8).max(0);
        let expected = 0.6 * f64::from(pushed) * CONTROL_PERIOD_S * 12.0 / (12.0 + 2.0 * WHEEL_KG);
        let got = free.state().twist.forward_m_per_s;
        assert!((got - expected).abs() < 1e-5, "tick {tick}: {got} against {expected}");
        assert_eq!(got == 0.0, pushed == 0, "tick {tick}");
    }
    // A run that begins in motion begins as if the first value had been there for long.
    let mut held = FreeRobot::at_rest(&robot, Pose::default());
    run(&mut held, &go, CONTROL_PERIOD_S);
    assert!(held.state().twist.forward_m_per_s > 0.004);
}

#[test]
fn the_inputs_are_what_their_names_say() {
    let robot = robot(car("rwd"));
    let command = robot.wheel_speeds(twist(0.8, 0.0, 0.5));
    let mut free = FreeRobot::at_rest(
        &robot,
        Pose {
            x_m: 0.4,
            y_m: -0.3,
            yaw_rad: 0.7,
        },
    );
    run(&mut free, &command, 1.0);
    let state = free.state();
    let seen = robot.observation(&state, &command);
    let of = |quantity| seen.value(quantity, 0);
    let sum: f64 = (0..4).map(|wheel| seen.value(Quantity::Load, wheel)).sum();
    assert!((sum - 12.0 * GRAVITY_M_PER_S2).abs() < 1e-9, "{sum} N");
    assert_eq!((of(Quantity::X), of(Quantity::Y)), (state.pose.x_m, state.pose.y_m));
    let (cos, sin) = (of(Quantity::HeadingCos), of(Quantity::HeadingSin));
    let square = cos * cos + sin * sin;
    assert!((square - 1.0).abs() < 1e-15);
    assert!((of(Quantity::HeadingSin) - libm::sin(state.pose.yaw_rad)).abs() < 1e-15);
    let (u, v, r) = (of(Quantity::Forward), of(Quantity::Left), of(Quantity::YawRate));
    assert_eq!(
        (u, v, r),
        (
            state.twist.forward_m_per_s,
            state.twist.left_m_per_s,
            state.twist.yaw_rate_rad_per_s
        )
    );
    assert_eq!(
        (of(Quantity::YawRateForward), of(Quantity::YawRateLeft)),
        (r * u, r * v)
    );
    // The set-points are those of a twist that the car can roll without slip (about the rear axle).
    assert!((of(Quantity::CommandForward) - 0.8).abs() < 1e-9 && (of(Quantity::CommandYawRate) - 0.5).abs() < 1e-9);
    assert_eq!(of(Quantity::CommandSteering), command.steering_rad);
    assert_eq!(of(Quantity::Steering), state.steering_rad);
    for wheel in 0..4 {
        assert_eq!(seen.value(Quantity::WheelSpeed, wheel), state.wheel_rad_per_s[wheel]);
        assert_eq!(seen.value(Quantity::Current, wheel), state.current_a[wheel]);
        assert_eq!(
            seen.value(Quantity::CommandWheel, wheel),
            command.wheel_rad_per_s[wheel]
        );
    }
    let rolled = (of(Quantity::RollingForward) - u).abs() + (of(Quantity::RollingYawRate) - r).abs();
    assert!(
        rolled > 0.0 && rolled < 0.02,
        "in grip the wheels slip a little: {rolled}"
    );
}

#[test]
fn a_robot_that_holds_its_wheels_answers_with_current() {
    // The body is pushed by m a; two wheels hold it by k i/R each, less what stands in their dry friction (0.02 N m).
    let robot = with_residual(diff2(), &constant(FORWARD, 1.0));
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    run(&mut free, &wheels(&[0.0, 0.0]), 4.0);
    let state = free.state();
    let (torque, most) = (12.0 * 0.05 / 2.0, 0.02);
    let held = -19.2 * 0.031 * state.current_a[0];
    assert!((held - torque).abs() <= most, "{held} N m against {torque} N m");
    assert!(state.twist.forward_m_per_s.abs() < 0.01);
}

#[test]
fn set_points_are_for_robots_without_motors() {
    let mut residual = constant(SHIFTS[0].0, 0.2);
    residual.outputs[0].limit = 1.0;
    let refused = Robot::with_model(diff2(), &[], Some(&residual)).unwrap_err();
    assert_eq!(refused.field, "residual.outputs[0].name");
    let mut description = diff2();
    description.motor = None;
    let robot = with_residual(description, &residual);
    let mut free = FreeRobot::at_rest(&robot, Pose::default());
    (0..960).for_each(|_| free.step(&WheelCommand::default()));
    let speed = free.state().twist.forward_m_per_s;
    assert!((speed - 0.2).abs() < 1e-3, "{speed} m/s without a command");
}
