//! Objects on disk: complete and durable, or absent.

use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use store::FileRecord;

/// An object that is about to be written.
#[derive(Debug)]
pub struct NewObject<'a> {
    /// Name inside the run's archive.
    pub name: &'a str,
    pub media_type: &'a str,
    /// Relative to the object folder.
    pub object_path: &'a str,
    pub bytes: &'a [u8],
}

/// Writes aside, syncs, renames, syncs the folder. Blocks; call on a thread for blocking work.
pub fn write(objects: &Path, new: &NewObject<'_>) -> io::Result<FileRecord> {
    let path = objects.join(new.object_path);
    let folder = path
        .parent()
        .ok_or_else(|| io::Error::other("an object lies in a folder"))?;
    create_folders(folder)?;
    let aside = folder.join(format!(".{}.tmp", uuid::Uuid::now_v7().simple()));
    let written = write_aside(&aside, new.bytes).and_then(|()| fs::rename(&aside, &path));
    if written.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&aside);
    }
    written?;
    File::open(folder)?.sync_all()?;
    Ok(FileRecord {
        name: new.name.to_owned(),
        bytes: i64::try_from(new.bytes.len()).map_err(io::Error::other)?,
        sha256: Sha256::digest(new.bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect(),
        media_type: new.media_type.to_owned(),
        object_path: new.object_path.to_owned(),
    })
}

fn write_aside(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create_new(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

/// Makes missing folders and syncs the parent of each, so that they outlive a power cut.
fn create_folders(folder: &Path) -> io::Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    let parent = folder
        .parent()
        .ok_or_else(|| io::Error::other("a folder has a parent"))?;
    create_folders(parent)?;
    match fs::create_dir(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => Err(error),
        _ => File::open(parent)?.sync_all(),
    }
}
