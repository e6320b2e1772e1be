//! Why a calibration, a setting or a fault is refused.

/// One rule that an input broke, and how to mend it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}; {limit}; {remedy}")]
pub struct CameraProblem {
    /// Path of the value in its document, for example `focal_px[0]`.
    pub field: String,
    pub message: String,
    pub limit: String,
    pub remedy: String,
}

impl CameraProblem {
    pub fn new(
        field: impl Into<String>,
        message: impl Into<String>,
        limit: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            field: field.into(),
            message: message.into(),
            limit: limit.into(),
            remedy: remedy.into(),
        }
    }
}

/// Refuses a value that is not a number from `from` to `to`.
pub(super) fn within(field: &str, value: f64, from: f64, to: f64, remedy: &str) -> Result<(), CameraProblem> {
    if value >= from && value <= to {
        return Ok(());
    }
    Err(CameraProblem::new(
        field,
        format!("is {value}"),
        format!("must be a number from {from} to {to}"),
        remedy,
    ))
}
