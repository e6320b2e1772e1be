//! Frames signed apart from the code under test: CRC, SipHash and layout written anew from `docs/link.md`.
#![allow(dead_code, reason = "every test file uses its own part")]

use robot::frame::Header;

pub const KEY: [u8; 16] = *b"sixteen byte key";
pub const GROUP: u8 = 3;
pub const TARGET: u8 = 6;
pub const FIX: u8 = 7;
/// Bytes of the payloads by type, 1 to 7; a group's are those of one part.
const PAYLOAD_BYTES: [usize; 7] = [11, 47, 11, 27, 48, 18, 16];

/// CRC-16/CCITT-FALSE, bit by bit.
fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut crc = 0xFFFF_u32;
    for bit in bytes
        .iter()
        .flat_map(|byte| (0..8).rev().map(move |place| u32::from(byte >> place & 1)))
    {
        let top = crc >> 15 & 1;
        crc = crc << 1 & 0xFFFF;
        if top ^ bit == 1 {
            crc ^= 0x1021;
        }
    }
    (crc as u16).to_be_bytes()
}

/// First four bytes of SipHash-2-4 [Aumasson, Bernstein 2012].
fn mac(bytes: &[u8]) -> [u8; 4] {
    let half = |from: usize| u64::from_le_bytes(KEY[from..from + 8].try_into().expect("eight bytes"));
    let (k0, k1) = (half(0), half(8));
    let mut v = [
        k0 ^ 0x736f_6d65_7073_6575,
        k1 ^ 0x646f_7261_6e64_6f6d,
        k0 ^ 0x6c79_6765_6e65_7261,
        k1 ^ 0x7465_6462_7974_6573,
    ];
    let round = |v: &mut [u64; 4]| {
        v[0] = v[0].wrapping_add(v[1]);
        v[1] = v[1].rotate_left(13) ^ v[0];
        v[0] = v[0].rotate_left(32);
        v[2] = v[2].wrapping_add(v[3]);
        v[3] = v[3].rotate_left(16) ^ v[2];
        v[0] = v[0].wrapping_add(v[3]);
        v[3] = v[3].rotate_left(21) ^ v[0];
        v[2] = v[2].wrapping_add(v[1]);
        v[1] = v[1].rotate_left(17) ^ v[2];
        v[2] = v[2].rotate_left(32);
    };
    let mut words: Vec<u64> = Vec::new();
    for chunk in bytes.chunks(8) {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        words.push(u64::from_le_bytes(word));
    }
    let length = (bytes.len() as u64 & 0xFF) << 56;
    match bytes.len() % 8 {
        0 => words.push(length),
        _ => *words.last_mut().expect("a word") |= length,
    }
    for word in words {
        v[3] ^= word;
        (0..2).for_each(|_| round(&mut v));
        v[0] ^= word;
    }
    v[2] ^= 0xFF;
    (0..4).for_each(|_| round(&mut v));
    let [a, b, c, d, ..] = (v[0] ^ v[1] ^ v[2] ^ v[3]).to_le_bytes();
    [a, b, c, d]
}

fn characters(bytes: &[u8]) -> Vec<u8> {
    let digits: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    format!(":{digits}\n").into_bytes()
}

/// A frame of this type with this payload, signed as the robot's laboratory would.
pub fn signed(kind: u8, header: &Header, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![1, kind];
    if kind == GROUP {
        bytes.push(1);
        for field in [header.epoch, header.sequence, header.tick, header.clock_ms] {
            bytes.extend(field.to_be_bytes());
        }
        bytes.push(header.robot);
        bytes.extend(header.echo_ms.to_be_bytes());
        bytes.extend(payload);
        bytes.extend(mac(&bytes));
        bytes.extend(crc(&bytes));
    } else {
        bytes.push(header.robot);
        for field in [
            header.epoch,
            header.sequence,
            header.tick,
            header.clock_ms,
            header.echo_ms,
        ] {
            bytes.extend(field.to_be_bytes());
        }
        bytes.extend(payload);
        bytes.extend(crc(&bytes));
        bytes.extend(mac(&bytes));
    }
    characters(&bytes)
}

/// Anything, from all zeros over the ends of every field to noise; flags mostly without reserved bits, so that the rest is read.
///
/// - `next`: a stream of random numbers.
pub fn payload(kind: u8, mut next: impl FnMut() -> u64) -> Vec<u8> {
    let ends = [0x00, 0x01, 0x7F, 0x80, 0xFF];
    let mode = next() % 4;
    let mut bytes: Vec<u8> = (0..PAYLOAD_BYTES[usize::from(kind) - 1])
        .map(|_| match mode {
            0 => ends[(next() % 5) as usize],
            1 => next() as u8,
            2 => (next() as u8) * u8::from(next().is_multiple_of(3)),
            _ => (next() % 4) as u8,
        })
        .collect();
    if !next().is_multiple_of(8) {
        match kind {
            1 | GROUP => bytes[0] &= 0b101,
            TARGET => {
                bytes[0] &= 0b1101;
                bytes[1] %= 101;
            }
            _ => {}
        }
    }
    bytes
}
