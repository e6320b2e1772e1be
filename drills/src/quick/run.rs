//! One claimed run from its lease to its files, driven by the [`Rig`].

use super::shelf::Shelf;
use crate::rig::{Rig, RigSettings};
use crate::scene::Scene;
use anyhow::{Result, bail};
use api::experiment::Mode;
use api::lab::{Assignment, LabDescription};
use api::run::Whose;
use control::scenario::Scenario;
use lab::carry_out;
use lab::clock::monotonic_us;
use lab::desk::Desk;
use lab::realtime::Realtime;
use lab::record::{LogLevel, Motion, Record, Tick};
use lab::recorder::RecorderHandle;
use lab::run::Conclusion;
use lab::safety::Ending;
use std::sync::Arc;
use tokio::task::spawn_blocking;

/// Between two looks for an end from outside.
const TICKS_PER_LOOK: i64 = 12;

/// Carries a run out.
///
/// - `seed`: of this run's noise and everyday variation.
pub async fn run(desk: &Arc<Desk>, description: &LabDescription, shelf: &Shelf, assignment: Assignment, seed: u64) {
    let scenario = carry_out::scenario(&assignment);
    let rig = scenario.map_err(carry_out::refused).and_then(|scenario| {
        rig_of(description, shelf, &assignment, &scenario, seed).map_err(|error| {
            let message = format!("The quick laboratory cannot set the run up: {error:#}.");
            Conclusion::failed(Whose::Platform, "start_refused", message)
        })
    });
    let names: Vec<String> = assignment
        .experiment
        .robots
        .iter()
        .map(|robot| robot.name.clone())
        .collect();
    let (own_desk, own_assignment) = (desk.clone(), assignment.clone());
    carry_out::carry_out(
        desk,
        &assignment,
        |_| {},
        async |lease, recorder| {
            let rig = match rig {
                Ok(rig) => rig,
                Err(conclusion) => return conclusion,
            };
            let ending = || carry_out::outside_ending(&own_desk, lease).map(|ending| Conclusion::of(ending, &[]));
            if let Err(conclusion) = carry_out::report_running(&own_desk, &own_assignment, ending).await {
                return conclusion;
            }
            recorder.log(
                LogLevel::Info,
                format!("motion in virtual time: {}", own_assignment.experiment.control.law),
            );
            let (desk, lease, recorder) = (own_desk.clone(), lease.clone(), recorder.clone());
            let driven = spawn_blocking(move || {
                let outside = || carry_out::outside_ending(&desk, &lease);
                drive(rig, outside, &recorder)
            });
            match driven.await {
                Ok(ending) => Conclusion::of(ending, &names),
                Err(_) => Conclusion::failed(
                    Whose::Platform,
                    "loop_failed",
                    "The quick laboratory's loop failed.".to_owned(),
                ),
            }
        },
    )
    .await;
}

fn rig_of(
    description: &LabDescription,
    shelf: &Shelf,
    assignment: &Assignment,
    scenario: &Scenario,
    seed: u64,
) -> Result<Rig> {
    if assignment.experiment.mode == Mode::Interactive {
        bail!(
            "an interactive run needs a virtual robot that follows in real time; `cargo xtask up` without --quick has one"
        );
    }
    let numbers: Vec<u8> = assignment.robots.iter().map(|robot| robot.number).collect();
    let taken = shelf.take(&numbers);
    let scene = Scene::of(description.clone(), serde_json::to_value(&assignment.experiment)?);
    let settings = RigSettings {
        seed,
        hidden: taken.hidden,
        up: taken.air,
        down: taken.air,
        begin_us: monotonic_us(),
        ..RigSettings::default()
    };
    Rig::with_scenario(&scene, &settings, scenario)
}

/// Ticks as fast as the machine allows, to the end of the run or what ends it from outside.
fn drive(mut rig: Rig, outside: impl Fn() -> Option<Ending>, recorder: &RecorderHandle) -> Ending {
    let realtime = Realtime {
        fifo: false,
        locked: false,
    };
    let start_us = rig.now_us();
    recorder.push_waiting(Record::Motion(Motion { start_us, realtime }));
    loop {
        let (tick, now_us) = (rig.slot(), rig.now_us());
        if tick % TICKS_PER_LOOK == 0
            && let Some(ending) = outside().or_else(|| recorder.failed().then_some(Ending::RecorderFailed))
        {
            return ending;
        }
        let more = rig.tick();
        for record in rig.records.drain(..) {
            recorder.push_waiting(record);
        }
        recorder.push_waiting(Record::Tick(Tick {
            tick,
            due_us: now_us,
            woke_us: now_us,
            done_us: now_us,
            missed: 0,
            exposure_us: rig.pilot().newest_exposure_us(),
        }));
        if !more {
            return rig.ended().unwrap_or(Ending::Finished);
        }
    }
}
