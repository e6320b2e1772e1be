//! From tracker poses to what the control law and the safety filter see: the newest believable pose, its age and
//! the velocity behind it. Rejects what no robot can do (jumps, swapped identities) and pictures that stand still.

/// Poses the velocity is fitted to: 8 poses span 58 ms at 120 Hz, 1 mm of pose noise becomes 18 mm/s.
const FIT_POSES: usize = 8;
/// Older poses say nothing about the velocity now.
const FIT_SPAN_US: i64 = 150_000;
/// A jump is more than the largest speed allows plus this.
const JUMP_MARGIN_M: f64 = 0.03;
/// Same for the yaw.
const JUMP_MARGIN_RAD: f64 = 0.08;
/// Further than this beyond what is possible a pose is another's: no slide and no late telemetry explains it.
const IMPOSTOR_M: f64 = 0.1;
const IMPOSTOR_RAD: f64 = 0.3;
/// Longest time between two pictures of a motion that goes on.
const MOTION_GAP_US: i64 = 100_000;
/// Poses that do not change while the wheels report this much travel come from a frozen picture.
const FROZEN_TRAVEL_M: f64 = 0.02;

/// Readings of the wheels that are kept: longer than a pose is on its way.
const ODOMETER_READINGS: usize = 16;
/// Way of the body for that of the fastest rim: two omni wheels at right angles make sqrt 2 of it, the rest is wear.
const WHEEL_WAY: f64 = 1.5;
/// A robot on locked wheels slides on for no longer than this at the speed it had.
const SLIDE_S: f64 = 0.3;

/// What the wheels had travelled up to a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Odometer {
    at_us: i64,
    travelled_m: f64,
}

/// A pose at an exposure time, world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseSample {
    pub exposure_us: i64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

/// The fastest a robot can be, from its wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits {
    pub speed_m_per_s: f64,
    pub yaw_rate_rad_per_s: f64,
}

/// What became of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Belief {
    Accepted,
    /// Not newer than the last one.
    Old,
    /// Further away than the robot can have moved.
    Jump,
    /// Unchanged while the wheels turn.
    Frozen,
    /// Not a finite number.
    Broken,
}

/// Pose and velocity of one robot.
#[derive(Debug, Clone)]
pub struct PoseTrack {
    limits: MotionLimits,
    poses: [PoseSample; FIT_POSES],
    count: usize,
    travel_since_change_m: f64,
    /// What the wheels reported up to some moments, newest first; their number.
    odometer: [Odometer; ODOMETER_READINGS],
    readings: usize,
    /// Reading at the newest believed pose.
    odometer_at_pose_m: Option<f64>,
    /// World velocity at the newest pose, where the localisation tells it.
    velocity: Option<[f64; 3]>,
    /// The newest pose of a motion that began with a jump: it stays a lie when the robot could have got there meanwhile.
    impostor: Option<PoseSample>,
}

/// Angle wrapped to +-pi.
pub fn wrap_rad(angle_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle_rad - turn * (angle_rad / turn).round()
}

impl PoseTrack {
    /// An empty track.
    pub const fn new(limits: MotionLimits) -> Self {
        let nowhere = PoseSample {
            exposure_us: i64::MIN,
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: 0.0,
        };
        Self {
            limits,
            poses: [nowhere; FIT_POSES],
            count: 0,
            travel_since_change_m: 0.0,
            odometer: [Odometer {
                at_us: i64::MIN,
                travelled_m: 0.0,
            }; ODOMETER_READINGS],
            readings: 0,
            odometer_at_pose_m: None,
            velocity: None,
            impostor: None,
        }
    }

    /// The newest believed pose.
    pub fn newest(&self) -> Option<PoseSample> {
        self.poses.first().copied().filter(|_| self.count > 0)
    }

    /// Path length the wheels report since the last call.
    pub fn wheels_travelled(&mut self, travel_m: f64) {
        self.travel_since_change_m += travel_m.abs();
    }

    /// As [`Self::wheels_travelled`] of a robot that tells when: a pose is then held against the way of the wheels, not only
    /// against the fastest the robot could be.
    ///
    /// - `until_us`: moment up to which the travel is known, the clock's bound taken off.
    pub fn wheels_travelled_until(&mut self, travel_m: f64, until_us: i64) {
        self.wheels_travelled(travel_m);
        let before_m = self.odometer.first().map_or(0.0, |reading| reading.travelled_m);
        self.odometer.rotate_right(1);
        if let Some(first) = self.odometer.first_mut() {
            *first = Odometer {
                at_us: until_us,
                travelled_m: before_m + travel_m.abs(),
            };
        }
        self.readings = (self.readings + 1).min(ODOMETER_READINGS);
    }

    /// Telemetry was missing for too long to say how far the wheels went.
    pub fn wheels_unknown(&mut self) {
        self.readings = 0;
        self.odometer_at_pose_m = None;
    }

    /// Furthest that the robot can be from the newest believed pose, m.
    fn reach_m(&self, last: &PoseSample, sample: &PoseSample) -> f64 {
        let elapsed_s = (sample.exposure_us - last.exposure_us) as f64 * 1e-6;
        let fastest_m = self.limits.speed_m_per_s * elapsed_s;
        let newest = self.odometer.first().filter(|_| self.readings > 0);
        let (Some(newest), Some(then_m)) = (newest, self.odometer_at_pose_m) else {
            return fastest_m;
        };
        // After the last telemetry anything is possible; before it the wheels rolled, or the robot slid on.
        let untold_s = ((sample.exposure_us - newest.at_us) as f64 * 1e-6).max(0.0);
        let [forward, left, _] = self.twist();
        let rolled_m = WHEEL_WAY * (newest.travelled_m - then_m);
        let slid_m = forward.hypot(left) * elapsed_s.min(SLIDE_S);
        fastest_m.min(rolled_m.max(slid_m) + self.limits.speed_m_per_s * untold_s)
    }

    /// What the wheels had reported at a moment; the oldest reading if it is older than that.
    fn odometer_at_m(&self, at_us: i64) -> Option<f64> {
        let readings = || self.odometer.iter().take(self.readings);
        let at = readings().find(|reading| reading.at_us <= at_us);
        at.or_else(|| readings().next_back()).map(|reading| reading.travelled_m)
    }

    /// Takes a pose of the localisation.
    ///
    /// - `velocity`: in the world at that moment, m/s, m/s, rad/s; without it the poses' own slope is used.
    pub fn observe(&mut self, sample: PoseSample, velocity: Option<[f64; 3]>) -> Belief {
        if !(sample.x_m.is_finite() && sample.y_m.is_finite() && sample.yaw_rad.is_finite()) {
            return Belief::Broken;
        }
        if let Some(last) = self.newest() {
            if sample.exposure_us <= last.exposure_us {
                return Belief::Old;
            }
            let unchanged = PoseSample {
                exposure_us: sample.exposure_us,
                ..last
            } == sample;
            if unchanged && self.travel_since_change_m > FROZEN_TRAVEL_M {
                return Belief::Frozen;
            }
            if self.is_impostor(&last, &sample) {
                self.impostor = Some(sample);
                return Belief::Jump;
            }
            let [beyond_m, beyond_rad] = self.beyond(&last, &sample);
            if beyond_m > 0.0 || beyond_rad > 0.0 {
                return Belief::Jump;
            }
            self.impostor = None;
            if !unchanged {
                self.travel_since_change_m = 0.0;
            }
        }
        self.poses.rotate_right(1);
        if let Some(first) = self.poses.first_mut() {
            *first = sample;
        }
        self.count = (self.count + 1).min(FIT_POSES);
        self.odometer_at_pose_m = self.odometer_at_m(sample.exposure_us);
        self.velocity = velocity.filter(|velocity| velocity.iter().all(|part| part.is_finite()));
        Belief::Accepted
    }

    /// A place at which the cameras together do not believe the robot. They give in after a while; this remembers how it began.
    pub fn refused(&mut self, sample: PoseSample) {
        if self.newest().is_some_and(|last| self.is_impostor(&last, &sample)) {
            self.impostor = Some(sample);
        }
    }

    /// True for a pose that is far from anything possible, and for those that go on from one.
    fn is_impostor(&self, last: &PoseSample, sample: &PoseSample) -> bool {
        let [beyond_m, beyond_rad] = self.beyond(last, sample);
        beyond_m > IMPOSTOR_M || beyond_rad > IMPOSTOR_RAD || self.goes_on(sample)
    }

    /// How far a pose is beyond what the robot can have done, m and rad; positive is a jump.
    fn beyond(&self, last: &PoseSample, sample: &PoseSample) -> [f64; 2] {
        let elapsed_s = (sample.exposure_us - last.exposure_us) as f64 * 1e-6;
        let moved_m = f64::hypot(sample.x_m - last.x_m, sample.y_m - last.y_m);
        let turned_rad = wrap_rad(sample.yaw_rad - last.yaw_rad).abs();
        [
            moved_m - self.reach_m(last, sample) - JUMP_MARGIN_M,
            turned_rad - self.limits.yaw_rate_rad_per_s * elapsed_s - JUMP_MARGIN_RAD,
        ]
    }

    /// True when a pose goes on with the motion that began with a jump.
    fn goes_on(&self, sample: &PoseSample) -> bool {
        let Some(before) = self.impostor else { return false };
        let elapsed_us = sample.exposure_us - before.exposure_us;
        let elapsed_s = elapsed_us as f64 * 1e-6;
        let moved_m = f64::hypot(sample.x_m - before.x_m, sample.y_m - before.y_m);
        let turned_rad = wrap_rad(sample.yaw_rad - before.yaw_rad).abs();
        (0..=MOTION_GAP_US).contains(&elapsed_us)
            && moved_m <= self.limits.speed_m_per_s * elapsed_s + JUMP_MARGIN_M
            && turned_rad <= self.limits.yaw_rate_rad_per_s * elapsed_s + JUMP_MARGIN_RAD
    }

    /// Body twist at the newest pose, forward m/s, left m/s, yaw rate rad/s: the localisation's velocity, or a
    /// straight-line fit over the newest poses.
    pub fn twist(&self) -> [f64; 3] {
        let Some(newest) = self.newest() else { return [0.0; 3] };
        if let Some([x, y, yaw]) = self.velocity {
            let (sin, cos) = newest.yaw_rad.sin_cos();
            return [cos * x + sin * y, cos * y - sin * x, yaw];
        }
        let recent = self
            .poses
            .iter()
            .take(self.count)
            .filter(|pose| newest.exposure_us - pose.exposure_us <= FIT_SPAN_US);
        let (mut n, mut t_sum, mut tt_sum) = (0.0, 0.0, 0.0);
        let (mut sums, mut t_sums) = ([0.0; 3], [0.0; 3]);
        for pose in recent {
            let t = (pose.exposure_us - newest.exposure_us) as f64 * 1e-6;
            let value = [
                pose.x_m - newest.x_m,
                pose.y_m - newest.y_m,
                wrap_rad(pose.yaw_rad - newest.yaw_rad),
            ];
            n += 1.0;
            t_sum += t;
            tt_sum += t * t;
            for ((sum, t_sum), value) in sums.iter_mut().zip(&mut t_sums).zip(value) {
                *sum += value;
                *t_sum += t * value;
            }
        }
        let spread = n * tt_sum - t_sum * t_sum;
        if n < 3.0 || spread <= 0.0 {
            return [0.0; 3];
        }
        let mut slope = [0.0; 3];
        for ((slope, sum), t_value) in slope.iter_mut().zip(sums).zip(t_sums) {
            *slope = (n * t_value - t_sum * sum) / spread;
        }
        let [x, y, yaw] = slope;
        let (sin, cos) = newest.yaw_rad.sin_cos();
        [cos * x + sin * y, cos * y - sin * x, yaw]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: MotionLimits = MotionLimits {
        speed_m_per_s: 1.5,
        yaw_rate_rad_per_s: 5.0,
    };

    fn at(k: i64, x_m: f64, y_m: f64, yaw_rad: f64) -> PoseSample {
        PoseSample {
            exposure_us: k * 8333,
            x_m,
            y_m,
            yaw_rad,
        }
    }

    #[test]
    fn finds_the_body_twist_of_a_steady_drive_across_the_wrap() {
        let mut track = PoseTrack::new(LIMITS);
        for k in 0..20 {
            let t = k as f64 * 8333e-6;
            // Moves along world y at 0.5 m/s with the nose almost at pi, turning through the wrap.
            let pose = at(k, 0.0, 0.5 * t, wrap_rad(3.1 + 1.0 * t));
            assert_eq!(track.observe(pose, None), Belief::Accepted);
        }
        let newest = track.newest().expect("a pose");
        let [forward, left, rate] = track.twist();
        let (sin, cos) = newest.yaw_rad.sin_cos();
        assert!(
            (forward - 0.5 * sin).abs() < 1e-9 && (left - 0.5 * cos).abs() < 1e-9,
            "{forward} {left}"
        );
        assert!((rate - 1.0).abs() < 1e-9);
    }

    #[test]
    fn rejects_jumps_until_the_robot_could_have_got_there() {
        let mut track = PoseTrack::new(LIMITS);
        track.observe(at(0, 0.0, 0.0, 0.0), None);
        assert_eq!(track.observe(at(1, 0.5, 0.0, 0.0), None), Belief::Jump);
        assert_eq!(track.observe(at(1, 0.0, 0.0, 1.0), None), Belief::Jump);
        assert_eq!(track.observe(at(60, 0.5, 0.0, 0.0), None), Belief::Accepted);
        assert_eq!(track.observe(at(60, 0.5, 0.0, 0.0), None), Belief::Old);
        assert_eq!(track.observe(at(61, f64::NAN, 0.0, 0.0), None), Belief::Broken);
    }

    #[test]
    fn a_jump_is_never_believed_while_the_wheels_stand() {
        let mut track = PoseTrack::new(LIMITS);
        let travel = |track: &mut PoseTrack, k: i64, travel_m: f64| {
            track.wheels_travelled_until(travel_m, k * 8333);
        };
        travel(&mut track, 0, 0.0);
        assert_eq!(track.observe(at(0, 0.0, 0.0, 0.0), None), Belief::Accepted);
        for k in 1..200 {
            travel(&mut track, k, 0.0);
            assert_eq!(track.observe(at(k, 0.3, 0.0, 0.0), None), Belief::Jump, "{k}");
        }
        // The wheels did roll 0.2 m meanwhile: a robot on omni wheels may be 0.3 m away, but this is what jumped there.
        travel(&mut track, 200, 0.2);
        assert_eq!(track.observe(at(200, 0.3, 0.0, 0.0), None), Belief::Jump);
        // Seen there anew, it may be the robot.
        assert_eq!(track.observe(at(215, 0.3, 0.0, 0.0), None), Belief::Accepted);
        // Without telemetry only the largest speed counts.
        track.wheels_unknown();
        assert_eq!(track.observe(at(216, 0.8, 0.0, 0.0), None), Belief::Jump);
        assert_eq!(track.observe(at(335, 0.8, 0.0, 0.0), None), Belief::Accepted);
    }

    /// A robot that brakes from 1 m/s is reported 0.3 m behind: its own way soon makes that possible, and it is a lie all the same.
    #[test]
    fn a_motion_that_began_with_a_jump_is_believed_when_it_jumps_back_only() {
        let mut track = PoseTrack::new(LIMITS);
        let x_m = |k: i64| {
            let t = (k as f64 * 8333e-6).min(0.25);
            t - 2.0 * t * t
        };
        for k in 0..60 {
            track.wheels_travelled_until((x_m(k) - x_m(k - 1)).max(0.0), k * 8333);
            let lie_m = if k > 3 && k < 50 { -0.31 } else { 0.0 };
            let belief = track.observe(at(k, x_m(k) + lie_m, 0.0, 0.0), Some([1.0, 0.0, 0.0]));
            let expected = if lie_m == 0.0 { Belief::Accepted } else { Belief::Jump };
            assert_eq!(belief, expected, "{k}");
        }
    }

    /// The same where the cameras' fusion refuses the lie itself for half a second and then takes it for the robot.
    #[test]
    fn a_lie_that_the_cameras_give_in_to_is_not_believed() {
        let mut track = PoseTrack::new(LIMITS);
        track.observe(at(0, 0.0, 0.0, 0.0), None);
        for k in 1..60 {
            track.refused(at(k, 0.4, 0.0, 0.0));
        }
        for k in 60..90 {
            assert_eq!(track.observe(at(k, 0.4, 0.0, 0.0), None), Belief::Jump, "{k}");
        }
        // Without the refusals it is a robot that was not seen for half a second.
        let mut track = PoseTrack::new(LIMITS);
        track.observe(at(0, 0.0, 0.0, 0.0), None);
        assert_eq!(track.observe(at(60, 0.4, 0.0, 0.0), None), Belief::Accepted);
    }

    /// Half a turn is a lie for as long as it is told, not until the robot could have turned.
    #[test]
    fn a_pose_that_turned_round_is_not_believed_later() {
        let mut track = PoseTrack::new(LIMITS);
        track.observe(at(0, 0.0, 0.0, 0.0), None);
        for k in 1..200 {
            assert_eq!(track.observe(at(k, 0.0, 0.0, 3.1), None), Belief::Jump, "{k}");
        }
        assert_eq!(track.observe(at(200, 0.0, 0.0, 0.0), None), Belief::Accepted);
    }

    /// A robot that slides a little further than is expected of it is believed as soon as that is possible.
    #[test]
    fn a_slide_is_no_lie() {
        let mut track = PoseTrack::new(LIMITS);
        for k in 0..3 {
            track.wheels_travelled_until(0.0, k * 8333);
            track.observe(at(k, 0.0, 0.0, 0.0), None);
        }
        let beliefs: Vec<Belief> = (3..30)
            .map(|k| {
                if k > 10 {
                    track.wheels_travelled_until(0.01, k * 8333);
                }
                // Pictures differ from one to the next.
                track.observe(at(k, 0.05 + 1e-5 * k as f64, 0.0, 0.0), None)
            })
            .collect();
        assert_eq!(beliefs.first(), Some(&Belief::Jump));
        assert_eq!(beliefs.last(), Some(&Belief::Accepted));
    }

    #[test]
    fn notices_a_frozen_picture_only_while_the_wheels_turn() {
        let mut track = PoseTrack::new(LIMITS);
        for k in 0..50 {
            assert_eq!(track.observe(at(k, 1.0, 1.0, 0.0), None), Belief::Accepted);
        }
        track.wheels_travelled(0.015);
        assert_eq!(track.observe(at(50, 1.0, 1.0, 0.0), None), Belief::Accepted);
        track.wheels_travelled(0.015);
        assert_eq!(track.observe(at(51, 1.0, 1.0, 0.0), None), Belief::Frozen);
        assert_eq!(track.observe(at(52, 1.001, 1.0, 0.0), None), Belief::Accepted);
        assert_eq!(track.newest().map(|pose| pose.exposure_us), Some(52 * 8333));
    }
}
