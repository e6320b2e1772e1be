//! Accelerations given to a replay act as those of a learned residual do.

use twin::golden::reference_robot;
use twin::pose::Pose;
use twin::replay::{CommandRow, HeldCommand, replay_after, replay_pushed};
use twin::residual::{Activation, Input, Layer, Output, ResidualDocument, SHIFTS};
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
            Some([PUSH[0], PUSH[1], PUSH[2], 0.0, 0.0, 0.0])
        })
        .unwrap();
        let expected = replay_after(&learned, &start, HeldCommand::default(), &[], &rows).unwrap();
        assert_eq!(pushed, expected, "{chassis}");
        let without = replay_after(&plain, &start, HeldCommand::default(), &[], &rows).unwrap();
        assert_ne!(pushed.last(), without.last());
        assert_eq!(ticks, (0..239).collect::<Vec<u64>>());
    }
}

#[test]
fn set_points_given_to_a_replay_are_those_of_a_residual_to_the_bit() {
    const SHIFT: [f64; 3] = [0.1, 0.0, -0.3];
    for chassis in ["omni4", "diff2", "rwd"] {
        let mut description = reference_robot(chassis);
        description.motor = None;
        let mut residual = constant();
        residual.layers[0].bias = SHIFT.to_vec();
        for (output, (name, _, limit)) in residual.outputs.iter_mut().zip(SHIFTS) {
            (output.name, output.limit) = (name.to_owned(), limit);
        }
        let plain = Robot::new(description.clone()).unwrap();
        let learned = Robot::with_model(description, &[], Some(&residual)).unwrap();
        let (start, held, rows) = (twin::free::Start::default(), HeldCommand::default(), rows());
        let push = [0.0, 0.0, 0.0, SHIFT[0], SHIFT[1], SHIFT[2]];
        let pushed = replay_pushed(&plain, &start, held, &[], &rows, &mut |_| Some(push)).unwrap();
        let expected = replay_after(&learned, &start, held, &[], &rows).unwrap();
        assert_eq!(pushed, expected, "{chassis}");
        let without = replay_after(&plain, &start, held, &[], &rows).unwrap();
        let added: f64 = pushed[239].state.wheel_rad_per_s.iter().sum::<f64>()
            - without[239].state.wheel_rad_per_s.iter().sum::<f64>();
        let wheels = learned.wheel_speeds(twin::twist::BodyTwist {
            forward_m_per_s: SHIFT[0],
            left_m_per_s: SHIFT[1],
            yaw_rate_rad_per_s: SHIFT[2],
        });
        // A steered robot's wheels depend on how it is steered.
        let expected: f64 = wheels.wheel_rad_per_s.iter().sum();
        assert!(
            chassis == "rwd" || (added - expected).abs() < 1e-9,
            "{chassis}: {added}"
        );
    }
}
