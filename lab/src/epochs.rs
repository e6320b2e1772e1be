//! The largest epoch each robot was ever commanded under, on disk before the first frame of it goes out, and the
//! sequence numbers used up within it.

use crate::durable;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// Sequence numbers taken from the book at a time: a run needs at most 75 000, idling 36 000 an hour.
pub const RESERVED_FRAMES: u32 = 1_000_000;

/// Where a robot's frames stand.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    pub epoch: u32,
    /// All sequences below may have been sent.
    pub sequence: u32,
}

/// See the module.
#[derive(Debug)]
pub struct EpochBook {
    path: PathBuf,
    places: BTreeMap<u8, Place>,
}

/// Why an epoch cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum EpochError {
    #[error("epoch {epoch} does not follow epoch {known} that robot {robot} was commanded under")]
    Old { robot: u8, epoch: i64, known: u32 },
    #[error("epoch {0} does not fit the robot link")]
    Range(i64),
    #[error("the epoch cannot be written to disk")]
    Io(#[from] io::Error),
}

impl EpochBook {
    /// Reads the book at `path`; a missing file is an empty book, a damaged one an error.
    pub fn open(path: &Path) -> io::Result<Self> {
        let places = match std::fs::read(path) {
            Ok(bytes) => serde_json::from_slice(&bytes)?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => BTreeMap::new(),
            Err(error) => return Err(error),
        };
        Ok(Self {
            path: path.to_owned(),
            places,
        })
    }

    /// Opens a new epoch for these robots; they may be sent [`RESERVED_FRAMES`] frames from sequence 1 under it.
    pub fn begin(&mut self, robots: &[u8], epoch: i64) -> Result<u32, EpochError> {
        let wire = u32::try_from(epoch)
            .ok()
            .filter(|epoch| *epoch > 0)
            .ok_or(EpochError::Range(epoch))?;
        let mut places = self.places.clone();
        for robot in robots {
            let place = places.entry(*robot).or_default();
            if place.epoch >= wire {
                return Err(EpochError::Old {
                    robot: *robot,
                    epoch,
                    known: place.epoch,
                });
            }
            *place = Place {
                epoch: wire,
                sequence: 1 + RESERVED_FRAMES,
            };
        }
        self.store(places)?;
        Ok(wire)
    }

    /// Sequences for more frames under the robot's present epoch; the first of [`RESERVED_FRAMES`] is returned.
    pub fn reserve(&mut self, robot: u8) -> io::Result<Place> {
        let mut places = self.places.clone();
        let place = places.entry(robot).or_default();
        let first = Place {
            sequence: place.sequence.max(1),
            ..*place
        };
        place.sequence = first.sequence.saturating_add(RESERVED_FRAMES);
        self.store(places)?;
        Ok(first)
    }

    fn store(&mut self, places: BTreeMap<u8, Place>) -> io::Result<()> {
        durable::write(&self.path, &serde_json::to_vec_pretty(&places)?)?;
        self.places = places;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epochs_only_grow_and_sequences_are_never_used_twice_over_restarts() {
        let path = std::env::temp_dir().join(format!("robopheus-epochs-{}.json", uuid::Uuid::now_v7()));
        let mut book = EpochBook::open(&path).expect("an empty book");
        assert_eq!(book.reserve(1).expect("numbers"), Place { epoch: 0, sequence: 1 });
        assert_eq!(book.begin(&[1, 2], 7).expect("an epoch"), 7);
        let mut book = EpochBook::open(&path).expect("the book after a restart");
        assert!(matches!(
            book.begin(&[2, 3], 7),
            Err(EpochError::Old {
                robot: 2,
                epoch: 7,
                known: 7
            })
        ));
        assert!(matches!(book.begin(&[3], -1), Err(EpochError::Range(-1))));
        assert!(matches!(book.begin(&[3], 1 << 32), Err(EpochError::Range(_))));
        let idle = book.reserve(1).expect("numbers");
        assert_eq!(
            idle,
            Place {
                epoch: 7,
                sequence: 1 + RESERVED_FRAMES
            }
        );
        let after = EpochBook::open(&path).expect("the book").reserve(1).expect("numbers");
        assert_eq!(after.sequence, idle.sequence + RESERVED_FRAMES);
        book.begin(&[1, 2, 3], 8).expect("the next epoch");
        std::fs::remove_file(&path).expect("clean up");
    }

    #[test]
    fn a_damaged_book_is_an_error() {
        let path = std::env::temp_dir().join(format!("robopheus-epochs-{}.json", uuid::Uuid::now_v7()));
        std::fs::write(&path, "{\"1\":{\"epoch\":").expect("a damaged file");
        assert!(EpochBook::open(&path).is_err());
        std::fs::remove_file(&path).expect("clean up");
    }
}
