//! Rules of the targets: whose they are, how many, where; what they mean is the law's table.

use super::check::{Problems, in_fence, in_obstacle, inside, radius_m};
use super::{MAX_ROBOTS, MAX_TARGETS, MIN_START_GAP_M, Scenario, Target};
use crate::law::{self, Owner, TargetRule, YawUse};
use crate::safety::Geofence;
use crate::vector::{length, sub};

pub fn check(scenario: &Scenario, problems: &mut Problems) {
    let experiment = &scenario.experiment;
    let targets = &experiment.targets;
    // A law that is not known has a problem of its own.
    let Some(spec) = law::law_spec(&experiment.control.law).or_else(|| law::law_spec(law::WAYPOINTS)) else {
        return;
    };
    let rule = spec.targets;
    let least = rule.least as usize;
    if targets.len() < least || targets.len() > MAX_TARGETS {
        let message = format!("{} targets", targets.len());
        let remedy = if least > 0 {
            "give at least one and not more than the limit"
        } else {
            "leave some out"
        };
        problems.add("targets", message, format!("{least} to {MAX_TARGETS} targets"), remedy);
    }
    let mut counts = vec![0_u32; experiment.robots.len().max(1)];
    let fence = Geofence::of(&scenario.arena.contents).ok().flatten();
    for (t, target) in targets.iter().enumerate().take(MAX_TARGETS) {
        let Some(index) = owner(scenario, t, target, rule, problems) else {
            continue;
        };
        check_place(scenario, t, target, index, problems);
        if let Some(fence) = &fence {
            let radius_m = largest_radius_m(scenario, index);
            in_fence(
                problems,
                format!("targets[{t}]"),
                fence,
                [target.x_m, target.y_m],
                radius_m,
            );
        }
        check_yaw(t, target, rule, spec.name, problems);
        let slot = index.unwrap_or(0);
        counts[slot] += 1;
        if counts[slot] > rule.most_each {
            too_many(scenario, t, index, rule, problems);
        }
    }
    if rule.apart {
        check_goals_apart(scenario, problems);
    }
}

/// Number of the robot that a target belongs to, `Some(None)` for the team; `None` when it has a problem.
fn owner(
    scenario: &Scenario,
    t: usize,
    target: &Target,
    rule: TargetRule,
    problems: &mut Problems,
) -> Option<Option<usize>> {
    let robots = &scenario.experiment.robots;
    let field = format!("targets[{t}].robot");
    if rule.owner == Owner::Team {
        let Some(name) = &target.robot else {
            return Some(None);
        };
        problems.add(
            field,
            format!("targets of this law belong to the team, not to {name:?}"),
            "no robot",
            "leave it out",
        );
        return None;
    }
    let index = match &target.robot {
        Some(name) => robots.iter().position(|robot| robot.name == *name),
        None if robots.len() == 1 => Some(0),
        None => None,
    };
    let Some(index) = index else {
        let names: Vec<&str> = robots.iter().map(|robot| robot.name.as_str()).collect();
        let message = match &target.robot {
            Some(name) => format!("the experiment has no robot {name:?}"),
            None => "with several robots every target names its robot".to_owned(),
        };
        problems.add(field, message, names.join(", "), "name one of the robots");
        return None;
    };
    if rule.owner == Owner::First && index != 0 {
        problems.add(
            field,
            format!("{} is not the first robot and takes no targets", robots[index].name),
            format!("{:?}, the first robot", robots[0].name),
            "give the target to the first robot, or change the order of the robots",
        );
        return None;
    }
    Some(Some(index))
}

fn too_many(scenario: &Scenario, t: usize, index: Option<usize>, rule: TargetRule, problems: &mut Problems) {
    match index {
        Some(index) if rule.most_each == 1 => problems.add(
            format!("targets[{t}].robot"),
            format!("{} has more than one goal", scenario.experiment.robots[index].name),
            "one goal for each robot",
            "use the law waypoints for several",
        ),
        _ => problems.add(
            format!("targets[{t}]"),
            "this target is one too many",
            format!("at most {}", rule.most_each),
            "leave some out",
        ),
    }
}

/// Radius of the robot or, when it may be any, of the largest.
fn largest_radius_m(scenario: &Scenario, index: Option<usize>) -> f64 {
    let robots = scenario.experiment.robots.len().min(MAX_ROBOTS);
    match index {
        Some(index) => radius_m(scenario, index),
        None => (0..robots).map(|i| radius_m(scenario, i)).fold(0.0, f64::max),
    }
}

/// Inside the walls and outside obstacles, for the robot or, if it may be any, for the largest.
fn check_place(scenario: &Scenario, t: usize, target: &Target, index: Option<usize>, problems: &mut Problems) {
    let radius_m = largest_radius_m(scenario, index);
    let axes = [
        ("x_m", target.x_m, scenario.arena.width_m),
        ("y_m", target.y_m, scenario.arena.height_m),
    ];
    for (axis, value_m, side_m) in axes {
        inside(problems, &format!("targets[{t}].{axis}"), value_m, side_m, radius_m);
    }
    let contents = &scenario.arena.contents;
    if let Some((at, overlap_m)) = contents.fixed_overlap_m(target.x_m, target.y_m, radius_m) {
        let name = &contents.fixed[at].name;
        in_obstacle(problems, format!("targets[{t}]"), name, [overlap_m, radius_m]);
    }
}

fn check_yaw(t: usize, target: &Target, rule: TargetRule, law: &str, problems: &mut Problems) {
    let field = format!("targets[{t}].yaw_rad");
    match (target.yaw_rad, rule.yaw) {
        (Some(_), YawUse::Unused) => problems.add(
            field,
            format!("the law {law} has no use for the yaw of a target"),
            "no yaw",
            "leave it out, or use the law go_to_pose",
        ),
        (Some(yaw_rad), _) => {
            problems.finite(field, yaw_rad, "radians");
        }
        (None, YawUse::Needed) => problems.add(
            field,
            format!("the law {law} needs the yaw on arrival"),
            "a finite number of radians",
            "give it, or use the law go_to_point",
        ),
        (None, _) => {}
    }
}

/// Two goals closer than the circles can never both be reached.
fn check_goals_apart(scenario: &Scenario, problems: &mut Problems) {
    let goals: Vec<(usize, [f64; 2])> = (0..scenario.experiment.robots.len().min(MAX_ROBOTS))
        .filter_map(|i| {
            scenario
                .targets_of(i)
                .next()
                .map(|target| (i, [target.x_m, target.y_m]))
        })
        .collect();
    for (later, (j, second)) in goals.iter().enumerate() {
        for (i, first) in &goals[..later] {
            let distance_m = length(sub(*first, *second));
            let least_m = radius_m(scenario, *i) + radius_m(scenario, *j) + MIN_START_GAP_M;
            if distance_m < least_m {
                let robots = &scenario.experiment.robots;
                problems.add(
                    "targets",
                    format!(
                        "the goals of {} and {} are {distance_m:.3} m apart",
                        robots[*i].name, robots[*j].name
                    ),
                    format!("at least {least_m:.3} m between their centres"),
                    "move one of the two goals",
                );
            }
        }
    }
}
