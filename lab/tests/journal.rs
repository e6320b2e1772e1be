//! The journal gives back what was written, and after a cut exactly the chunks that were whole.

mod fixture;

use fixture::Folder;
use lab::journal::{FILE_NAME, JournalReader, JournalWriter};
use lab::record::Record;

fn read(folder: &Folder) -> (Vec<Record>, bool) {
    let mut reader = JournalReader::open(folder.path()).expect("a journal");
    let records = reader.by_ref().collect();
    assert_eq!(reader.unreadable(), 0);
    (records, reader.torn())
}

/// Three chunks; returns the records and the file length after each.
fn write(folder: &Folder) -> (Vec<Record>, Vec<u64>) {
    let records = fixture::records(40, true);
    let mut journal = JournalWriter::create(folder.path()).expect("a new journal");
    let mut lengths = Vec::new();
    let [first, second] = [records.len() - 30, records.len() - 4];
    for part in [&records[..first], &records[first..second], &records[second..]] {
        part.iter().for_each(|record| journal.push(record).expect("push"));
        journal.flush().expect("flush");
        lengths.push(
            std::fs::metadata(folder.path().join(FILE_NAME))
                .expect("the file")
                .len(),
        );
    }
    (records, lengths)
}

#[test]
fn gives_back_every_record() {
    let folder = Folder::new("journal-whole");
    let (records, _) = write(&folder);
    assert_eq!(read(&folder), (records, false));
}

#[test]
fn a_tail_torn_at_any_byte_costs_that_chunk_only() {
    let folder = Folder::new("journal-torn");
    let (records, lengths) = write(&folder);
    let whole = std::fs::read(folder.path().join(FILE_NAME)).expect("the bytes");
    let kept = &records[..records.len() - 4];
    for length in lengths[1]..lengths[2] {
        std::fs::write(folder.path().join(FILE_NAME), &whole[..length as usize]).expect("cut");
        let (read, torn) = read(&folder);
        assert!(read == kept, "cut at {length}: {} records", read.len());
        assert_eq!(torn, length != lengths[1], "cut at {length}");
    }
}

#[test]
fn a_damaged_byte_anywhere_in_the_last_chunk_is_noticed() {
    let folder = Folder::new("journal-damage");
    let (records, lengths) = write(&folder);
    let whole = std::fs::read(folder.path().join(FILE_NAME)).expect("the bytes");
    for place in (lengths[1]..lengths[2]).step_by(7) {
        let mut damaged = whole.clone();
        damaged[place as usize] ^= 0x20;
        std::fs::write(folder.path().join(FILE_NAME), damaged).expect("damage");
        let (read, torn) = read(&folder);
        assert!(torn && read == records[..records.len() - 4], "damage at {place}");
    }
}

#[test]
fn an_existing_journal_is_never_overwritten() {
    let folder = Folder::new("journal-exists");
    write(&folder);
    assert!(JournalWriter::create(folder.path()).is_err());
}
