//! Poses of the last 0.4 s.

/// Steps kept, at 480 Hz 0.4 s.
const LENGTH: usize = 192;

/// A ring of poses, one a step.
#[derive(Debug, Clone)]
pub(super) struct History {
    poses: [[f64; 3]; LENGTH],
    /// Where the newest stands.
    newest: usize,
    filled: usize,
}

impl Default for History {
    fn default() -> Self {
        Self {
            poses: [[0.0; 3]; LENGTH],
            newest: 0,
            filled: 0,
        }
    }
}

impl History {
    pub(super) fn push(&mut self, pose: [f64; 3]) {
        self.newest = (self.newest + 1) % LENGTH;
        self.poses[self.newest] = pose;
        self.filled = (self.filled + 1).min(LENGTH);
    }

    /// Pose so many steps ago, between two steps in proportion; yaws are not wrapped, so that this is right.
    pub(super) fn at(&self, steps: f64) -> Option<[f64; 3]> {
        let whole = libm::floor(steps);
        let (back, share) = (whole as usize, steps - whole);
        let later = self.back(back)?;
        if share == 0.0 {
            return Some(later);
        }
        let earlier = self.back(back + 1)?;
        Some(core::array::from_fn(|i| later[i] + share * (earlier[i] - later[i])))
    }

    fn back(&self, steps: usize) -> Option<[f64; 3]> {
        (steps < self.filled).then(|| self.poses[(self.newest + LENGTH - steps) % LENGTH])
    }

    /// Moves all poses by a correction, so that older fixes are not counted twice.
    pub(super) fn shift(&mut self, by: [f64; 3]) {
        for pose in &mut self.poses {
            for (value, by) in pose.iter_mut().zip(by) {
                *value += by;
            }
        }
    }
}
