//! Link keys: `{"1": "<32 hexadecimal digits>", ...}` in a file that only its owner reads.

use robot::key::Key;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    #[error("cannot access the key file")]
    Io(#[from] std::io::Error),
    #[error("the key file is not a JSON object of robot numbers and keys")]
    Parse(#[from] serde_json::Error),
    #[error("the key of robot {0:?} is not 32 hexadecimal digits under a number of 1 to 250")]
    Malformed(String),
}

/// Keys by robot number.
#[derive(Debug, Clone, Default)]
pub struct Keys(BTreeMap<u8, Key>);

impl Keys {
    pub fn read(path: &Path) -> Result<Self, KeyError> {
        Self::parse(&std::fs::read_to_string(path)?)
    }

    pub fn get(&self, number: u8) -> Option<Key> {
        self.0.get(&number).copied()
    }

    pub fn parse(text: &str) -> Result<Self, KeyError> {
        let entries: BTreeMap<String, String> = serde_json::from_str(text)?;
        let parsed = entries
            .into_iter()
            .map(|(number, digits)| match (number.parse(), Key::from_hex(&digits)) {
                (Ok(number @ 1..=250), Some(key)) => Ok((number, key)),
                _ => Err(KeyError::Malformed(number)),
            });
        Ok(Self(parsed.collect::<Result<_, _>>()?))
    }
}

/// Writes random keys for these robots unless the file is there; `true` when it was written.
///
/// The file appears complete or not at all, readable by its owner only.
pub fn make_keys(path: &Path, numbers: impl Iterator<Item = u8>) -> Result<bool, KeyError> {
    if path.exists() {
        return Ok(false);
    }
    let mut random = File::open("/dev/urandom")?;
    let mut entries = BTreeMap::new();
    for number in numbers {
        let mut bytes = [0u8; 16];
        random.read_exact(&mut bytes)?;
        let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        entries.insert(number.to_string(), digits);
    }
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".{}.part", std::process::id()));
    let mut file = OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(&part)?;
    file.write_all(serde_json::to_string_pretty(&entries)?.as_bytes())?;
    file.sync_all()?;
    // A link fails when somebody else made the file meanwhile, where a rename would replace it.
    let linked = std::fs::hard_link(&part, path);
    std::fs::remove_file(&part)?;
    match linked {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => Ok(false),
        Err(error) => Err(error.into()),
    }
}
