//! Who is on the floor before a run: missing robots are carried there, strangers away. The hand does both; where there is none,
//! people are told what to do.

use crate::hand::{self, Placement};
use crate::lab::Lab;
use crate::lease::Lease;
use crate::prepare::{FRESH_US, TIME_LIMIT, is_at};
use crate::record::LogLevel;
use crate::recorder::RecorderHandle;
use crate::run::{Conclusion, outside_ending};
use api::lab::Assignment;
use api::run::Whose;
use std::time::Duration;
use tokio::time::Instant;

/// The hand may be tried again after this.
const HAND_RETRY: Duration = Duration::from_millis(500);
/// A robot of no run that was seen within this time is taken for one that still stands there.
const REMEMBERED_US: i64 = 10_000_000;

/// Puts the robots of the run that are not on the floor at their starts and takes all strangers off it. The hand is asked only
/// when somebody must be carried; without one strangers stay, and the safety filter keeps clear of them.
///
/// - `true` when some were on the floor already and may have to drive.
pub(crate) async fn gather(
    lab: &Lab,
    assignment: &Assignment,
    parked: &[u8],
    lease: &Lease,
    recorder: &RecorderHandle,
) -> Result<bool, Conclusion> {
    let numbers = assignment.robots.iter().map(|robot| robot.number);
    let standing: Vec<u8> = numbers.filter(|number| is_seen(lab, *number)).collect();
    let missing = placements(assignment, &standing);
    let strangers = strangers(lab, assignment, parked);
    let Some(hand) = lab.hand.as_deref() else {
        tell_people(assignment, &missing, &strangers, recorder);
        return Ok(true);
    };
    if missing.is_empty() && strangers.is_empty() {
        return Ok(true);
    }
    if !standing.is_empty() {
        let keep: Vec<u8> = standing.iter().chain(parked).copied().collect();
        match hand::place(Some(hand), &missing, &keep).await {
            Ok(()) => return Ok(true),
            // A start may be taken by a robot that is to go elsewhere: then that one is carried as well.
            Err(error) => recorder.log(
                LogLevel::Info,
                format!("all robots are carried to their starts: {error}"),
            ),
        }
    }
    place(lab, assignment, parked, lease, recorder).await?;
    Ok(false)
}

fn is_seen(lab: &Lab, number: u8) -> bool {
    was_seen(lab, number, FRESH_US)
}

fn was_seen(lab: &Lab, number: u8, within_us: i64) -> bool {
    lab.localisation
        .pose(number)
        .is_some_and(|(_, age_us)| age_us < within_us)
}

/// Robots of the laboratory on the floor that have nothing to do there.
fn strangers(lab: &Lab, assignment: &Assignment, parked: &[u8]) -> Vec<u8> {
    let of_run = |number: u8| assignment.robots.iter().any(|robot| robot.number == number);
    let all = lab.link.robots().map(|robot| robot.number);
    all.filter(|number| !of_run(*number) && !parked.contains(number) && was_seen(lab, *number, REMEMBERED_US))
        .collect()
}

/// What people in a laboratory without a hand should know before the robots drive.
fn tell_people(assignment: &Assignment, missing: &[Placement], strangers: &[u8], recorder: &RecorderHandle) {
    for wanted in missing {
        let name = name_of(assignment, wanted.number);
        let message = format!(
            "robot {name} is not seen: put it on the floor, best at {}",
            words(wanted)
        );
        recorder.log(LogLevel::Warning, message);
    }
    if !strangers.is_empty() {
        let message =
            format!("robots {strangers:?} stay on the floor, obstacles for the safety filter: there is no hand");
        recorder.log(LogLevel::Warning, message);
    }
}

fn name_of(assignment: &Assignment, number: u8) -> &str {
    let mut robots = assignment.robots.iter();
    let robot = robots.find(|robot| robot.number == number);
    robot.map_or("unknown", |robot| robot.description.name.as_str())
}

fn words(place: &Placement) -> String {
    let Placement { x_m, y_m, yaw_rad, .. } = place;
    format!("x {x_m:.2} m, y {y_m:.2} m, yaw {yaw_rad:.2} rad")
}

/// The end of a run whose robots must be carried where nobody but a person can.
pub(crate) fn nobody_carries(lab: &Lab, assignment: &Assignment, why: &str) -> Conclusion {
    let there: Vec<u8> = assignment
        .experiment
        .robots
        .iter()
        .zip(&assignment.robots)
        .filter(|(wanted, robot)| {
            let seen = lab.localisation.pose(robot.number);
            seen.is_some_and(|(pose, _)| is_at(&pose, &wanted.start))
        })
        .map(|(_, robot)| robot.number)
        .collect();
    let wanted: Vec<String> = placements(assignment, &there)
        .iter()
        .map(|place| format!("{} at {}", name_of(assignment, place.number), words(place)))
        .collect();
    let message = format!(
        "The robots cannot get to their starts by themselves ({why}), and this laboratory has no hand that carries them. Put {} and \
         submit again.",
        wanted.join("; ")
    );
    Conclusion::failed(Whose::Operator, "placing_failed", message)
}

/// Starts of the robots that are not in `standing`.
fn placements(assignment: &Assignment, standing: &[u8]) -> Vec<Placement> {
    let starts = assignment.experiment.robots.iter().zip(&assignment.robots);
    starts
        .filter(|(_, robot)| !standing.contains(&robot.number))
        .map(|(wanted, robot)| Placement {
            number: robot.number,
            x_m: wanted.start.x_m,
            y_m: wanted.start.y_m,
            yaw_rad: wanted.start.yaw_rad,
        })
        .collect()
}

/// Has the hand put all robots of the run at their starts.
pub(crate) async fn place(
    lab: &Lab,
    assignment: &Assignment,
    parked: &[u8],
    lease: &Lease,
    recorder: &RecorderHandle,
) -> Result<(), Conclusion> {
    let deadline = Instant::now() + TIME_LIMIT;
    let placements = placements(assignment, &[]);
    loop {
        let error = match hand::place(lab.hand.as_deref(), &placements, parked).await {
            Ok(()) => return Ok(()),
            Err(error) => error,
        };
        if let Some(conclusion) = outside_ending(lab, lease) {
            return Err(conclusion);
        }
        if Instant::now() + HAND_RETRY >= deadline {
            let message = format!("The robots could not be put at their starts: {error}.");
            return Err(Conclusion::failed(Whose::Platform, "placing_failed", message));
        }
        recorder.log(LogLevel::Warning, format!("placing the robots: {error}; trying again"));
        tokio::time::sleep(HAND_RETRY).await;
    }
}
