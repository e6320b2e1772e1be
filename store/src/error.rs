//! What can go wrong between the service and its database, in the words of the data model.

use std::time::Duration;

/// Failure of a store function. Expected outcomes (stale lease, refused transition, conflict) are values, not errors.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The database cannot be reached now; the same call may succeed later.
    #[error("the database is not available")]
    Unavailable(#[source] sqlx::Error),
    /// The database gave up on a lock, a statement or a serialisation; the same call may succeed at once.
    #[error("the database is busy")]
    Busy(#[source] sqlx::Error),
    /// A run that has ended was about to change.
    #[error("the run has ended and no longer changes")]
    RunEnded,
    /// A run was about to make a transition that its state does not allow.
    #[error("the run may not change like this: {0}")]
    TransitionRefused(String),
    /// An experiment document was about to change.
    #[error("an experiment is immutable once submitted")]
    ExperimentImmutable,
    /// A rule of the schema was broken; carries the constraint's name.
    #[error("rule `{0}` of the database refused the change")]
    Constraint(String),
    /// A stored document no longer reads as its type.
    #[error("the stored {what} does not read as its type")]
    Corrupt {
        what: &'static str,
        #[source]
        source: serde_json::Error,
    },
    /// A value handed in is outside what the store accepts.
    #[error("{field} must be {limit}")]
    OutOfRange { field: &'static str, limit: &'static str },
    /// The schema could not be brought up to date.
    #[error("the database schema could not be brought up to date")]
    Migration(#[source] sqlx::migrate::MigrateError),
    /// Anything else the database said.
    #[error("the database refused the statement")]
    Database(#[source] sqlx::Error),
}

/// Result of a store function.
pub type Result<T> = std::result::Result<T, StoreError>;

impl StoreError {
    /// True when the same call may succeed later without any change.
    pub fn is_transient(&self) -> bool {
        matches!(self, Self::Unavailable(_) | Self::Busy(_))
    }

    pub(crate) fn corrupt(what: &'static str) -> impl FnOnce(serde_json::Error) -> Self {
        move |source| Self::Corrupt { what, source }
    }
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        use sqlx::Error as E;
        let refusal = match &error {
            E::Database(database) => Refusal {
                code: database.code().unwrap_or_default().into_owned(),
                constraint: database.constraint().map(str::to_owned),
                message: database.message().to_owned(),
            },
            E::Io(_) | E::Tls(_) | E::Protocol(_) | E::PoolTimedOut | E::PoolClosed | E::WorkerCrashed => {
                return Self::Unavailable(error);
            }
            _ => return Self::Database(error),
        };
        refusal.into_store_error(error)
    }
}

struct Refusal {
    code: String,
    constraint: Option<String>,
    message: String,
}

impl Refusal {
    fn into_store_error(self, error: sqlx::Error) -> StoreError {
        match (self.constraint.as_deref(), self.code.as_str()) {
            (Some("runs_terminal_is_terminal"), _) => StoreError::RunEnded,
            (Some("runs_transition_allowed" | "runs_epoch_grows"), _) => StoreError::TransitionRefused(self.message),
            (Some("experiments_immutable"), _) => StoreError::ExperimentImmutable,
            (Some(name), _) => StoreError::Constraint(name.to_owned()),
            // Lock not available, deadlock, serialisation failure, cancelled by a timeout.
            (None, "55P03" | "40P01" | "40001" | "57014") => StoreError::Busy(error),
            // Connection exceptions, too many connections, shutting down, crashed, starting up.
            (None, "53300" | "57P01" | "57P02" | "57P03") => StoreError::Unavailable(error),
            (None, code) if code.starts_with("08") => StoreError::Unavailable(error),
            (None, _) => StoreError::Database(error),
        }
    }
}

/// Seconds as SQL wants them; refuses what no lease or wait may be.
pub(crate) fn seconds(field: &'static str, value: Duration) -> Result<f64> {
    let limit = "between 10 ms and one hour";
    if (Duration::from_millis(10)..=Duration::from_secs(3600)).contains(&value) {
        Ok(value.as_secs_f64())
    } else {
        Err(StoreError::OutOfRange { field, limit })
    }
}
