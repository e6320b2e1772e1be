//! One frame as bytes, `docs/camera-stream.md`: a header of 44 bytes, then the pixels.

use super::calibration::MAX_SIDE_PX;
use crc32fast::hash as crc32;

pub const MAGIC: [u8; 4] = *b"RBCF";
pub const VERSION: u8 = 1;
/// The only pixel format: grey, 8 bits.
pub const GREY8: u8 = 1;
pub const HEADER_BYTES: usize = 44;
/// Largest payload a decoder accepts.
pub const MAX_PAYLOAD_BYTES: usize = MAX_SIDE_PX as usize * MAX_SIDE_PX as usize;

/// What a frame says about its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameHeader {
    pub camera: u16,
    /// Counts the camera's exposures from 0; a missing number is a lost frame.
    pub sequence: u64,
    /// Middle of the exposure, `CLOCK_MONOTONIC` of the host.
    pub mid_exposure_us: i64,
    pub exposure_us: u32,
    pub width_px: u16,
    pub height_px: u16,
}

impl FrameHeader {
    /// One byte a pixel.
    pub fn payload_bytes(&self) -> usize {
        usize::from(self.width_px) * usize::from(self.height_px)
    }
}

/// A frame out of a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    pub header: FrameHeader,
    /// Row by row from the top.
    pub pixels: Vec<u8>,
}

/// Why bytes are not a frame.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    #[error("the stream has {found:02X?} where a frame begins")]
    Magic { found: [u8; 4] },
    #[error("frame version {found}, not {VERSION}")]
    Version { found: u8 },
    #[error("pixel format {found}, not {GREY8}")]
    PixelFormat { found: u8 },
    #[error("the header's CRC is {found:08X}, its bytes give {computed:08X}")]
    HeaderCrc { found: u32, computed: u32 },
    #[error("{width_px} x {height_px} pixels; sides are 1 to {MAX_SIDE_PX}")]
    Size { width_px: u16, height_px: u16 },
    #[error("{found} bytes of payload for a picture of {wanted}")]
    PayloadLength { found: usize, wanted: usize },
    #[error("frame {sequence}: the pixels' CRC is {found:08X}, the bytes give {computed:08X}")]
    PayloadCrc { sequence: u64, found: u32, computed: u32 },
}

/// Puts a frame's bytes into `out`, replacing what was there.
///
/// - Errors: a size out of its limits, or pixels that are not `width * height`; then `out` is empty.
pub fn encode(header: &FrameHeader, pixels: &[u8], out: &mut Vec<u8>) -> Result<(), FrameError> {
    out.clear();
    check_size(header)?;
    if pixels.len() != header.payload_bytes() {
        return Err(FrameError::PayloadLength {
            found: pixels.len(),
            wanted: header.payload_bytes(),
        });
    }
    out.reserve(HEADER_BYTES + pixels.len());
    out.extend_from_slice(&MAGIC);
    out.extend_from_slice(&[VERSION, GREY8]);
    out.extend_from_slice(&header.camera.to_be_bytes());
    out.extend_from_slice(&header.sequence.to_be_bytes());
    out.extend_from_slice(&header.mid_exposure_us.to_be_bytes());
    out.extend_from_slice(&header.exposure_us.to_be_bytes());
    out.extend_from_slice(&header.width_px.to_be_bytes());
    out.extend_from_slice(&header.height_px.to_be_bytes());
    out.extend_from_slice(&(pixels.len() as u32).to_be_bytes());
    out.extend_from_slice(&crc32(pixels).to_be_bytes());
    let crc = crc32(out);
    out.extend_from_slice(&crc.to_be_bytes());
    out.extend_from_slice(pixels);
    Ok(())
}

/// Frames out of the bytes of a stream, in any pieces. Holds at most one frame of the largest size.
#[derive(Debug, Clone, Default)]
pub struct FrameDecoder {
    buffer: Vec<u8>,
    broken: Option<FrameError>,
}

impl FrameDecoder {
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes bytes as they came and returns how many; the rest goes in after [`Self::next_frame`] gave what is complete.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        let room = (HEADER_BYTES + MAX_PAYLOAD_BYTES).saturating_sub(self.buffer.len());
        let taken = bytes.len().min(room);
        self.buffer.extend_from_slice(&bytes[..taken]);
        taken
    }

    /// The next frame, or `None` until more bytes come.
    ///
    /// - Errors: [`FrameError::PayloadCrc`] loses that frame only. Any other means that the place of the next frame is unknown:
    ///   it is repeated at every call, and the connection should be closed.
    pub fn next_frame(&mut self) -> Result<Option<Frame>, FrameError> {
        if let Some(error) = &self.broken {
            return Err(error.clone());
        }
        let Some(bytes) = self.buffer.first_chunk::<HEADER_BYTES>() else {
            return Ok(None);
        };
        let (header, crc) = match decode_header(bytes) {
            Ok(header) => header,
            Err(error) => {
                self.buffer = Vec::new();
                self.broken = Some(error.clone());
                return Err(error);
            }
        };
        let end = HEADER_BYTES + header.payload_bytes();
        let Some(payload) = self.buffer.get(HEADER_BYTES..end) else {
            return Ok(None);
        };
        let computed = crc32(payload);
        let pixels = (computed == crc).then(|| payload.to_vec());
        self.buffer.drain(..end);
        match pixels {
            Some(pixels) => Ok(Some(Frame { header, pixels })),
            None => Err(FrameError::PayloadCrc {
                sequence: header.sequence,
                found: crc,
                computed,
            }),
        }
    }
}

/// A header and the CRC of the payload that follows it. Checked from the outside in: magic, version, CRC, then what it says.
pub fn decode_header(bytes: &[u8; HEADER_BYTES]) -> Result<(FrameHeader, u32), FrameError> {
    let [magic @ .., version, format] = field::<6>(bytes, 0);
    if magic != MAGIC {
        return Err(FrameError::Magic { found: magic });
    }
    if version != VERSION {
        return Err(FrameError::Version { found: version });
    }
    let (found, computed) = (u32::from_be_bytes(field(bytes, 40)), crc32(&bytes[..40]));
    if found != computed {
        return Err(FrameError::HeaderCrc { found, computed });
    }
    if format != GREY8 {
        return Err(FrameError::PixelFormat { found: format });
    }
    let header = FrameHeader {
        camera: u16::from_be_bytes(field(bytes, 6)),
        sequence: u64::from_be_bytes(field(bytes, 8)),
        mid_exposure_us: i64::from_be_bytes(field(bytes, 16)),
        exposure_us: u32::from_be_bytes(field(bytes, 24)),
        width_px: u16::from_be_bytes(field(bytes, 28)),
        height_px: u16::from_be_bytes(field(bytes, 30)),
    };
    check_size(&header)?;
    let found = u32::from_be_bytes(field(bytes, 32)) as usize;
    if found != header.payload_bytes() {
        return Err(FrameError::PayloadLength {
            found,
            wanted: header.payload_bytes(),
        });
    }
    Ok((header, u32::from_be_bytes(field(bytes, 36))))
}

/// `N` bytes from `at` on; zeros beyond the header, where no field is.
fn field<const N: usize>(bytes: &[u8; HEADER_BYTES], at: usize) -> [u8; N] {
    bytes
        .get(at..)
        .and_then(|rest| rest.first_chunk())
        .copied()
        .unwrap_or([0; N])
}

fn check_size(header: &FrameHeader) -> Result<(), FrameError> {
    let fits = |side: u16| (1..=MAX_SIDE_PX).contains(&side);
    if fits(header.width_px) && fits(header.height_px) {
        return Ok(());
    }
    Err(FrameError::Size {
        width_px: header.width_px,
        height_px: header.height_px,
    })
}
