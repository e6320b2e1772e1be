//! Accelerations given to a replay act as those of a learned residual do.

use twin::golden::reference_robot;
use twin::pose::Pose;
use twin::replay::{CommandRow, HeldCommand, replay_after, replay_pushed};
use twin::residual::{Activation, Input, Layer, Output, ResidualDocument};
use twin::robot::Robot;

const PUSH: [f64; 3] = [-0.7, 0.4, 1.5];

fn rows() -> Vec<CommandRow> {
    (0..240)
        .map(|k| {
            let mut row = CommandRow {
                time_s: f64::from(k) / 120.0,
                ..CommandRow::default()
            };
            row.forward_m_per_s = (k % 60 == 0).then_some(0.3 + 0.005 * f64::from(k));
            row.yaw_rate_rad_per_s = (k == 60).then_some(0.8);
            row
        })
        .collect()
}

fn constant() -> ResidualDocument {
    let layer = Layer {
        weights: vec![0.0; 3],
        bias: PUSH.to_vec(),
        activation: Activation::Linear,
    };
    let names = [
        "acceleration_forward_m_per_s2",
        "acceleration_left_m_per_s2",
        "acceleration_yaw_rad_per_s2",
    ];
    let outputs = names.map(|name| Output {
        name: name.to_owned(),
        scale: 1.0,
        limit: 5.0,
    });
    ResidualDocument::new(
        vec![Input::new("forward_m_per_s", -100.0, 100.0)],
        1.0,
        vec![layer],
        outputs.to_vec(),
    )
}

#[test]
fn a_constant_push_is_a_constant_residual_to_the_bit() {
    for chassis in ["omni4", "diff2", "rwd"] {
        let description = reference_robot(chassis);
        let plain = Robot::new(description.clone()).unwrap();
        let learned = Robot::with_model(description, &[], Some(&constant())).unwrap();
        let start = twin::free::Start {
            pose: Pose::default(),
            ..Default::default()
        };
        let rows = rows();
        let mut ticks = Vec::new();
        let pushed = replay_pushed(&plain, &start, HeldCommand::default(), &[], &rows, &mut |tick| {
            ticks.push(tick.number);
            Some(PUSH)
        })
        .unwrap();
        let expected = replay_after(&learned, &start, HeldCommand::default(), &[], &rows).unwrap();
        assert_eq!(pushed, expected, "{chassis}");
        let without = replay_after(&plain, &start, HeldCommand::default(), &[], &rows).unwrap();
        assert_ne!(pushed.last(), without.last());
        assert_eq!(ticks, (0..239).collect::<Vec<u64>>());
    }
}
