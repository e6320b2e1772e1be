//! Arenas and robots as the laboratory reports them.

use crate::fixture::*;
use api::lab::{LabStatus, RobotStatus};

#[tokio::test]
async fn robots_and_arenas_go_offline_when_nobody_reports() {
    let world = world().await;
    world.store.lab_register(&lab()).await.unwrap();
    let robots = world.store.robot_list().await.unwrap();
    assert_eq!(robots.len(), lab().robots.len());
    assert!(robots.iter().all(|robot| robot.state == "offline"), "never reported");
    world.report_status(false).await;
    let robots = world.store.robot_list().await.unwrap();
    assert!(
        robots
            .iter()
            .all(|robot| robot.state == "idle" && robot.bus_v == Some(24.0))
    );
    assert_eq!(robots[0].robot, lab().robots[0]);
    assert_eq!(world.store.arena_list().await.unwrap()[0].state, "free");
    world
        .database
        .execute("UPDATE robot_status SET seen_at = seen_at - interval '5.1 seconds'")
        .await;
    world
        .database
        .execute("UPDATE arena_status SET seen_at = seen_at - interval '5.1 seconds'")
        .await;
    assert!(
        world
            .store
            .robot_list()
            .await
            .unwrap()
            .iter()
            .all(|robot| robot.state == "offline" && robot.message.is_some())
    );
    assert_eq!(world.store.arena_list().await.unwrap()[0].state, "offline");
}

#[tokio::test]
async fn a_status_of_an_unknown_laboratory_is_refused() {
    let world = world_with_lab().await;
    let status = LabStatus {
        lab: "another".to_owned(),
        arena: "reference".to_owned(),
        stopped: true,
        robots: Vec::new(),
    };
    assert!(!world.store.lab_status_put(&status).await.unwrap());
    assert_eq!(world.store.arena_list().await.unwrap()[0].state, "free");
    let ghost = RobotStatus {
        name: "ghost".to_owned(),
        online: true,
        bus_v: None,
        health: None,
        link: None,
        stop_acknowledged: false,
        activity: None,
    };
    let status = LabStatus {
        lab: "reference-lab".to_owned(),
        arena: "reference".to_owned(),
        stopped: false,
        robots: vec![ghost],
    };
    assert!(
        world.store.lab_status_put(&status).await.unwrap(),
        "a robot that is not registered is ignored"
    );
    assert_eq!(world.store.robot_list().await.unwrap().len(), lab().robots.len());
}

#[tokio::test]
async fn registering_again_replaces_the_robots() {
    let world = world_with_lab().await;
    let mut changed = lab();
    changed.robots.remove(5);
    let (first, second) = (changed.robots[0].number, changed.robots[1].number);
    changed.robots[0].number = second;
    changed.robots[1].number = first;
    changed.arena.width_m = 5.0;
    changed.arena.contents = Some(api::arena::Contents {
        tilt_x_rad: -0.02,
        ..Default::default()
    });
    world.store.lab_register(&changed).await.unwrap();
    let robots = world.store.robot_list().await.unwrap();
    assert_eq!(robots.len(), lab().robots.len() - 1);
    assert_eq!((robots[0].name.as_str(), robots[0].robot.number), ("omni-02", first));
    assert_eq!(world.store.arena_list().await.unwrap()[0].arena, changed.arena);
    assert!(world.store.model_list(None).await.unwrap().is_empty());
}
