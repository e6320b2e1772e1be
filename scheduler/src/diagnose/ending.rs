//! How a diagnosis ended, before it is written.

use api::diagnosis::DiagnosisProblem;
use store::DiagnosisRecord;

#[derive(Debug)]
pub enum Ending {
    Found(Box<DiagnosisRecord>),
    /// It can have no result, or was cancelled.
    Problem(DiagnosisProblem),
    /// Something failed that may pass; the text is for the log.
    Failed(String),
    /// The worker was asked to stop before it was done.
    Stopped,
}

impl Ending {
    pub fn problem(code: &str, message: impl Into<String>) -> Self {
        Self::Problem(DiagnosisProblem {
            code: code.to_owned(),
            message: message.into(),
        })
    }
}
