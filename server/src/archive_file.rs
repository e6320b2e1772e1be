//! Making `archive.zip` out of an attempt's files: same members, same bytes. Blocks; no database, no HTTP.

use crate::app::error::AppError;
use crate::objects::{self, ObjectFolder};
use api::run::FileView;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::fs::File;
use std::io::{BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};
use store::FileRecord;
use uuid::Uuid;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// First member of every archive.
pub const MANIFEST: &str = "manifest.json";
/// Already packed; deflate would only cost time.
const PACKED: [&str; 5] = ["mcap", "parquet", "png", "mp4", "zip"];

/// A finished archive on disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArchiveFile {
    pub path: PathBuf,
    pub sha256: String,
}

/// What goes into an archive.
#[derive(Debug, Clone)]
pub struct Contents {
    pub run: Uuid,
    pub epoch: i64,
    pub files: Vec<FileRecord>,
}

/// Stands beside the archive: which members it was made of and its own digest.
#[derive(Debug, Serialize, Deserialize)]
struct Sidecar {
    members_sha256: String,
    bytes: u64,
    sha256: String,
}

/// Made only when the laboratory's own manifest never arrived, so that what did arrive can still be had.
#[derive(Debug, Serialize)]
struct ServiceManifest<'a> {
    format: &'static str,
    run_id: Uuid,
    epoch: i64,
    complete: bool,
    made_by: &'static str,
    files: &'a [FileView],
}

impl Contents {
    /// The archive of exactly these files, built if it is missing, outdated or damaged.
    pub fn archive(&self, objects: &ObjectFolder) -> Result<ArchiveFile, AppError> {
        let folder = objects.attempt(self.run, self.epoch);
        let (path, sidecar_path) = (folder.join("archive.zip"), folder.join("archive.json"));
        if let Some(sidecar) = self.sidecar(&sidecar_path) {
            match objects::sha256_of(&path) {
                Ok((bytes, sha256)) if bytes == sidecar.bytes && sha256 == sidecar.sha256 => {
                    return Ok(ArchiveFile { path, sha256 });
                }
                _ => {
                    tracing::warn!(run.id = %self.run, epoch = self.epoch, "archive is missing or damaged; building it again")
                }
            }
        }
        let temporary = objects.temporary();
        let built = self.write(objects, &temporary);
        if built.is_err() {
            let _best_effort = std::fs::remove_file(&temporary);
        }
        built?;
        let (bytes, sha256) = objects::sha256_of(&temporary)?;
        objects.publish(&temporary, &path)?;
        let sidecar = Sidecar {
            members_sha256: self.members_sha256(),
            bytes,
            sha256: sha256.clone(),
        };
        let text = serde_json::to_string(&sidecar).map_err(|error| AppError::Internal(error.to_string()))?;
        std::fs::write(&temporary, text)?;
        objects.publish(&temporary, &sidecar_path)?;
        Ok(ArchiveFile { path, sha256 })
    }

    fn sidecar(&self, path: &Path) -> Option<Sidecar> {
        let sidecar: Sidecar = serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()?;
        (sidecar.members_sha256 == self.members_sha256()).then_some(sidecar)
    }

    /// Members in their order in the archive: the manifest, then by name.
    fn members(&self) -> Vec<&FileRecord> {
        let mut members: Vec<_> = self.files.iter().collect();
        members.sort_by(|a, b| (a.name != MANIFEST, &a.name).cmp(&(b.name != MANIFEST, &b.name)));
        members
    }

    fn members_sha256(&self) -> String {
        let mut hasher = Sha256::new();
        for member in self.members() {
            hasher.update(format!("{}\n{}\n{}\n", member.name, member.bytes, member.sha256));
        }
        objects::hex(&hasher.finalize())
    }

    fn write(&self, objects: &ObjectFolder, target: &Path) -> Result<(), AppError> {
        let mut zip = ZipWriter::new(BufWriter::new(File::create_new(target)?));
        let members = self.members();
        if members.first().is_none_or(|member| member.name != MANIFEST) {
            let views: Vec<_> = self.files.iter().map(view).collect();
            let manifest = ServiceManifest {
                format: "robopheus.archive/1",
                run_id: self.run,
                epoch: self.epoch,
                complete: false,
                made_by: "service",
                files: &views,
            };
            let text = serde_json::to_vec_pretty(&manifest).map_err(|error| AppError::Internal(error.to_string()))?;
            zip.start_file(MANIFEST, options(MANIFEST, text.len() as u64))
                .map_err(zip_error)?;
            zip.write_all(&text)?;
        }
        for member in members {
            add(&mut zip, objects, member)?;
        }
        let mut file = zip.finish().map_err(zip_error)?;
        file.flush()?;
        Ok(())
    }
}

/// Copies one member and checks its bytes against the database on the way.
fn add<W: Write + std::io::Seek>(
    zip: &mut ZipWriter<W>,
    objects: &ObjectFolder,
    member: &FileRecord,
) -> Result<(), AppError> {
    let damaged = || AppError::Corrupt {
        what: member.name.clone(),
    };
    let mut file = File::open(objects.path_of(&member.object_path)?).map_err(|_| damaged())?;
    zip.start_file(&member.name, options(&member.name, file.metadata()?.len()))
        .map_err(zip_error)?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 128 * 1024];
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            break;
        }
        hasher.update(&buffer[..count]);
        zip.write_all(&buffer[..count])?;
    }
    if objects::hex(&hasher.finalize()) == member.sha256 {
        Ok(())
    } else {
        Err(damaged())
    }
}

/// The wire view of a stored file.
pub fn view(file: &FileRecord) -> FileView {
    FileView {
        name: file.name.clone(),
        bytes: file.bytes,
        sha256: file.sha256.clone(),
        media_type: file.media_type.clone(),
    }
}

/// No clock and no modes of this machine: the same members give the same archive.
fn options(name: &str, bytes: u64) -> SimpleFileOptions {
    let packed = PACKED.contains(&name.rsplit('.').next().unwrap_or_default());
    let method = if packed {
        CompressionMethod::Stored
    } else {
        CompressionMethod::Deflated
    };
    SimpleFileOptions::default()
        .compression_method(method)
        .last_modified_time(zip::DateTime::default())
        .unix_permissions(0o644)
        .large_file(bytes > u64::from(u32::MAX) / 2)
}

fn zip_error(error: zip::result::ZipError) -> AppError {
    AppError::Internal(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contents(objects: &ObjectFolder, files: &[(&str, &[u8])]) -> Contents {
        let run = Uuid::now_v7();
        let mut views = Vec::new();
        for (name, bytes) in files {
            let temporary = objects.temporary();
            std::fs::write(&temporary, bytes).expect("temporary file");
            let (length, sha256) = objects::sha256_of(&temporary).expect("readable");
            let object_path = ObjectFolder::object_path(run, 1, name, &sha256);
            objects
                .publish(&temporary, &objects.path_of(&object_path).expect("inside"))
                .expect("published");
            views.push(FileRecord {
                object_path,
                name: (*name).to_owned(),
                bytes: i64::try_from(length).expect("small"),
                sha256,
                media_type: objects::media_type(name).to_owned(),
            });
        }
        Contents {
            run,
            epoch: 1,
            files: views,
        }
    }

    fn folder() -> (PathBuf, ObjectFolder) {
        let root = std::env::temp_dir().join(format!("robopheus-archive-{}", Uuid::now_v7()));
        (root.clone(), ObjectFolder::open(root).expect("folder"))
    }

    #[test]
    fn the_manifest_comes_first_and_two_builds_are_equal() {
        let (root, objects) = folder();
        let contents = contents(
            &objects,
            &[
                ("log.txt", b"hello"),
                ("manifest.json", b"{}"),
                ("robots/a/run.json", b"[]"),
            ],
        );
        let first = contents.archive(&objects).expect("built");
        std::fs::remove_file(&first.path).expect("removed");
        assert_eq!(contents.archive(&objects).expect("built again"), first);
        let mut zip = zip::ZipArchive::new(File::open(&first.path).expect("there")).expect("a zip");
        let names: Vec<_> = (0..zip.len())
            .map(|i| zip.by_index(i).expect("member").name().expect("name").into_owned())
            .collect();
        assert_eq!(names, ["manifest.json", "log.txt", "robots/a/run.json"]);
        std::fs::remove_dir_all(root).expect("cleared");
    }

    #[test]
    fn a_flipped_bit_in_a_member_is_found_and_one_in_the_archive_is_healed() {
        let (root, objects) = folder();
        let contents = contents(&objects, &[("manifest.json", b"{}"), ("log.txt", b"a line of the log")]);
        let good = contents.archive(&objects).expect("built");
        let mut bytes = std::fs::read(&good.path).expect("read");
        for position in (0..bytes.len()).step_by(7) {
            bytes[position] ^= 1;
            std::fs::write(&good.path, &bytes).expect("written");
            bytes[position] ^= 1;
            assert_eq!(contents.archive(&objects).expect("healed"), good);
            assert_eq!(std::fs::read(&good.path).expect("read"), bytes);
        }
        let log = contents
            .files
            .iter()
            .find(|file| file.name == "log.txt")
            .expect("there");
        std::fs::write(objects.path_of(&log.object_path).expect("inside"), b"a line of the lag").expect("damaged");
        std::fs::remove_file(&good.path).expect("removed");
        assert!(matches!(contents.archive(&objects), Err(AppError::Corrupt { what }) if what == "log.txt"));
        std::fs::remove_dir_all(root).expect("cleared");
    }

    #[test]
    fn files_without_a_manifest_can_still_be_had_and_say_so() {
        let (root, objects) = folder();
        let contents = contents(&objects, &[("log.txt", b"cut off")]);
        let archive = contents.archive(&objects).expect("built");
        let mut zip = zip::ZipArchive::new(File::open(archive.path).expect("there")).expect("a zip");
        let manifest: serde_json::Value = serde_json::from_reader(zip.by_index(0).expect("first")).expect("JSON");
        assert_eq!(manifest["complete"], false);
        assert_eq!(manifest["files"][0]["name"], "log.txt");
        std::fs::remove_dir_all(root).expect("cleared");
    }
}
