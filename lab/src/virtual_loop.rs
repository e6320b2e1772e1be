//! Runs of the twin at the robots' pace: 120 ticks a second, so that whoever follows a run follows this one as well.

use crate::clock::{monotonic_ns, monotonic_us, wait_until_ns};
use crate::desk::Desk;
use crate::lease::Lease;
use crate::live::TICKS_PER_FRAME;
use crate::realtime::Realtime;
use crate::record::{LogLevel, Motion, Record, Tick};
use crate::recorder::RecorderHandle;
use crate::run::Conclusion;
use crate::safety::Ending;
use crate::service::ServiceError;
use crate::virtual_run::{VirtualEnding, VirtualRun};
use crate::{carry_out, salvage};
use api::lab::{Assignment, ClaimRequest};
use api::run::Whose;
use std::sync::Arc;
use tokio::task::spawn_blocking;

/// From the report that the run begins to tick 0.
const LEAD_US: i64 = 20_000;

/// The next run of the twin, or none within the wait.
pub async fn next_run(desk: &Desk, request: &ClaimRequest) -> Result<Option<Assignment>, ServiceError> {
    salvage::sweep(desk).await?;
    desk.service.claim(request).await
}

/// Carries a run out in the twin.
pub async fn run(desk: &Arc<Desk>, assignment: Assignment) {
    let drive =
        async |lease: &Arc<Lease>, recorder: &RecorderHandle| match attempt(desk, &assignment, lease, recorder).await {
            Ok(conclusion) | Err(conclusion) => conclusion,
        };
    carry_out::carry_out(desk, &assignment, |_| {}, drive).await;
}

async fn attempt(
    desk: &Arc<Desk>,
    assignment: &Assignment,
    lease: &Arc<Lease>,
    recorder: &RecorderHandle,
) -> Result<Conclusion, Conclusion> {
    let scenario = carry_out::scenario(assignment).map_err(carry_out::refused)?;
    let ending = || carry_out::outside_ending(desk, lease).map(|ending| Conclusion::of(ending, &[]));
    carry_out::report_running(desk, assignment, ending).await?;
    let start_us = monotonic_us() + LEAD_US;
    let run = VirtualRun::new(&scenario, assignment, start_us).map_err(carry_out::refused)?;
    recorder.log(
        LogLevel::Info,
        format!("the twin moves: {}", assignment.experiment.control.law),
    );
    let (own_desk, own_lease, own_recorder) = (desk.clone(), lease.clone(), recorder.clone());
    let driven = spawn_blocking(move || {
        let outside = || carry_out::outside_ending(&own_desk, &own_lease);
        drive(run, start_us, outside, own_recorder)
    });
    let (ending, run) = driven
        .await
        .map_err(|_| Conclusion::failed(Whose::Platform, "loop_failed", "The twin's loop failed.".to_owned()))?;
    recorder.log(
        LogLevel::Info,
        format!(
            "the twin stands after {} ticks, trace digest {}",
            run.tick(),
            run.digest()
        ),
    );
    let names: Vec<_> = assignment
        .experiment
        .robots
        .iter()
        .map(|robot| robot.name.clone())
        .collect();
    Ok(match ending {
        VirtualEnding::As(ending) => Conclusion::of(ending, &names).because(run.fault()),
        VirtualEnding::Broken => Conclusion::failed(
            Whose::User,
            "left_finite_numbers",
            "The simulation left the finite numbers; the rehearsal's findings say where.".to_owned(),
        ),
    })
}

/// Steps at the robots' pace; a process that was held up catches up.
fn drive(
    mut run: VirtualRun,
    start_us: i64,
    outside: impl Fn() -> Option<Ending>,
    mut recorder: RecorderHandle,
) -> (VirtualEnding, VirtualRun) {
    let realtime = Realtime {
        fifo: false,
        locked: false,
    };
    recorder.push(Record::Motion(Motion { start_us, realtime }));
    run.begin(&mut recorder);
    loop {
        let tick = run.tick();
        let due_us = run.due_us(tick);
        // Once a picture is enough: nobody's safety hangs on it.
        if tick % TICKS_PER_FRAME == 0 {
            wait_until_ns(due_us * 1000);
            if let Some(ending) = outside().or_else(|| recorder.failed().then_some(Ending::RecorderFailed)) {
                return (VirtualEnding::As(ending), run);
            }
        }
        let woke_us = (monotonic_ns() / 1000).max(due_us);
        let ended = run.step(&mut recorder);
        recorder.push(Record::Tick(Tick {
            tick,
            due_us,
            woke_us,
            done_us: monotonic_us().max(woke_us),
            missed: 0,
            exposure_us: due_us,
        }));
        if let Some(ending) = ended {
            return (ending, run);
        }
    }
}
