//! Whether pictures come from the camera that a calibration file was made for: another one's file is as valid, and every robot
//! would stand somewhere else.

use std::path::{Path, PathBuf};

/// The camera of a calibration file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    file: PathBuf,
    name: String,
    /// None when nobody knows: then any camera is taken.
    number: Option<u16>,
}

impl Identity {
    /// - `name`: of the camera in the calibration file; the digits at its end are its number (`cam-1`).
    /// - `number`: of the camera in its frames, instead of what the name says.
    pub fn new(file: &Path, name: &str, number: Option<u16>) -> Self {
        Self {
            file: file.to_owned(),
            name: name.to_owned(),
            number: number.or_else(|| digits(name).parse().ok()),
        }
    }

    /// - `found`: number of the camera in a frame.
    /// - Errors: what is wrong and what to do, in words.
    pub fn check(&self, found: u16) -> Result<(), String> {
        let Some(number) = self.number.filter(|number| *number != found) else {
            return Ok(());
        };
        let Self { file, name, .. } = self;
        let stem = name.strip_suffix(digits(name)).unwrap_or(name);
        Err(format!(
            "{} is the calibration of camera {name} (number {number}), but the pictures come from camera {found} ({stem}{found}?): give \
             --calibration the file of that camera, or --frames the pictures of {name}; where the number of a camera is not at the end \
             of its name, say it with --camera-number {found}",
            file.display()
        ))
    }
}

fn digits(name: &str) -> &str {
    name.get(name.trim_end_matches(|letter: char| letter.is_ascii_digit()).len()..)
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_at_the_end_of_the_name_or_the_one_that_is_told_must_be_that_of_the_pictures() {
        let file = Path::new("/etc/cam-1.json");
        let named = Identity::new(file, "cam-12", None);
        assert_eq!(named.check(12), Ok(()));
        let words = named.check(2).expect_err("another camera");
        for part in [
            "/etc/cam-1.json",
            "cam-12",
            "cam-2?",
            "--calibration",
            "--camera-number 2",
        ] {
            assert!(words.contains(part), "{part}: {words}");
        }
        let told = Identity::new(file, "cam-12", Some(3));
        assert!(told.check(3).is_ok() && told.check(12).is_err());
        assert_eq!(Identity::new(file, "north", None).check(7), Ok(()));
        assert!(Identity::new(file, "north", Some(1)).check(7).is_err());
    }
}
