//! The camera's bytes: frames of `docs/camera-stream.md` from any reader.

use std::io::{self, Read};

const MAGIC: [u8; 4] = *b"RBCF";
const VERSION: u8 = 1;
const GREY_8: u8 = 1;
/// Bytes before the pixels.
pub const HEADER_BYTES: usize = 44;
const SIDE_MAX_PX: u16 = 2048;

/// What stands before the pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameHeader {
    pub camera: u16,
    pub sequence: u64,
    pub mid_exposure_us: i64,
    pub exposure_us: u32,
    pub width_px: u16,
    pub height_px: u16,
}

/// Why a frame is not one.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    #[error("the header begins with {0:02x?} instead of \"RBCF\"")]
    Magic([u8; 4]),
    #[error("layout version {0}; this program reads version 1")]
    Version(u8),
    #[error("the header's checksum is wrong")]
    HeaderChecksum,
    #[error("pixel format {0}; this program reads 1, grey with 8 bits")]
    PixelFormat(u8),
    #[error("{width_px} x {height_px} px; sides are 1 to 2048 px")]
    Size { width_px: u16, height_px: u16 },
    #[error("{found} bytes of pixels for {expected} px")]
    PayloadLength { found: u32, expected: u32 },
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// What came of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    Frame(FrameHeader),
    /// The pixels fail their checksum: this frame is lost, the next follows.
    PixelsLost(FrameHeader),
}

fn array<const N: usize>(bytes: &[u8], from: usize) -> [u8; N] {
    let mut out = [0; N];
    if let Some(part) = bytes.get(from..from + N) {
        out.copy_from_slice(part);
    }
    out
}

/// Checks a header from the outside in.
///
/// - Returns it with the checksum of the pixels.
pub fn read_header(bytes: &[u8; HEADER_BYTES]) -> Result<(FrameHeader, u32), FrameError> {
    let magic = array(bytes, 0);
    if magic != MAGIC {
        return Err(FrameError::Magic(magic));
    }
    let [version, format] = array(bytes, 4);
    if version != VERSION {
        return Err(FrameError::Version(version));
    }
    let (checked, _) = bytes.split_at(40);
    if crc32fast::hash(checked) != u32::from_be_bytes(array(bytes, 40)) {
        return Err(FrameError::HeaderChecksum);
    }
    if format != GREY_8 {
        return Err(FrameError::PixelFormat(format));
    }
    let header = FrameHeader {
        camera: u16::from_be_bytes(array(bytes, 6)),
        sequence: u64::from_be_bytes(array(bytes, 8)),
        mid_exposure_us: i64::from_be_bytes(array(bytes, 16)),
        exposure_us: u32::from_be_bytes(array(bytes, 24)),
        width_px: u16::from_be_bytes(array(bytes, 28)),
        height_px: u16::from_be_bytes(array(bytes, 30)),
    };
    let FrameHeader {
        width_px, height_px, ..
    } = header;
    if ![width_px, height_px]
        .iter()
        .all(|side| (1..=SIDE_MAX_PX).contains(side))
    {
        return Err(FrameError::Size { width_px, height_px });
    }
    let (found, expected) = (
        u32::from_be_bytes(array(bytes, 32)),
        u32::from(width_px) * u32::from(height_px),
    );
    if found != expected {
        return Err(FrameError::PayloadLength { found, expected });
    }
    Ok((header, u32::from_be_bytes(array(bytes, 36))))
}

/// Reads the next frame.
///
/// - `pixels`: filled with the picture, row by row from the top.
/// - Errors: after any the place of the next frame is unknown: close the connection. The end of the stream is
///   [`io::ErrorKind::UnexpectedEof`].
pub fn read_frame(stream: &mut impl Read, pixels: &mut Vec<u8>) -> Result<Received, FrameError> {
    let mut bytes = [0; HEADER_BYTES];
    stream.read_exact(&mut bytes)?;
    let (header, checksum) = read_header(&bytes)?;
    pixels.resize(usize::from(header.width_px) * usize::from(header.height_px), 0);
    stream.read_exact(pixels)?;
    Ok(if crc32fast::hash(pixels) == checksum {
        Received::Frame(header)
    } else {
        Received::PixelsLost(header)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the documentation, byte for byte.
    fn example() -> Vec<u8> {
        let page = include_str!("../../../docs/camera-stream.md");
        let line = page
            .lines()
            .find(|line| line.starts_with("52424346"))
            .expect("an example");
        let digits = line.as_bytes().chunks(2);
        digits
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).expect("ASCII"), 16).expect("hexadecimal"))
            .collect()
    }

    #[test]
    fn the_example_of_the_documentation_reads_as_it_says() {
        let mut pixels = Vec::new();
        let received = read_frame(&mut example().as_slice(), &mut pixels).expect("a frame");
        let header = FrameHeader {
            camera: 1,
            sequence: 0x0102_0304_0506_0708,
            mid_exposure_us: 1_234_567_890_123,
            exposure_us: 3000,
            width_px: 4,
            height_px: 2,
        };
        assert_eq!(received, Received::Frame(header));
        assert_eq!(pixels, [0, 1, 2, 3, 128, 200, 254, 255]);
    }

    #[test]
    fn every_spoiled_byte_is_noticed_and_spoiled_pixels_lose_one_frame_only() {
        let good = example();
        for place in 0..good.len() {
            let mut bytes = good.clone();
            bytes[place] ^= 0x10;
            bytes.extend_from_slice(&good);
            let (mut stream, mut pixels) = (bytes.as_slice(), Vec::new());
            let first = read_frame(&mut stream, &mut pixels);
            if place < HEADER_BYTES && !(36..40).contains(&place) {
                assert!(first.is_err(), "byte {place}");
            } else if place >= HEADER_BYTES {
                assert!(matches!(first, Ok(Received::PixelsLost(_))), "byte {place}");
                assert!(matches!(read_frame(&mut stream, &mut pixels), Ok(Received::Frame(_))));
            } else {
                assert!(!matches!(first, Ok(Received::Frame(_))), "byte {place}");
            }
        }
    }

    #[test]
    fn a_cut_off_frame_is_the_end_of_the_stream() {
        let good = example();
        for length in 0..good.len() {
            let error = read_frame(&mut &good[..length], &mut Vec::new()).expect_err("cut off");
            assert!(matches!(error, FrameError::Io(error) if error.kind() == io::ErrorKind::UnexpectedEof));
        }
    }
}
