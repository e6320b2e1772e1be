//! What can go wrong when the service does something, without HTTP words.

use api::problem::FieldProblem;

/// Outcome of an operation that was not carried out.
#[derive(Debug, thiserror::Error)]
pub enum AppError {
    #[error("there is no {noun} {id}")]
    NotFound { noun: &'static str, id: String },
    #[error("{detail}")]
    Invalid {
        code: &'static str,
        detail: String,
        errors: Vec<FieldProblem>,
    },
    #[error("{detail}")]
    Conflict { code: &'static str, detail: String },
    #[error("larger than {limit_bytes} bytes")]
    TooLarge { limit_bytes: u64 },
    #[error("the sender stopped in the middle")]
    Interrupted,
    #[error("the database does not answer")]
    DatabaseUnavailable,
    #[error("{what} is damaged in the store")]
    Corrupt { what: String },
    #[error("{0}")]
    Internal(String),
}

impl AppError {
    pub fn not_found(noun: &'static str, id: impl ToString) -> Self {
        Self::NotFound {
            noun,
            id: id.to_string(),
        }
    }
}

impl From<std::io::Error> for AppError {
    fn from(error: std::io::Error) -> Self {
        Self::Internal(error.to_string())
    }
}

impl From<store::StoreError> for AppError {
    fn from(error: store::StoreError) -> Self {
        use store::StoreError as E;
        if error.is_transient() {
            tracing::warn!(error = %chain(&error), "the database did not answer");
            return Self::DatabaseUnavailable;
        }
        match error {
            E::RunEnded => Self::Conflict {
                code: "run_ended",
                detail: error.to_string(),
            },
            E::TransitionRefused(_) => Self::Conflict {
                code: "transition_refused",
                detail: error.to_string(),
            },
            E::Constraint(_) => Self::Conflict {
                code: "rule_broken",
                detail: error.to_string(),
            },
            E::OutOfRange { .. } => Self::Invalid {
                code: "out_of_range",
                detail: error.to_string(),
                errors: Vec::new(),
            },
            other => Self::Internal(chain(&other)),
        }
    }
}

/// An error and everything behind it, for the log.
pub fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}
