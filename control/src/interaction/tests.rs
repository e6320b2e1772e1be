//! What the correction says when nothing can be believed, and what it does when everything can.

use twin::SUBSTEPS;
use twin::effect::Effect;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;

use super::{Interaction, Settings, TURNS};
use crate::TICK_S;
use crate::answer::Answer;
use crate::law::{Drive, RobotObservation};
use crate::safety::{FilterBody, Limits, SafetyFilter};
use crate::vector::distance_to_segment;

const CHASSIS: [&str; 6] = ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"];

fn robot(chassis: &str, effects: &[Effect]) -> Robot {
    let path = format!("{}/../examples/robots/{chassis}-sam3x.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).expect("a file");
    let document: serde_json::Value = serde_json::from_str(&text).expect("a document");
    let description: RobotDescription = serde_json::from_value(document["robot"].clone()).expect("a description");
    Robot::with_effects(description, effects).expect("a robot")
}

/// A robot in the twin, its filter and its correction.
struct Scene {
    /// Whose marker the tracker sees.
    tracked: Robot,
    robot: FreeRobot,
    filter: SafetyFilter,
    interaction: Interaction,
    answer: Answer,
    /// Where the robot should have been so far, and where it was.
    way: Vec<[f64; 2]>,
    was: Vec<[f64; 2]>,
}

impl Scene {
    fn new(truth: &Robot, model: &Robot) -> Scene {
        let body = FilterBody {
            robot: truth.clone(),
            bounding_radius_m: 0.25,
        };
        Scene {
            tracked: truth.clone(),
            robot: FreeRobot::at_rest(truth, Pose::default()),
            filter: SafetyFilter::new(Limits::default(), [60.0, 60.0], vec![body]),
            interaction: Interaction::new(model, Drive::of(truth), Settings::default()),
            answer: Answer::of(truth),
            way: Vec::new(),
            was: Vec::new(),
        }
    }

    fn seen(&self) -> RobotObservation {
        let state = self.robot.state();
        RobotObservation {
            pose: self.tracked.seen_pose(state.pose),
            pose_age_s: 0.0,
            twist: state.twist,
            online: true,
        }
    }

    /// A tick under a wish; whether the correction was active.
    fn tick(&mut self, wanted: &BodyTwist) -> bool {
        let seen = self.seen();
        let ideal = self.interaction.observe(&seen, Some(self.answer));
        if let Some([should, _]) = self.interaction.expected() {
            self.way.push([should.x_m, should.y_m]);
            self.was.push([seen.pose.x_m, seen.pose.y_m]);
        }
        let command = self
            .interaction
            .command(wanted, (self.was.len() as u64).is_multiple_of(TURNS));
        let told = command.unwrap_or(*wanted);
        assert!(
            [told.forward_m_per_s, told.left_m_per_s, told.yaw_rate_rad_per_s]
                .iter()
                .all(|part| part.is_finite())
        );
        if let Some(command) = command {
            assert!(ideal.is_some());
            // Bounded around what the law asks for within the horizon.
            assert!(
                (command.forward_m_per_s - wanted.forward_m_per_s).abs() <= 0.7,
                "{command:?} for {wanted:?}"
            );
            assert!(command.yaw_rate_rad_per_s.abs() <= 2.5 * (wanted.yaw_rate_rad_per_s.abs() + 1.8) + 1.0);
        }
        let filtered = self.filter.apply(&[seen], &[told])[0];
        self.interaction.sent(&filtered.command, None);
        let wheels = filtered.command.wheel_command();
        (0..SUBSTEPS).for_each(|_| self.robot.step(&wheels));
        command.is_some()
    }

    /// Distance between where the robot was half a second ago and the way on which it should have been, m.
    fn off_m(&self) -> f64 {
        let Some(was) = self.was.len().checked_sub(60).map(|then| self.was[then]) else {
            return 0.0;
        };
        let legs = self.way.windows(2).rev().take(120);
        legs.map(|leg| distance_to_segment(was, leg[0], leg[1]))
            .fold(f64::INFINITY, f64::min)
    }
}

fn wish(chassis: &str, tick: u32) -> BodyTwist {
    let t = f64::from(tick) * TICK_S;
    let forward_m_per_s = 0.4 + 0.1 * libm::sin(0.9 * t);
    BodyTwist {
        forward_m_per_s,
        left_m_per_s: if chassis == "omni4" {
            0.1 * libm::sin(1.3 * t)
        } else {
            0.0
        },
        yaw_rate_rad_per_s: 0.5 * libm::sin(1.1 * t),
    }
}

#[test]
fn with_the_right_model_every_chassis_is_where_an_ideal_robot_would_be() {
    let effects = [
        Effect::new("floor_friction", &[("scale", 0.5)]),
        Effect::new("motor_lag", &[("time_constant", 0.06)]),
    ];
    let mut worst = Vec::new();
    for chassis in CHASSIS {
        let truth = robot(chassis, &effects);
        let mut scene = Scene::new(&truth, &truth);
        let mut worst_m: f64 = 0.0;
        for tick in 0..1200 {
            assert!(scene.tick(&wish(chassis, tick)), "{chassis}, tick {tick}");
            if tick > 240 {
                worst_m = worst_m.max(scene.off_m());
            }
        }
        println!("{chassis}: {:.2} mm", 1e3 * worst_m);
        worst.push((chassis, worst_m));
    }
    for (chassis, worst_m) in worst {
        assert!(worst_m < 0.006, "{chassis}: {worst_m} m");
    }
}

/// A tracker whose marker sits off the body's origin and whose scale is wrong: the model knows of both, so nothing is left for the
/// bias to learn.
#[test]
fn a_model_is_compared_where_the_tracker_sees_it() {
    let effects = [
        Effect::new("marker_offset", &[("x", 0.04), ("y", 0.02), ("yaw", 0.0)]),
        Effect::new("pose_scale", &[("relative", -0.05)]),
    ];
    for chassis in CHASSIS {
        let truth = robot(chassis, &effects);
        let mut scene = Scene::new(&truth, &truth);
        scene.interaction = Interaction::new(
            &truth,
            Drive::of(&truth),
            Settings {
                learns_bias: false,
                ..Settings::default()
            },
        );
        let mut worst_m: f64 = 0.0;
        for tick in 0..1200 {
            scene.tick(&wish(chassis, tick));
            if tick > 240 {
                worst_m = worst_m.max(scene.off_m());
            }
        }
        println!("{chassis}: {:.2} mm", 1e3 * worst_m);
        assert!(worst_m < 0.006, "{chassis}: {worst_m} m");
    }
}

/// Out and back four times, along curves: the wheels are turned while the robot hardly moves.
#[test]
fn cars_that_change_gear_are_where_an_ideal_one_would_be() {
    let effects = [
        Effect::new("steering_offset", &[("offset", 0.04)]),
        Effect::new("steering_lag", &[("time_constant", 0.05)]),
        Effect::new("floor_friction", &[("scale", 0.5)]),
    ];
    for chassis in ["fwd", "rwd", "awd"] {
        let truth = robot(chassis, &effects);
        let mut scene = Scene::new(&truth, &truth);
        let mut worst_m: f64 = 0.0;
        for tick in 0..2400 {
            let t = f64::from(tick) * TICK_S;
            let forward_m_per_s = 0.5 * libm::sin(1.2 * t);
            let per_m = 0.8 * libm::sin(0.7 * t);
            scene.tick(&BodyTwist {
                forward_m_per_s,
                left_m_per_s: 0.0,
                yaw_rate_rad_per_s: per_m * forward_m_per_s,
            });
            if tick > 240 {
                worst_m = worst_m.max(scene.off_m());
            }
        }
        println!("{chassis}: {:.2} mm", 1e3 * worst_m);
        assert!(worst_m < 0.006, "{chassis}: {worst_m} m");
    }
}

#[test]
fn a_better_model_brings_the_robot_closer() {
    let effects = [
        Effect::new("motor_lag", &[("time_constant", 0.12)]),
        Effect::new("wheel_radius", &[("relative", -0.05)]),
    ];
    let mut both = Vec::new();
    for chassis in ["omni4", "diff2", "rwd"] {
        let truth = robot(chassis, &effects);
        let rms_m = |model: &Robot| {
            let mut scene = Scene::new(&truth, model);
            scene.interaction = Interaction::new(
                model,
                Drive::of(&truth),
                Settings {
                    learns_bias: false,
                    ..Settings::default()
                },
            );
            let mut squares = 0.0;
            for tick in 0..1200 {
                scene.tick(&wish(chassis, tick));
                squares += if tick > 240 { scene.off_m() * scene.off_m() } else { 0.0 };
            }
            (squares / 960.0_f64).sqrt()
        };
        let (right_m, nominal_m) = (rms_m(&truth), rms_m(&robot(chassis, &[])));
        println!("{chassis}: {:.2} mm, nominal {:.2} mm", 1e3 * right_m, 1e3 * nominal_m);
        both.push((chassis, right_m, nominal_m));
    }
    for (chassis, right_m, nominal_m) in both {
        assert!(right_m < 0.8 * nominal_m, "{chassis}: {right_m} m, {nominal_m} m");
    }
}

#[test]
fn a_model_that_leaves_finite_numbers_is_not_believed() {
    for value in [f64::NAN, f64::INFINITY, 1e30, -1e30, f64::MAX] {
        let truth = robot("omni4", &[]);
        let mut scene = Scene::new(&truth, &truth);
        for tick in 0..240 {
            scene.tick(&wish("omni4", tick));
        }
        for tick in 240..480 {
            scene.interaction.spoil(value);
            let active = scene.tick(&wish("omni4", tick));
            assert!(!active, "{value}: tick {tick}");
        }
        // It comes back when the model does.
        let active = (480..900).filter(|tick| scene.tick(&wish("omni4", *tick))).count();
        assert!(active > 200, "{value}: {active} ticks");
    }
}

#[test]
fn what_cannot_be_seen_or_is_late_leaves_the_wish_as_it_is() {
    let truth = robot("diff2", &[]);
    let mut scene = Scene::new(&truth, &truth);
    for tick in 0..240 {
        assert!(scene.tick(&wish("diff2", tick)));
    }
    let seen = scene.seen();
    let bad = |change: fn(&mut RobotObservation)| {
        let mut seen = seen;
        change(&mut seen);
        seen
    };
    let cases = [
        (bad(|seen| seen.pose.x_m = f64::NAN), Some(scene.answer)),
        (bad(|seen| seen.pose_age_s = 0.4), Some(scene.answer)),
        (bad(|seen| seen.pose_age_s = f64::NAN), Some(scene.answer)),
        (bad(|seen| seen.pose.y_m += 1.0), Some(scene.answer)),
        (seen, None),
        (
            seen,
            Some(Answer {
                driving_s: f64::NAN,
                turning_s: 0.1,
            }),
        ),
    ];
    for (seen, answer) in cases {
        assert_eq!(scene.interaction.observe(&seen, answer), None, "{seen:?}, {answer:?}");
        assert_eq!(scene.interaction.command(&BodyTwist::default(), true), None);
    }
}

#[test]
fn a_robot_that_is_to_rest_is_told_to_rest() {
    let truth = robot("awd", &[]);
    let mut scene = Scene::new(&truth, &robot("awd", &[Effect::new("floor_tilt", &[("x", 0.03)])]));
    for tick in 0..240 {
        scene.tick(&wish("awd", tick));
    }
    for _ in 0..240 {
        scene.tick(&BodyTwist::default());
    }
    let seen = scene.seen();
    assert!(scene.interaction.observe(&seen, Some(scene.answer)).is_some());
    assert_eq!(
        scene.interaction.command(&BodyTwist::default(), true),
        Some(BodyTwist::default())
    );
}

/// A robot that drags its wheels over the floor turns about a point that loads and motors choose. Its virtual robot does so too:
/// held against one that turns about its own middle, it would be pushed out of its turn.
#[test]
fn a_robot_that_skids_turns_where_its_model_does() {
    let effects = [
        Effect::new("center_of_mass_offset", &[("x", 0.03), ("y", 0.0)]),
        Effect::new("payload", &[("mass", 3.0), ("inertia", 0.05)]),
    ];
    let truth = robot("diff4", &effects);
    let mut scene = Scene::new(&truth, &truth);
    let point_m = scene.interaction.point_x_m();
    let turn = BodyTwist {
        yaw_rate_rad_per_s: 1.2,
        ..BodyTwist::default()
    };
    let (mut worst_m, still) = (0.0_f64, BodyTwist::default());
    for tick in 0..600 {
        scene.tick(if tick < 120 { &still } else { &turn });
        if tick > 240 {
            let [should, _] = scene.interaction.expected().expect("active");
            let is = scene.seen().pose;
            worst_m = worst_m.max(libm::hypot(should.x_m - is.x_m, should.y_m - is.y_m));
        }
    }
    println!("turns {:.1} mm ahead; {:.1} mm off", 1e3 * point_m, 1e3 * worst_m);
    assert!(point_m > 0.01 && worst_m < 0.005, "{point_m} m, {worst_m} m");
}
