//! `robopheus cancel`

use crate::output::Output;
use crate::settings::Settings;

#[derive(clap::Args)]
pub struct Arguments {
    /// Run identifier, as `robopheus runs` prints it
    run: uuid::Uuid,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let run = settings.client()?.run_cancel(arguments.run).await?;
    output.result(&run, || match run.state.is_terminal() {
        true => format!("{} is {}", run.id, run.state.as_str()),
        false => format!("{} is {} and has been asked to stop", run.id, run.state.as_str()),
    })
}
