//! `robopheus fetch`

use crate::output::Output;
use crate::settings::Settings;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Arguments {
    /// Run identifier, as `robopheus runs` prints it
    run: uuid::Uuid,
    /// Where to put the archive [default: <run>.zip here]
    #[arg(long, short)]
    out: Option<PathBuf>,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let path = arguments
        .out
        .unwrap_or_else(|| PathBuf::from(format!("{}.zip", arguments.run)));
    let bar = output.bar(0, "{msg} {wide_bar} {bytes}/{total_bytes} {bytes_per_sec}");
    bar.set_message("fetching");
    let progress = |at: client::DownloadProgress| {
        bar.set_length(at.total_bytes.unwrap_or(at.received_bytes));
        bar.set_position(at.received_bytes);
    };
    let download = settings
        .client()?
        .run_archive_fetch(arguments.run, &path, progress)
        .await?;
    bar.finish_and_clear();
    output.result(&download, || {
        let partial = if download.complete {
            ""
        } else {
            "; the run was cut off, this is what was saved"
        };
        format!(
            "{} ({:.1} MB, {} files checked{partial})",
            download.path.display(),
            download.bytes as f64 / 1e6,
            download.files_checked
        )
    })
}
