//! `robopheus-learning`: the learning server. It learns every robot of a run while the run goes on, tells the hub how well robots are
//! predicted, and hands versions that turned out better to the service.

use anyhow::{Context, Result};
use clap::Parser;
use lab::backoff::Backoff;
use lab::begin::begin;
use lab::learning::{LearningRun, Lesson};
use lab::record::Record;
use lab::service::Service;
use lab::subscription;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Lessons that wait for the service; more are lost, and said to be.
const WAITING_LESSONS: usize = 64;
/// Attempts to hand a version in.
const ATTEMPTS: u32 = 8;

/// Learns robots' models beside their runs.
#[derive(Debug, Parser)]
#[command(name = "robopheus-learning", version)]
struct Settings {
    /// Address of the laboratory's hub; what `<data>/lab-hub.addr` says when left out.
    #[arg(long)]
    hub: Option<String>,
    /// Data folder of the laboratory.
    #[arg(long, env = "ROBOPHEUS_DATA", default_value = "data")]
    data: PathBuf,
    /// Address of the service. Without it versions are logged and forgotten.
    #[arg(long, env = "ROBOPHEUS_SERVER", requires = "token_file")]
    server: Option<String>,
    /// File with the bearer token of the role `lab`.
    #[arg(long, env = "ROBOPHEUS_LAB_TOKEN_FILE")]
    token_file: Option<PathBuf>,
}

fn main() -> Result<()> {
    let settings: Settings = begin()?;
    let service = match (&settings.server, &settings.token_file) {
        (Some(server), Some(file)) => {
            let token = std::fs::read_to_string(file).with_context(|| format!("read the token {}", file.display()))?;
            Some(Service::new(server, &token)?)
        }
        _ => None,
    };
    let (lessons, waiting) = sync_channel(WAITING_LESSONS);
    std::thread::Builder::new()
        .name("versions".to_owned())
        .spawn(move || hand_in(service.as_ref(), &waiting))?;
    subscription::keep(settings.hub.as_deref(), &settings.data, |stream| {
        follow(stream, &lessons)
    });
    Ok(())
}

/// Run after run, until the hub is gone.
fn follow(mut stream: TcpStream, lessons: &SyncSender<Lesson>) -> Result<()> {
    let reader = BufReader::new(stream.try_clone()?);
    let mut run = LearningRun::default();
    for line in reader.lines() {
        let line = line?;
        // Words about lost lines are no records.
        let Ok(record) = serde_json::from_str::<Record>(&line) else {
            tracing::warn!(line, "not a record: nothing of this run is kept");
            run.lost();
            continue;
        };
        let heard = run.take(&record);
        for problem in heard.problems {
            tracing::warn!(problem, "not learned");
        }
        if let Some(word) = heard.word {
            let mut line = serde_json::to_vec(&Record::Learning(word))?;
            line.push(b'\n');
            stream.write_all(&line)?;
        }
        for lesson in heard.lessons {
            tell(&lesson);
            if lessons.try_send(lesson).is_err() {
                tracing::error!("too many versions wait for the service: one is lost");
            }
        }
    }
    Ok(())
}

fn tell(lesson: &Lesson) {
    let closing = &lesson.closing;
    let [parent_mm, learnt_mm] = [closing.parent_rms_m, closing.learnt_rms_m].map(|error_m| 1e3 * error_m);
    tracing::info!(
        run.id = %lesson.run_id,
        robot = lesson.robot,
        predictions = closing.predictions,
        discarded = lesson.discarded,
        better = closing.is_better,
        "learned: 0.5 s ahead {parent_mm:.1} mm -> {learnt_mm:.1} mm in the last third"
    );
}

/// Hands versions to the service, one after the other, until the process ends.
fn hand_in(service: Option<&Service>, lessons: &Receiver<Lesson>) {
    let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return tracing::error!(%error, "no versions are handed in"),
    };
    while let Ok(lesson) = lessons.recv() {
        let (Some(version), Some(service)) = (&lesson.version, service) else {
            continue;
        };
        let mut backoff = Backoff::default();
        for attempt in 1..=ATTEMPTS {
            match runtime.block_on(service.learned(lesson.run_id, version)) {
                Ok(view) => {
                    tracing::info!(version = view.version, robot = lesson.robot, "version handed in");
                    break;
                }
                Err(error) if error.is_temporary() && attempt < ATTEMPTS => {
                    tracing::warn!(%error, attempt, "the version waits");
                    std::thread::sleep(backoff.next_wait());
                }
                Err(error) => {
                    tracing::error!(%error, robot = lesson.robot, "the version is lost");
                    break;
                }
            }
        }
    }
}
