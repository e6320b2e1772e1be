//! What laws see instead of late poses: against closed forms.

mod common;

use common::{CHASSIS, Pcg, chassis_robot};
use control::TICK_S;
use control::answer::Answer;
use control::law::RobotObservation;
use control::prediction::{GAP_M_PER_S, LONGEST_PREDICTION_S, Predictor};
use control::safety::Limits;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

fn twist(forward_m_per_s: f64, left_m_per_s: f64, yaw_rate_rad_per_s: f64) -> BodyTwist {
    BodyTwist {
        forward_m_per_s,
        left_m_per_s,
        yaw_rate_rad_per_s,
    }
}

fn seen(pose: Pose, pose_age_s: f64, twist: BodyTwist) -> RobotObservation {
    RobotObservation {
        pose,
        pose_age_s,
        twist,
        online: true,
    }
}

fn both(seconds: f64) -> Option<Answer> {
    Some(Answer {
        driving_s: seconds,
        turning_s: seconds,
    })
}

/// Pose after a constant twist, as rotation about the centre of its circle.
fn on_circle(from: &Pose, twist: &BodyTwist, time_s: f64) -> Pose {
    let (u, v, r) = (twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s);
    let (s, c) = (libm::sin(from.yaw_rad), libm::cos(from.yaw_rad));
    let (vx, vy) = (c * u - s * v, s * u + c * v);
    // The centre lies at the velocity turned left, divided by r.
    let centre = [from.x_m - vy / r, from.y_m + vx / r];
    let (s, c) = (libm::sin(r * time_s), libm::cos(r * time_s));
    let arm = [from.x_m - centre[0], from.y_m - centre[1]];
    Pose {
        x_m: centre[0] + c * arm[0] - s * arm[1],
        y_m: centre[1] + s * arm[0] + c * arm[1],
        yaw_rad: from.yaw_rad + r * time_s,
    }
}

fn apart(a: &Pose, b: &Pose) -> f64 {
    a.distance_m(b).max((a.yaw_rad - b.yaw_rad).abs())
}

#[test]
fn a_circle_is_predicted_exactly() {
    let mut random = Pcg(5);
    for round in 0..200 {
        let told = twist(
            random.between(-0.7, 0.7),
            random.between(-0.7, 0.7),
            random.between(0.05, 3.0) * if round % 2 == 0 { 1.0 } else { -1.0 },
        );
        let (answer_s, age_s) = (random.between(0.0, 0.2), random.between(0.0, 0.1));
        let mut predictor = Predictor::new(0.0);
        predictor.set_answer(both(answer_s));
        (0..700).for_each(|_| predictor.sent(&told));
        let measured = Pose {
            x_m: random.between(-2.0, 2.0),
            y_m: random.between(-2.0, 2.0),
            yaw_rad: random.between(-3.0, 3.0),
        };
        let found = predictor.predict(&seen(measured, age_s, told));
        let truth = on_circle(&measured, &told, answer_s + age_s);
        assert!(apart(&found.pose, &truth) < 1e-9, "{told:?} {found:?} {truth:?}");
        assert!((found.pose_age_s + answer_s).abs() < 1e-12);
        assert!((found.twist.forward_m_per_s - told.forward_m_per_s).abs() < 1e-12);
    }
}

/// Commands that change every tick, done `answer` ticks later by a robot that integrates them exactly.
#[test]
fn changing_commands_on_their_way_are_predicted_exactly() {
    let mut random = Pcg(6);
    for (answer, age) in [(0_usize, 3_usize), (6, 2), (12, 0), (20, 5)] {
        let mut predictor = Predictor::new(0.0);
        predictor.set_answer(both(answer as f64 * TICK_S));
        let told: Vec<BodyTwist> = (0..400)
            .map(|_| {
                twist(
                    random.between(-0.7, 0.7),
                    random.between(-0.7, 0.7),
                    random.between(0.1, 3.0),
                )
            })
            .collect();
        // What is done from tick k on was sent `answer` ticks before.
        let mut truth = vec![Pose::default(); answer + 1];
        for command in &told {
            truth.push(on_circle(&truth[truth.len() - 1], command, TICK_S));
        }
        for tick in 0..told.len() {
            if tick > answer + age {
                let then = tick - age;
                let observation = seen(truth[then], age as f64 * TICK_S, told[then - answer]);
                let found = predictor.predict(&observation);
                // Everything that is done until then was sent before this tick.
                let expected = truth[tick + answer];
                assert!(apart(&found.pose, &expected) < 1e-9, "{tick} {found:?} {expected:?}");
                let last = told[tick - 1];
                assert!(
                    (found.twist.left_m_per_s - last.left_m_per_s).abs() < 1e-12,
                    "{found:?}"
                );
            }
            predictor.sent(&told[tick]);
        }
    }
}

#[test]
fn without_delay_or_when_off_the_law_sees_what_was_measured_bit_for_bit() {
    let told = twist(0.3, -0.2, 1.0);
    let pose = Pose {
        x_m: 0.1 + 0.2,
        y_m: -0.0,
        yaw_rad: 1.0 / 3.0,
    };
    let bits = |seen: &RobotObservation| {
        let (p, t) = (seen.pose, seen.twist);
        let all = [p.x_m, p.y_m, p.yaw_rad, seen.pose_age_s];
        let rest = [t.forward_m_per_s, t.left_m_per_s, t.yaw_rate_rad_per_s];
        (all.map(f64::to_bits), rest.map(f64::to_bits), seen.online)
    };
    let mut predictor = Predictor::new(-0.1);
    (0..80).for_each(|_| predictor.sent(&told));
    let late = seen(pose, 0.05, twist(-0.0, 0.1, 0.2));
    assert_eq!(bits(&predictor.predict(&late)), bits(&late));
    predictor.set_answer(both(0.0));
    let fresh = seen(pose, 0.0, twist(-0.0, 0.1, 0.2));
    assert_eq!(bits(&predictor.predict(&fresh)), bits(&fresh));
    predictor.set_answer(both(0.1));
    assert_ne!(bits(&predictor.predict(&fresh)), bits(&fresh));
    predictor.set_answer(both(f64::NAN));
    assert_eq!(bits(&predictor.predict(&late)), bits(&late));
}

/// |error| <= e + (e_yaw + H e_rate) L + sqrt(2) H e_v with L the way that is predicted: nothing is amplified.
#[test]
fn noise_grows_no_further_than_its_bound() {
    let (e_m, e_yaw, e_v, e_rate) = (0.002, 0.004, 0.02, 0.05);
    let mut random = Pcg(8);
    let mut largest_share = 0.0_f64;
    for _ in 0..200 {
        let told = twist(
            random.between(-0.5, 0.5),
            random.between(-0.5, 0.5),
            random.between(0.1, 2.0),
        );
        let (answer_s, age_s) = (0.12, 0.05);
        let horizon_s = answer_s + age_s;
        let mut predictor = Predictor::new(0.0);
        predictor.set_answer(both(answer_s));
        (0..100).for_each(|_| predictor.sent(&told));
        let way_m = (told.speed_m_per_s() + 2.0_f64.sqrt() * e_v) * horizon_s;
        let yaw_bound = e_yaw + horizon_s * e_rate;
        let bound = 2.0_f64.sqrt() * (e_m + horizon_s * e_v) + yaw_bound * way_m;
        let mut truth = Pose::default();
        for _ in 0..240 {
            let mut noise = |size: f64| random.between(-size, size);
            let measured = Pose {
                x_m: truth.x_m + noise(e_m),
                y_m: truth.y_m + noise(e_m),
                yaw_rad: truth.yaw_rad + noise(e_yaw),
            };
            let moving = twist(
                told.forward_m_per_s + noise(e_v),
                told.left_m_per_s + noise(e_v),
                told.yaw_rate_rad_per_s + noise(e_rate),
            );
            let found = predictor.predict(&seen(measured, age_s, moving));
            let off = found.pose.distance_m(&on_circle(&truth, &told, horizon_s));
            let turned = (found.pose.yaw_rad - truth.yaw_rad - told.yaw_rate_rad_per_s * horizon_s).abs();
            assert!(
                off <= bound && turned <= yaw_bound,
                "{off} of {bound}, {turned} of {yaw_bound}"
            );
            largest_share = largest_share.max(off / bound);
            truth = on_circle(&truth, &told, TICK_S);
            predictor.sent(&told);
        }
    }
    println!("{largest_share:.2} of the bound");
    assert!(largest_share > 0.3);
}

/// A robot that does 80 % of what it is told is predicted where it will be once that was seen for a while.
#[test]
fn what_a_robot_does_differently_is_learnt_within_bounds() {
    let (told, done) = (twist(0.4, 0.0, 1.0), twist(0.32, 0.02, 0.7));
    let (answer_s, age_s) = (0.1, 0.02);
    let mut predictor = Predictor::new(0.0);
    predictor.set_answer(both(answer_s));
    let mut truth = Pose::default();
    let mut last = f64::INFINITY;
    for tick in 0..1200 {
        let found = predictor.predict(&seen(truth, age_s, done));
        let off = apart(&found.pose, &on_circle(&truth, &done, answer_s + age_s));
        if tick == 20 {
            last = off;
        }
        truth = on_circle(&truth, &done, TICK_S);
        predictor.sent(&told);
        if tick == 1199 {
            println!("{:.1} mm before, {:.3} mm after", 1e3 * last, 1e3 * off);
            assert!(off < 1e-4 && last > 0.01, "{last} {off}");
        }
    }
    // Nothing that a localisation may say makes it predict more than the limits.
    let mut predictor = Predictor::new(0.0);
    predictor.set_answer(both(0.1));
    for _ in 0..600 {
        predictor.predict(&seen(truth, age_s, twist(50.0, 0.0, 0.0)));
        predictor.sent(&BodyTwist::default());
    }
    let found = predictor.predict(&seen(truth, age_s, BodyTwist::default()));
    assert!(found.pose.distance_m(&truth) <= GAP_M_PER_S * 0.12 + 1e-9);
}

#[test]
fn a_robot_unseen_is_not_predicted_beyond_the_limit_and_nothing_makes_a_number_that_is_none() {
    let told = twist(0.5, 0.0, 0.0);
    let mut predictor = Predictor::new(0.0);
    predictor.set_answer(both(0.2));
    (0..100).for_each(|_| predictor.sent(&told));
    let pose = Pose::default();
    for age_s in [0.1, 0.15, 0.2, 0.3, 1.0, 1e9] {
        let found = predictor.predict(&seen(pose, age_s, told));
        let predicted_s = (0.2 + age_s).min(LONGEST_PREDICTION_S);
        assert!(
            found.pose.x_m <= 0.5 * LONGEST_PREDICTION_S + 1e-9,
            "{age_s}: {found:?}"
        );
        assert!(
            (age_s - found.pose_age_s - predicted_s).abs() < 1e-6 * age_s.max(1.0),
            "{age_s}: {found:?}"
        );
    }
    let odd = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1e300,
        -1e300,
        f64::MAX,
        1e-320,
        0.0,
        -1.0,
    ];
    let mut random = Pcg(9);
    let mut pick = || {
        let odds = odd[random.next() as usize % odd.len()];
        if random.next().is_multiple_of(3) {
            odds
        } else {
            random.between(-2.0, 2.0)
        }
    };
    let mut predicted = 0;
    for _ in 0..20_000 {
        predictor.set_answer(Some(Answer {
            driving_s: pick(),
            turning_s: pick(),
        }));
        predictor.sent(&twist(pick(), pick(), pick()));
        let observation = seen(
            Pose {
                x_m: pick(),
                y_m: pick(),
                yaw_rad: pick(),
            },
            pick(),
            twist(pick(), pick(), pick()),
        );
        let found = predictor.predict(&observation);
        let measured = observation.pose.is_finite();
        assert_eq!(found.pose.is_finite(), measured, "{observation:?} {found:?}");
        predicted += u32::from(found != observation && measured);
    }
    assert!(predicted > 1000, "{predicted}");
}

/// The robot's own answer: where a robot is `v T` behind its command after a small step, T is what is found.
#[test]
fn answers_of_the_six_chassis_are_what_their_steps_show() {
    for chassis in CHASSIS {
        let description = chassis_robot(chassis, "r")["description"].clone();
        let robot = Robot::new(serde_json::from_value(description).expect("description")).expect("robot");
        let answer = Answer::of(&robot);
        println!(
            "{chassis}: driving {:.3} s, turning {:.3} s",
            answer.driving_s, answer.turning_s
        );
        let mut free = twin::free::FreeRobot::at_rest(&robot, Pose::default());
        let command = robot.wheel_speeds(twist(0.1, 0.0, 0.0));
        (0..480).for_each(|_| free.step(&command));
        let state = free.state();
        let behind_s = 1.0 - state.pose.x_m / state.twist.forward_m_per_s;
        assert!(
            (behind_s - answer.driving_s).abs() < 5e-3,
            "{chassis}: {behind_s} {answer:?}"
        );
        assert!((0.02..0.2).contains(&answer.driving_s) && (0.02..0.35).contains(&answer.turning_s));
        let latency_s = control::answer::assumed_latency_s(&robot, &answer, &Limits::default());
        assert!(latency_s >= Limits::default().latency_s, "{chassis}: {latency_s}");
        assert_eq!(
            latency_s > Limits::default().latency_s,
            chassis == "diff4",
            "{chassis}: {latency_s}"
        );
    }
}
