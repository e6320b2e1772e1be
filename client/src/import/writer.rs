//! Bundles on disk: written beside their place, moved there when everything is whole.

use anyhow::{Context, ensure};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// A folder that vanishes unless it is kept.
pub struct Draft {
    folder: PathBuf,
    goal: PathBuf,
    kept: bool,
}

impl Draft {
    /// - Errors: the goal exists, or its parent does not.
    pub fn new(goal: &Path) -> anyhow::Result<Draft> {
        ensure!(!goal.exists(), "{} exists; name a new folder", goal.display());
        let parent = match goal.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let name = goal.file_name().context("the output needs a name")?.to_string_lossy();
        let folder = parent.join(format!(".{name}.part-{}", std::process::id()));
        if folder.exists() {
            std::fs::remove_dir_all(&folder)?;
        }
        std::fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
        Ok(Draft {
            folder,
            goal: goal.to_owned(),
            kept: false,
        })
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Moves it to its place.
    pub fn keep(mut self) -> anyhow::Result<()> {
        File::open(&self.folder)?.sync_all()?;
        std::fs::rename(&self.folder, &self.goal)
            .with_context(|| format!("cannot move the bundle to {}", self.goal.display()))?;
        self.kept = true;
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.kept {
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }
}

/// Telemetry of one run, row by row.
pub struct Rows {
    file: BufWriter<File>,
    text: String,
    pub rows: u64,
    pub bytes: u64,
    pub last_s: f64,
}

impl Rows {
    /// - `names`: the columns after `time_s`.
    pub fn create(folder: &Path, names: &[String]) -> anyhow::Result<Rows> {
        std::fs::create_dir_all(folder)?;
        let path = folder.join("telemetry.csv");
        let file = File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
        let mut rows = Rows {
            file: BufWriter::with_capacity(1 << 16, file),
            text: String::new(),
            rows: 0,
            bytes: 0,
            last_s: 0.0,
        };
        rows.text.push_str("time_s");
        for name in names {
            rows.text.push(',');
            rows.text.push_str(name);
        }
        rows.flush_line()?;
        Ok(rows)
    }

    /// One row; empty where there is no sample.
    pub fn push(&mut self, time_s: f64, values: &[Option<f64>]) -> anyhow::Result<()> {
        // Writing to a string cannot fail.
        let _ = write!(self.text, "{time_s}");
        for value in values {
            self.text.push(',');
            if let Some(value) = value {
                let _ = write!(self.text, "{value}");
            }
        }
        self.rows += 1;
        self.last_s = time_s;
        self.flush_line()
    }

    fn flush_line(&mut self) -> anyhow::Result<()> {
        self.text.push('\n');
        self.file
            .write_all(self.text.as_bytes())
            .context("cannot write telemetry.csv")?;
        self.bytes += self.text.len() as u64;
        self.text.clear();
        Ok(())
    }

    /// The table is whole.
    pub fn close(self) -> anyhow::Result<()> {
        let file = self.file.into_inner().map_err(std::io::IntoInnerError::into_error)?;
        Ok(file.sync_all()?)
    }
}
