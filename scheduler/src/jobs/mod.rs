//! Kinds of jobs, one a file. A kind is its name, its limits and a function from a leased job to an [`Ending`].

pub mod rehearse;

use store::{JobFailure, VerdictRecord};

/// How a job ended, before it is written.
#[derive(Debug)]
pub enum Ending {
    /// The rehearsal has a verdict.
    Verdict(Box<VerdictRecord>),
    /// It did not work out; `error` is for the log and the job's row.
    Failed { error: String, then: JobFailure },
    /// The run is gone; nothing is left to do.
    Nothing,
    /// The worker was asked to stop before the job was done.
    Stopped,
}
