//! Where an angle turned back: what decides on which side of a play the driven part lies.

/// Turning points kept; of a deeper nest the smallest swing is forgotten.
const KEPT: usize = 12;

/// The turning points of an angle that still matter, oldest first, the angle now last.
///
/// A wider swing wipes out those inside of it, since a play that has been pushed through does not remember how often it
/// was before (Mayergoyz, *Mathematical Models of Hysteresis*, 1991, section 1.2). A nest of ever smaller swings is left.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reversals {
    points_rad: [f64; KEPT],
    count: usize,
}

impl Reversals {
    /// Takes note of the angle, rad; what is not finite is left out.
    pub fn push(&mut self, angle_rad: f64) {
        if !angle_rad.is_finite() {
            return;
        }
        while let Some(last) = self.points().last() {
            // Before the first point the angle was straight, as if it came from the other side.
            let before = self.count.checked_sub(2).map_or(-last, |at| self.points_rad[at]);
            let (swing, step) = (last - before, angle_rad - last);
            if swing * step >= 0.0 {
                self.count -= 1;
            } else if step.abs() >= swing.abs() {
                self.count -= self.count.min(2);
            } else {
                break;
            }
        }
        if self.count == KEPT {
            self.count -= 2;
        }
        self.points_rad[self.count] = angle_rad;
        self.count += 1;
    }

    /// Angle of a part that the first one drags along through a play of twice `half_rad`, rad, straight at first; `None` where
    /// nothing is known.
    pub fn dragged_rad(&self, half_rad: f64) -> Option<f64> {
        let drag = |place: f64, angle: &f64| place.max(angle - half_rad).min(angle + half_rad);
        (self.count > 0).then(|| self.points().iter().fold(0.0, drag))
    }

    fn points(&self) -> &[f64] {
        &self.points_rad[..self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angles that wander, from a linear congruential generator.
    fn wander(seed: u64, steps: usize) -> Vec<f64> {
        let mut state = seed;
        let mut angle_rad = 0.0;
        (0..steps)
            .map(|_| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                let part = (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
                angle_rad = 0.9 * angle_rad + 0.2 * part;
                angle_rad
            })
            .collect()
    }

    #[test]
    fn the_part_lies_where_the_whole_path_dragged_it() {
        for seed in 0..40 {
            for half_rad in [0.0, 0.005, 0.02, 0.05, 0.2] {
                let mut reversals = Reversals::default();
                let mut place: f64 = 0.0;
                for angle in wander(seed, 300) {
                    reversals.push(angle);
                    place = place.max(angle - half_rad).min(angle + half_rad);
                    let known = reversals.dragged_rad(half_rad).expect("angles were pushed");
                    assert!(
                        (known - place).abs() < 1e-12,
                        "seed {seed}, half {half_rad}: {known} {place}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_deep_nest_forgets_its_smallest_swings_only() {
        let mut reversals = Reversals::default();
        let mut place: f64 = 0.0;
        let half_rad = 0.1;
        let mut size = 0.5;
        for k in 0..60 {
            size *= 0.93;
            let angle = if k % 2 == 0 { size } else { -size };
            reversals.push(angle);
            place = place.max(angle - half_rad).min(angle + half_rad);
            let known = reversals.dragged_rad(half_rad).expect("angles were pushed");
            assert!((known - place).abs() < 0.12, "swing {k}: {known} {place}");
        }
    }

    #[test]
    fn nothing_is_known_without_angles() {
        let mut reversals = Reversals::default();
        reversals.push(f64::NAN);
        assert_eq!(reversals.dragged_rad(0.1), None);
        reversals.push(0.0);
        assert_eq!(reversals.dragged_rad(0.1), Some(0.0));
    }
}
