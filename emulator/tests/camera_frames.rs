//! The bytes of a frame, and the socket they go through.

mod rig;

use crc32fast::hash as crc32;
use emulator::camera::frame::{
    FrameDecoder, FrameError, FrameHeader, HEADER_BYTES, MAX_PAYLOAD_BYTES, decode_header, encode,
};
use emulator::camera::sender::{FrameSender, MAX_READERS};
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::{Duration, Instant};

const HEADER: FrameHeader = FrameHeader {
    camera: 1,
    sequence: 0x0102_0304_0506_0708,
    mid_exposure_us: 1_234_567_890_123,
    exposure_us: 3000,
    width_px: 4,
    height_px: 2,
};
const PIXELS: [u8; 8] = [0, 1, 2, 3, 128, 200, 254, 255];
/// The frame of `docs/camera-stream.md`.
const GOLDEN: &str =
    "524243460101000101020304050607080000011f71fb04cb00000bb800040002000000081ce55d7ba96d524f0001020380c8feff";

fn frame(header: &FrameHeader, pixels: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(header, pixels, &mut bytes).expect("a frame");
    bytes
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The frame with one header byte changed and the header's CRC made right again.
fn with(at: usize, change: u8) -> Vec<u8> {
    let mut bytes = frame(&HEADER, &PIXELS);
    bytes[at] ^= change;
    let crc = crc32(&bytes[..40]).to_be_bytes();
    bytes[40..44].copy_from_slice(&crc);
    bytes
}

fn refused(bytes: &[u8]) -> FrameError {
    let mut decoder = FrameDecoder::new();
    decoder.push(bytes);
    decoder.next_frame().expect_err("refused")
}

#[test]
fn the_golden_frame_both_ways() {
    assert_eq!(hex(&frame(&HEADER, &PIXELS)), GOLDEN);
    let documented: String = include_str!("../../docs/camera-stream.md").split_whitespace().collect();
    assert!(documented.contains(GOLDEN), "docs/camera-stream.md shows another frame");
    let mut decoder = FrameDecoder::new();
    decoder.push(&frame(&HEADER, &PIXELS));
    let back = decoder.next_frame().expect("sound").expect("whole");
    assert_eq!((back.header, back.pixels.as_slice()), (HEADER, PIXELS.as_slice()));
    assert_eq!(decoder.next_frame(), Ok(None));
}

#[test]
fn frames_come_out_of_any_pieces_and_a_truncated_one_waits() {
    let mut stream = frame(&HEADER, &PIXELS);
    stream.extend(frame(&FrameHeader { sequence: 9, ..HEADER }, &PIXELS));
    let whole = stream.len() / 2;
    for piece in [1, 3, 43, 44, 45, whole, 2 * whole] {
        let (mut decoder, mut sequences) = (FrameDecoder::new(), Vec::new());
        for bytes in stream.chunks(piece) {
            assert_eq!(decoder.push(bytes), bytes.len());
            while let Some(frame) = decoder.next_frame().expect("sound") {
                sequences.push(frame.header.sequence);
            }
        }
        assert_eq!(sequences, [HEADER.sequence, 9], "pieces of {piece}");
    }
    for length in 0..whole {
        let mut decoder = FrameDecoder::new();
        decoder.push(&stream[..length]);
        assert_eq!(decoder.next_frame(), Ok(None), "{length} bytes");
    }
}

#[test]
fn every_flipped_bit_is_noticed() {
    let sound = frame(&HEADER, &PIXELS);
    for bit in 0..sound.len() * 8 {
        let mut bytes = sound.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        match refused(&bytes) {
            FrameError::Magic { .. } => assert!(bit / 8 < 4),
            FrameError::Version { .. } => assert_eq!(bit / 8, 4),
            FrameError::HeaderCrc { .. } => assert!((5..44).contains(&(bit / 8))),
            FrameError::PayloadCrc { sequence, .. } => assert!(bit / 8 >= 44 && sequence == HEADER.sequence),
            other => panic!("bit {bit}: {other}"),
        }
    }
}

#[test]
fn headers_that_ask_for_nonsense_are_refused_before_their_payload() {
    assert_eq!(refused(&with(5, 3)), FrameError::PixelFormat { found: 2 });
    assert_eq!(
        refused(&with(28, 0x10)),
        FrameError::Size {
            width_px: 0x1004,
            height_px: 2
        }
    );
    assert_eq!(
        refused(&with(31, 2)),
        FrameError::Size {
            width_px: 4,
            height_px: 0
        }
    );
    let huge = FrameError::PayloadLength {
        found: 0xFF00_0008,
        wanted: 8,
    };
    assert_eq!(refused(&with(32, 0xFF)[..HEADER_BYTES]), huge);
    let header: [u8; HEADER_BYTES] = with(32, 0xFF)[..HEADER_BYTES].try_into().expect("a header");
    assert_eq!(decode_header(&header), Err(huge));
}

#[test]
fn a_bad_header_ends_a_stream_and_bad_pixels_lose_one_frame() {
    let (mut broken, next) = (
        frame(&HEADER, &PIXELS),
        frame(&FrameHeader { sequence: 9, ..HEADER }, &PIXELS),
    );
    broken[50] ^= 1;
    let mut decoder = FrameDecoder::new();
    decoder.push(&[broken, next.clone()].concat());
    assert!(matches!(decoder.next_frame(), Err(FrameError::PayloadCrc { .. })));
    assert_eq!(decoder.next_frame().expect("sound").expect("whole").header.sequence, 9);

    let mut decoder = FrameDecoder::new();
    decoder.push(&[b"junk".as_slice(), &next, &next].concat());
    let error = decoder.next_frame().expect_err("junk");
    decoder.push(&next);
    assert_eq!(decoder.next_frame().expect_err("still"), error);
}

#[test]
fn a_decoder_holds_no_more_than_the_largest_frame() {
    let mut decoder = FrameDecoder::new();
    let header = FrameHeader {
        width_px: 2048,
        height_px: 2048,
        ..HEADER
    };
    let bytes = frame(&header, &vec![7; MAX_PAYLOAD_BYTES]);
    assert_eq!(decoder.push(&bytes), bytes.len());
    assert_eq!(decoder.push(&[1, 2, 3]), 0);
    assert_eq!(
        decoder.next_frame().expect("sound").expect("whole").pixels.len(),
        MAX_PAYLOAD_BYTES
    );
    assert_eq!(decoder.push(&[1, 2, 3]), 3);
}

#[test]
fn pixels_that_do_not_fit_are_not_encoded() {
    let mut out = vec![1];
    assert_eq!(
        encode(&HEADER, &PIXELS[..7], &mut out),
        Err(FrameError::PayloadLength { found: 7, wanted: 8 })
    );
    let wide = FrameHeader {
        width_px: 2049,
        ..HEADER
    };
    assert!(matches!(
        encode(&wide, &[0; 4098], &mut out),
        Err(FrameError::Size { .. })
    ));
    assert!(out.is_empty());
}

fn socket_path(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("robopheus-camera-{name}-{}.sock", std::process::id()))
}

/// Waits until `done` or fails.
fn wait(what: &str, mut done: impl FnMut() -> bool) {
    let end = Instant::now() + Duration::from_secs(20);
    while !done() {
        assert!(Instant::now() < end, "waited for {what} in vain");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn vga(sequence: u64) -> FrameHeader {
    FrameHeader {
        sequence,
        width_px: 640,
        height_px: 480,
        ..HEADER
    }
}

#[test]
fn a_fast_reader_gets_every_frame_in_order() {
    let path = socket_path("fast");
    let mut sender = FrameSender::listen(&path).expect("a socket");
    let mut stream = UnixStream::connect(&path).expect("a connection");
    wait("the reader", || {
        sender.poll();
        sender.counts().readers == 1
    });
    let reader = std::thread::spawn(move || {
        let (mut decoder, mut frames, mut bytes) = (FrameDecoder::new(), Vec::new(), vec![0; 1 << 16]);
        loop {
            let count = stream.read(&mut bytes).expect("bytes");
            if count == 0 {
                return frames;
            }
            assert_eq!(decoder.push(&bytes[..count]), count);
            while let Some(frame) = decoder.next_frame().expect("sound") {
                frames.push(frame);
            }
        }
    });
    for sequence in 0..20 {
        sender
            .send(&vga(sequence), &vec![sequence as u8; 307_200])
            .expect("sent");
        wait("the write", || sender.counts().written == sequence + 1);
    }
    assert_eq!(sender.counts().dropped, 0);
    drop(sender);
    let frames = reader.join().expect("the reader");
    assert_eq!(
        frames.iter().map(|frame| frame.header.sequence).collect::<Vec<_>>(),
        (0..20).collect::<Vec<_>>()
    );
    assert!(frames.iter().all(|frame| {
        frame
            .pixels
            .iter()
            .all(|pixel| u64::from(*pixel) == frame.header.sequence)
    }));
    assert!(!path.exists());
}

#[test]
fn a_reader_that_does_not_read_loses_frames_and_holds_nobody_up() {
    let path = socket_path("slow");
    let mut sender = FrameSender::listen(&path).expect("a socket");
    let mut stuck = UnixStream::connect(&path).expect("a connection");
    wait("the reader", || {
        sender.poll();
        sender.counts().readers == 1
    });
    let begin = Instant::now();
    for sequence in 0..200 {
        sender.send(&vga(sequence), &vec![0; 307_200]).expect("sent");
    }
    assert!(begin.elapsed() < Duration::from_secs(10), "the sender waited");
    let counts = sender.counts();
    // 307 kB frames: the kernel holds less than ten of them, one is being written, one waits
    assert!(counts.dropped >= 188, "{counts:?}");
    // what does arrive is whole and in order
    let (mut decoder, mut bytes, mut sequences) = (FrameDecoder::new(), vec![0; 1 << 16], Vec::new());
    let wanted = 200 - counts.dropped;
    while (sequences.len() as u64) < wanted {
        let count = stuck.read(&mut bytes).expect("bytes");
        decoder.push(&bytes[..count]);
        while let Some(frame) = decoder.next_frame().expect("sound") {
            sequences.push(frame.header.sequence);
        }
    }
    assert!(sequences.windows(2).all(|pair| pair[0] < pair[1]) && sequences[0] == 0);
    // the writer counts a frame after its last byte, which may have been read by then
    wait("the count", || sender.counts().written >= wanted);
    assert_eq!(sender.counts().written, wanted);
    drop(sender);
}

#[test]
fn readers_come_and_go_up_to_their_limit() {
    let path = socket_path("many");
    let mut sender = FrameSender::listen(&path).expect("a socket");
    let mut streams: Vec<UnixStream> = (0..=MAX_READERS)
        .map(|_| UnixStream::connect(&path).expect("a connection"))
        .collect();
    wait("the readers", || {
        sender.poll();
        sender.counts().readers == MAX_READERS
    });
    let mut last = streams.pop().expect("one too many");
    assert_eq!(last.read(&mut [0; 1]).expect("the end"), 0, "hung up on");
    streams.clear();
    wait("the end of all readers", || {
        sender.send(&HEADER, &PIXELS).expect("sent");
        sender.counts().readers == 0
    });
}
