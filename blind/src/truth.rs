//! The sealed truth: written and hashed before the namer sees anything.

use crate::effects::Truth;
use crate::kind::Kind;
use crate::oracle::Visible;
use crate::set::{Driven, Known, Set};
use crate::telemetry::hex;
use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What a set really is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sealed {
    pub set: u64,
    pub seed: u64,
    pub kind: Kind,
    pub chassis: String,
    pub known: Vec<Known>,
    pub unknown: Option<String>,
    pub unknown_visible: Option<Visible>,
    /// Of every bundle, in the order in which the namer gets them.
    pub bundles: Vec<String>,
}

impl Sealed {
    pub fn new(set: &Set, driven: &Driven) -> Sealed {
        Sealed {
            set: set.number,
            seed: set.seed,
            kind: set.kind,
            chassis: set.chassis.clone(),
            known: driven.known.clone(),
            unknown: set.unknown.clone(),
            unknown_visible: driven.unknown.clone(),
            bundles: driven
                .references
                .iter()
                .chain(&driven.runs)
                .map(|run| run.sha256.clone())
                .collect(),
        }
    }

    /// The file's text and its SHA-256.
    ///
    /// - Errors: a number that JSON cannot hold.
    pub fn text(&self) -> Result<(String, String)> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        let seal = hex(&Sha256::digest(text.as_bytes()));
        Ok((text, seal))
    }

    /// The effects as the library describes them best.
    pub fn truths(&self) -> impl Iterator<Item = &Truth> {
        self.known.iter().map(|known| &known.best)
    }
}

/// Folder of truths and the list of their seals.
pub struct Vault {
    folder: PathBuf,
}

impl Vault {
    pub fn new(out: &Path) -> Result<Vault> {
        let folder = out.join("truth");
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(Vault { folder })
    }

    fn path(&self, set: u64) -> PathBuf {
        self.folder.join(format!("{set:06}.json"))
    }

    /// Writes a truth and its seal; returns the seal.
    pub fn seal(&self, sealed: &Sealed) -> Result<String> {
        let (text, seal) = sealed.text()?;
        fs::write(self.path(sealed.set), text)?;
        let mut seals = fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(self.folder.join("seals.txt"))?;
        writeln!(seals, "{seal}  {:06}.json", sealed.set)?;
        seals.sync_all()?;
        Ok(seal)
    }

    /// Opens a truth again.
    ///
    /// - Errors: it is not what was sealed.
    pub fn open(&self, set: u64, seal: &str) -> Result<Sealed> {
        let text = fs::read(self.path(set))?;
        let found = hex(&Sha256::digest(&text));
        ensure!(
            found == seal,
            "truth of set {set} was changed after it was sealed: {found}, sealed {seal}"
        );
        Ok(serde_json::from_slice(&text)?)
    }
}
