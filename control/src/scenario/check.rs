//! The rules of an experiment. Every rule names the field, what is wrong, what is allowed and what to do.

use std::collections::BTreeSet;

use twin::pairing::{self, ControllerKind, Pairing, SensorKind};
use twin::robot::Robot;

use super::{
    FORMAT, FieldProblem, MAX_DURATION_S, MAX_ROBOTS, MIN_DURATION_S, MIN_START_GAP_M, Scenario, ScenarioRobot, targets,
};
use crate::interaction;
use crate::law;
use crate::safety::Geofence;
use crate::vector::{length, sub};

const CHASSIS: [&str; 6] = ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"];
const CONTROLLERS: [&str; 3] = ["mega2560", "sam3x", "tx2"];
/// What every robot of a laboratory sends.
const LINK_SENSORS: [SensorKind; 5] = [
    SensorKind::Encoder,
    SensorKind::Current,
    SensorKind::BusVoltage,
    SensorKind::Gyro,
    SensorKind::Accelerometer,
];
const MAX_NAME_CHARACTERS: usize = 64;
/// Smallest and largest side of an arena.
const ARENA_SIDE_M: std::ops::RangeInclusive<f64> = 0.5..=200.0;
const BOUNDING_RADIUS_M: std::ops::RangeInclusive<f64> = 0.01..=5.0;

pub fn check(scenario: &Scenario) -> Vec<FieldProblem> {
    let mut problems = Problems(Vec::new());
    check_arena(scenario, &mut problems);
    check_document(scenario, &mut problems);
    check_interaction(scenario, &mut problems);
    check_robots(scenario, &mut problems);
    check_starts(scenario, &mut problems);
    targets::check(scenario, &mut problems);
    law::check(&scenario.experiment.control, &mut |field, message, limit, remedy| {
        problems.add(field, message, limit, remedy);
    });
    // What only the law knows can be asked once everything else is right.
    if problems.0.is_empty() {
        problems.0 = law::check_scenario(scenario);
    }
    problems.0
}

pub(super) struct Problems(Vec<FieldProblem>);

impl Problems {
    pub(super) fn add(
        &mut self,
        field: impl Into<String>,
        message: impl Into<String>,
        limit: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        self.0.push(FieldProblem {
            field: field.into(),
            message: message.into(),
            limit: limit.into(),
            remedy: remedy.into(),
        });
    }

    /// Adds a problem and returns false when the number is not finite.
    pub(super) fn finite(&mut self, field: String, value: f64, unit: &str) -> bool {
        if !value.is_finite() {
            self.add(
                field,
                format!("{value} is not a finite number"),
                format!("a finite number of {unit}"),
                "give a number",
            );
        }
        value.is_finite()
    }
}

fn check_arena(scenario: &Scenario, problems: &mut Problems) {
    let arena = &scenario.arena;
    for (field, side_m) in [("arena.width_m", arena.width_m), ("arena.height_m", arena.height_m)] {
        if !ARENA_SIDE_M.contains(&side_m) {
            problems.add(
                field,
                format!("an arena side of {side_m} m cannot be used"),
                format!("{} m to {} m", ARENA_SIDE_M.start(), ARENA_SIDE_M.end()),
                "correct the laboratory's description",
            );
        }
    }
    for problem in arena.contents.check(&arena.walls()) {
        problems.add(
            format!("arena.contents.{}", problem.field),
            problem.message,
            problem.limit,
            problem.remedy,
        );
    }
    if let Err(problem) = Geofence::of(&arena.contents) {
        problems.add(problem.field, problem.message, problem.limit, problem.remedy);
    }
    if scenario.experiment.arena != arena.name {
        let message = format!("the arena {:?} is not here", scenario.experiment.arena);
        problems.add(
            "arena",
            message,
            format!("{:?}", arena.name),
            "name the arena of the laboratory",
        );
    }
    if scenario.experiment.floor != arena.floor {
        let message = format!(
            "the arena {:?} has no floor {:?}",
            arena.name, scenario.experiment.floor
        );
        problems.add(
            "floor",
            message,
            format!("{:?}", arena.floor),
            "name the floor that the arena has",
        );
    }
}

fn check_document(scenario: &Scenario, problems: &mut Problems) {
    let experiment = &scenario.experiment;
    if experiment.format != FORMAT {
        let message = format!("the format {:?} is not known", experiment.format);
        problems.add("format", message, format!("{FORMAT:?}"), format!("write {FORMAT:?}"));
    }
    if !(MIN_DURATION_S..=MAX_DURATION_S).contains(&experiment.duration_s) {
        problems.add(
            "duration_s",
            format!("{} s is not a possible duration", experiment.duration_s),
            format!("{MIN_DURATION_S} s to {MAX_DURATION_S} s"),
            "choose a duration in this range",
        );
    }
    if experiment
        .model
        .as_ref()
        .is_some_and(|model| model.is_empty() || model.len() > 128)
    {
        problems.add(
            "model",
            "a model version has 1 to 128 characters",
            "1 to 128 characters",
            "leave it null for the nominal twin",
        );
    }
}

fn check_interaction(scenario: &Scenario, problems: &mut Problems) {
    let Some(asked) = scenario.experiment.control.interaction else {
        return;
    };
    if scenario.experiment.control.feedback_alone {
        problems.add(
            "control.feedback_alone",
            "models cannot correct the commands of feedback alone",
            "`feedback_alone` or `interaction`, not both",
            "leave one of the two out",
        );
    }
    let [least_s, most_s] = interaction::HORIZONS_S;
    // False also of what is not a number.
    if !(least_s..=most_s).contains(&asked.horizon_s) {
        problems.add(
            "control.interaction.horizon_s",
            format!("the models cannot look {} s ahead", asked.horizon_s),
            format!("{least_s} s to {most_s} s"),
            "choose a horizon in this range, or leave `interaction` out",
        );
    }
}

fn check_robots(scenario: &Scenario, problems: &mut Problems) {
    let robots = &scenario.experiment.robots;
    if robots.is_empty() || robots.len() > MAX_ROBOTS {
        let message = format!("{} robots", robots.len());
        problems.add(
            "robots",
            message,
            format!("1 to {MAX_ROBOTS} robots"),
            "choose at least one and not more than the limit",
        );
    }
    let mut names = BTreeSet::new();
    for (i, robot) in robots.iter().enumerate() {
        let at = format!("robots[{i}]");
        if robot.name.is_empty() || robot.name.chars().count() > MAX_NAME_CHARACTERS {
            let limit = format!("1 to {MAX_NAME_CHARACTERS} characters");
            problems.add(
                format!("{at}.name"),
                "the name is empty or too long",
                limit,
                "name a robot of the laboratory",
            );
        }
        if !names.insert(robot.name.as_str()) {
            let message = format!("{:?} is named twice", robot.name);
            problems.add(format!("{at}.name"), message, "each robot once", "choose another robot");
        }
        if !CHASSIS.contains(&robot.chassis.as_str()) {
            let message = format!("the chassis {:?} is not known", robot.chassis);
            problems.add(
                format!("{at}.chassis"),
                message,
                CHASSIS.join(", "),
                "choose one of these",
            );
        }
        if !CONTROLLERS.contains(&robot.controller.as_str()) {
            let message = format!("the controller {:?} is not known", robot.controller);
            problems.add(
                format!("{at}.controller"),
                message,
                CONTROLLERS.join(", "),
                "choose one of these",
            );
        }
        check_lab_robot(scenario, i, &at, problems);
    }
    if scenario.robots.len() > robots.len() {
        let message = format!(
            "{} robots for an experiment with {}",
            scenario.robots.len(),
            robots.len()
        );
        problems.add(
            "laboratory.robots",
            message,
            "the robots of the experiment, in its order",
            "leave the others out",
        );
    }
}

/// The laboratory must have the robot, with the same chassis and controller.
fn check_lab_robot(scenario: &Scenario, i: usize, at: &str, problems: &mut Problems) {
    let robot = &scenario.experiment.robots[i];
    let Some(known) = scenario
        .robots
        .get(i)
        .filter(|known| known.description.name == robot.name)
    else {
        let message = format!("the laboratory has no robot {:?}", robot.name);
        let names: Vec<&str> = scenario
            .robots
            .iter()
            .map(|known| known.description.name.as_str())
            .collect();
        problems.add(
            format!("{at}.name"),
            message,
            names.join(", "),
            "name a robot of the laboratory",
        );
        return;
    };
    let chassis = chassis_name(known);
    if robot.chassis != chassis {
        let message = format!("{} has the chassis {chassis:?}, not {:?}", robot.name, robot.chassis);
        problems.add(
            format!("{at}.chassis"),
            message,
            format!("{chassis:?}"),
            "use the chassis of the robot or another robot",
        );
    }
    if robot.controller != known.controller {
        let message = format!(
            "{} has the controller {:?}, not {:?}",
            robot.name, known.controller, robot.controller
        );
        problems.add(
            format!("{at}.controller"),
            message,
            format!("{:?}", known.controller),
            "use the controller of the robot",
        );
    }
    if !BOUNDING_RADIUS_M.contains(&known.bounding_radius_m) {
        problems.add(
            format!("laboratory.robots[{i}].bounding_radius_m"),
            format!("{} m is not a possible bounding radius", known.bounding_radius_m),
            format!("{} m to {} m", BOUNDING_RADIUS_M.start(), BOUNDING_RADIUS_M.end()),
            "correct the laboratory's description",
        );
    }
    match Robot::new(known.description.clone()) {
        Ok(made) if made.drive_axis_rad().is_some() => problems.add(
            format!("{at}.chassis"),
            format!(
                "{} drives on two of its omni wheels: nothing holds it across their axis, so it slides out of every \
                 bend and neither laws nor the safety filter can stop it there",
                robot.name
            ),
            "robots that hold their velocity in every direction: all chassis with their usual wheels",
            "drive all four wheels, or choose another robot",
        ),
        Ok(_) => {}
        Err(error) => {
            let field = format!("laboratory.robots[{i}].description.{}", error.field);
            problems.add(field, error.message, error.limit, error.remedy);
        }
    }
    check_pairing(known, i, problems);
}

/// The robot's controller must be able to drive its chassis and to read what the link carries.
fn check_pairing(known: &ScenarioRobot, i: usize, problems: &mut Problems) {
    let Some(controller) = ControllerKind::from_name(&known.controller) else {
        return;
    };
    let pair = Pairing {
        controller,
        sensors: LINK_SENSORS.to_vec(),
        robot: known.description.clone(),
    };
    for problem in pairing::check(&pair).err().unwrap_or_default() {
        let unit = problem.budget.unit();
        problems.add(
            format!("laboratory.robots[{i}].controller"),
            format!("{} needs {} {unit}", problem.subject, problem.needed),
            format!("{} {unit} on {}", problem.available, problem.controller),
            &problem.remedy,
        );
    }
}

/// The chassis as it is written in documents.
fn chassis_name(robot: &ScenarioRobot) -> String {
    match serde_json::to_value(&robot.description.chassis) {
        Ok(serde_json::Value::String(name)) => name,
        _ => String::new(),
    }
}

pub(super) fn radius_m(scenario: &Scenario, i: usize) -> f64 {
    scenario
        .robots
        .get(i)
        .map_or(0.0, |robot| robot.bounding_radius_m)
        .clamp(0.0, *BOUNDING_RADIUS_M.end())
}

fn check_starts(scenario: &Scenario, problems: &mut Problems) {
    let robots = &scenario.experiment.robots;
    let fence = Geofence::of(&scenario.arena.contents).ok().flatten();
    for (i, robot) in robots.iter().enumerate() {
        let start = robot.start;
        problems.finite(format!("robots[{i}].start.yaw_rad"), start.yaw_rad, "radians");
        let place = [
            ("x_m", start.x_m, scenario.arena.width_m),
            ("y_m", start.y_m, scenario.arena.height_m),
        ];
        for (axis, value_m, side_m) in place {
            inside(
                problems,
                &format!("robots[{i}].start.{axis}"),
                value_m,
                side_m,
                radius_m(scenario, i),
            );
        }
        let contents = &scenario.arena.contents;
        let radius_m = radius_m(scenario, i);
        let fixed = contents.fixed_overlap_m(start.x_m, start.y_m, radius_m);
        let pushable = contents.pushable_overlap_m(start.x_m, start.y_m, radius_m);
        let fixed = fixed.map(|(at, overlap_m)| (&contents.fixed[at].name, overlap_m));
        let pushable = pushable.map(|(at, overlap_m)| (&contents.pushable[at].name, overlap_m));
        if let Some((name, overlap_m)) = fixed.or(pushable) {
            in_obstacle(problems, format!("robots[{i}].start"), name, [overlap_m, radius_m]);
        }
        if let Some(fence) = &fence {
            in_fence(
                problems,
                format!("robots[{i}].start"),
                fence,
                [start.x_m, start.y_m],
                radius_m,
            );
        }
    }
    for (j, second) in robots.iter().enumerate().take(MAX_ROBOTS) {
        for (i, first) in robots.iter().enumerate().take(j) {
            let distance_m = length(sub(
                [first.start.x_m, first.start.y_m],
                [second.start.x_m, second.start.y_m],
            ));
            let least_m = radius_m(scenario, i) + radius_m(scenario, j) + MIN_START_GAP_M;
            if distance_m < least_m {
                problems.add(
                    format!("robots[{j}].start"),
                    format!(
                        "{} and {} start {distance_m:.3} m apart and would overlap",
                        first.name, second.name
                    ),
                    format!("at least {least_m:.3} m between their centres"),
                    "move one of the two start poses",
                );
            }
        }
    }
}

/// A place where the bounding circle of a robot overlaps an obstacle; lengths are overlap and radius, m.
pub(super) fn in_obstacle(problems: &mut Problems, field: String, obstacle: &str, [overlap_m, radius_m]: [f64; 2]) {
    problems.add(
        field,
        format!("there the robot (radius {radius_m} m) would stand {overlap_m:.3} m inside the obstacle {obstacle:?}"),
        format!("at least {radius_m} m from the obstacle"),
        "move it away from the obstacle",
    );
}

/// The whole bounding circle must lie inside the geofence.
pub(super) fn in_fence(problems: &mut Problems, field: String, fence: &Geofence, at_m: [f64; 2], radius_m: f64) {
    let beyond_m = radius_m - fence.depth_m(at_m);
    // Places that are no numbers are reported by themselves.
    if beyond_m > 1e-9 {
        problems.add(
            field,
            format!(
                "there the robot (radius {radius_m} m) would stand {beyond_m:.3} m beyond the geofence of the arena"
            ),
            format!("at least {radius_m} m inside the geofence"),
            "move it further inside",
        );
    }
}

/// The whole bounding circle must lie inside the walls.
pub(super) fn inside(problems: &mut Problems, field: &str, value_m: f64, side_m: f64, radius_m: f64) {
    if !problems.finite(field.to_owned(), value_m, "metres") {
        return;
    }
    let limit_m = (side_m / 2.0 - radius_m).max(0.0);
    if value_m.abs() > limit_m {
        problems.add(
            field,
            format!("at {value_m} m the robot (radius {radius_m} m) would stand in the wall"),
            format!("-{limit_m:.3} m to {limit_m:.3} m"),
            "move it into the arena",
        );
    }
}
