//! `<data>/up.json`: what is running, for programs that want to know.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::Serialize;

use super::ports::Ports;

/// Writes the file whole each time, so that a reader never sees half of it.
pub struct Record {
    file: PathBuf,
    data: PathBuf,
    server: String,
    lab_stop: String,
    robot_udp_base: u16,
}

#[derive(Serialize)]
struct Row<'a> {
    server: &'a str,
    lab_stop: &'a str,
    robot_udp_base: u16,
    data: &'a Path,
    pids: &'a BTreeMap<&'static str, u32>,
}

impl Record {
    pub fn new(data: &Path, ports: &Ports) -> Self {
        Self {
            file: data.join("up.json"),
            data: data.to_path_buf(),
            server: format!("http://127.0.0.1:{}", ports.server),
            lab_stop: format!("http://127.0.0.1:{}", ports.lab_stop),
            robot_udp_base: ports.robot_udp_base,
        }
    }

    /// Replaces the file.
    pub fn write(&self, pids: &BTreeMap<&'static str, u32>) -> Result<()> {
        let row = Row {
            server: &self.server,
            lab_stop: &self.lab_stop,
            robot_udp_base: self.robot_udp_base,
            data: &self.data,
            pids,
        };
        let next = self.file.with_extension("json.next");
        fs::write(&next, serde_json::to_vec_pretty(&row)?).with_context(|| format!("write {}", next.display()))?;
        fs::rename(&next, &self.file).with_context(|| format!("write {}", self.file.display()))
    }

    /// Removes the file: nothing runs.
    pub fn remove(&self) {
        fs::remove_file(&self.file).ok();
    }

    /// Address in the file of a data folder.
    pub fn server_in(data: &Path) -> Option<String> {
        let value: serde_json::Value = serde_json::from_slice(&fs::read(data.join("up.json")).ok()?).ok()?;
        Some(value.get("server")?.as_str()?.to_owned())
    }
}
