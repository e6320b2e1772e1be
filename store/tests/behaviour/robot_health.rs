//! Robots' health: kept as reported, and unfit robots get no run.

use crate::fixture::*;
use api::health::{BatteryLevel, LinkQuality, RobotHealth};
use api::lab::RobotStatus;

const FINE: RobotHealth = RobotHealth {
    battery: BatteryLevel::Good,
    rest_v: 24.5,
    stalled: false,
    sensor_fault: false,
    bounded_estimate: true,
};
const LINK: LinkQuality = LinkQuality {
    loss_share: 0.01,
    delay_p50_ms: 2.5,
    delay_p95_ms: 6.25,
    jitter_ms: 1.75,
};

fn robot(name: &str, health: Option<RobotHealth>) -> RobotStatus {
    RobotStatus {
        name: name.to_owned(),
        online: true,
        bus_v: Some(24.0),
        health,
        link: health.map(|_| LINK),
        stop_acknowledged: false,
        activity: None,
    }
}

/// The first robot of the fixture's experiment.
fn first() -> String {
    experiment().robots[0].name.clone()
}

#[tokio::test]
async fn health_and_link_come_back_as_they_were_reported() {
    let world = world_with_lab().await;
    let name = first();
    let view = async || {
        let robots = world.store.robot_list().await.unwrap();
        robots.into_iter().find(|view| view.name == name).unwrap()
    };
    assert_eq!((view().await.health, view().await.link), (None, None));
    let odd = RobotHealth {
        battery: BatteryLevel::Critical,
        rest_v: 21.125,
        stalled: true,
        ..FINE
    };
    for health in [Some(FINE), Some(odd), None] {
        world.report_robots(false, vec![robot(&name, health)]).await;
        let view = view().await;
        assert_eq!(view.health, health);
        assert_eq!(view.link, health.map(|_| LINK));
        let message = health
            .filter(|health| health.stalled)
            .map(|_| "has to be looked at (a motor was blocked)");
        assert_eq!(view.message.as_deref(), message);
    }
}

#[tokio::test]
async fn a_robot_that_is_not_fit_gets_no_run_and_the_queue_says_why() {
    let world = world_with_lab().await;
    let name = first();
    let run_id = world.queued().await;
    let levels = [
        (BatteryLevel::Good, None),
        (BatteryLevel::Low, Some("is charging (battery low)")),
        (BatteryLevel::Critical, Some("is charging (battery critical)")),
        (BatteryLevel::Empty, Some("is charging (battery empty)")),
    ];
    for (battery, charging) in levels {
        for (stalled, sensor_fault) in [(true, false), (false, true), (true, true), (false, false)] {
            let health = RobotHealth {
                battery,
                stalled,
                sensor_fault,
                ..FINE
            };
            let wanted = match (battery, sensor_fault, stalled) {
                (BatteryLevel::Empty, _, _) | (_, false, false) => charging,
                (_, true, _) => Some("has to be looked at (a sensor is faulty)"),
                (_, false, true) => Some("has to be looked at (a motor was blocked)"),
            };
            let Some(wanted) = wanted else { continue };
            world.report_robots(false, vec![robot(&name, Some(health))]).await;
            assert_eq!(
                world.store.run_claim(&world.claim(), LONG).await.unwrap(),
                None,
                "{health:?}"
            );
            let view = world.store.run_get(run_id).await.unwrap().unwrap();
            assert_eq!(view.waiting_reason, Some(format!("{name} {wanted}")), "{health:?}");
            assert_eq!(view.expected_start, None);
        }
    }
    world.report_robots(false, vec![robot(&name, Some(FINE))]).await;
    assert_eq!(world.preparing(LONG).await.run_id, run_id);
}

#[tokio::test]
async fn what_a_robot_does_between_runs_comes_back_and_a_run_hides_it() {
    use api::health::RobotActivity;
    let world = world_with_lab().await;
    let name = first();
    for activity in [Some(RobotActivity::DrivingHome), Some(RobotActivity::Charging), None] {
        let told = RobotStatus {
            activity,
            ..robot(&name, Some(FINE))
        };
        world.report_robots(false, vec![told.clone()]).await;
        let views = world.store.robot_list().await.unwrap();
        let seen = views.iter().find(|view| view.name == name).unwrap();
        assert_eq!((seen.state.as_str(), seen.activity), ("idle", activity));
        if activity.is_none() {
            world.queued().await;
            world.preparing(LONG).await;
            world
                .report_robots(
                    false,
                    vec![RobotStatus {
                        activity: Some(RobotActivity::Charging),
                        ..told
                    }],
                )
                .await;
            let views = world.store.robot_list().await.unwrap();
            let seen = views.iter().find(|view| view.name == name).unwrap();
            assert_eq!((seen.state.as_str(), seen.activity), ("leased", None));
        }
    }
}
