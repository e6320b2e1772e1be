//! One short trace of a learned residual on every chassis: all inputs, all activations, the edge of the validity region.

use std::collections::BTreeMap;

use super::effects::trace;
use super::{CHASSIS, GoldenError, reference_robot};
use crate::residual::{Activation, INPUTS, Input, Layer, MAX_UNITS, OUTPUTS, Of, Output, ResidualDocument};
use crate::robot::{Robot, RobotDescription};

/// Digest by `<chassis>/residual`; committed in `twin/golden/residual.json`.
pub fn residual_digests() -> Result<BTreeMap<String, String>, GoldenError> {
    let mut digests = BTreeMap::new();
    for chassis in CHASSIS {
        let description = reference_robot(chassis);
        let residual = reference_residual(&description);
        let robot = Robot::with_model(description, &[], Some(&residual))?;
        digests.insert(format!("{chassis}/residual"), trace(&robot)?);
    }
    Ok(digests)
}

/// A network of 12 + 8 units that sees everything a robot has, some of it 1 to 4 control ticks ago.
pub fn reference_residual(robot: &RobotDescription) -> ResidualDocument {
    let mut inputs = Vec::new();
    for entry in INPUTS {
        let of_wheel = |fits: &dyn Fn(usize) -> bool| -> Vec<Option<usize>> {
            (0..robot.wheels.len()).filter(|wheel| fits(*wheel)).map(Some).collect()
        };
        let wheels = match entry.of {
            Of::Robot => vec![None],
            Of::SteeredRobot if robot.steering.is_some() => vec![None],
            Of::SteeredRobot => Vec::new(),
            Of::Wheel => of_wheel(&|_| true),
            Of::RollingWheel => of_wheel(&|wheel| robot.wheels[wheel].kind != "caster"),
            Of::DrivenWheel | Of::Motor => of_wheel(&|wheel| robot.wheels[wheel].driven),
        };
        // Ranges that the trace leaves now and then.
        let reach = match entry.unit {
            "N" => 60.0,
            "A" => 6.0,
            "rad/s" if entry.of != Of::Robot => 20.0,
            _ => 1.0,
        };
        for wheel in wheels {
            let mut input = Input::new(entry.name, -reach, reach).normalised(0.1 * reach, 0.5 * reach);
            input.wheel = wheel;
            input.ticks_ago = inputs.len() % 5;
            inputs.push(input);
        }
    }
    inputs.truncate(MAX_UNITS);
    let mut number = 0.0;
    let mut next = || {
        number += 1.0;
        libm::sin(1.7 * number)
    };
    let mut layer = |units: usize, width: usize, activation| Layer {
        weights: (0..units * width).map(|_| 0.4 * next()).collect(),
        bias: (0..units).map(|_| 0.2 * next()).collect(),
        activation,
    };
    let layers = vec![
        layer(12, inputs.len(), Activation::Tanh),
        layer(8, 12, Activation::Softsign),
        layer(OUTPUTS.len(), 8, Activation::Linear),
    ];
    let output = |(name, _, largest): (&str, &str, f64)| Output {
        name: name.to_owned(),
        scale: 0.3 * largest,
        limit: 0.2 * largest,
    };
    ResidualDocument::new(inputs, 3.0, layers, OUTPUTS.map(output).to_vec())
}
