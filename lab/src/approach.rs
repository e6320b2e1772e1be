//! Robots drive themselves to their starts, or home, through the same safety filter as the run.

use crate::commander::Still;
use crate::lab::Lab;
use crate::lease::Lease;
use crate::link::HeldPort;
use crate::loop_120hz::{LoopEnd, LoopResult, Setup};
use crate::pose_frame::SeenPose;
use crate::prepare;
use crate::record::LogLevel;
use crate::recorder::RecorderHandle;
use crate::run::{self, Conclusion};
use crate::safety::{Ending, Signals};
use crate::schedule::TICK_HZ;
use api::experiment::Pose;
use api::lab::Assignment;
use control::scenario::Scenario;
use control::team::Team;
use serde_json::json;
use std::sync::Arc;

/// Ticks of the approach are numbered from here, so that they are negative as everything before the start.
pub const FIRST_TICK: i64 = -1_000_000;
/// Robots that are not where they should be by then are carried.
pub const TIME_LIMIT_S: f64 = 60.0;

/// What came of it.
pub enum Approach {
    /// The robots stand where they drove to.
    Arrived(Vec<HeldPort>),
    /// They could not get there by themselves; the words say why.
    Stuck(Vec<HeldPort>, String),
}

/// Robots that drive to places of their own, all at once.
pub(crate) struct Ride<'a> {
    /// Robots and arena; the law and the targets of the experiment do not count.
    pub assignment: &'a Assignment,
    /// By robot of the assignment; one without a goal stands still.
    pub goals: Vec<Option<Pose>>,
    pub signals: Box<dyn Fn() -> Signals + Send>,
}

/// Drives all robots of the run from where they are seen to their starts.
///
/// - `ports`: in the order of the experiment.
/// - Errors: what ended the run meanwhile: a stop, a lost lease, a silent robot.
pub async fn drive(
    lab: &Arc<Lab>,
    assignment: &Assignment,
    lease: &Arc<Lease>,
    recorder: &RecorderHandle,
    ports: Vec<HeldPort>,
) -> Result<Approach, Conclusion> {
    recorder.log(LogLevel::Info, "robots drive to their starts");
    let starts = assignment.experiment.robots.iter();
    let to_starts = Ride {
        assignment,
        goals: starts.map(|robot| Some(robot.start)).collect(),
        signals: run::signals(lab, lease, recorder, assignment),
    };
    ride(lab, to_starts, recorder, ports).await
}

/// Drives robots from where they are seen to their goals, by `go_to_pose` through the safety filter.
///
/// - `ports`: in the order of the experiment.
/// - Errors: what ended it before: a stop, a lost lease, a silent robot.
pub(crate) async fn ride(
    lab: &Arc<Lab>,
    ride: Ride<'_>,
    recorder: &RecorderHandle,
    mut ports: Vec<HeldPort>,
) -> Result<Approach, Conclusion> {
    let Ride {
        assignment,
        goals,
        signals,
    } = ride;
    let team = standing(lab, assignment).and_then(|standing| team(assignment, &standing, &goals));
    let team = match team {
        Ok(team) => team,
        Err(why) => return Ok(Approach::Stuck(ports, why)),
    };
    let limits = run::limits(assignment)?;
    let (poses, telemetry) = (lab.localisation.listen(), lab.link.listen());
    let robots = match run::pilot_robots(lab, &ports, &limits) {
        Ok(robots) => robots,
        Err(conclusion) => {
            ports.iter_mut().for_each(|port| {
                port.still(Still::Rest, 0);
            });
            return Err(conclusion);
        }
    };
    let setup = Setup {
        team,
        robots,
        strangers: run::strangers(lab, assignment),
        ports,
        poses,
        telemetry,
        recorder: recorder.clone(),
        signals,
        duration_ticks: (TIME_LIMIT_S * TICK_HZ as f64).round() as i64,
        first_tick: FIRST_TICK,
        phase_us: lab.localisation.tick_phase_us(1e6 / TICK_HZ as f64),
    };
    let LoopEnd { result, ports, .. } = run::run_loop(setup).await?;
    let LoopResult { ending, ticks, .. } = result;
    let names: Vec<_> = names(assignment);
    match left_over(ending, ticks) {
        Ok(None) => Ok(Approach::Arrived(ports)),
        Ok(Some(why)) => Ok(Approach::Stuck(ports, why)),
        Err(ending) => Err(Conclusion::of(ending, &names)),
    }
}

/// What is left to do after a ride: nothing, or why robots are not where they should be.
///
/// - `ticks`: that it took.
/// - Errors: an ending that is the run's as well.
pub fn left_over(ending: Ending, ticks: i64) -> Result<Option<String>, Ending> {
    match ending {
        Ending::Finished if ticks < (TIME_LIMIT_S * TICK_HZ as f64) as i64 => Ok(None),
        Ending::Finished => Ok(Some(format!("not there within {TIME_LIMIT_S} s"))),
        // No reason to end a run that has not begun: somebody carries them.
        Ending::Deadlock => Ok(Some("they hold each other".to_owned())),
        ending => Err(ending),
    }
}

/// A robot that is seen here stands at its start.
pub fn is_at_start(seen: &Pose, start: &Pose) -> bool {
    let seen = SeenPose {
        number: 0,
        x_m: seen.x_m,
        y_m: seen.y_m,
        yaw_rad: seen.yaw_rad,
        velocity: None,
        spread: None,
    };
    prepare::is_at(&seen, start)
}

fn names(assignment: &Assignment) -> Vec<String> {
    let robots = assignment.experiment.robots.iter();
    robots.map(|robot| robot.name.clone()).collect()
}

/// Where the robots of a run are seen, in the order of its experiment.
fn standing(lab: &Lab, assignment: &Assignment) -> Result<Vec<Pose>, String> {
    let robots = assignment.experiment.robots.iter().zip(&assignment.robots);
    let seen = robots.map(|(wanted, robot)| {
        let (pose, _) = lab
            .localisation
            .pose(robot.number)
            .ok_or_else(|| format!("{} is not seen", wanted.name))?;
        Ok(Pose {
            x_m: pose.x_m,
            y_m: pose.y_m,
            yaw_rad: pose.yaw_rad,
        })
    });
    seen.collect()
}

/// The experiment's robots with where they stand as starts, and these goals.
///
/// - `standing`, `goals`: in the order of the experiment; a robot without a goal stands still.
/// - Errors: in words, why nothing takes them there.
pub fn team(assignment: &Assignment, standing: &[Pose], goals: &[Option<Pose>]) -> Result<Team, String> {
    let mut experiment = assignment.experiment.clone();
    let mut targets = Vec::with_capacity(experiment.robots.len());
    for ((wanted, pose), goal) in experiment.robots.iter_mut().zip(standing).zip(goals) {
        if let Some(Pose { x_m, y_m, yaw_rad }) = goal {
            targets.push(json!({"robot": wanted.name, "x_m": x_m, "y_m": y_m, "yaw_rad": yaw_rad}));
        }
        wanted.start = *pose;
    }
    let mut document = json!({
        "experiment": experiment,
        "robots": assignment.robots,
        "arena": assignment.arena,
    });
    document["experiment"]["control"] = json!({"law": control::law::GO_TO_POSE, "parameters": {}});
    document["experiment"]["targets"] = json!(targets);
    let words = |problems: Vec<control::scenario::FieldProblem>| {
        let first = problems.into_iter().next();
        first.map_or_else(String::new, |problem| format!("{}: {}", problem.field, problem.message))
    };
    let scenario = Scenario::from_json(&document.to_string()).map_err(words)?;
    // The rules for starts are for people who choose them; the robots stand where they stand.
    let law = control::law::build(&scenario).ok_or_else(|| "no law takes these robots to a pose".to_owned())?;
    Team::with_law(&scenario, law).map_err(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_that_do_not_get_there_are_carried_and_what_ends_a_run_ends_it() {
        let limit = (TIME_LIMIT_S * TICK_HZ as f64) as i64;
        assert_eq!(left_over(Ending::Finished, limit - 1), Ok(None));
        assert!(matches!(left_over(Ending::Finished, limit), Ok(Some(why)) if why.contains("60 s")));
        assert!(matches!(left_over(Ending::Deadlock, 100), Ok(Some(_))));
        for ending in [
            Ending::ProtectiveStop,
            Ending::LeaseLost,
            Ending::RobotSilent(1),
            Ending::Cancelled,
        ] {
            assert_eq!(left_over(ending, 100), Err(ending));
        }
    }

    #[test]
    fn a_start_is_reached_within_its_tolerances() {
        let start = Pose {
            x_m: 1.0,
            y_m: 0.0,
            yaw_rad: 3.1,
        };
        assert!(is_at_start(&Pose { yaw_rad: -3.1, ..start }, &start));
        assert!(!is_at_start(&Pose { yaw_rad: 2.9, ..start }, &start));
        assert!(!is_at_start(&Pose { x_m: 1.06, ..start }, &start));
    }
}
