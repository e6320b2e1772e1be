//! `robopheus runs`

use crate::output::Output;
use crate::settings::Settings;
use api::run::RunView;

#[derive(clap::Args)]
pub struct Arguments {
    /// Only runs that have not ended
    #[arg(long)]
    open: bool,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let mut runs = settings.client()?.run_list().await?;
    runs.retain(|run| !arguments.open || !run.state.is_terminal());
    output.result(&runs, || table(&runs))
}

fn table(runs: &[RunView]) -> String {
    if runs.is_empty() {
        return "no runs yet; send one with `robopheus submit EXPERIMENT.json`".into();
    }
    let mut text = format!("{:36}  {:11}  {:20}  {}", "RUN", "STATE", "SUBMITTED (UTC)", "LABEL");
    for run in runs {
        let submitted = run.created_at.format("%Y-%m-%d %H:%M:%S");
        text.push_str(&format!(
            "\n{}  {:11}  {:20}  {}",
            run.id,
            run.state.as_str(),
            submitted.to_string(),
            run.label
        ));
        if let Some(why) = run
            .fault
            .as_ref()
            .map(|fault| &fault.message)
            .or(run.waiting_reason.as_ref())
        {
            text.push_str(&format!("  ({why})"));
        }
    }
    text
}
