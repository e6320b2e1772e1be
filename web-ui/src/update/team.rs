//! Which robots take part in the experiment.

use super::compose::rehearse_soon;
use super::note;
use crate::state::State;
use api::arena::Arena;
use api::experiment::{Experiment, ExperimentRobot, Pose, Target};
use control::law::{Owner, law_spec};
use control::scenario::{MAX_ROBOTS, ScenarioArena, free_place};

/// A robot joins the experiment, where there is the most room, or leaves it; its targets go with it.
pub fn take(state: &mut State, name: &str, joins: bool) {
    let takes_part = state.compose.experiment.robots.iter().any(|robot| robot.name == name);
    if takes_part == joins {
        return;
    }
    let result = if joins {
        join(state, name)
    } else {
        leave(&mut state.compose.experiment, name)
    };
    match result {
        Ok(()) => {
            state.compose.edited = true;
            rehearse_soon(state);
        }
        Err(words) => note(state, words),
    }
}

fn leave(experiment: &mut Experiment, name: &str) -> Result<(), String> {
    if experiment.robots.len() == 1 {
        return Err(format!(
            "{name} is the last robot of the experiment: take another one first."
        ));
    }
    experiment.robots.retain(|robot| robot.name != name);
    experiment
        .targets
        .retain(|target| target.robot.as_deref() != Some(name));
    Ok(())
}

fn join(state: &mut State, name: &str) -> Result<(), String> {
    let Some(robot) = state.lab.robot(name) else {
        return Err(format!("The laboratory has no robot {name}."));
    };
    let (chassis, controller) = (robot.description.chassis.clone(), robot.controller.clone());
    let radius_m = robot.bounding_radius_m;
    let experiment = &state.compose.experiment;
    if experiment.robots.len() >= MAX_ROBOTS {
        return Err(format!("An experiment has at most {MAX_ROBOTS} robots."));
    }
    let radius_of = |name: &str| state.lab.robot(name).map_or(radius_m, |robot| robot.bounding_radius_m);
    let starts = experiment.robots.iter();
    let starts: Vec<_> = starts
        .map(|robot| ([robot.start.x_m, robot.start.y_m], radius_of(&robot.name)))
        .collect();
    let targets = experiment.targets.iter();
    let targets: Vec<_> = targets
        .map(|target| {
            (
                [target.x_m, target.y_m],
                target.robot.as_deref().map_or(radius_m, radius_of),
            )
        })
        .collect();
    let room = |taken: &[([f64; 2], f64)]| {
        let arena = scenario_arena(state.lab.arena_or_reference(&experiment.arena))?;
        free_place(&arena, taken, radius_m)
    };
    let crowded = || format!("There is no room for {name} on the floor: move the others together, or take one out.");
    let [x_m, y_m] = room(&starts).ok_or_else(crowded)?;
    let target = if wants_target(experiment) {
        Some(room(&targets).ok_or_else(crowded)?)
    } else {
        None
    };
    let experiment = &mut state.compose.experiment;
    let names_targets = law_spec(&experiment.control.law).is_none_or(|law| law.targets.owner != Owner::Team);
    if let (1, Some(only), true) = (experiment.robots.len(), experiment.robots.first(), names_targets) {
        // With several robots every target says whose it is.
        for target in experiment.targets.iter_mut().filter(|target| target.robot.is_none()) {
            target.robot = Some(only.name.clone());
        }
    }
    experiment.robots.push(ExperimentRobot {
        name: name.to_owned(),
        chassis,
        controller,
        start: Pose { x_m, y_m, yaw_rad: 0.0 },
    });
    experiment.targets.extend(target.map(|[x_m, y_m]| Target {
        robot: Some(name.to_owned()),
        x_m,
        y_m,
        yaw_rad: None,
    }));
    Ok(())
}

/// Whether the law has each robot drive to targets of its own.
fn wants_target(experiment: &Experiment) -> bool {
    let law = law_spec(&experiment.control.law);
    law.is_some_and(|law| law.targets.owner == Owner::Robot && law.targets.least > 0)
}

fn scenario_arena(arena: &Arena) -> Option<ScenarioArena> {
    serde_json::from_value(serde_json::to_value(arena).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::{Command, Effect};
    use crate::state::{Clock, Template, TwinStatus};
    use crate::update;
    use uuid::Uuid;

    fn clock(time_s: f64) -> Clock {
        Clock {
            time_s,
            utc: chrono::DateTime::from_timestamp_millis((1.7e12 + time_s * 1000.0) as i64).expect("in range"),
        }
    }

    fn page(template: Template) -> State {
        let mut state = State::new(Uuid::from_u128(5 << 64), clock(0.0), false);
        update::command(&mut state, Command::ChooseTemplate(template));
        state
    }

    fn press(state: &mut State, name: &str, joins: bool) {
        let name = name.to_owned();
        update::command(state, Command::TakeRobot { name, joins });
    }

    fn names(state: &State) -> Vec<&str> {
        state
            .compose
            .experiment
            .robots
            .iter()
            .map(|robot| robot.name.as_str())
            .collect()
    }

    /// Names of all robots of the laboratory.
    fn everyone(state: &State) -> Vec<String> {
        let robots = state.lab.robots_in("reference");
        robots.into_iter().map(|(name, _)| name.to_owned()).collect()
    }

    /// The document as the twin gets it has no problem.
    fn is_sound(state: &mut State) {
        let time_s = state.clock.time_s + 1.0;
        let effects = update::tick(state, clock(time_s));
        let scenario = effects.iter().find_map(|effect| match effect {
            Effect::StartTwin { scenario, .. } => Some(scenario.clone()),
            _ => None,
        });
        let scenario = control::scenario::Scenario::from_json(&scenario.expect("the twin starts"));
        assert!(scenario.is_ok(), "{scenario:?}");
        assert!(matches!(state.compose.twin.status, TwinStatus::Running { .. }));
    }

    #[test]
    fn ten_robots_join_a_template_and_leave_it_again() {
        for template in Template::ALL {
            let mut state = page(template);
            let before = state.compose.experiment.clone();
            let others = everyone(&state);
            for name in &others {
                if state.compose.experiment.robots.len() < 10 {
                    press(&mut state, name, true);
                }
            }
            assert_eq!(names(&state).len(), 10, "{template:?}");
            assert!(state.compose.edited);
            is_sound(&mut state);
            for name in &others {
                if !before.robots.iter().any(|robot| robot.name == *name) {
                    press(&mut state, name, false);
                }
            }
            assert_eq!(state.compose.experiment.robots, before.robots, "{template:?}");
            assert_eq!(
                state.compose.experiment.targets.len(),
                before.targets.len(),
                "{template:?}"
            );
            is_sound(&mut state);
        }
    }

    #[test]
    fn the_last_robot_stays_and_a_full_floor_says_so() {
        let mut state = page(Template::RectangleOmni4);
        press(&mut state, "omni-01", false);
        assert_eq!(names(&state), ["omni-01"]);
        assert!(state.toasts.back().expect("words").text.contains("last robot"));
        press(&mut state, "nobody", true);
        assert!(state.toasts.back().expect("words").text.contains("no robot nobody"));
        let all = everyone(&state);
        for robot in &mut state.lab.reference.robots {
            robot.bounding_radius_m = 0.6;
        }
        all.iter().for_each(|name| press(&mut state, name, true));
        assert!(names(&state).len() < all.len());
        assert!(state.toasts.back().expect("words").text.contains("no room"));
    }
}
