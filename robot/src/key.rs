//! The key a robot shares with its laboratory, set at commissioning.

use core::fmt;
use core::hash::Hasher;
use siphasher::sip::SipHasher24;

/// Bytes of the authentication code at the end of every frame.
pub const MAC_BYTES: usize = 4;

/// 16-byte key of one robot. `Debug` does not show it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key([u8; 16]);

impl Key {
    pub const fn new(bytes: [u8; 16]) -> Self {
        Self(bytes)
    }

    /// From 32 hexadecimal digits of either case; `None` for anything else.
    pub fn from_hex(text: &str) -> Option<Self> {
        let digits = text.as_bytes();
        let mut bytes = [0; 16];
        if digits.len() != 2 * bytes.len() {
            return None;
        }
        for (byte, pair) in bytes.iter_mut().zip(digits.chunks_exact(2)) {
            let high = crate::hex::digit(pair[0].to_ascii_uppercase())?;
            let low = crate::hex::digit(pair[1].to_ascii_uppercase())?;
            *byte = high << 4 | low;
        }
        Some(Self(bytes))
    }

    /// First four bytes of the SipHash-2-4 output (its 64-bit value written little-endian, as the reference code does).
    pub(crate) fn mac(&self, bytes: &[u8]) -> [u8; MAC_BYTES] {
        let mut hasher = SipHasher24::new_with_key(&self.0);
        hasher.write(bytes);
        let [a, b, c, d, ..] = hasher.finish().to_le_bytes();
        [a, b, c, d]
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Key(..)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First and last line of `vectors_sip64` in the SipHash authors' reference code.
    #[test]
    fn mac_agrees_with_the_siphash_reference_vectors() {
        let key = Key::from_hex("000102030405060708090a0b0c0d0e0f").unwrap();
        assert_eq!(key.mac(&[]), [0x31, 0x0e, 0x0e, 0xdd]);
        let mut message = [0u8; 15];
        for (i, byte) in message.iter_mut().enumerate() {
            *byte = i as u8;
        }
        assert_eq!(key.mac(&message), [0xe5, 0x45, 0xbe, 0x49]);
    }

    #[test]
    fn refuses_malformed_text() {
        assert!(Key::from_hex("00").is_none());
        assert!(Key::from_hex("000102030405060708090a0b0c0d0e0g").is_none());
        assert!(Key::from_hex("000102030405060708090A0b0c0d0e0f").is_some());
    }
}
