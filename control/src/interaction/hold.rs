//! When the correction rests.

use crate::safety::Intervention;

/// The filter changes more than this.
const CHANGED_M_PER_S: f64 = 0.05;
const CHANGED_RAD_PER_S: f64 = 0.3;
/// So many ticks in a row: something is in the way.
const CHANGED_TICKS: u32 = 12;
/// The correction rests for so long after the filter was in the way, and after a doubt.
const CLEAR_TICKS: u32 = 60;
const DOUBT_TICKS: u32 = 120;

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Hold {
    changed_ticks: u32,
    rest_ticks: u32,
}

impl Hold {
    /// - `believed`: model, pose and delay can be believed.
    pub(super) fn allows(&mut self, believed: bool) -> bool {
        if !believed {
            self.rest_ticks = self.rest_ticks.max(CLEAR_TICKS);
        }
        self.rest_ticks == 0
    }

    pub(super) fn doubt(&mut self) {
        self.rest_ticks = DOUBT_TICKS;
    }

    /// What the filter changed on this tick.
    pub(super) fn note(&mut self, intervention: Option<&Intervention>) {
        self.rest_ticks = self.rest_ticks.saturating_sub(1);
        // True also of what is not a number.
        let changed = intervention.is_some_and(|intervention| {
            !(intervention.change_m_per_s < CHANGED_M_PER_S && intervention.change_rad_per_s < CHANGED_RAD_PER_S)
        });
        self.changed_ticks = if changed { self.changed_ticks + 1 } else { 0 };
        if self.changed_ticks > CHANGED_TICKS {
            self.changed_ticks = 0;
            self.rest_ticks = CLEAR_TICKS;
        }
    }
}
