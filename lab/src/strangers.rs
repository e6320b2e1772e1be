//! Robots on the floor that are not in the run: they stand where they were left, or somebody moves them. The localisation
//! sees them; the safety filter keeps the run's robots off them.

use crate::pose_frame::SeenPose;
use control::safety::MovingDisc;

/// Most of them; with more on the floor the run's robots stop.
pub const MOST: usize = 32;
/// Circle of a robot that the laboratory does not know: a square of 0.35 m fits into it.
const UNKNOWN_RADIUS_M: f64 = 0.25;
/// A push changes its velocity by no more than this.
const PUSH_M_PER_S2: f64 = 1.0;
/// A tag that was read so often within this time is a robot, and not an error of the reading.
const SIGHTINGS: u32 = 3;
const SIGHTED_US: i64 = 1_000_000;
/// A robot that was not seen for this long stands, somewhere: it is that much larger.
const HIDDEN_US: i64 = 500_000;
const HIDDEN_M: f64 = 0.15;
/// And for this long it is not on the floor any more.
const GONE_US: i64 = 10_000_000;
/// A robot that stands as a fixed obstacle has been moved when it is this far from its place.
const MOVED_M: f64 = 0.03;
/// The way between two poses this far apart makes a velocity where the localisation does not tell one.
const SLOPE_US: i64 = 60_000;

#[derive(Debug, Clone, Copy)]
struct Stranger {
    number: u8,
    sightings: u32,
    exposure_us: i64,
    position_m: [f64; 2],
    velocity_m_per_s: [f64; 2],
    /// Where the slope begins.
    anchor: (i64, [f64; 2]),
}

/// See the module. Allocates only in `new`.
#[derive(Debug, Clone)]
pub struct Strangers {
    /// Circle of each number.
    radii_m: [f64; 256],
    /// Robots that the arena of this run has as fixed obstacles, with their places.
    standing: Vec<(u8, [f64; 2])>,
    /// In the order of their numbers.
    seen: Vec<Stranger>,
    discs: Vec<MovingDisc>,
}

impl Default for Strangers {
    fn default() -> Self {
        Self::new(&[])
    }
}

impl Strangers {
    /// - `known`: number and bounding radius, m, of the laboratory's robots.
    pub fn new(known: &[(u8, f64)]) -> Self {
        let mut radii_m = [UNKNOWN_RADIUS_M; 256];
        for (number, radius_m) in known {
            if let Some(slot) = radii_m.get_mut(usize::from(*number)) {
                *slot = *radius_m;
            }
        }
        Self {
            radii_m,
            standing: Vec::new(),
            // One more than there may be, so that too many are noticed.
            seen: Vec::with_capacity(MOST + 1),
            discs: Vec::with_capacity(MOST + 1),
        }
    }

    /// Robots that are fixed obstacles already, with their places, m: they count here once they are moved.
    #[must_use]
    pub fn beside(mut self, standing: Vec<(u8, [f64; 2])>) -> Self {
        self.standing = standing;
        self
    }

    /// A robot of no run was seen.
    ///
    /// - `exposure_us`: when; older sightings than the newest are not used.
    pub fn see(&mut self, pose: &SeenPose, exposure_us: i64) {
        let position_m = [pose.x_m, pose.y_m];
        if !(pose.x_m.is_finite() && pose.y_m.is_finite()) {
            return;
        }
        let fresh = Stranger {
            number: pose.number,
            sightings: 1,
            exposure_us,
            position_m,
            velocity_m_per_s: [0.0; 2],
            anchor: (exposure_us, position_m),
        };
        let place = self.seen.partition_point(|one| one.number < pose.number);
        let room = self.seen.len() <= MOST;
        match self.seen.get_mut(place).filter(|one| one.number == pose.number) {
            Some(one) if exposure_us <= one.exposure_us => {}
            Some(one) if one.sightings < SIGHTINGS && exposure_us - one.exposure_us > SIGHTED_US => *one = fresh,
            Some(one) => one.follow(pose, exposure_us),
            None if room => self.seen.insert(place, fresh),
            // More than enough to stop for.
            None => {}
        }
    }

    /// What the safety filter is told.
    pub fn discs(&mut self, now_us: i64) -> &[MovingDisc] {
        self.seen.retain(|one| now_us - one.exposure_us < GONE_US);
        self.discs.clear();
        let stands = |one: &&Stranger| {
            let place = self.standing.iter().find(|(number, _)| *number == one.number);
            place.is_some_and(|(_, [x_m, y_m])| f64::hypot(one.position_m[0] - x_m, one.position_m[1] - y_m) < MOVED_M)
        };
        let robots = self
            .seen
            .iter()
            .filter(|one| one.sightings >= SIGHTINGS && !stands(one));
        self.discs.extend(robots.map(|one| {
            let age_us = (now_us - one.exposure_us).max(0);
            let hidden = age_us > HIDDEN_US;
            let radius_m = self.radii_m.get(usize::from(one.number));
            MovingDisc {
                id: u32::from(one.number),
                position_m: one.position_m,
                velocity_m_per_s: if hidden { [0.0; 2] } else { one.velocity_m_per_s },
                radius_m: radius_m.copied().unwrap_or(UNKNOWN_RADIUS_M) + if hidden { HIDDEN_M } else { 0.0 },
                age_s: age_us.min(HIDDEN_US) as f64 * 1e-6,
                acceleration_m_per_s2: PUSH_M_PER_S2,
            }
        }));
        &self.discs
    }
}

impl Stranger {
    fn follow(&mut self, pose: &SeenPose, exposure_us: i64) {
        self.sightings = self.sightings.saturating_add(1);
        self.exposure_us = exposure_us;
        self.position_m = [pose.x_m, pose.y_m];
        let (since_us, from_m) = self.anchor;
        let elapsed_us = exposure_us - since_us;
        if let Some([x, y, _]) = pose
            .velocity
            .filter(|velocity| velocity.iter().all(|part| part.is_finite()))
        {
            self.velocity_m_per_s = believable([x, y]);
        } else if elapsed_us >= SLOPE_US {
            let per_s = 1e6 / elapsed_us as f64;
            let [x0, y0] = from_m;
            self.velocity_m_per_s = believable([(pose.x_m - x0) * per_s, (pose.y_m - y0) * per_s]);
        }
        if elapsed_us >= SLOPE_US {
            self.anchor = (exposure_us, self.position_m);
        }
    }
}

/// Nobody pushes a robot faster than this; what seems to is carried.
fn believable([x, y]: [f64; 2]) -> [f64; 2] {
    const FASTEST_M_PER_S: f64 = 3.0;
    let speed = x.hypot(y);
    if speed > FASTEST_M_PER_S {
        [x * FASTEST_M_PER_S / speed, y * FASTEST_M_PER_S / speed]
    } else {
        [x, y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_US: i64 = 8333;

    fn pose(number: u8, x_m: f64, velocity: Option<[f64; 3]>) -> SeenPose {
        SeenPose {
            number,
            x_m,
            y_m: 0.5,
            yaw_rad: 0.0,
            velocity,
            spread: None,
        }
    }

    #[test]
    fn one_reading_is_an_error_and_three_are_a_robot() {
        let mut strangers = Strangers::new(&[(7, 0.3)]);
        strangers.see(&pose(7, 1.0, None), 0);
        strangers.see(&pose(7, 1.0, None), 2_000_000);
        strangers.see(&pose(7, 1.0, None), 2_000_000 + TICK_US);
        assert!(strangers.discs(2_000_000 + TICK_US).is_empty());
        strangers.see(&pose(7, 1.0, None), 2_000_000 + 2 * TICK_US);
        let discs = strangers.discs(2_000_000 + 3 * TICK_US);
        assert_eq!(discs.len(), 1);
        assert_eq!(
            (discs[0].id, discs[0].radius_m, discs[0].position_m),
            (7, 0.3, [1.0, 0.5])
        );
        assert!((discs[0].age_s - 0.008_333).abs() < 1e-9);
    }

    #[test]
    fn a_parked_robot_is_an_obstacle_until_it_is_pushed() {
        let mut strangers = Strangers::default().beside(vec![(3, [1.0, 0.5])]);
        for k in 0..3 {
            strangers.see(&pose(3, 1.02, None), k * TICK_US);
            strangers.see(&pose(4, 1.0, None), k * TICK_US);
        }
        let discs = strangers.discs(3 * TICK_US);
        assert_eq!((discs.len(), discs[0].id), (1, 4));
        strangers.see(&pose(3, 1.04, None), 3 * TICK_US);
        assert_eq!(strangers.discs(4 * TICK_US).len(), 2);
    }

    #[test]
    fn a_pushed_one_has_the_velocity_that_is_told_or_that_its_poses_show() {
        for told in [None, Some([0.4, 0.0, 0.1])] {
            let mut strangers = Strangers::default();
            for k in 0..30 {
                strangers.see(&pose(3, 0.4 * (k * TICK_US) as f64 * 1e-6, told), k * TICK_US);
            }
            let [vx, vy] = strangers.discs(30 * TICK_US)[0].velocity_m_per_s;
            assert!((vx - 0.4).abs() < 1e-9 && vy.abs() < 1e-9, "{vx} {vy}");
        }
    }

    #[test]
    fn a_hidden_one_stands_and_is_larger_until_it_is_forgotten() {
        let mut strangers = Strangers::default();
        for k in 0..30 {
            strangers.see(&pose(3, 0.0, Some([0.4, 0.0, 0.0])), k * TICK_US);
        }
        let last_us = 29 * TICK_US;
        let hidden = strangers.discs(last_us + 600_000)[0];
        assert_eq!(hidden.velocity_m_per_s, [0.0; 2]);
        assert!((hidden.radius_m - 0.40).abs() < 1e-12 && (hidden.age_s - 0.5).abs() < 1e-12);
        assert_eq!(strangers.discs(last_us + 9_000_000).len(), 1);
        assert!(strangers.discs(last_us + 10_000_001).is_empty());
    }

    #[test]
    fn too_many_are_told_of_and_numbers_stand_in_order() {
        let mut strangers = Strangers::default();
        for k in 0..3 {
            for number in (1..=60).rev() {
                strangers.see(&pose(number, f64::from(number), None), k * TICK_US);
            }
        }
        let ids: Vec<u32> = strangers.discs(3 * TICK_US).iter().map(|disc| disc.id).collect();
        assert_eq!(ids.len(), MOST + 1);
        assert!(ids.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
