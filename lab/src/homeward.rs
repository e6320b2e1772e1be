//! The end of a run, once its result is with the service: its robots drive home to their docks and charge there.
//!
//! The same way as to the starts ([`approach`]): `go_to_pose` through the safety filter, robots that stay behind as
//! obstacles, everything in a journal. Those whose battery is low go first. A press of the stop, the end of the process and the
//! lease end it, and so does the next run; then the robots stay where they are. Whatever else keeps a robot from its dock ends
//! with the hand taking it to the rack.

use crate::approach::{self, Approach, Ride};
use crate::clock::monotonic_us;
use crate::deliver;
use crate::lab::Lab;
use crate::ladder::{self, Consequence, Finding};
use crate::lease::Lease;
use crate::link::HeldPort;
use crate::parked::Parked;
use crate::prepare::{self, Place};
use crate::rack::{self, Floor};
use crate::record::{End, LogLevel, Record, Start};
use crate::recorder::{Recorder, RecorderHandle};
use crate::run::{self, Conclusion};
use crate::safety::Signals;
use api::experiment::Pose;
use api::lab::{Assignment, HeartbeatReply};
use api::run::RunState;
use chrono::Utc;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;
use tokio::task::{JoinHandle, spawn_blocking};

/// As long as a run's: without a word from the service for this long, less a margin, nothing moves.
const LEASE_S: f64 = 15.0;
/// Between two questions whether the arena is anybody's.
const PERIOD: Duration = Duration::from_secs(1);

/// Robots on their way home.
#[derive(Debug)]
pub struct WayHome {
    lease: Arc<Lease>,
    task: JoinHandle<()>,
}

/// Why robots are not at home.
#[derive(Debug)]
enum Obstacle {
    /// Something more important; they stay where they are.
    Ended(&'static str),
    /// It did not work; they are carried.
    Failed(String),
}

impl WayHome {
    /// Sends the robots of a finished run home; none when nobody has to go, or may.
    pub fn begin(lab: &Arc<Lab>, assignment: &Assignment, conclusion: &Conclusion) -> Option<Self> {
        // An interrupted run holds the arena: nothing moves before someone has looked.
        let in_order = matches!(
            conclusion.state,
            RunState::Done | RunState::Failed | RunState::Cancelled
        );
        if !in_order || lab.docks.is_empty() || lab.latch.is_pressed() || lab.desk.shutdown.is_requested() {
            return None;
        }
        let mut assignment = assignment.clone();
        let goes = |number: u8| is_traveller(lab, number);
        let names: BTreeSet<String> = assignment
            .robots
            .iter()
            .filter(|robot| goes(robot.number))
            .map(|robot| robot.description.name.clone())
            .collect();
        assignment
            .robots
            .retain(|robot| names.contains(&robot.description.name));
        assignment.experiment.robots.retain(|robot| names.contains(&robot.name));
        if assignment.robots.is_empty() || assignment.robots.len() != assignment.experiment.robots.len() {
            return None;
        }
        lab.set_homeward(numbers(&assignment).into_iter().collect());
        let lease = Arc::new(Lease::claimed(LEASE_S));
        let task = tokio::spawn(travel(lab.clone(), assignment, lease.clone()));
        Some(Self { lease, task })
    }

    /// Ends it; returns when the robots are at rest and the right to drive them is free.
    pub async fn end(self) {
        self.lease.cancel();
        // A panic on the way home was logged, and the ports are back.
        let _over = self.task.await;
    }
}

/// It has a dock, is not there, and can drive there.
fn is_traveller(lab: &Lab, number: u8) -> bool {
    let fit = lab
        .link
        .robot(number)
        .is_some_and(|robot| robot.is_online() && robot.finding().consequence() < Consequence::Stop);
    fit && lab.docks.of(number).is_some() && lab.seen(number).is_some() && !lab.is_docked(number)
}

fn numbers(assignment: &Assignment) -> Vec<u8> {
    assignment.robots.iter().map(|robot| robot.number).collect()
}

async fn travel(lab: Arc<Lab>, assignment: Assignment, lease: Arc<Lease>) {
    let asking = tokio::spawn(keep_asking(lab.clone(), lease.clone()));
    let outcome = recorded(&lab, &assignment, &lease).await;
    asking.abort();
    match outcome {
        Ok(()) => tracing::info!(run.id = %assignment.run_id, robots = ?numbers(&assignment), "robots are home"),
        Err(Obstacle::Ended(why)) => {
            tracing::info!(run.id = %assignment.run_id, "the way home ends, robots stay where they are: {why}");
        }
        Err(Obstacle::Failed(why)) => {
            tracing::warn!(run.id = %assignment.run_id, "robots do not get home by themselves: {why}");
            let lost = |number: u8| numbers(&assignment).contains(&number) && !lab.is_docked(number);
            let all: Vec<u8> = lab.link.robots().map(|robot| robot.number).collect();
            let (go, stay) = all.into_iter().partition(|number| lost(*number));
            rack::take_away(&lab, &Floor { stay, go }).await;
        }
    }
    lab.set_homeward(BTreeSet::new());
}

/// Without a run there is no lease: robots move only while the service says that the arena is nobody's.
async fn keep_asking(lab: Arc<Lab>, lease: Arc<Lease>) {
    let mut ticks = tokio::time::interval(PERIOD);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    while !lease.is_stale() {
        ticks.tick().await;
        let sent_us = monotonic_us();
        match lab.desk.service.arena(&lab.description.arena.name).await {
            Ok(Some(arena)) if arena.state != "leased" => {
                let reply = HeartbeatReply {
                    lease_s: LEASE_S,
                    cancel_requested: false,
                };
                lease.take(sent_us, Ok(reply));
            }
            Ok(_) => lease.set_stale(),
            Err(error) => lease.take(sent_us, Err(error)),
        }
    }
}

/// What moves robots is written down: in a journal of its own, which no service asks for.
async fn recorded(lab: &Arc<Lab>, assignment: &Assignment, lease: &Arc<Lease>) -> Result<(), Obstacle> {
    let assignment = Parked::standing(lab, |number| !numbers(assignment).contains(&number)).with(assignment);
    let recorder = start_recorder(lab, &assignment)
        .map_err(|error| Obstacle::Failed(format!("the laboratory cannot write its record: {error}")))?;
    let outcome = drive(lab, &assignment, lease, &recorder.handle()).await;
    let end = End {
        at_us: monotonic_us(),
        state: match &outcome {
            Ok(()) => RunState::Done,
            Err(Obstacle::Ended(_)) => RunState::Cancelled,
            Err(Obstacle::Failed(_)) => RunState::Failed,
        },
        fault: None,
        records_dropped: 0,
    };
    if let Ok(Err(error)) = spawn_blocking(move || recorder.finish(end)).await {
        tracing::error!(%error, "the record of the way home is incomplete");
    }
    outcome
}

fn start_recorder(lab: &Lab, assignment: &Assignment) -> std::io::Result<Recorder> {
    let folder = lab
        .desk
        .folder
        .join(format!("{}-{}-home", assignment.run_id, assignment.epoch));
    std::fs::create_dir(&folder)?;
    // First: a journal without the mark would be handed in as a run's.
    deliver::mark_delivered(&folder, "home")?;
    let start = Start {
        assignment: assignment.clone(),
        wall: Utc::now(),
        at_us: monotonic_us(),
    };
    Recorder::start_unwatched(&folder, Record::Start(Box::new(start)))
}

async fn drive(
    lab: &Arc<Lab>,
    assignment: &Assignment,
    lease: &Arc<Lease>,
    recorder: &RecorderHandle,
) -> Result<(), Obstacle> {
    let docks: Vec<Option<Pose>> = numbers(assignment)
        .into_iter()
        .map(|number| lab.docks.of(number))
        .collect();
    let ports: Option<Vec<HeldPort>> = numbers(assignment)
        .into_iter()
        .map(|number| lab.link.robot(number)?.take_port())
        .collect();
    let ports = ports.ok_or_else(|| Obstacle::Failed("a robot is in another run".to_owned()))?;
    let keeper = run::keep(lab, ports).map_err(|conclusion| obstacle(lab, lease, &conclusion))?;
    let ready = prepare::wait_ready(lab, assignment, lease, Place::Anywhere).await;
    let mut ports = keeper.stop();
    ready.map_err(|conclusion| obstacle(lab, lease, &conclusion))?;
    let mut stuck = None;
    for goals in stages(lab, assignment, docks) {
        recorder.log(
            LogLevel::Info,
            format!("{} robots drive home", goals.iter().flatten().count()),
        );
        let ride = Ride {
            assignment,
            goals,
            signals: signals(lab, lease, recorder, assignment),
        };
        let ridden = approach::ride(lab, ride, recorder, ports).await;
        match ridden.map_err(|conclusion| obstacle(lab, lease, &conclusion))? {
            Approach::Arrived(back) => ports = back,
            Approach::Stuck(back, why) => {
                ports = back;
                stuck = Some(why);
            }
        }
    }
    match numbers(assignment).into_iter().find(|number| !lab.is_docked(*number)) {
        None => Ok(()),
        Some(number) => {
            let why = stuck.unwrap_or_else(|| format!("robot {number} stopped elsewhere"));
            recorder.log(LogLevel::Warning, why.clone());
            Err(Obstacle::Failed(why))
        }
    }
}

/// Goals of one ride after the other: robots with a low battery first, while the others stand; then everybody.
fn stages(lab: &Lab, assignment: &Assignment, docks: Vec<Option<Pose>>) -> Vec<Vec<Option<Pose>>> {
    let low = |number| {
        lab.link
            .robot(number)
            .is_some_and(|robot| robot.finding().is_of_battery())
    };
    let low: Vec<bool> = numbers(assignment).into_iter().map(low).collect();
    split(&low, docks)
}

fn split(low: &[bool], docks: Vec<Option<Pose>>) -> Vec<Vec<Option<Pose>>> {
    let first: Vec<Option<Pose>> = docks.iter().zip(low).map(|(dock, low)| dock.filter(|_| *low)).collect();
    if first.iter().all(Option::is_none) || low.iter().all(|low| *low) {
        vec![docks]
    } else {
        vec![first, docks]
    }
}

/// As a run's, but a battery that is almost empty is a reason to go on.
fn signals(
    lab: &Arc<Lab>,
    lease: &Arc<Lease>,
    recorder: &RecorderHandle,
    assignment: &Assignment,
) -> Box<dyn Fn() -> Signals + Send> {
    let of_a_run = run::signals(lab, lease, recorder, assignment);
    let robots: Vec<_> = numbers(assignment)
        .into_iter()
        .filter_map(|number| lab.link.robot(number).cloned())
        .collect();
    let grave = |finding: Finding| match finding.consequence() {
        Consequence::Stop => finding,
        Consequence::None | Consequence::NoNewRun | Consequence::EndRun => Finding::Fine,
    };
    Box::new(move || Signals {
        robot_finding: ladder::gravest(robots.iter().map(|robot| grave(robot.finding()))),
        ..of_a_run()
    })
}

/// Why it ended: something more important, or the conclusion's own words.
fn obstacle(lab: &Lab, lease: &Lease, conclusion: &Conclusion) -> Obstacle {
    if lab.latch.is_pressed() {
        Obstacle::Ended("the protective stop was pressed")
    } else if lab.desk.shutdown.is_requested() {
        Obstacle::Ended("the laboratory ends")
    } else if lease.is_cancelled() {
        Obstacle::Ended("the next run begins")
    } else if lease.is_stale() {
        Obstacle::Ended("the arena is no longer free")
    } else if monotonic_us() >= lease.until_us() {
        Obstacle::Ended("the service cannot be reached")
    } else {
        let fault = conclusion.fault.as_ref();
        Obstacle::Failed(fault.map_or_else(String::new, |fault| fault.message.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn dock(x_m: f64) -> Option<Pose> {
        Some(Pose {
            x_m,
            y_m: 0.0,
            yaw_rad: 0.0,
        })
    }

    #[test]
    fn robots_with_a_low_battery_go_first_and_everybody_goes() {
        let docks = || vec![dock(0.0), dock(1.0), dock(2.0)];
        assert_eq!(
            split(&[false, true, false], docks()),
            vec![vec![None, dock(1.0), None], docks()]
        );
        assert_eq!(split(&[false, false, false], docks()), vec![docks()]);
        assert_eq!(split(&[true, true, true], docks()), vec![docks()]);
    }
}
