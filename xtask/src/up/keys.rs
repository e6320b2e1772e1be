//! Keys of the robot links: one per robot, made once, readable by their owner only.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use anyhow::{Context, Result};
use serde::Deserialize;

const KEY_BYTES: usize = 16;

#[derive(Deserialize)]
struct Lab {
    robots: Vec<LabRobot>,
}

#[derive(Deserialize)]
struct LabRobot {
    number: u32,
}

/// Writes a key for every robot of the laboratory that has none yet; existing keys stay.
pub fn make_missing(file: &Path, lab: &Path) -> Result<()> {
    let text = fs::read(lab).with_context(|| format!("read {}", lab.display()))?;
    let lab: Lab = serde_json::from_slice(&text).with_context(|| format!("robots in {}", lab.display()))?;
    let mut keys = read(file)?;
    let before = keys.len();
    for robot in &lab.robots {
        if let std::collections::btree_map::Entry::Vacant(place) = keys.entry(robot.number.to_string()) {
            place.insert(random_key()?);
        }
    }
    if keys.len() == before {
        return Ok(());
    }
    let next = file.with_extension("json.next");
    fs::remove_file(&next).ok();
    let mut output = OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(&next)?;
    output.write_all(&serde_json::to_vec_pretty(&keys)?)?;
    output.sync_all()?;
    fs::rename(&next, file).with_context(|| format!("write {}", file.display()))
}

fn read(file: &Path) -> Result<BTreeMap<String, String>> {
    match fs::read(file) {
        Ok(text) => serde_json::from_slice(&text).with_context(|| format!("keys in {}", file.display())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(BTreeMap::new()),
        Err(error) => Err(error).with_context(|| format!("read {}", file.display())),
    }
}

fn random_key() -> Result<String> {
    let mut bytes = [0_u8; KEY_BYTES];
    File::open("/dev/urandom")
        .and_then(|mut source| source.read_exact(&mut bytes))
        .context("read /dev/urandom")?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::MetadataExt;

    #[test]
    fn keys_are_private_differ_and_stay() {
        let folder = std::env::temp_dir().join(format!("xtask-keys-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let (file, lab) = (folder.join("link-keys.json"), folder.join("lab.json"));
        fs::write(&lab, r#"{"robots":[{"number":1},{"number":2}]}"#).unwrap();
        make_missing(&file, &lab).unwrap();
        let first = read(&file).unwrap();
        assert_eq!(file.metadata().unwrap().mode() & 0o777, 0o600);
        assert_eq!(first.keys().collect::<Vec<_>>(), ["1", "2"]);
        assert!(first["1"] != first["2"] && first["1"].len() == 2 * KEY_BYTES);
        fs::write(&lab, r#"{"robots":[{"number":2},{"number":7}]}"#).unwrap();
        make_missing(&file, &lab).unwrap();
        let second = read(&file).unwrap();
        assert_eq!((second.len(), &second["2"]), (3, &first["2"]));
        fs::remove_dir_all(&folder).unwrap();
    }
}
