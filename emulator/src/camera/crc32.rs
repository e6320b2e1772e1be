//! CRC-32 as in Ethernet, zip and PNG (polynomial 0x04C11DB7, reflected, start and end inverted), sixteen bytes at a time.

const LANES: usize = 16;

/// `TABLES[n][byte]`: the remainder of `byte` followed by `n` zero bytes.
static TABLES: [[u32; 256]; LANES] = tables();

const fn tables() -> [[u32; 256]; LANES] {
    let mut tables = [[0u32; 256]; LANES];
    let mut byte = 0;
    while byte < 256 {
        let mut remainder = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            remainder = if remainder & 1 == 1 {
                remainder >> 1 ^ 0xEDB8_8320
            } else {
                remainder >> 1
            };
            bit += 1;
        }
        tables[0][byte] = remainder;
        byte += 1;
    }
    let mut lane = 1;
    while lane < LANES {
        let mut byte = 0;
        while byte < 256 {
            let before = tables[lane - 1][byte];
            tables[lane][byte] = before >> 8 ^ tables[0][(before & 0xFF) as usize];
            byte += 1;
        }
        lane += 1;
    }
    tables
}

/// CRC-32 of `bytes`.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut remainder = u32::MAX;
    let mut blocks = bytes.chunks_exact(LANES);
    for block in &mut blocks {
        let start = remainder.to_le_bytes();
        let mut next = 0;
        for (at, byte) in block.iter().enumerate() {
            let byte = byte ^ start.get(at).copied().unwrap_or(0);
            next ^= TABLES[LANES - 1 - at][usize::from(byte)];
        }
        remainder = next;
    }
    for byte in blocks.remainder() {
        remainder = remainder >> 8 ^ TABLES[0][usize::from(remainder as u8 ^ byte)];
    }
    !remainder
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_check_values() {
        assert_eq!(crc32(b""), 0);
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        assert_eq!(crc32(b"The quick brown fox jumps over the lazy dog"), 0x414F_A339);
    }

    #[test]
    fn blocks_and_single_bytes_agree() {
        let bytes: Vec<u8> = (0..1000u32).map(|i| ((i * i) >> 3) as u8).collect();
        for length in [15, 16, 17, 31, 32, 33, 1000] {
            let slow = bytes[..length].iter().fold(u32::MAX, |remainder, byte| {
                (0..8).fold(remainder ^ u32::from(*byte), |r, _| {
                    if r & 1 == 1 { r >> 1 ^ 0xEDB8_8320 } else { r >> 1 }
                })
            });
            assert_eq!(crc32(&bytes[..length]), !slow);
        }
    }
}
