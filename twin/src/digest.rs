//! Witness of a trace.

use core::fmt;

use crate::state::{BodyState, MAX_WORDS};

/// 128-bit xxh3 chained over every tick: digest(k) = xxh3(digest(k - 1), tick k, every number of every robot).
///
/// Little-endian bytes; equal digests mean bit-equal traces. Shown as 32 hexadecimal characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Digest(u128);

impl Digest {
    /// Digest of a byte string, for fingerprints of inputs.
    pub(crate) fn of_bytes(bytes: &[u8]) -> Digest {
        Digest(xxhash_rust::xxh3::xxh3_128(bytes))
    }

    /// The number itself.
    pub fn value(&self) -> u128 {
        self.0
    }

    /// Reads 32 hexadecimal characters.
    pub fn parse(text: &str) -> Option<Digest> {
        if text.len() != 32 || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return None;
        }
        u128::from_str_radix(text, 16).ok().map(Digest)
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// Collects one tick into a buffer that is hashed at once.
#[derive(Debug, Clone, Default)]
pub(crate) struct TickHasher {
    bytes: Vec<u8>,
}

impl TickHasher {
    pub(crate) fn begin(&mut self, previous: Digest, tick: u64) {
        self.bytes.clear();
        self.bytes.extend_from_slice(&previous.0.to_le_bytes());
        self.bytes.extend_from_slice(&tick.to_le_bytes());
    }

    pub(crate) fn robot(&mut self, state: &BodyState, lanes: usize) {
        let mut words = [0.0; MAX_WORDS];
        let count = state.words(lanes, &mut words);
        let mut packed = [0_u8; MAX_WORDS * 8];
        for (slot, word) in packed.chunks_exact_mut(8).zip(&words[..count]) {
            slot.copy_from_slice(&word.to_bits().to_le_bytes());
        }
        self.bytes.extend_from_slice(&packed[..count * 8]);
    }

    /// Further numbers of the robot before.
    pub(crate) fn numbers(&mut self, words: impl Iterator<Item = f64>) {
        for word in words {
            self.bytes.extend_from_slice(&word.to_bits().to_le_bytes());
        }
    }

    pub(crate) fn finish(&self) -> Digest {
        Digest::of_bytes(&self.bytes)
    }
}
