//! Numbers of a robot description: one table ([`TABLE`]) for validation, documents and sliders.

mod chassis;
mod check;
mod control;
mod plausible;
pub mod table;

use serde::Serialize;

pub(crate) use check::check;
pub use table::{Parameter, Practical, Source, TABLE, WhenAbsent};

/// A number or name in a description that cannot be simulated.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
#[error("{field}: {message} (limit: {limit}; {remedy})")]
pub struct ParameterError {
    /// Path of the field, for example `wheels[2].radius_m`.
    pub field: String,
    /// What is wrong, with the value.
    pub message: String,
    /// What is allowed, with the unit.
    pub limit: String,
    /// What to do about it.
    pub remedy: String,
}

/// Chassis that the wheel table describes.
pub const CHASSIS: [&str; 6] = ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"];
/// Wheel kinds.
pub const WHEEL_KINDS: [&str; 3] = ["omni", "standard", "caster"];

/// The entry of [`TABLE`] for a field, positions left out (`wheels[].radius_m`) or given (`wheels[2].radius_m`).
pub fn find(field: &str) -> Option<&'static Parameter> {
    TABLE.iter().copied().find(|parameter| {
        let Some((before, after)) = parameter.path.split_once("[]") else {
            return parameter.path == field;
        };
        let Some(rest) = field.strip_prefix(before).and_then(|rest| rest.strip_suffix(after)) else {
            return false;
        };
        let position = rest.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        position.is_some_and(|position| position.bytes().all(|byte| byte.is_ascii_digit()))
    })
}

/// Allowed range of one number of the sensors' settings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Range {
    pub(crate) key: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) remedy: &'static str,
}

pub(crate) const fn range(key: &'static str, unit: &'static str, low: f64, high: f64, remedy: &'static str) -> Range {
    Range {
        key,
        unit,
        low,
        high,
        remedy,
    }
}

pub(crate) fn problem(
    field: impl Into<String>,
    message: impl Into<String>,
    limit: impl Into<String>,
    remedy: &str,
) -> ParameterError {
    ParameterError {
        field: field.into(),
        message: message.into(),
        limit: limit.into(),
        remedy: remedy.to_owned(),
    }
}

/// Adds a problem unless the value is a number in the range; its field is the range's key behind `prefix`.
pub(crate) fn check_range(problems: &mut Vec<ParameterError>, prefix: &str, value: f64, range: &Range) {
    if value.is_finite() && (range.low..=range.high).contains(&value) {
        return;
    }
    let message = if value.is_finite() {
        format!("{value} is out of range")
    } else {
        format!("{value} is not a finite number")
    };
    let unit = if range.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", range.unit)
    };
    let limit = format!("{}..={}{unit}", range.low, range.high);
    problems.push(problem(format!("{prefix}{}", range.key), message, limit, range.remedy));
}

/// Adds a problem unless the value is a number in the parameter's range; `wheel` is the position for one in `wheels`.
fn check_value(problems: &mut Vec<ParameterError>, wheel: Option<usize>, value: f64, parameter: &Parameter) {
    if parameter.allows(value) {
        return;
    }
    let message = if value.is_finite() {
        format!("{value} is out of range")
    } else {
        format!("{value} is not a finite number")
    };
    problems.push(problem(
        field(parameter, wheel),
        message,
        parameter.limit(),
        parameter.remedy,
    ));
}

/// Path of a parameter's field.
fn field(parameter: &Parameter, wheel: Option<usize>) -> String {
    match wheel {
        Some(wheel) => parameter.path.replacen("[]", &format!("[{wheel}]"), 1),
        None => parameter.path.to_owned(),
    }
}
