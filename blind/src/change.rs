//! Everything that is not as the description says: the plant's own numbers, what the firmware does to set-points, forces
//! from outside, and what sensors make of the truth. Neutral values mean "absent".

use crate::firmware::Firmware;
use crate::forces::Forces;
use crate::sensing::Sensing;
use emulator::hidden::{HiddenFloor, HiddenRobot};

#[derive(Debug, Clone, Default)]
pub struct Change {
    pub hidden: HiddenRobot,
    pub floor: HiddenFloor,
    pub firmware: Firmware,
    pub forces: Forces,
    pub sensing: Sensing,
    /// Battery voltage lost per second.
    pub droop_v_per_s: f64,
}
