//! What can go wrong between this program and the service.

use api::problem::Problem;

#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The service understood the request and refused it.
    #[error("{}", problem_text(.0))]
    Refused(Box<Problem>),
    /// No answer: wrong address, service down, connection lost.
    #[error("the service at {url} cannot be reached: {source}")]
    Unreachable { url: String, source: reqwest::Error },
    /// An answer that is not in the service's vocabulary, usually another program on that port or another version.
    #[error("unexpected answer from {url}: HTTP {status}, {detail}")]
    Unexpected { url: String, status: u16, detail: String },
    #[error("{path}: {source}")]
    File { path: String, source: std::io::Error },
    /// A downloaded file does not have the digest its manifest gives.
    #[error("{file} is damaged: expected SHA-256 {expected}, found {found}; delete it and fetch again")]
    Damaged {
        file: String,
        expected: String,
        found: String,
    },
    #[error("{file} is not a run archive: {detail}")]
    NotAnArchive { file: String, detail: String },
}

impl ClientError {
    /// Exit status of the command line: 1 refused, 3 unreachable, 4 damaged data.
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::Refused(_) => 1,
            Self::Unreachable { .. } | Self::Unexpected { .. } => 3,
            Self::File { .. } | Self::Damaged { .. } | Self::NotAnArchive { .. } => 4,
        }
    }

    pub(crate) fn file(path: &std::path::Path, source: std::io::Error) -> Self {
        Self::File {
            path: path.display().to_string(),
            source,
        }
    }
}

fn problem_text(problem: &Problem) -> String {
    let mut text = format!("{} ({})", problem.detail, problem.code);
    for error in &problem.errors {
        text.push_str(&format!(
            "\n  {}: {}; allowed: {}; {}",
            error.field, error.message, error.limit, error.remedy
        ));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use api::problem::FieldProblem;

    #[test]
    fn refusal_names_every_field_with_limit_and_remedy() {
        let problem = Problem {
            kind: "about:blank".into(),
            title: "Invalid experiment".into(),
            status: 422,
            detail: "the experiment breaks 1 rule".into(),
            code: "invalid_experiment".into(),
            errors: vec![FieldProblem {
                field: "duration_s".into(),
                message: "-1 is negative".into(),
                limit: "0.1 to 600 s".into(),
                remedy: "give a positive duration".into(),
            }],
        };
        let text = ClientError::Refused(Box::new(problem)).to_string();
        for part in [
            "invalid_experiment",
            "duration_s",
            "-1 is negative",
            "0.1 to 600 s",
            "give a positive duration",
        ] {
            assert!(text.contains(part), "{part} missing in {text}");
        }
    }
}
