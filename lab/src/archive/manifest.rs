//! `manifest.json`: what an archive holds, whether it is all there, and how punctual the loop was.

use super::stages::Stages;
use crate::edge::Edge;
use crate::realtime::Realtime;
use api::run::{Fault, RunState};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use uuid::Uuid;

/// Version of the layout.
pub const FORMAT: &str = "robopheus.archive/1";
/// Name of the manifest inside the archive.
pub const FILE_NAME: &str = "manifest.json";
/// Two ticks closer than this are bunched.
pub const BUNCHED_US: i64 = 4000;

/// Last file written; lists all the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Always [`FORMAT`].
    pub format: String,
    pub run_id: Uuid,
    pub epoch: i64,
    /// The record reaches from the start to an orderly end with nothing dropped.
    pub complete: bool,
    /// How the run ended, as far as the laboratory knows.
    pub state: Option<RunState>,
    pub fault: Option<Fault>,
    pub files: Vec<FileEntry>,
    pub ticks_recorded: i64,
    pub ticks_missed: i64,
    pub tick_jitter: TickJitter,
    /// How long each stage from light to command took.
    #[serde(default)]
    pub stages: Stages,
    /// What came in at the laboratory's edge during the run, used or not; absent in a virtual run and in one that was cut off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<Edge>,
}

/// One file of the archive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Path inside the archive with `/`.
    pub name: String,
    pub bytes: u64,
    /// Lower-case hexadecimal.
    pub sha256: String,
}

/// Lateness of the control loop beside the machine's own: plain sleeps of one tick in another thread.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TickJitter {
    pub late_p50_ms: f64,
    pub late_p99_ms: f64,
    pub late_max_ms: f64,
    /// Pairs of ticks that started less than 4 ms apart.
    pub bunched: u64,
    /// Work of a tick, from waking to the last frame sent.
    pub work_p99_ms: f64,
    pub sleep_samples: u64,
    pub sleep_late_p50_ms: f64,
    pub sleep_late_p99_ms: f64,
    pub sleep_late_max_ms: f64,
    pub realtime: Option<Realtime>,
}

/// Size and hash of a file.
pub fn describe(folder: &Path, name: &str) -> io::Result<FileEntry> {
    let mut file = File::open(folder.join(name))?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 64 << 10];
    let mut bytes = 0;
    loop {
        let read = file.read(&mut buffer)?;
        let Some(part) = buffer.get(..read).filter(|part| !part.is_empty()) else {
            break;
        };
        hash.update(part);
        bytes += read as u64;
    }
    Ok(FileEntry {
        name: name.to_owned(),
        bytes,
        sha256: hex(&hash.finalize()),
    })
}

/// Lower-case hexadecimal.
fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a String cannot fail.
        let _infallible = write!(text, "{byte:02x}");
        text
    })
}
