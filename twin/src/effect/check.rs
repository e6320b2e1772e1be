//! Whether a list of effects can act on a robot.

use super::Effect;
use super::library::{EffectEntry, LIBRARY, Needs, find};
use crate::parameter::ParameterError;
use crate::robot::RobotDescription;

/// The first thing that is wrong, by its path in the model document.
pub(crate) fn check(robot: &RobotDescription, effects: &[Effect]) -> Result<(), ParameterError> {
    for (position, effect) in effects.iter().enumerate() {
        check_one(robot, effect, &format!("effects[{position}]"))?;
    }
    Ok(())
}

fn check_one(robot: &RobotDescription, effect: &Effect, at: &str) -> Result<(), ParameterError> {
    let Some(entry) = find(&effect.name) else {
        return Err(ParameterError {
            field: format!("{at}.name"),
            message: format!("{:?} is not in the effect library", effect.name),
            limit: format!("one of {} names", LIBRARY.len()),
            remedy: "take a name from the effect library's table".to_owned(),
        });
    };
    check_needs(robot, entry, at)?;
    check_index(robot, effect, entry, at)?;
    for (name, value) in &effect.parameters {
        let field = format!("{at}.parameters.{name}");
        let Some(parameter) = entry.parameter(name) else {
            let known: Vec<&str> = entry.parameters.iter().map(|parameter| parameter.name).collect();
            return Err(ParameterError {
                field,
                message: format!("{} has no parameter of this name", entry.name),
                limit: known.join(", "),
                remedy: "use the parameter names of the effect library".to_owned(),
            });
        };
        let number = value.unwrap_or(f64::INFINITY);
        if number.is_nan() || number < parameter.low || number > parameter.high {
            return Err(ParameterError {
                field,
                message: format!("{number} {} is not possible", parameter.unit),
                limit: format!("{} to {} {}", parameter.low, parameter.high, parameter.unit),
                remedy: format!("{} means no effect", parameter.neutral),
            });
        }
    }
    Ok(())
}

fn check_needs(robot: &RobotDescription, entry: &EffectEntry, at: &str) -> Result<(), ParameterError> {
    let has_kind = |kind: &str| robot.wheels.iter().any(|wheel| wheel.kind == kind);
    let (met, what) = match entry.needs {
        Needs::Nothing => (true, ""),
        Needs::Motor => (robot.motor.is_some(), "a motor description"),
        Needs::Steering => (robot.steering.is_some(), "a steering gear"),
        Needs::OmniWheel => (has_kind("omni"), "an omni wheel"),
        Needs::StandardWheel => (has_kind("standard"), "a standard wheel"),
        Needs::Caster => (has_kind("caster"), "a caster"),
    };
    if met {
        return Ok(());
    }
    Err(ParameterError {
        field: format!("{at}.name"),
        message: format!(
            "{} has no {}",
            robot.name,
            what.trim_start_matches("a ").trim_start_matches("an ")
        ),
        limit: format!("{} needs {what}", entry.name),
        remedy: "leave the effect out for this robot".to_owned(),
    })
}

fn check_index(robot: &RobotDescription, effect: &Effect, entry: &EffectEntry, at: &str) -> Result<(), ParameterError> {
    let wrong = |message: String, remedy: &str| ParameterError {
        field: format!("{at}.index"),
        message,
        limit: format!(
            "0 to {}, a wheel that is no caster",
            robot.wheels.len().saturating_sub(1)
        ),
        remedy: remedy.to_owned(),
    };
    match (entry.indexed, effect.index) {
        (false, None) => Ok(()),
        (false, Some(_)) => Err(wrong(
            format!("{} acts on all wheels", entry.name),
            "leave the index out or set it to null",
        )),
        (true, None) => Err(wrong(
            format!("{} acts on one wheel", entry.name),
            "give its position in `wheels`, from 0",
        )),
        (true, Some(index)) => match robot.wheels.get(index) {
            None => Err(wrong(
                format!("there is no wheel {index}"),
                "give its position in `wheels`, from 0",
            )),
            Some(wheel) if wheel.kind == "caster" => Err(wrong(
                format!("wheel {index} is a caster"),
                "name a wheel that rolls on its own axle",
            )),
            Some(wheel) if entry.needs == Needs::Motor && !wheel.driven => {
                Err(wrong(format!("wheel {index} is not driven"), "name a driven wheel"))
            }
            Some(_) => Ok(()),
        },
    }
}
