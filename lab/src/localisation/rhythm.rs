//! When pictures arrive within the period of the control loop, so that the loop can tick just after them.

use std::f64::consts::TAU;

/// Arrivals that are looked at: half a second of two cameras at 60 Hz.
const ARRIVALS: usize = 64;
/// Share of the arrivals that the loop should not be ahead of.
const SHARE: f64 = 0.9;
/// From the arrival to the tick, for the poses' way to the loop.
const MARGIN_US: f64 = 400.0;
/// Mean length of the arrivals' unit vectors below which there is no rhythm: cameras that run freely.
const RHYTHM_LEAST: f64 = 0.6;

/// The last arrivals.
#[derive(Debug, Clone)]
pub(super) struct Rhythm {
    arrivals_us: [i64; ARRIVALS],
    count: usize,
}

impl Default for Rhythm {
    fn default() -> Self {
        Self {
            arrivals_us: [0; ARRIVALS],
            count: 0,
        }
    }
}

impl Rhythm {
    /// A picture arrived.
    pub(super) fn note(&mut self, arrival_us: i64) {
        if let Some(place) = self.arrivals_us.get_mut(self.count % ARRIVALS) {
            *place = arrival_us;
        }
        self.count += 1;
    }

    /// Best moment for ticks, as the rest of its time divided by the period; `None` without a rhythm.
    pub(super) fn phase_us(&self, period_us: f64) -> Option<f64> {
        if self.count < ARRIVALS {
            return None;
        }
        let angles: Vec<f64> = self
            .arrivals_us
            .iter()
            .map(|arrival_us| (*arrival_us as f64 % period_us) / period_us * TAU)
            .collect();
        let (sin, cos) = angles
            .iter()
            .fold((0.0, 0.0), |(sin, cos), angle| (sin + angle.sin(), cos + angle.cos()));
        if sin.hypot(cos) < RHYTHM_LEAST * ARRIVALS as f64 {
            return None;
        }
        let middle = sin.atan2(cos);
        let mut late: Vec<f64> = angles
            .iter()
            .map(|angle| {
                let off = angle - middle;
                off - TAU * (off / TAU).round()
            })
            .collect();
        late.sort_by(f64::total_cmp);
        let at = late.get((SHARE * ARRIVALS as f64) as usize)?;
        Some(((middle + at) / TAU * period_us + MARGIN_US).rem_euclid(period_us))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_US: f64 = 25_000.0 / 3.0;

    #[test]
    fn ticks_follow_pictures_that_come_with_the_loop_even_across_the_wrap() {
        for shift_us in [0, 2000, 4000, 8000] {
            let mut rhythm = Rhythm::default();
            for k in 0..200_i64 {
                // Every second period, up to 0.5 ms late.
                rhythm.note(shift_us + (k * 50_000) / 3 + (k * 37) % 500);
            }
            let phase_us = rhythm.phase_us(PERIOD_US).expect("a rhythm");
            let after_us = (phase_us - shift_us as f64).rem_euclid(PERIOD_US);
            assert!((700.0..1000.0).contains(&after_us), "{shift_us}: {after_us}");
        }
    }

    #[test]
    fn free_running_cameras_and_too_few_pictures_have_no_rhythm() {
        let mut rhythm = Rhythm::default();
        for k in 0..40 {
            rhythm.note(k * 8333);
        }
        assert_eq!(rhythm.phase_us(PERIOD_US), None);
        for k in 0..200 {
            rhythm.note(k * 9117);
        }
        assert_eq!(rhythm.phase_us(PERIOD_US), None);
    }
}
