//! `robopheus login`

use crate::output::Output;
use crate::settings::Settings;
use anyhow::Context;

#[derive(clap::Args)]
pub struct Arguments {
    /// File that holds the token; `--token` and ROBOPHEUS_TOKEN work as well
    #[arg(long)]
    token_file: Option<std::path::PathBuf>,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let mut settings = settings.clone();
    if let Some(path) = &arguments.token_file {
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        settings.token = Some(text.trim().to_owned());
    }
    // A call that needs the token proves address and token before they are kept.
    let robots = settings.client()?.robot_list().await?.len();
    let path = settings.store()?;
    let stored = serde_json::json!({ "server": settings.server, "stored_in": path, "robots": robots });
    output.result(&stored, || {
        format!("{}: {robots} robots; stored in {}", settings.server, path.display())
    })
}
