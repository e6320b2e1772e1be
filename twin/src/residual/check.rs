//! Whether a residual can be evaluated on a robot.

use super::document::{Input, Layer, Output, ResidualDocument};
use super::input::{INPUTS, InputEntry, Of, find};
use super::{FORMAT, MAX_LAYERS, MAX_TICKS_AGO, MAX_UNITS, SHIFTS, outputs};
use crate::parameter::ParameterError;
use crate::robot::RobotDescription;

/// Largest magnitude of a weight, a bias, a mean or an end of a range.
const LARGEST: f64 = 1e6;
/// Largest magnitude of a normalised input.
const LARGEST_NORMALISED: f64 = 1e3;
const LARGEST_OUTPUT_SCALE: f64 = 1e3;
const SMALLEST_SCALE: f64 = 1e-6;
const FADE: (f64, f64) = (0.01, 10.0);

/// The first thing that is wrong, by its path in the model document.
pub(super) fn check(robot: &RobotDescription, residual: &ResidualDocument) -> Result<(), ParameterError> {
    if residual.format != FORMAT {
        let message = format!("{:?} is not a residual that this version evaluates", residual.format);
        return Err(problem("format", message, FORMAT, "give this format"));
    }
    count(
        "inputs",
        residual.inputs.len(),
        MAX_UNITS,
        "give the network fewer inputs",
    )?;
    for (position, input) in residual.inputs.iter().enumerate() {
        check_input(robot, input, &format!("inputs[{position}]"))?;
        let same =
            |other: &&Input| (&other.name, other.wheel, other.ticks_ago) == (&input.name, input.wheel, input.ticks_ago);
        if let Some(first) = residual.inputs[..position].iter().position(|other| same(&other)) {
            return Err(problem(
                &format!("inputs[{position}].name"),
                format!("{} is that of inputs[{first}] again", input.name),
                "each name, wheel and ticks_ago once",
                "leave one of them out",
            ));
        }
    }
    number(
        "fade",
        residual.fade,
        FADE,
        "give the width of the fade as a share of the ranges, such as 0.25",
    )?;
    count(
        "layers",
        residual.layers.len(),
        MAX_LAYERS,
        "give the network fewer layers",
    )?;
    let mut width = residual.inputs.len();
    for (position, layer) in residual.layers.iter().enumerate() {
        width = check_layer(layer, width, &format!("layers[{position}]"))?;
    }
    if residual.outputs.len() != width {
        return Err(problem(
            "outputs",
            format!("{} outputs for {width} rows of the last layer", residual.outputs.len()),
            "one output per row of the last layer",
            "correct the last layer or the outputs",
        ));
    }
    for (position, output) in residual.outputs.iter().enumerate() {
        check_output(
            robot,
            output,
            &residual.outputs[..position],
            &format!("outputs[{position}]"),
        )?;
    }
    Ok(())
}

fn check_input(robot: &RobotDescription, input: &Input, at: &str) -> Result<(), ParameterError> {
    let Some(entry) = find(&input.name) else {
        return Err(problem(
            &format!("{at}.name"),
            format!("{:?} is no input", input.name),
            &INPUTS.map(|entry| entry.name).join(", "),
            "take a name from the list of inputs",
        ));
    };
    check_owner(robot, input, entry, at)?;
    if input.ticks_ago > MAX_TICKS_AGO {
        return Err(problem(
            &format!("{at}.ticks_ago"),
            format!("{} control ticks are too long ago", input.ticks_ago),
            &format!("0..={MAX_TICKS_AGO}"),
            "look back less far",
        ));
    }
    let remedy = format!("give the number in {}, as in the training data", entry.unit);
    number(&format!("{at}.mean"), input.mean, (-LARGEST, LARGEST), &remedy)?;
    number(&format!("{at}.scale"), input.scale, (SMALLEST_SCALE, LARGEST), &remedy)?;
    number(&format!("{at}.low"), input.low, (-LARGEST, LARGEST), &remedy)?;
    number(&format!("{at}.high"), input.high, (-LARGEST, LARGEST), &remedy)?;
    if input.high - input.low < SMALLEST_SCALE {
        return Err(problem(
            &format!("{at}.high"),
            format!("{} is not above low = {}", input.high, input.low),
            &format!("at least low + {SMALLEST_SCALE}"),
            "leave out an input that did not vary in the training data",
        ));
    }
    for (name, end) in [("low", input.low), ("high", input.high)] {
        let normalised = (end - input.mean) / input.scale;
        if normalised.abs() > LARGEST_NORMALISED {
            return Err(problem(
                &format!("{at}.{name}"),
                format!("{end} is {normalised} when normalised"),
                &format!("+-{LARGEST_NORMALISED}"),
                "give mean and scale of the training data",
            ));
        }
    }
    Ok(())
}

/// Whether the robot has what the quantity is measured at.
fn check_owner(robot: &RobotDescription, input: &Input, entry: &InputEntry, at: &str) -> Result<(), ParameterError> {
    let of_wheel = !matches!(entry.of, Of::Robot | Of::SteeredRobot);
    let wrong =
        |message: String, limit: &str, remedy: &str| Err(problem(&format!("{at}.wheel"), message, limit, remedy));
    let wheel = match (of_wheel, input.wheel) {
        (false, Some(_)) => {
            return wrong(
                format!("{} belongs to no wheel", entry.name),
                "null",
                "leave the wheel out or set it to null",
            );
        }
        (false, None) if entry.of == Of::SteeredRobot && robot.steering.is_none() => {
            return Err(problem(
                &format!("{at}.name"),
                format!("{} has no steering gear", robot.name),
                "robots with a steering gear",
                "leave the input out for this robot",
            ));
        }
        (false, None) => return Ok(()),
        (true, None) => {
            return wrong(
                format!("{} is measured at one wheel", entry.name),
                "a position in `wheels`, from 0",
                "name the wheel",
            );
        }
        (true, Some(wheel)) => wheel,
    };
    let Some(found) = robot.wheels.get(wheel) else {
        let limit = format!("0..={}", robot.wheels.len().saturating_sub(1));
        return wrong(
            format!("there is no wheel {wheel}"),
            &limit,
            "name a wheel of the robot",
        );
    };
    let (fits, limit) = match entry.of {
        Of::RollingWheel => (found.kind != "caster", "a wheel that is no caster"),
        Of::DrivenWheel => (found.driven, "a driven wheel"),
        Of::Motor => (
            found.driven && robot.motor.is_some(),
            "a driven wheel of a robot with a motor description",
        ),
        Of::Robot | Of::SteeredRobot | Of::Wheel => (true, ""),
    };
    if fits {
        return Ok(());
    }
    wrong(
        format!("wheel {wheel} has no {}", entry.name),
        limit,
        "leave the input out or name another wheel",
    )
}

/// Units of the layer.
fn check_layer(layer: &Layer, width: usize, at: &str) -> Result<usize, ParameterError> {
    let units = layer.bias.len();
    count(&format!("{at}.bias"), units, MAX_UNITS, "give the layer fewer units")?;
    if layer.weights.len() != units * width {
        return Err(problem(
            &format!("{at}.weights"),
            format!("{} weights for {units} units of {width} inputs", layer.weights.len()),
            &format!("{} weights", units * width),
            "give one row per unit, one after the other",
        ));
    }
    for (name, numbers) in [("weights", &layer.weights), ("bias", &layer.bias)] {
        for (position, value) in numbers.iter().enumerate() {
            let field = || format!("{at}.{name}[{position}]");
            if !in_range(*value, (-LARGEST, LARGEST)) {
                number(&field(), *value, (-LARGEST, LARGEST), "train the network again")?;
            }
        }
    }
    Ok(units)
}

fn check_output(robot: &RobotDescription, output: &Output, before: &[Output], at: &str) -> Result<(), ParameterError> {
    let Some((_, unit, largest)) = outputs(robot).find(|(name, _, _)| *name == output.name) else {
        let message = if SHIFTS.iter().any(|(name, _, _)| *name == output.name) {
            format!("{} is for robots without motors; {} has some", output.name, robot.name)
        } else {
            format!("{:?} is no output", output.name)
        };
        let names: Vec<&str> = outputs(robot).map(|(name, _, _)| name).collect();
        return Err(problem(
            &format!("{at}.name"),
            message,
            &names.join(", "),
            "take a name from the list of outputs",
        ));
    };
    if before.iter().any(|other| other.name == output.name) {
        return Err(problem(
            &format!("{at}.name"),
            format!("{} stands twice", output.name),
            "each output once",
            "leave one of them out",
        ));
    }
    let remedy = format!("give the number in {unit}");
    let scale = (-LARGEST_OUTPUT_SCALE, LARGEST_OUTPUT_SCALE);
    number(&format!("{at}.scale"), output.scale, scale, &remedy)?;
    number(&format!("{at}.limit"), output.limit, (SMALLEST_SCALE, largest), &remedy)
}

fn count(field: &str, found: usize, most: usize, remedy: &str) -> Result<(), ParameterError> {
    if (1..=most).contains(&found) {
        return Ok(());
    }
    let remedy = if found == 0 { "give at least one" } else { remedy };
    Err(problem(
        field,
        format!("{found} entries"),
        &format!("1..={most}"),
        remedy,
    ))
}

fn in_range(value: f64, (low, high): (f64, f64)) -> bool {
    value.is_finite() && (low..=high).contains(&value)
}

fn number(field: &str, value: f64, range: (f64, f64), remedy: &str) -> Result<(), ParameterError> {
    if in_range(value, range) {
        return Ok(());
    }
    let (low, high) = range;
    Err(problem(
        field,
        format!("{value} is out of range"),
        &format!("{low}..={high}"),
        remedy,
    ))
}

fn problem(field: &str, message: String, limit: &str, remedy: &str) -> ParameterError {
    ParameterError {
        field: format!("residual.{field}"),
        message,
        limit: limit.to_owned(),
        remedy: remedy.to_owned(),
    }
}
