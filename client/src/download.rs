//! Downloads that resume and are checked.

use crate::{Client, ClientError};
use futures_util::StreamExt;
use reqwest::{Method, StatusCode, header};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use uuid::Uuid;

/// Times a broken download is taken up again before giving up.
const ATTEMPTS: u32 = 5;

/// Bytes so far and in all, as far as known.
#[derive(Debug, Clone, Copy)]
pub struct DownloadProgress {
    pub received_bytes: u64,
    pub total_bytes: Option<u64>,
}

/// A complete, verified archive on disk.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Download {
    pub path: PathBuf,
    pub bytes: u64,
    /// Members whose SHA-256 was compared with the manifest inside.
    pub files_checked: usize,
    /// False when the run was cut off and the archive holds what was saved.
    pub complete: bool,
}

#[derive(serde::Deserialize)]
struct Manifest {
    complete: bool,
    files: Vec<ManifestFile>,
}

#[derive(serde::Deserialize)]
struct ManifestFile {
    name: String,
    sha256: String,
}

impl Client {
    /// Fetches a run's archive into `path`, resuming a partial file, and checks every member against the manifest.
    ///
    /// - `progress` is called after each piece.
    /// - Errors: [`ClientError::Damaged`] if a member's digest differs; the file is then left for inspection.
    pub async fn run_archive_fetch(
        &self,
        id: Uuid,
        path: &Path,
        mut progress: impl FnMut(DownloadProgress),
    ) -> Result<Download, ClientError> {
        let partial = path.with_extension("zip.part");
        let mut entity = None;
        let mut attempt = 1;
        loop {
            match self.archive_piece(id, &partial, &mut entity, &mut progress).await {
                Ok(()) => break,
                Err(ClientError::Unreachable { .. }) if attempt < ATTEMPTS => attempt += 1,
                Err(error) => return Err(error),
            }
        }
        std::fs::rename(&partial, path).map_err(|e| ClientError::file(path, e))?;
        archive_check(path)
    }

    async fn archive_piece(
        &self,
        id: Uuid,
        partial: &Path,
        entity: &mut Option<String>,
        progress: &mut impl FnMut(DownloadProgress),
    ) -> Result<(), ClientError> {
        // A part left by an earlier call belongs to an unknown version: only what this call began is resumed.
        let have = if entity.is_some() {
            std::fs::metadata(partial).map_or(0, |m| m.len())
        } else {
            0
        };
        let mut builder = self.request(Method::GET, &format!("/runs/{id}/archive"));
        if let (true, Some(tag)) = (have > 0, entity.as_ref()) {
            builder = builder
                .header(header::RANGE, format!("bytes={have}-"))
                .header(header::IF_RANGE, tag);
        }
        let response = self.send(builder).await?;
        let resumed = response.status() == StatusCode::PARTIAL_CONTENT;
        *entity = response
            .headers()
            .get(header::ETAG)
            .and_then(|v| v.to_str().ok())
            .map(str::to_owned);
        let start = if resumed { have } else { 0 };
        let total_bytes = response.content_length().map(|rest| rest + start);
        let url = response.url().to_string();
        let mut file = OpenOptions::new()
            .create(true)
            .write(true)
            .append(resumed)
            .truncate(!resumed)
            .open(partial)
            .map_err(|e| ClientError::file(partial, e))?;
        let mut received_bytes = start;
        let mut stream = response.bytes_stream();
        while let Some(piece) = stream.next().await {
            let piece = piece.map_err(|source| ClientError::Unreachable {
                url: url.clone(),
                source,
            })?;
            file.write_all(&piece).map_err(|e| ClientError::file(partial, e))?;
            received_bytes += piece.len() as u64;
            progress(DownloadProgress {
                received_bytes,
                total_bytes,
            });
        }
        file.sync_all().map_err(|e| ClientError::file(partial, e))
    }
}

/// Compares every member of a run archive with the manifest inside it.
fn archive_check(path: &Path) -> Result<Download, ClientError> {
    let not_an_archive = |detail: String| ClientError::NotAnArchive {
        file: path.display().to_string(),
        detail,
    };
    let file = File::open(path).map_err(|e| ClientError::file(path, e))?;
    let bytes = file.metadata().map_err(|e| ClientError::file(path, e))?.len();
    let mut archive = zip::ZipArchive::new(file).map_err(|e| not_an_archive(e.to_string()))?;
    let manifest: Manifest = {
        let member = archive
            .by_name("manifest.json")
            .map_err(|e| not_an_archive(e.to_string()))?;
        serde_json::from_reader(member).map_err(|e| not_an_archive(format!("manifest.json: {e}")))?
    };
    let expected: BTreeMap<_, _> = manifest
        .files
        .iter()
        .map(|f| (f.name.as_str(), f.sha256.as_str()))
        .collect();
    for (name, sha256) in &expected {
        let mut member = archive
            .by_name(name)
            .map_err(|e| not_an_archive(format!("{name}: {e}")))?;
        let found = sha256_of(&mut member).map_err(|e| not_an_archive(format!("{name}: {e}")))?;
        if found != *sha256 {
            return Err(ClientError::Damaged {
                file: (*name).into(),
                expected: (*sha256).into(),
                found,
            });
        }
    }
    Ok(Download {
        path: path.to_owned(),
        bytes,
        files_checked: expected.len(),
        complete: manifest.complete,
    })
}

fn sha256_of(reader: &mut impl Read) -> std::io::Result<String> {
    let mut hash = Sha256::new();
    let mut buffer = vec![0_u8; 64 * 1024];
    loop {
        let count = reader.read(&mut buffer)?;
        if count == 0 {
            return Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect());
        }
        hash.update(&buffer[..count]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zip::write::SimpleFileOptions;

    fn archive(folder: &Path, log: &[u8], sha256: &str) -> PathBuf {
        let path = folder.join("run.zip");
        let mut zip = zip::ZipWriter::new(File::create(&path).unwrap());
        zip.start_file("manifest.json", SimpleFileOptions::default()).unwrap();
        let manifest = serde_json::json!({"format": "robopheus.archive/1", "complete": true,
            "files": [{"name": "log.txt", "bytes": log.len(), "sha256": sha256}]});
        zip.write_all(manifest.to_string().as_bytes()).unwrap();
        zip.start_file("log.txt", SimpleFileOptions::default()).unwrap();
        zip.write_all(log).unwrap();
        zip.finish().unwrap();
        path
    }

    #[test]
    fn a_changed_member_is_reported_with_both_digests() {
        let folder = std::env::temp_dir().join(format!("robopheus-client-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        // SHA-256 of "abc", FIPS 180-2 appendix B.1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let good = archive_check(&archive(&folder, b"abc", abc)).unwrap();
        assert_eq!((good.files_checked, good.complete), (1, true));
        let bad = archive_check(&archive(&folder, b"abd", abc)).unwrap_err();
        assert!(
            matches!(bad, ClientError::Damaged { ref file, .. } if file == "log.txt"),
            "{bad}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
