//! The append-only file behind a run: chunks of records, each with its length and checksum, so that whatever a
//! crash leaves behind is either read whole or recognised as torn.
//!
//! Layout: 8 bytes [`MAGIC`], then chunks of `length u32 le`, `crc32 u32 le`, `length` bytes of JSON lines.

use crate::record::Record;
use crc32fast::hash as crc32;
use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

/// Name of the journal inside a run's folder.
pub const FILE_NAME: &str = "journal.bin";
const MAGIC: &[u8; 8] = b"RPHJRNL1";
/// A length beyond this can only be damage.
const CHUNK_LIMIT_BYTES: usize = 16 << 20;

/// Appends records; nothing is on disk before [`JournalWriter::flush`].
#[derive(Debug)]
pub struct JournalWriter {
    file: File,
    chunk: Vec<u8>,
}

impl JournalWriter {
    /// Starts a new journal in `folder`, which exists; fails when there is one already.
    pub fn create(folder: &Path) -> io::Result<Self> {
        let mut file = OpenOptions::new()
            .append(true)
            .create_new(true)
            .open(folder.join(FILE_NAME))?;
        file.write_all(MAGIC)?;
        file.sync_all()?;
        File::open(folder)?.sync_all()?;
        Ok(Self {
            file,
            chunk: Vec::with_capacity(256 << 10),
        })
    }

    /// Adds a record to the chunk in memory.
    pub fn push(&mut self, record: &Record) -> io::Result<()> {
        serde_json::to_writer(&mut self.chunk, record)?;
        self.chunk.push(b'\n');
        Ok(())
    }

    /// Bytes waiting for [`Self::flush`].
    pub const fn pending_bytes(&self) -> usize {
        self.chunk.len()
    }

    /// Writes the chunk and waits until it is on disk.
    pub fn flush(&mut self) -> io::Result<()> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        let mut framed = Vec::with_capacity(self.chunk.len() + 8);
        framed.extend_from_slice(&(self.chunk.len() as u32).to_le_bytes());
        framed.extend_from_slice(&crc32(&self.chunk).to_le_bytes());
        framed.append(&mut self.chunk);
        self.file.write_all(&framed)?;
        self.file.sync_data()
    }
}

/// Reads a journal chunk by chunk and stops at the first byte that does not fit.
#[derive(Debug)]
pub struct JournalReader {
    file: BufReader<File>,
    lines: std::vec::IntoIter<Record>,
    torn: bool,
    unreadable: u64,
    ended: bool,
}

impl JournalReader {
    /// Opens the journal in `folder`. A file without the header counts as torn and empty.
    pub fn open(folder: &Path) -> io::Result<Self> {
        let mut file = BufReader::new(File::open(folder.join(FILE_NAME))?);
        let mut magic = [0; 8];
        let torn = file.read_exact(&mut magic).is_err() || &magic != MAGIC;
        Ok(Self {
            file,
            lines: Vec::new().into_iter(),
            torn,
            unreadable: 0,
            ended: torn,
        })
    }

    /// The end of the file was not a whole chunk; known once the iterator is exhausted.
    pub const fn torn(&self) -> bool {
        self.torn
    }

    /// Lines inside whole chunks that were not records of this version.
    pub const fn unreadable(&self) -> u64 {
        self.unreadable
    }

    fn next_chunk(&mut self) -> Option<Vec<u8>> {
        let mut head = [0; 8];
        let got = read_up_to(&mut self.file, &mut head);
        if got == 0 {
            return None;
        }
        let [l0, l1, l2, l3, c0, c1, c2, c3] = head;
        let length = u32::from_le_bytes([l0, l1, l2, l3]) as usize;
        let mut chunk = Vec::new();
        let whole = got == head.len()
            && length <= CHUNK_LIMIT_BYTES
            && self
                .file
                .by_ref()
                .take(length as u64)
                .read_to_end(&mut chunk)
                .is_ok_and(|read| read == length)
            && crc32(&chunk) == u32::from_le_bytes([c0, c1, c2, c3]);
        self.torn = !whole;
        whole.then_some(chunk)
    }
}

impl Iterator for JournalReader {
    type Item = Record;

    fn next(&mut self) -> Option<Record> {
        loop {
            if let Some(record) = self.lines.next() {
                return Some(record);
            }
            if self.ended {
                return None;
            }
            let Some(chunk) = self.next_chunk() else {
                self.ended = true;
                return None;
            };
            let mut records = Vec::new();
            for line in chunk.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
                match serde_json::from_slice(line) {
                    Ok(record) => records.push(record),
                    Err(_) => self.unreadable += 1,
                }
            }
            self.lines = records.into_iter();
        }
    }
}

/// Fills as much of `buffer` as the file has left.
fn read_up_to(file: &mut impl Read, buffer: &mut [u8]) -> usize {
    let mut filled = 0;
    while let Some(rest) = buffer.get_mut(filled..).filter(|rest| !rest.is_empty()) {
        match file.read(rest) {
            Ok(0) => break,
            Ok(read) => filled += read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => break,
        }
    }
    filled
}
