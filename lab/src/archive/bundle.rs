//! The archive builder: reads a journal once and writes all files beside each other, then shows them at once.

use super::manifest::{self, FileEntry, Manifest, TickJitter};
use super::mcap::{McapFile, WallClock};
use super::parquet::TelemetryTable;
use super::punctuality::Punctuality;
use super::stages::StageTimes;
use super::track::{self, Track};
use crate::edge::Edge;
use crate::journal::JournalReader;
use crate::notes;
use crate::record::{End, LogLevel, Record, Start};
use chrono::{DateTime, SecondsFormat, Utc};
use serde::Serialize;
use serde_json::json;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Why no archive could be made.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// Nothing in the journal says which run it was.
    #[error("the journal does not begin with a whole start record")]
    StartMissing,
    #[error("reading or writing files failed")]
    Io(#[from] io::Error),
    #[error("writing a document failed")]
    Json(#[from] serde_json::Error),
    #[error("writing run.mcap failed")]
    Mcap(#[from] ::mcap::McapError),
    #[error("writing telemetry failed")]
    Parquet(#[from] ::parquet::errors::ParquetError),
}

/// Builds the archive of the journal in `journal_folder` as folder `out`, replacing an earlier one.
///
/// The folder appears by a rename after all files are on disk; the manifest inside is written last.
pub fn build(journal_folder: &Path, out: &Path) -> Result<Manifest, ArchiveError> {
    let temporary = out.with_extension("tmp");
    for stale in [&temporary, &out.to_path_buf()] {
        if stale.exists() {
            fs::remove_dir_all(stale)?;
        }
    }
    let manifest = write_files(journal_folder, &temporary)?;
    fs::rename(&temporary, out)?;
    sync_folder(out.parent().unwrap_or(out))?;
    Ok(manifest)
}

fn write_files(journal_folder: &Path, folder: &Path) -> Result<Manifest, ArchiveError> {
    let mut journal = JournalReader::open(journal_folder)?;
    let Some(Record::Start(start)) = journal.next() else {
        return Err(ArchiveError::StartMissing);
    };
    let mut files = Files::create(folder, &start)?;
    let mut end = None;
    for record in journal.by_ref() {
        if files.tables.is_empty() {
            let start_us = match &record {
                Record::Motion(motion) => Some(motion.start_us),
                Record::End(_) => Some(start.at_us),
                _ => None,
            };
            let Some(start_us) = start_us else {
                // Robots on their way to their starts.
                files.take_before(&record)?;
                continue;
            };
            files.open_tables(&start, start_us)?;
        }
        files.take(&record)?;
        if let Record::End(record) = record {
            end = Some(record);
        }
    }
    if files.tables.is_empty() {
        files.open_tables(&start, start.at_us)?;
    }
    let whole = !journal.torn() && journal.unreadable() == 0;
    files.finish(&start, end.as_deref(), whole)
}

/// The files being written.
struct Files {
    folder: PathBuf,
    names: Vec<String>,
    clock: WallClock,
    mcap: McapFile,
    log: BufWriter<File>,
    tables: Vec<TelemetryTable>,
    track: Option<Track>,
    punctuality: Punctuality,
    stages: StageTimes,
    edge: Option<Edge>,
}

impl Files {
    fn create(folder: &Path, start: &Start) -> Result<Self, ArchiveError> {
        fs::create_dir_all(folder)?;
        let assignment = &start.assignment;
        let clock = WallClock::new(start.wall.timestamp_nanos_opt().unwrap_or(0), start.at_us);
        write_json(&folder.join("experiment.json"), &assignment.experiment)?;
        write_json(&folder.join("verdict.json"), &assignment.verdict)?;
        Ok(Self {
            mcap: McapFile::create(&folder.join("run.mcap"), assignment, clock)?,
            log: BufWriter::new(File::create(folder.join("log.txt"))?),
            names: ["experiment.json", "verdict.json", "log.txt", "run.mcap"]
                .map(str::to_owned)
                .to_vec(),
            folder: folder.to_owned(),
            clock,
            tables: Vec::new(),
            track: None,
            punctuality: Punctuality::default(),
            stages: StageTimes::default(),
            edge: None,
        })
    }

    fn open_tables(&mut self, start: &Start, start_us: i64) -> Result<(), ArchiveError> {
        self.track = Some(Track::new(&start.assignment.robots, start_us));
        for robot in &start.assignment.robots {
            let name = &robot.description.name;
            let place = format!("robots/{name}");
            fs::create_dir_all(self.folder.join(&place))?;
            let run = json!({
                "format": "robopheus.run/1",
                "robot": robot.description,
                "floor": start.assignment.arena.floor,
                "label": format!("run {} of {name}", start.assignment.run_id),
                "started": self.wall_text(start_us),
                "change_free_reference": false,
                "stamp": "sample",
            });
            write_json(&self.folder.join(&place).join("run.json"), &run)?;
            let table = self.folder.join(&place).join("telemetry.parquet");
            self.tables.push(TelemetryTable::create(
                &table,
                robot.number,
                &robot.description,
                start_us,
            )?);
            self.names
                .extend(["run.json", "telemetry.parquet"].map(|file| format!("{place}/{file}")));
        }
        Ok(())
    }

    /// Takes a record from before the start: it counts for `run.mcap` and the log, not for the run's figures and tables.
    fn take_before(&mut self, record: &Record) -> Result<(), ArchiveError> {
        self.mcap.take(record)?;
        self.take_edge(record);
        self.take_log(record)
    }

    fn take_edge(&mut self, record: &Record) {
        if let Record::Edge(edge) = record {
            self.edge = Some((**edge).clone());
        }
    }

    fn take_log(&mut self, record: &Record) -> Result<(), ArchiveError> {
        match record {
            Record::Log(line) => {
                let level = match line.level {
                    LogLevel::Info => "info",
                    LogLevel::Warning => "warning",
                    LogLevel::Error => "error",
                };
                writeln!(self.log, "{} {level} {}", self.wall_text(line.at_us), line.message)?;
            }
            Record::Notes(notes) => {
                for text in notes::lines(&notes.notes) {
                    writeln!(self.log, "{} info controller: {text}", self.wall_text(notes.at_us))?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn take(&mut self, record: &Record) -> Result<(), ArchiveError> {
        self.punctuality.take(record);
        self.stages.take(record);
        self.mcap.take(record)?;
        for table in &mut self.tables {
            table.take(record)?;
        }
        if let Some(track) = &mut self.track {
            track.take(record);
        }
        self.take_edge(record);
        self.take_log(record)
    }

    fn wall_text(&self, at_us: i64) -> String {
        let wall = DateTime::<Utc>::from_timestamp_nanos(i64::try_from(self.clock.ns(at_us)).unwrap_or(i64::MAX));
        wall.to_rfc3339_opts(SecondsFormat::Micros, true)
    }

    fn finish(mut self, start: &Start, end: Option<&End>, whole: bool) -> Result<Manifest, ArchiveError> {
        let (ticks_recorded, ticks_missed) = (self.punctuality.ticks(), self.punctuality.missed());
        let tick_jitter = self.punctuality.finish();
        let stages = self.stages.finish();
        write_ending(&mut self.log, end, whole)?;
        write_jitter(&mut self.log, ticks_recorded, ticks_missed, &tick_jitter)?;
        self.log.flush()?;
        self.mcap.finish()?;
        for table in self.tables {
            table.finish()?;
        }
        if let Some(track) = self.track {
            crate::durable::write(
                &self.folder.join(track::FILE_NAME),
                &serde_json::to_vec(&track.finish())?,
            )?;
        }
        let describe = |name: &String| -> io::Result<FileEntry> {
            File::open(self.folder.join(name))?.sync_all()?;
            manifest::describe(&self.folder, name)
        };
        let manifest = Manifest {
            format: manifest::FORMAT.to_owned(),
            run_id: start.assignment.run_id,
            epoch: start.assignment.epoch,
            complete: whole && end.is_some_and(|end| end.records_dropped == 0),
            state: end.map(|end| end.state),
            fault: end.and_then(|end| end.fault.clone()),
            files: self.names.iter().map(describe).collect::<io::Result<_>>()?,
            ticks_recorded,
            ticks_missed,
            tick_jitter,
            stages,
            edge: self.edge,
        };
        write_json(&self.folder.join(manifest::FILE_NAME), &manifest)?;
        for robot in &start.assignment.robots {
            sync_folder(&self.folder.join("robots").join(&robot.description.name))?;
        }
        sync_folder(&self.folder)?;
        Ok(manifest)
    }
}

fn write_ending(log: &mut impl Write, end: Option<&End>, whole: bool) -> io::Result<()> {
    match end {
        Some(end) => {
            let why = end
                .fault
                .as_ref()
                .map(|fault| format!(": {} ({})", fault.message, fault.code))
                .unwrap_or_default();
            writeln!(log, "run ended as {}{why}", end.state.as_str())?;
            if end.records_dropped > 0 {
                writeln!(
                    log,
                    "{} records were lost because the recorder's queue was full",
                    end.records_dropped
                )?;
            }
        }
        None => writeln!(
            log,
            "the record ends here: the laboratory process stopped without ending the run"
        )?,
    }
    if !whole {
        writeln!(
            log,
            "the end of the journal was damaged; everything before it is in this archive"
        )?;
    }
    Ok(())
}

fn write_jitter(log: &mut impl Write, recorded: i64, missed: i64, jitter: &TickJitter) -> io::Result<()> {
    writeln!(
        log,
        "ticks: {recorded} recorded, {missed} missed, {} bunched (< 4 ms apart)",
        jitter.bunched
    )?;
    writeln!(
        log,
        "loop lateness: p50 {:.3} ms, p99 {:.3} ms, max {:.3} ms; work of a tick p99 {:.3} ms; plain 8.33 ms sleeps on this machine late by p50 {:.3} ms, p99 {:.3} ms, max {:.3} ms ({} samples)",
        jitter.late_p50_ms,
        jitter.late_p99_ms,
        jitter.late_max_ms,
        jitter.work_p99_ms,
        jitter.sleep_late_p50_ms,
        jitter.sleep_late_p99_ms,
        jitter.sleep_late_max_ms,
        jitter.sleep_samples,
    )
}

fn write_json(path: &Path, document: &impl Serialize) -> Result<(), ArchiveError> {
    let mut file = File::create(path)?;
    file.write_all(&serde_json::to_vec_pretty(document)?)?;
    file.sync_all()?;
    Ok(())
}

fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}
