//! Where results, progress and errors go.

use client::ClientError;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::IsTerminal;

/// An outcome that is not an error of the program but should end with status 1, for example a rejected experiment.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Unsuccessful(pub String);

pub struct Output {
    json: bool,
}

impl Output {
    pub fn new(json: bool) -> Self {
        Self { json }
    }

    /// Prints a result: `value` with `--json`, else `text`.
    pub fn result(&self, value: &impl Serialize, text: impl FnOnce() -> String) -> anyhow::Result<()> {
        use std::io::Write;
        let line = if self.json {
            serde_json::to_string(value)?
        } else {
            text()
        };
        match writeln!(std::io::stdout().lock(), "{line}") {
            // The reader went away (`robopheus runs | head`): nothing is left to say.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            other => Ok(other?),
        }
    }

    /// A progress bar on a terminal, nothing elsewhere.
    ///
    /// - `template`: indicatif template.
    pub fn bar(&self, length: u64, template: &str) -> ProgressBar {
        if self.json || !std::io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        ProgressBar::new(length).with_style(style.progress_chars("━╸ "))
    }

    /// Says what went wrong and ends the program.
    pub fn fail(&self, error: &anyhow::Error) -> ! {
        let client_error = error.downcast_ref::<ClientError>();
        if self.json {
            let body = match client_error {
                Some(ClientError::Refused(problem)) => serde_json::to_value(problem).unwrap_or_default(),
                _ => serde_json::json!({ "detail": format!("{error:#}") }),
            };
            eprintln!("{body}");
        } else {
            eprintln!("robopheus: {error:#}");
        }
        std::process::exit(client_error.map_or(1, ClientError::exit_code))
    }
}
