//! Virtual runs have a queue and a lease of their own beside the robots'.

use crate::fixture::*;
use api::lab::Side;
use api::run::RunState;
use std::time::Duration;
use store::*;
use uuid::Uuid;

fn twin_of(world: &World) -> Claim {
    Claim {
        instance: Uuid::now_v7(),
        side: Side::Virtual,
        ..world.claim()
    }
}

#[tokio::test]
async fn each_side_takes_its_own_runs_at_the_same_time() {
    let world = world_with_lab().await;
    let [driven, simulated] = [world.queued().await, world.queued_virtual().await];
    let twin = twin_of(&world);
    let claimed = world
        .store
        .run_claim(&twin, LONG)
        .await
        .unwrap()
        .expect("the virtual run");
    assert_eq!(claimed.run_id, simulated);
    assert_eq!(
        world.store.run_claim(&twin, LONG).await.unwrap(),
        None,
        "the other one is for robots"
    );
    assert_eq!(
        world.preparing(LONG).await.run_id,
        driven,
        "the twin does not occupy the robots"
    );
    let robots = world.store.robot_list().await.unwrap();
    assert!(robots.iter().any(|robot| robot.state == "leased"));
}

#[tokio::test]
async fn a_virtual_run_needs_no_laboratory() {
    let world = world_with_lab().await;
    let run_id = world.queued_virtual().await;
    world
        .database
        .execute("UPDATE arena_status SET stopped = true, seen_at = clock_timestamp() - interval '1 hour'")
        .await;
    world
        .database
        .execute("UPDATE arenas SET held_until = clock_timestamp() + interval '1 hour', held_reason = 'x'")
        .await;
    let reason = || async { world.store.run_get(run_id).await.unwrap().unwrap().waiting_reason };
    assert_eq!(
        reason().await.as_deref(),
        Some("the simulation server is not connected")
    );
    let twin = twin_of(&world);
    world.store.simulator_seen(&twin.lab, &twin.arena).await.unwrap();
    assert_eq!(
        reason().await.as_deref(),
        Some("next in line: the simulation server is about to take it")
    );
    assert!(world.store.run_claim(&twin, LONG).await.unwrap().is_some());
}

#[tokio::test]
async fn a_simulation_server_that_dies_holds_no_arena() {
    let world = world_with_lab().await;
    let run_id = world.queued_virtual().await;
    let twin = twin_of(&world);
    let lease = Duration::from_millis(10);
    let claimed = world
        .store
        .run_claim(&twin, lease)
        .await
        .unwrap()
        .expect("the virtual run");
    assert_eq!(claimed.run_id, run_id);
    tokio::time::sleep(Duration::from_millis(40)).await;
    assert_eq!(world.store.reap(&LIMITS).await.unwrap().len(), 1);
    let run = world.store.run_get(run_id).await.unwrap().unwrap();
    assert_eq!(run.state, RunState::Queued, "nothing moved, so it is tried again");
    assert_eq!(world.store.arena_list().await.unwrap()[0].state, "free");
}
