//! Bit-exact state of a world as text.

use serde::{Deserialize, Serialize};

/// State of a world after a tick, exact to the bit: every number is its 64 bits in hexadecimal.
///
/// A world restored from it continues identically at every later tick, digest included. It belongs to worlds of the
/// same arena, contents, robots and twin version; others refuse it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Snapshot {
    /// [`crate::VERSION`] that wrote it.
    pub twin_version: String,
    /// Fingerprint of arena, contents and robots.
    pub world: String,
    pub tick: u64,
    pub digest: String,
    /// One string per robot, 16 characters per number.
    pub robots: Vec<String>,
    /// The same for every pushable obstacle.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<String>,
}

pub(crate) fn encoded(words: &[f64]) -> String {
    let mut text = String::with_capacity(words.len() * 16);
    for word in words {
        text.push_str(&format!("{:016x}", word.to_bits()));
    }
    text
}

pub(crate) fn decoded(text: &str) -> Option<Vec<f64>> {
    if !text.len().is_multiple_of(16) || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    text.as_bytes()
        .chunks(16)
        .map(|chunk| {
            let digits = core::str::from_utf8(chunk).ok()?;
            u64::from_str_radix(digits, 16).ok().map(f64::from_bits)
        })
        .collect()
}
