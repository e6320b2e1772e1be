//! Place in the queue, expected start, reason for waiting.

use crate::fixture::*;
use api::run::{RunState, RunView};
use uuid::Uuid;

async fn view(world: &World, run_id: Uuid) -> RunView {
    world.store.run_get(run_id).await.unwrap().unwrap()
}

#[tokio::test]
async fn positions_and_reasons_follow_the_queue() {
    let world = world_with_lab().await;
    let runs = [
        world.queued().await,
        world.queued().await,
        world.queued().await,
        world.queued().await,
    ];
    let reason = |view: RunView| view.waiting_reason.unwrap();
    assert_eq!(
        reason(view(&world, runs[0]).await),
        "next in line: the laboratory is about to take it"
    );
    assert_eq!(
        reason(view(&world, runs[1]).await),
        "one run ahead of you in arena reference"
    );
    assert_eq!(
        reason(view(&world, runs[2]).await),
        "two runs ahead of you in arena reference"
    );
    let mut starts = Vec::new();
    for (index, run_id) in runs.into_iter().enumerate() {
        let view = view(&world, run_id).await;
        assert_eq!(view.queue_position, Some(index as i64 + 1));
        starts.push(view.expected_start.unwrap());
    }
    assert!(starts.is_sorted(), "{starts:?}");
    let gap_s = (starts[3] - starts[2]).as_seconds_f64();
    assert!(
        (gap_s - 45.0).abs() < 5.0,
        "30 s of motion and the overhead, not {gap_s} s"
    );

    let fence = world.preparing(LONG).await;
    assert_eq!(
        reason(view(&world, runs[0]).await),
        "the laboratory is placing the robots"
    );
    assert_eq!(
        reason(view(&world, runs[1]).await),
        "one run ahead of you in arena reference"
    );
    assert_eq!(view(&world, runs[1]).await.queue_position, Some(1));
    world.reports(fence, RunState::Running).await;
    let running = view(&world, runs[0]).await;
    assert_eq!(
        (running.waiting_reason, running.queue_position, running.expected_start),
        (None, None, None)
    );
    let listed = world.store.run_list(10, None).await.unwrap();
    assert_eq!(
        listed.iter().map(|run| run.id).collect::<Vec<_>>(),
        [runs[3], runs[2], runs[1], runs[0]]
    );
    assert_eq!(listed[0], view(&world, runs[3]).await.clone_with_start(&listed[0]));
}

/// Expected starts move with the clock; everything else must be equal.
trait WithStart {
    fn clone_with_start(&self, other: &RunView) -> RunView;
}

impl WithStart for RunView {
    fn clone_with_start(&self, other: &RunView) -> RunView {
        RunView {
            expected_start: other.expected_start,
            ..self.clone()
        }
    }
}

#[tokio::test]
async fn what_keeps_a_run_waiting_is_said() {
    let world = world().await;
    let run_id = world.queued().await;
    let reason = async || view(&world, run_id).await.waiting_reason.unwrap();
    assert_eq!(reason().await, "no laboratory has registered the arena reference");
    world.store.lab_register(&lab()).await.unwrap();
    assert_eq!(reason().await, "next in line: the laboratory is about to take it");
    world.report_status(true).await;
    assert_eq!(
        reason().await,
        "the arena reference is held: the protective stop is pressed"
    );
    assert_eq!(view(&world, run_id).await.expected_start, None);
    world.report_status(false).await;
    world
        .database
        .execute("UPDATE arenas SET held_until = clock_timestamp() + interval '1 hour', held_reason = 'a check is due'")
        .await;
    assert_eq!(reason().await, "the arena reference is held: a check is due");
    world
        .database
        .execute("UPDATE arena_status SET seen_at = clock_timestamp() - interval '6 seconds'")
        .await;
    assert_eq!(reason().await, "the laboratory is not connected");
    assert_eq!(view(&world, run_id).await.expected_start, None);
}
