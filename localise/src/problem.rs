//! What is wrong with an input, and what to do about it.

use serde::Serialize;

/// An input that cannot be used.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
#[error("{field}: {message} (limit: {limit}; {remedy})")]
pub struct Problem {
    /// Path of the field, for example `focal_px[0]`.
    pub field: String,
    /// What is wrong, with the value.
    pub message: String,
    /// What is allowed, with the unit.
    pub limit: String,
    /// What to do about it.
    pub remedy: String,
}

impl Problem {
    pub(crate) fn new(
        field: impl Into<String>,
        message: impl Into<String>,
        limit: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Problem {
        Problem {
            field: field.into(),
            message: message.into(),
            limit: limit.into(),
            remedy: remedy.into(),
        }
    }

    /// A finite number between two limits.
    pub(crate) fn in_range(field: &str, value: f64, limits: [f64; 2], unit: &str, remedy: &str) -> Result<(), Problem> {
        if value >= limits[0] && value <= limits[1] {
            return Ok(());
        }
        let unit = if unit.is_empty() {
            String::new()
        } else {
            format!(" {unit}")
        };
        Err(Problem::new(
            field,
            format!("{value}{unit} is not possible"),
            format!("{} to {}{unit}", limits[0], limits[1]),
            remedy,
        ))
    }
}
