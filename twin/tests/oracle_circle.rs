//! Circles: Ackermann geometry, neutral steering, the friction limit sideways, the effective track of a skid steer.

mod support;

use core::f64::consts::PI;

use support::drive::{assert_close, rolling, run, torque_free, twist};
use support::{all, car, diff2, diff4, omni4, robot, wheels};
use twin::command::WheelCommand;
use twin::free::{FreeRobot, Start};
use twin::pose::Pose;
use twin::robot::RobotDescription;
use twin::twist::BodyTwist;
use twin::{PHYSICS_PERIOD_S, SLIP_SCALE_M_PER_S};

const G: f64 = 9.81;

/// Velocity of the contact point across a wheel that stands at `angle_rad`.
fn across_m_per_s(twist: &BodyTwist, x_m: f64, y_m: f64, angle_rad: f64) -> f64 {
    let (sin, cos) = libm::sincos(angle_rad);
    let (x, y) = (
        twist.forward_m_per_s - twist.yaw_rate_rad_per_s * y_m,
        twist.left_m_per_s + twist.yaw_rate_rad_per_s * x_m,
    );
    cos * y - sin * x
}

/// A car on a circle of `curvature` (at the rear axle) with the wheel speeds of slip-free rolling, after 5 s.
fn on_a_circle(description: &RobotDescription, speed: f64, curvature: f64) -> FreeRobot {
    let (front, rear) = (description.wheels[0].x_m, description.wheels[2].x_m);
    let mut start = rolling(description, twist(speed, -rear * speed * curvature, speed * curvature));
    for index in [0, 1] {
        // A front wheel is as fast as its hub: distance to the centre (0, 1/curvature) of the circle times yaw rate.
        let (x, y) = (front - rear, description.wheels[index].y_m - 1.0 / curvature);
        start.wheel_rad_per_s[index] = speed * curvature * (x * x + y * y).sqrt() / 0.05;
    }
    start.steering_rad = libm::atan((front - rear) * curvature);
    let command = WheelCommand {
        wheel_rad_per_s: start.wheel_rad_per_s,
        steering_rad: start.steering_rad,
    };
    let mut free = FreeRobot::moving(&robot(description.clone()), &start);
    run(&mut free, &command, 5.0);
    free
}

#[test]
fn all_axles_of_a_slow_car_meet_in_one_point() {
    // Centre at 1/1.5 m left of the rear axle; the axle of the wheel at (l_f, y) points at it when
    // tan delta = L/(1/kappa - y): 23.9 and 19.2 degrees (parallel wheels at 21.3 would slip by 5 mm/s).
    for chassis in ["fwd", "rwd", "awd"] {
        let description = car(chassis);
        let free = on_a_circle(&description, 0.1, 1.5);
        let state = free.state();
        for (index, wheel) in description.wheels.iter().enumerate() {
            let angle = if index < 2 {
                libm::atan(0.26 / (1.0 / 1.5 - wheel.y_m))
            } else {
                0.0
            };
            let slip = across_m_per_s(&state.twist, wheel.x_m, wheel.y_m, angle);
            // m u r = 0.18 N of 94 N friction: s0 atanh(0.0019) = 4e-5 m/s.
            assert!(slip.abs() < 6e-5, "{chassis} wheel {index}: {slip:e} m/s across");
        }
        let curvature = state.twist.yaw_rate_rad_per_s / state.twist.forward_m_per_s;
        assert_close(chassis, curvature, 1.5, 1e-3);
    }
}

#[test]
fn the_tyre_law_steers_neutrally_and_slides_out_by_a_known_speed() {
    // Statics: N_f = m g l_r/L and lateral force F_f = m a_y l_r/L, so F/N = a_y/g at both axles, and
    // tanh(s/s0) = a_y/(mu g) makes both axles slide outward at the same s = s0 atanh(a_y/(mu g)) (load transfer moves
    // load between wheels of the same slip). Hence no under- or oversteer, r/u = kappa, and v = l_r r - s.
    for chassis in ["fwd", "rwd", "awd"] {
        for (front, rear) in [(0.13, -0.13), (0.16, -0.10), (0.10, -0.16)] {
            let mut description = car(chassis);
            for wheel in &mut description.wheels {
                wheel.x_m = if wheel.x_m > 0.0 { front } else { rear };
            }
            let curvature = 0.4;
            let free = on_a_circle(&description, 1.6, curvature);
            let state = free.state();
            let (u, r) = (state.twist.forward_m_per_s, state.twist.yaw_rate_rad_per_s);
            // The front axle slides by s/cos delta and not s (0.5 %), across a wheel that has turned by delta = 6 degrees:
            // r/u is off by about s delta^2/(2 L u) and the drag F_f sin delta costs a little slip.
            assert_close(&format!("{chassis} {front}: r/u, 1/m"), r / u, curvature, 5e-4);
            let slide = -across_m_per_s(&state.twist, rear, 0.0, 0.0);
            let expected = SLIP_SCALE_M_PER_S * libm::atanh(u * r / (0.8 * G));
            assert_close(&format!("{chassis} {front}: slide, m/s"), slide, expected, 0.005);
        }
    }
}

#[test]
fn a_sideways_slide_ends_after_the_known_distance() {
    // Standard wheels at rest slide sideways with mu N each; together mu m g (diff2: half the load is on casters).
    // dv/dt = -a tanh(v/s0):  y = (1/a) int v coth(v/s0) dv = (v0^2/2 + pi^2 s0^2/12)/a.
    for (description, share) in [(car("awd"), 1.0), (car("rwd"), 1.0), (diff4(), 1.0), (diff2(), 0.5)] {
        let mut description = torque_free(description, 0.0, 0.0);
        description.floor_friction = 0.4;
        let deceleration = share * 0.4 * G;
        let expected = (1.0 / 2.0 + PI * PI * SLIP_SCALE_M_PER_S * SLIP_SCALE_M_PER_S / 12.0) / deceleration;
        let start = Start {
            twist: twist(0.0, 1.0, 0.0),
            ..Start::default()
        };
        let robot = robot(description);
        let mut free = FreeRobot::moving(&robot, &start);
        run(&mut free, &WheelCommand::default(), 3.0);
        assert!(free.state().twist.speed_m_per_s() < 1e-9);
        // Statics keeps the yaw moment at zero; sticking spares the end of the creep below s0/2: (s0/2) s0/a.
        let spared = 0.5 * SLIP_SCALE_M_PER_S * SLIP_SCALE_M_PER_S / deceleration;
        assert_close(robot.name(), free.state().pose.y_m, expected, spared / expected);
        assert!(free.state().pose.yaw_rad.abs() < 1e-6, "{}", free.state().pose.yaw_rad);
    }
}

#[test]
fn omni_wheels_roll_sideways_freely() {
    // Nothing slides when the rollers turn: with free wheels the sideways speed stays (the same start stops a diff4).
    let description = torque_free(omni4(), 0.0, 0.0);
    let start = rolling(&description, twist(0.0, 1.0, 0.0));
    let mut free = FreeRobot::moving(&robot(description), &start);
    run(&mut free, &WheelCommand::default(), 3.0);
    assert_close("left, m/s", free.state().twist.left_m_per_s, 1.0, 1e-9);
}

#[test]
fn no_manoeuvre_accelerates_more_than_friction_allows() {
    // |sum F| <= sum mu N = mu m g whatever slides, grips, steers or spins; cars in a full-speed turn use nearly all.
    for mut description in all() {
        description.floor_friction = 0.3;
        let robot = robot(description);
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        let (mut largest, mut last) = (0.0_f64, (0.0, 0.0));
        for step in 0..2400_u32 {
            let turn = f64::from(step / 300 % 3) - 1.0;
            let mut command = wheels(&[
                34.0 - 9.0 * turn,
                34.0 + 9.0 * turn,
                34.0 - 9.0 * turn,
                34.0 + 9.0 * turn,
            ]);
            command.steering_rad = 0.45 * turn;
            if robot.chassis() == "omni4" {
                // Its wheels 0 and 1 point backward.
                command.wheel_rad_per_s[0] *= -1.0;
                command.wheel_rad_per_s[1] *= -1.0;
            }
            free.step(&command);
            let state = free.state();
            let (sin, cos) = libm::sincos(state.pose.yaw_rad);
            let (u, v) = (state.twist.forward_m_per_s, state.twist.left_m_per_s);
            let world = (u * cos - v * sin, u * sin + v * cos);
            // Over a control tick: single steps are allowed an error of 1.6e-4 m/s each way (2.6 % of mu g here).
            if step % 4 == 3 {
                let (dx, dy) = (world.0 - last.0, world.1 - last.1);
                largest = largest.max((dx * dx + dy * dy).sqrt() / (4.0 * PHYSICS_PERIOD_S));
                last = world;
            }
        }
        let share = largest / (0.3 * G);
        println!("{}: {share:.5} of mu g", robot.name());
        // What all wheels together can give: everything with standard wheels only; diff2 has half of its weight on
        // casters; omni4 pushes at 45 degrees to its motion; one axle drives fwd and rwd, and both hold in the turn.
        let (least, most) = match robot.chassis() {
            "omni4" => (0.999, 1.0 / 2.0_f64.sqrt()),
            "diff2" => (0.999, 0.5),
            "fwd" | "rwd" => (0.9, 1.0),
            _ => (0.999, 1.0),
        };
        // A tenth of the allowed error of a step is left over a tick: 0.1 %.
        assert!(share < most * (1.0 + 1e-3), "{}: {share}", robot.name());
        assert!(share > least * most, "{}: {share}", robot.name());
    }
}

#[test]
fn a_skid_steer_turns_like_a_wider_robot() {
    // Turning in place the wheel at (+-L/2, +-B/2) slips by s_l = R W - r B/2 along and s_t = r L/2 across; all four
    // slips have one size, so the moment vanishes where s_l B/2 = s_t L/2, whatever the friction law:
    //   r = 2 R W / (B + L^2/B), the rate of a slip-free robot of track B + L^2/B.
    for (length, track) in [(0.24, 0.24), (0.20, 0.30), (0.30, 0.20)] {
        let mut description = diff4();
        for wheel in &mut description.wheels {
            wheel.x_m = 0.5 * length * 1.0_f64.copysign(wheel.x_m);
            wheel.y_m = 0.5 * track * 1.0_f64.copysign(wheel.y_m);
        }
        // The wheels keep their set-points: the law is about the contact.
        description.motor = None;
        let robot = robot(description);
        for speed in [0.1, 2.0, 20.0] {
            let mut free = FreeRobot::at_rest(&robot, Pose::default());
            run(&mut free, &wheels(&[-speed, speed, -speed, speed]), 4.0);
            let expected = 2.0 * 0.05 * speed / (track + length * length / track);
            assert_close(
                &format!("L {length}, B {track}, W {speed}: yaw rate, rad/s"),
                free.state().twist.yaw_rate_rad_per_s,
                expected,
                1e-6,
            );
        }
    }
}

#[test]
fn a_skid_steer_on_a_slow_arc_has_the_same_effective_track() {
    // At slips far below s0 the law is linear, forces of u and r superpose: u = R (W_r + W_l)/2 and
    // r = R (W_r - W_l)/(B + L^2/B), B = L = 0.24 m: effective track 0.48 m.
    let mut description = diff4();
    description.motor = None;
    let mut free = FreeRobot::at_rest(&robot(description), Pose::default());
    // Slips of 1 mm/s: tanh bends by (s/s0)^2/3 = 1e-3, the same for all four wheels but for the centripetal m u r.
    run(&mut free, &wheels(&[1.0, 1.08, 1.0, 1.08]), 4.0);
    let state = free.state();
    assert_close(
        "yaw rate, rad/s",
        state.twist.yaw_rate_rad_per_s,
        0.05 * 0.08 / 0.48,
        2e-3,
    );
    assert_close("forward, m/s", state.twist.forward_m_per_s, 0.05 * 1.04, 1e-4);
}
