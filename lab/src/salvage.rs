//! What earlier processes left behind: runs that a crash cut off and files that could not be handed in.

use crate::deliver::{self, Attempt, DELIVERED_MARK};
use crate::desk::Desk;
use crate::journal::{self, JournalReader};
use crate::record::{End, Record};
use crate::service::ServiceError;
use anyhow::Result;
use api::lab::SalvageReport;
use api::run::{Fault, RunState, Whose};
use std::fs;
use std::path::{Path, PathBuf};
use tokio::task::spawn_blocking;

/// Folders of runs that were handed in and are kept for a look.
const KEPT_FOLDERS: usize = 20;

/// What a journal says about its run.
#[derive(Debug, Clone, PartialEq)]
pub struct Leftover {
    pub attempt_run: uuid::Uuid,
    pub epoch: i64,
    /// The control loop had begun.
    pub moved: bool,
    pub ticks_recorded: i64,
    pub ticks_missed: i64,
    pub end: Option<End>,
}

/// Reads what is needed to close a run; `None` when not even its start is readable.
pub fn inspect(folder: &Path) -> Option<Leftover> {
    let mut journal = JournalReader::open(folder).ok()?;
    let Some(Record::Start(start)) = journal.next() else {
        return None;
    };
    let mut leftover = Leftover {
        attempt_run: start.assignment.run_id,
        epoch: start.assignment.epoch,
        moved: false,
        ticks_recorded: 0,
        ticks_missed: 0,
        end: None,
    };
    for record in journal {
        match record {
            Record::Motion(_) => leftover.moved = true,
            Record::Tick(tick) if leftover.moved => {
                leftover.ticks_recorded += 1;
                leftover.ticks_missed = tick.missed;
            }
            Record::End(end) => leftover.end = Some(*end),
            _ => {}
        }
    }
    Some(leftover)
}

impl Leftover {
    /// What the service is told.
    pub fn report(&self) -> SalvageReport {
        SalvageReport {
            epoch: self.epoch,
            fault: self.fault(),
            ticks_recorded: self.moved.then_some(self.ticks_recorded),
            ticks_missed: self.moved.then_some(self.ticks_missed),
        }
    }

    /// Why the run could not end in order.
    pub fn fault(&self) -> Fault {
        let platform = |code: &str, message: &str| Fault {
            whose: Whose::Platform,
            code: code.to_owned(),
            message: message.to_owned(),
        };
        match &self.end {
            Some(End { fault: Some(fault), .. }) => fault.clone(),
            Some(_) => platform(
                "upload_interrupted",
                "The run ended, but its files could not be handed in in time.",
            ),
            None => platform(
                "lab_restarted",
                "The laboratory process stopped during the run and was started again.",
            ),
        }
    }
}

/// Folders with a journal that was not handed in, oldest name first.
pub fn leftovers(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<_> = run_folders(folder)
        .into_iter()
        .filter(|run| !run.join(DELIVERED_MARK).exists())
        .collect();
    found.sort();
    found
}

fn run_folders(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join(journal::FILE_NAME).exists())
        .collect()
}

/// Closes everything left behind. An error means: the service is away, try again later.
pub async fn sweep(desk: &Desk) -> Result<(), ServiceError> {
    for folder in leftovers(&desk.folder) {
        if desk.shutdown.is_requested() {
            return Ok(());
        }
        let own = folder.clone();
        let leftover = spawn_blocking(move || inspect(&own)).await.unwrap_or_default();
        let how = match leftover {
            None => "unreadable".to_owned(),
            // Nothing moved: the service gives the run to somebody else when the lease is over.
            Some(Leftover {
                moved: false,
                end: None,
                ..
            }) => "never moved".to_owned(),
            Some(leftover) => salvage(desk, &folder, &leftover).await?,
        };
        tracing::info!(folder = %folder.display(), how, "leftover closed");
        if let Err(error) = deliver::mark_delivered(&folder, &how) {
            tracing::error!(folder = %folder.display(), %error, "a leftover cannot be marked");
        }
    }
    prune(&desk.folder);
    Ok(())
}

async fn salvage(desk: &Desk, folder: &Path, leftover: &Leftover) -> Result<String, ServiceError> {
    let (run_id, epoch) = (leftover.attempt_run, leftover.epoch);
    let run = match desk.service.salvage(run_id, &leftover.report()).await {
        Ok(run) => run,
        Err(error) if error.is_temporary() => return Err(error),
        Err(error) => return Ok(format!("refused: {error}")),
    };
    if run.state == RunState::Done {
        return Ok("the run is done".to_owned());
    }
    let attempt = Attempt {
        run_id,
        epoch,
        folder: folder.to_owned(),
    };
    let sent = async {
        let manifest = deliver::build_archive(folder).await?;
        deliver::upload_all(desk, &attempt, &manifest, || true).await
    };
    match sent.await {
        Ok(()) => Ok("salvaged".to_owned()),
        Err(error) => match error.downcast::<ServiceError>() {
            Ok(error) if error.is_temporary() => Err(error),
            Ok(error) => Ok(format!("files refused: {error}")),
            Err(error) => Ok(format!("no archive: {error:#}")),
        },
    }
}

/// Removes the oldest folders that were handed in.
fn prune(folder: &Path) {
    let modified = |path: &PathBuf| {
        fs::metadata(path.join(DELIVERED_MARK))
            .and_then(|mark| mark.modified())
            .ok()
    };
    let mut done: Vec<_> = run_folders(folder)
        .into_iter()
        .filter_map(|path| Some((modified(&path)?, path)))
        .collect();
    done.sort();
    let excess = done.len().saturating_sub(KEPT_FOLDERS);
    for (_, path) in done.into_iter().take(excess) {
        if let Err(error) = fs::remove_dir_all(&path) {
            tracing::warn!(folder = %path.display(), %error, "an old run cannot be removed");
        }
    }
}
