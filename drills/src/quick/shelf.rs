//! The emulated laboratory between runs: what the hand's socket changes, and what the next run takes over.

use crate::air::AirSettings;
use anyhow::{Context, Result};
use api::lab::LabDescription;
use emulator::Laboratory;
use emulator::camera::{CameraSet, CameraSettings};
use emulator::hand::Hand;
use emulator::hidden::Hidden;
use emulator::keys::Keys;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How often the hand's socket is looked at.
const LOOK: Duration = Duration::from_millis(5);
/// Of the cameras that are not there.
const NO_PICTURES_HZ: f64 = 60.0;

/// See the module. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Shelf {
    laboratory: Arc<Mutex<Laboratory>>,
}

/// What a run takes over from the shelf.
#[derive(Debug, Clone)]
pub struct Taken {
    pub hidden: Hidden,
    /// Both ways of the link, slowed down by as much as the fault menu says.
    pub air: AirSettings,
}

impl Shelf {
    /// Answers on the hand's socket from now on, with the emulator's own requests.
    ///
    /// - Errors: a laboratory that the emulator does not take; a socket that somebody else has.
    pub fn open(description: &LabDescription, hidden: Hidden, keys: &Keys, seed: u64, hand: &Path) -> Result<Self> {
        let laboratory = Laboratory::new(description, hidden, keys, seed)?;
        let shelf = Self {
            laboratory: Arc::new(Mutex::new(laboratory)),
        };
        let mut hand = Hand::listen(hand).with_context(|| format!("listen on {}", hand.display()))?;
        let mut cameras = CameraSet::start(&[], &CameraSettings::default(), NO_PICTURES_HZ, 0)?;
        let own = shelf.clone();
        std::thread::Builder::new().name("hand".to_owned()).spawn(move || {
            loop {
                {
                    let mut laboratory = own.laboratory.lock().unwrap_or_else(PoisonError::into_inner);
                    hand.poll(&mut laboratory, &mut cameras);
                }
                std::thread::sleep(LOOK);
            }
        })?;
        Ok(shelf)
    }

    /// Configuration and air of the next run.
    ///
    /// - `robots`: numbers of the robots in the run; the slowest link of them is everybody's.
    pub fn take(&self, robots: &[u8]) -> Taken {
        let laboratory = self.laboratory.lock().unwrap_or_else(PoisonError::into_inner);
        let units = laboratory.units().iter();
        let late_ms = units
            .filter(|unit| robots.contains(&unit.robot().number))
            .map(|unit| unit.faults().impairment.delay_ms)
            .fold(0.0, f64::max);
        let late_us = (1000.0 * late_ms).round() as i64;
        let quiet = AirSettings::default();
        Taken {
            hidden: laboratory.hidden().clone(),
            air: AirSettings {
                delay_us: quiet.delay_us.map(|delay_us| delay_us + late_us),
                ..quiet
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader, Write};
    use std::os::unix::net::UnixStream;

    fn asked(path: &Path, line: &str) -> String {
        let mut stream = UnixStream::connect(path).expect("a socket");
        writeln!(stream, "{line}").expect("written");
        let mut reply = String::new();
        BufReader::new(stream).read_line(&mut reply).expect("a reply");
        reply
    }

    #[test]
    fn the_next_run_takes_over_what_the_hand_was_told() {
        let path = std::env::temp_dir().join(format!("shelf-{}.sock", std::process::id()));
        let description: LabDescription =
            serde_json::from_str(include_str!("../../../examples/lab/reference.json")).expect("a laboratory");
        let keys: Vec<String> = (1..=50)
            .map(|number| format!("\"{number}\":\"000102030405060708090a0b0c0d0e0f\""))
            .collect();
        let keys = Keys::parse(&format!("{{{}}}", keys.join(","))).expect("keys");
        let shelf = Shelf::open(&description, Hidden::neutral(), &keys, 1, &path).expect("a shelf");
        assert_eq!(shelf.take(&[1]).air, AirSettings::default());
        let hide = r#"{"hide":{"effect":"payload","robot":"omni-01","mass_share":0.25}}"#;
        assert!(asked(&path, hide).contains("true"));
        assert!(asked(&path, r#"{"fault":{"number":1,"kind":"delay_frames","delay_ms":40}}"#).contains("true"));
        let taken = shelf.take(&[1]);
        assert!((taken.hidden.robot("omni-01").mass_scale - 1.25).abs() < 1e-12);
        assert_eq!(taken.air.delay_us, [41_000, 45_000]);
        assert_eq!(
            shelf.take(&[2]).air,
            AirSettings::default(),
            "another robot's link is as always"
        );
        let refused = asked(
            &path,
            r#"{"hide":{"effect":"payload","robot":"nobody","mass_share":0.25}}"#,
        );
        assert!(refused.contains("nobody") && refused.contains("false"), "{refused}");
        assert!(asked(&path, r#"{"hide":{"effect":"none"}}"#).contains("true"));
        assert_eq!(shelf.take(&[1]).hidden.robot("omni-01").mass_scale, 1.0);
    }
}
