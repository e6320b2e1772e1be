//! Faults of a camera on demand, for drills and tests.

use super::frame::HEADER_BYTES;
use super::problem::{CameraProblem, within};
use serde::{Deserialize, Serialize};

/// Limits of the fault menu.
pub const MAX_DEAD_PIXELS: usize = 4096;
pub const MAX_DIRT_SPOTS: usize = 16;

/// A pixel that always reads the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeadPixel {
    pub u_px: u16,
    pub v_px: u16,
    pub value: u8,
}

/// Dirt on the lens's protecting glass: a round shadow with a soft rim.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirtSpot {
    pub u_px: f64,
    pub v_px: f64,
    pub radius_px: f64,
    /// Share of light that passes, 0 to 1.
    pub transmission: f64,
}

/// One entry of the fault menu.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum CameraFault {
    /// The same picture again and again; sequence and time go on.
    Frozen,
    /// This share of frames never leaves the camera; their sequence numbers are missing.
    DropFrames { fraction: f64 },
    /// Two robots carry each other's tag.
    SwapTags { tags: [u16; 2] },
    /// These pixels always read the same.
    DeadPixels { pixels: Vec<DeadPixel> },
    /// One more spot of dirt.
    Dirt { spot: DirtSpot },
    /// The hall's light is off.
    LightOff,
    /// Pictures of half their height, as of a camera in another mode.
    WrongSize,
    /// This share of frames is damaged on the way.
    DamageFrames { fraction: f64, part: Damage },
    /// Ends all faults of the camera.
    None,
}

/// What of a frame is damaged on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Damage {
    /// A byte of the pixels: their CRC is wrong.
    Pixels,
    /// A byte of the header: its CRC is wrong.
    Header,
    /// The second half of the frame is missing; the next frame follows at once.
    Rest,
}

impl Damage {
    /// Does it to a frame's bytes.
    pub fn spoil(self, frame: &mut Vec<u8>) {
        let middle = (HEADER_BYTES + frame.len()) / 2;
        let spoilt = match self {
            Self::Pixels => middle,
            Self::Header => HEADER_BYTES / 2,
            Self::Rest => return frame.truncate(middle),
        };
        if let Some(byte) = frame.get_mut(spoilt) {
            *byte ^= 0x10;
        }
    }
}

/// `{"camera": 0, "kind": "frozen"}`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraFaultRequest {
    pub camera: u16,
    #[serde(flatten)]
    pub fault: CameraFault,
}

/// Faults of one camera that are on.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CameraFaults {
    pub frozen: bool,
    pub dropped_fraction: f64,
    pub swapped_tags: Option<[u16; 2]>,
    pub dead_pixels: Vec<DeadPixel>,
    pub dirt: Vec<DirtSpot>,
    pub light_off: bool,
    pub wrong_size: bool,
    pub damaged_fraction: f64,
    pub damage: Option<Damage>,
}

impl CameraFaults {
    /// Adds a fault to those that are on.
    ///
    /// - Errors: a value out of its limits; then nothing changes.
    pub fn apply(&mut self, fault: CameraFault) -> Result<(), CameraProblem> {
        match fault {
            CameraFault::Frozen => self.frozen = true,
            CameraFault::DropFrames { fraction } => {
                within("fraction", fraction, 0.0, 1.0, "give a share")?;
                self.dropped_fraction = fraction;
            }
            CameraFault::SwapTags { tags } => self.swapped_tags = Some(tags),
            CameraFault::DeadPixels { pixels } => {
                within("pixels", pixels.len() as f64, 0.0, MAX_DEAD_PIXELS as f64, "list fewer")?;
                self.dead_pixels = pixels;
            }
            CameraFault::Dirt { spot } => {
                let sane = "give a place in the picture";
                within("spot.u_px", spot.u_px, -4096.0, 4096.0, sane)?;
                within("spot.v_px", spot.v_px, -4096.0, 4096.0, sane)?;
                within("spot.radius_px", spot.radius_px, 0.5, 4096.0, sane)?;
                within("spot.transmission", spot.transmission, 0.0, 1.0, "give a share")?;
                within(
                    "dirt",
                    self.dirt.len() as f64,
                    0.0,
                    MAX_DIRT_SPOTS as f64 - 1.0,
                    "end the faults first",
                )?;
                self.dirt.push(spot);
            }
            CameraFault::LightOff => self.light_off = true,
            CameraFault::WrongSize => self.wrong_size = true,
            CameraFault::DamageFrames { fraction, part } => {
                within("fraction", fraction, 0.0, 1.0, "give a share")?;
                (self.damaged_fraction, self.damage) = (fraction, Some(part));
            }
            CameraFault::None => *self = Self::default(),
        }
        Ok(())
    }

    /// The tag that the camera sees where a robot carries tag `id`.
    pub fn seen_tag(&self, id: u16) -> u16 {
        match self.swapped_tags {
            Some([one, other]) if id == one => other,
            Some([one, other]) if id == other => one,
            _ => id,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_read_from_json_add_up_and_end_together() {
        let read = |text: &str| serde_json::from_str::<CameraFaultRequest>(text).expect("a fault");
        let mut faults = CameraFaults::default();
        for text in [
            r#"{"camera":0,"kind":"frozen"}"#,
            r#"{"camera":0,"kind":"drop_frames","fraction":0.25}"#,
            r#"{"camera":0,"kind":"swap_tags","tags":[3,5]}"#,
            r#"{"camera":0,"kind":"dead_pixels","pixels":[{"u_px":1,"v_px":2,"value":255}]}"#,
            r#"{"camera":0,"kind":"dirt","spot":{"u_px":10,"v_px":20,"radius_px":5,"transmission":0.3}}"#,
            r#"{"camera":0,"kind":"light_off"}"#,
            r#"{"camera":0,"kind":"wrong_size"}"#,
            r#"{"camera":0,"kind":"damage_frames","fraction":0.5,"part":"header"}"#,
        ] {
            faults.apply(read(text).fault).expect("accepted");
        }
        assert!(faults.frozen && faults.light_off && faults.dropped_fraction == 0.25);
        assert_eq!((faults.dead_pixels.len(), faults.dirt.len()), (1, 1));
        assert!(faults.wrong_size);
        assert_eq!((faults.damaged_fraction, faults.damage), (0.5, Some(Damage::Header)));
        assert_eq!([3, 4, 5].map(|id| faults.seen_tag(id)), [5, 4, 3]);
        faults
            .apply(read(r#"{"camera":0,"kind":"none"}"#).fault)
            .expect("accepted");
        assert_eq!(faults, CameraFaults::default());
    }

    #[test]
    fn faults_out_of_their_limits_are_refused_and_change_nothing() {
        let mut faults = CameraFaults::default();
        let spot = DirtSpot {
            u_px: 0.0,
            v_px: 0.0,
            radius_px: 0.0,
            transmission: 0.5,
        };
        let pixels = vec![
            DeadPixel {
                u_px: 0,
                v_px: 0,
                value: 0
            };
            MAX_DEAD_PIXELS + 1
        ];
        for (fault, field) in [
            (CameraFault::DropFrames { fraction: 1.5 }, "fraction"),
            (CameraFault::Dirt { spot }, "spot.radius_px"),
            (CameraFault::DeadPixels { pixels }, "pixels"),
        ] {
            assert_eq!(faults.apply(fault).expect_err("refused").field, field);
        }
        assert_eq!(faults, CameraFaults::default());
        let good = DirtSpot { radius_px: 4.0, ..spot };
        for _ in 0..MAX_DIRT_SPOTS {
            faults.apply(CameraFault::Dirt { spot: good }).expect("accepted");
        }
        assert_eq!(
            faults
                .apply(CameraFault::Dirt { spot: good })
                .expect_err("refused")
                .field,
            "dirt"
        );
    }
}
