//! Effects of sensors: from a trace of true states to what is reported at a time stamp.
//!
//! Always in the order of the light: marker, its height, lens, scale, seam; times of the tracker and of the robot's clock
//! first.

use super::Effect;
use crate::PHYSICS_RATE_HZ;
use crate::pose::{Pose, wrapped_rad};
use crate::state::RobotState;

/// Height of the cameras over the floor, m.
const CAMERA_HEIGHT_M: f64 = 2.5;
/// Foot points of the two cameras: at plus and minus this x, m.
const CAMERA_FOOT_X_M: f64 = 1.0;
/// Field that a rolling shutter reads in its readout time, m.
const FIELD_HEIGHT_M: f64 = 3.0;

/// Time stamps are text with microseconds: one this close to a physics step is of that step.
const STAMP_TOLERANCE_STEPS: f64 = 1e-3;

/// The marker and everything between it and the tracker's pose come from here on.
const MARKER_RANK: u8 = 3;

/// One sensor effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SensorStage {
    Latency { latency_s: f64 },
    Shutter { readout_s: f64 },
    Clock { offset_s: f64, drift: f64 },
    Gyro { factor: f64, bias_rad_per_s: f64 },
    ImuYaw { cos: f64, sin: f64 },
    Current { factor: f64, bias_a: f64 },
    Marker { yaw_rad: f64, x_m: f64, y_m: f64 },
    TagHeight { factor: f64 },
    Lens { k1_per_m2: f64, x_m: f64, y_m: f64 },
    Scale { factor: f64 },
    Seam { x_m: f64, y_m: f64, yaw_rad: f64 },
}

/// The sensor effects of a list, in the order in which they act.
pub(crate) fn stages(effects: &[Effect]) -> Vec<SensorStage> {
    let mut stages: Vec<SensorStage> = effects.iter().filter_map(stage).collect();
    stages.sort_by_key(SensorStage::rank);
    stages
}

fn stage(effect: &Effect) -> Option<SensorStage> {
    let value = |name: &str| effect.value(name);
    Some(match effect.name.as_str() {
        "localization_latency" => SensorStage::Latency {
            latency_s: value("latency"),
        },
        "rolling_shutter" => SensorStage::Shutter {
            readout_s: value("readout"),
        },
        "clock_offset" => SensorStage::Clock {
            offset_s: value("offset"),
            drift: value("drift"),
        },
        "gyro_bias" => SensorStage::Gyro {
            factor: 1.0,
            bias_rad_per_s: value("bias"),
        },
        "gyro_scale" => SensorStage::Gyro {
            factor: 1.0 + value("relative"),
            bias_rad_per_s: 0.0,
        },
        "imu_yaw" => {
            let (sin, cos) = libm::sincos(value("yaw"));
            SensorStage::ImuYaw { cos, sin }
        }
        "current_sensor" => SensorStage::Current {
            factor: 1.0 + value("relative"),
            bias_a: value("bias"),
        },
        "marker_offset" => SensorStage::Marker {
            yaw_rad: value("yaw"),
            x_m: value("x"),
            y_m: value("y"),
        },
        "tag_height" => SensorStage::TagHeight {
            factor: CAMERA_HEIGHT_M / (CAMERA_HEIGHT_M - value("z")),
        },
        "lens_distortion" => SensorStage::Lens {
            k1_per_m2: value("k1"),
            x_m: value("x"),
            y_m: value("y"),
        },
        "pose_scale" => SensorStage::Scale {
            factor: 1.0 + value("relative"),
        },
        "camera_seam" => SensorStage::Seam {
            x_m: value("x"),
            y_m: value("y"),
            yaw_rad: value("yaw"),
        },
        _ => return None,
    })
}

impl SensorStage {
    fn rank(&self) -> u8 {
        match self {
            SensorStage::Latency { .. } | SensorStage::Shutter { .. } | SensorStage::Clock { .. } => 0,
            // A bias is added behind the scale.
            SensorStage::Gyro { bias_rad_per_s, .. } => 1 + u8::from(*bias_rad_per_s != 0.0),
            SensorStage::ImuYaw { .. } | SensorStage::Current { .. } => 2,
            SensorStage::Marker { .. } => MARKER_RANK,
            SensorStage::TagHeight { .. } => 4,
            SensorStage::Lens { .. } => 5,
            SensorStage::Scale { .. } => 6,
            SensorStage::Seam { .. } => 7,
        }
    }

    fn apply(&self, out: &mut RobotState) {
        match self {
            SensorStage::Latency { .. } | SensorStage::Shutter { .. } | SensorStage::Clock { .. } => {}
            SensorStage::Gyro { factor, bias_rad_per_s } => {
                out.gyro_z_rad_per_s = out.gyro_z_rad_per_s * factor + bias_rad_per_s;
            }
            SensorStage::ImuYaw { cos, sin } => {
                let (x, y) = (out.accel_x_m_per_s2, out.accel_y_m_per_s2);
                out.accel_x_m_per_s2 = cos * x + sin * y;
                out.accel_y_m_per_s2 = cos * y - sin * x;
            }
            SensorStage::Current { factor, bias_a } => {
                for current in &mut out.current_a {
                    *current = *current * factor + bias_a;
                }
            }
            _ => self.apply_to_pose(&mut out.pose),
        }
    }

    /// The part of it that changes where the tracker sees a pose; times are left out.
    fn apply_to_pose(&self, pose: &mut Pose) {
        self.apply_to_pose_in(pose, pose.x_m);
    }

    /// The same in the picture of the camera on the side of `camera_x_m`.
    fn apply_to_pose_in(&self, pose: &mut Pose, camera_x_m: f64) {
        match self {
            SensorStage::Marker { yaw_rad, x_m, y_m } => {
                let (sin, cos) = libm::sincos(pose.yaw_rad);
                pose.x_m += cos * x_m - sin * y_m;
                pose.y_m += sin * x_m + cos * y_m;
                pose.yaw_rad = wrapped_rad(pose.yaw_rad + yaw_rad);
            }
            SensorStage::TagHeight { factor } => {
                let foot_m = CAMERA_FOOT_X_M.copysign(camera_x_m);
                pose.x_m = foot_m + factor * (pose.x_m - foot_m);
                pose.y_m *= factor;
            }
            SensorStage::Lens { k1_per_m2, x_m, y_m } => {
                let (dx, dy) = (pose.x_m - x_m, pose.y_m - y_m);
                let factor = 1.0 + k1_per_m2 * (dx * dx + dy * dy);
                pose.x_m = x_m + factor * dx;
                pose.y_m = y_m + factor * dy;
            }
            SensorStage::Scale { factor } => {
                pose.x_m *= factor;
                pose.y_m *= factor;
            }
            SensorStage::Seam { x_m, y_m, yaw_rad } if camera_x_m > 0.0 => {
                let (sin, cos) = libm::sincos(*yaw_rad);
                let (dx, dy) = (pose.x_m - CAMERA_FOOT_X_M, pose.y_m);
                *pose = Pose {
                    x_m: CAMERA_FOOT_X_M + cos * dx - sin * dy + x_m,
                    y_m: sin * dx + cos * dy + y_m,
                    yaw_rad: wrapped_rad(pose.yaw_rad + yaw_rad),
                };
            }
            _ => {}
        }
    }
}

/// Where the tracker sees a robot.
pub(crate) fn seen_pose(stages: &[SensorStage], mut pose: Pose) -> Pose {
    stages.iter().for_each(|stage| stage.apply_to_pose(&mut pose));
    pose
}

/// Where the camera on the side of `camera_x_m` sees a robot, wherever that is.
pub(crate) fn seen_pose_in(stages: &[SensorStage], mut pose: Pose, camera_x_m: f64) -> Pose {
    stages
        .iter()
        .for_each(|stage| stage.apply_to_pose_in(&mut pose, camera_x_m));
    pose
}

/// Where the marker of a robot is.
pub(crate) fn marked_pose(stages: &[SensorStage], mut pose: Pose) -> Pose {
    let markers = stages.iter().filter(|stage| stage.rank() == MARKER_RANK);
    markers.for_each(|stage| stage.apply_to_pose(&mut pose));
    pose
}

/// Whether it matters which camera sees a robot.
pub(crate) fn tells_cameras_apart(stages: &[SensorStage]) -> bool {
    stages
        .iter()
        .any(|stage| matches!(stage, SensorStage::TagHeight { .. } | SensorStage::Seam { .. }))
}

/// Whether the tracker sees robots elsewhere than they are.
pub(crate) fn moves_poses(stages: &[SensorStage]) -> bool {
    stages.iter().any(|stage| stage.rank() >= MARKER_RANK)
}

/// The newest true states of a trace, one per physics step.
#[derive(Debug, Clone)]
pub(crate) struct History {
    /// A ring once it has `capacity` places: the oldest is at `first`, which is 0 before.
    states: Vec<RobotState>,
    capacity: usize,
    first: usize,
    count: usize,
    /// Step of the newest state.
    newest: u64,
    /// How far behind and ahead of a time stamp the trace must be known, s.
    back_s: f64,
    pub(crate) ahead_s: f64,
}

impl History {
    /// Begins with the state at step 0 of a trace that lasts `duration_s`.
    pub(crate) fn new(stages: &[SensorStage], duration_s: f64, first: RobotState) -> History {
        let (mut back_s, mut ahead_s) = (0.0, 0.0);
        for stage in stages {
            let (earliest_s, latest_s) = match stage {
                SensorStage::Latency { latency_s } => (-latency_s, 0.0),
                SensorStage::Shutter { readout_s } => (-readout_s.abs(), readout_s.abs()),
                SensorStage::Clock { offset_s, drift } => {
                    let at_end = -offset_s - drift * duration_s;
                    (at_end.min(-offset_s).min(0.0), at_end.max(-offset_s).max(0.0))
                }
                _ => (0.0, 0.0),
            };
            back_s -= earliest_s;
            ahead_s += latest_s;
        }
        let capacity = 3 + ((back_s + ahead_s) * f64::from(PHYSICS_RATE_HZ)) as usize;
        History {
            states: vec![first],
            capacity,
            first: 0,
            count: 1,
            newest: 0,
            back_s,
            ahead_s,
        }
    }

    /// Goes on by a step; the place of its state, still with an older one in it.
    pub(crate) fn next(&mut self) -> &mut RobotState {
        if self.count == self.capacity {
            self.first = self.at(1);
        } else {
            if self.count == self.states.len() {
                self.states.push(RobotState::ZERO);
            }
            self.count += 1;
        }
        self.newest += 1;
        let last = self.at(self.count - 1);
        &mut self.states[last]
    }

    /// Place of the state `index` steps after the oldest, at most a round away.
    fn at(&self, index: usize) -> usize {
        let at = self.first + index;
        if at < self.states.len() {
            at
        } else {
            at - self.states.len()
        }
    }

    fn get(&self, index: usize) -> Option<&RobotState> {
        (index < self.count).then(|| &self.states[self.at(index)])
    }

    /// Whether the state after so many steps is needed for time stamps from `position` on, in physics steps.
    pub(crate) fn needs(&self, steps: u64, position: f64) -> bool {
        (steps + 2) as f64 >= position - self.back_s * f64::from(PHYSICS_RATE_HZ)
    }

    /// Goes on by a step whose state is not needed, nor those before it.
    pub(crate) fn skip(&mut self) {
        (self.first, self.count) = (0, 0);
        self.newest += 1;
    }

    /// Reads the true state at a time in physics steps; linear between two steps, the ends hold.
    fn read(&self, position: f64, out: &mut RobotState) {
        match self.beside(position) {
            (before, after, Some(part)) => interpolate(before, after, part, out),
            (_, after, None) => *out = *after,
        }
    }

    /// The pose of that state.
    fn pose_at(&self, position: f64) -> Pose {
        match self.beside(position) {
            (before, after, Some(part)) => interpolated_pose(&before.pose, &after.pose, part),
            (_, after, None) => after.pose,
        }
    }

    /// The states before and after a time, and the part of the way from one to the other; `None`: it is the second.
    fn beside(&self, position: f64) -> (&RobotState, &RobotState, Option<f64>) {
        debug_assert!(self.count > 0, "no state is known");
        let nearest = position.round();
        let position = if (position - nearest).abs() < STAMP_TOLERANCE_STEPS {
            nearest
        } else {
            position
        };
        let oldest = self.newest + 1 - self.count as u64;
        let upper = position.ceil().max(oldest as f64).min(self.newest as f64);
        let index = upper as usize - oldest as usize;
        let Some(after) = self.get(index) else {
            let oldest = &self.states[self.first];
            return (oldest, oldest, None);
        };
        match index.checked_sub(1).and_then(|before| self.get(before)) {
            Some(before) if position < upper => (before, after, Some((1.0 - (upper - position)).max(0.0))),
            _ => (after, after, None),
        }
    }

    /// What the sensors report for a time stamp, in physics steps.
    ///
    /// - `out`: overwritten; in place, since a state is some hundred bytes and a replay has one for every row.
    pub(crate) fn measure(&self, stages: &[SensorStage], position: f64, out: &mut RobotState) {
        if stages.is_empty() {
            return self.read(position, out);
        }
        let rate = f64::from(PHYSICS_RATE_HZ);
        let (mut board, mut seen, mut readout_s) = (position, position, 0.0);
        for stage in stages {
            match stage {
                SensorStage::Latency { latency_s } => seen -= latency_s * rate,
                SensorStage::Clock { offset_s, drift } => board -= offset_s * rate + drift * position,
                SensorStage::Shutter { readout_s: more } => readout_s += more,
                _ => {}
            }
        }
        self.read(board, out);
        let mut pose = self.pose_at(seen);
        if readout_s != 0.0 {
            pose = self.pose_at(seen + readout_s * rate * pose.y_m / FIELD_HEIGHT_M);
        }
        out.pose = pose;
        for stage in stages {
            stage.apply(out);
        }
    }
}

/// The state a part of the way from `a` to `b`; voltages are those of the step.
fn interpolate(a: &RobotState, b: &RobotState, part: f64, out: &mut RobotState) {
    let mix = |from: f64, to: f64| from + part * (to - from);
    *out = *b;
    out.pose = interpolated_pose(&a.pose, &b.pose, part);
    out.twist.forward_m_per_s = mix(a.twist.forward_m_per_s, b.twist.forward_m_per_s);
    out.twist.left_m_per_s = mix(a.twist.left_m_per_s, b.twist.left_m_per_s);
    out.twist.yaw_rate_rad_per_s = mix(a.twist.yaw_rate_rad_per_s, b.twist.yaw_rate_rad_per_s);
    out.gyro_z_rad_per_s = mix(a.gyro_z_rad_per_s, b.gyro_z_rad_per_s);
    for wheel in 0..crate::MAX_WHEELS {
        out.wheel_rad_per_s[wheel] = mix(a.wheel_rad_per_s[wheel], b.wheel_rad_per_s[wheel]);
        out.wheel_rad[wheel] = mix(a.wheel_rad[wheel], b.wheel_rad[wheel]);
        out.current_a[wheel] = mix(a.current_a[wheel], b.current_a[wheel]);
    }
    out.bus_v = mix(a.bus_v, b.bus_v);
    out.accel_x_m_per_s2 = mix(a.accel_x_m_per_s2, b.accel_x_m_per_s2);
    out.accel_y_m_per_s2 = mix(a.accel_y_m_per_s2, b.accel_y_m_per_s2);
    out.steering_rad = mix(a.steering_rad, b.steering_rad);
}

fn interpolated_pose(a: &Pose, b: &Pose, part: f64) -> Pose {
    Pose {
        x_m: a.x_m + part * (b.x_m - a.x_m),
        y_m: a.y_m + part * (b.y_m - a.y_m),
        yaw_rad: wrapped_rad(a.yaw_rad + part * wrapped_rad(b.yaw_rad - a.yaw_rad)),
    }
}
