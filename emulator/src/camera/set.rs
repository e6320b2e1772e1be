//! All cameras of a laboratory: where the robots were during an exposure goes to a camera's own thread, which renders and sends.

use super::calibration::Calibration;
use super::device::Camera;
use super::exposure::instants_us;
use super::faults::{CameraFault, CameraFaultRequest};
use super::frame::FrameError;
use super::problem::CameraProblem;
use super::robot_view::{RobotInView, RobotShape};
use super::sender::FrameSender;
use super::settings::CameraSettings;
use super::tag::Tag;
use crate::plant::Pose;
use crate::unit::Unit;
use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

/// Poses within one exposure.
const INSTANTS: usize = 4;
/// Exposures that wait for a camera's thread; further ones are lost, as in a camera that is too slow.
const WAITING: usize = 2;
/// How far back poses are kept: longer than the longest exposure of a camera that runs.
const HISTORY_US: i64 = 60_000;
/// Limits of the rate.
const RATE_HZ: [f64; 2] = [1.0, 500.0];

/// Why cameras cannot be emulated.
#[derive(Debug, thiserror::Error)]
pub enum CameraSetError {
    #[error("{path}: {problem}")]
    Calibration { path: String, problem: String },
    #[error("camera {camera}: {problem}")]
    Camera { camera: usize, problem: CameraProblem },
    #[error("camera rate {0} Hz is outside 1..=500 Hz; 60 is usual on two cores")]
    Rate(f64),
    #[error("there is no camera {0}")]
    Unknown(u16),
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

/// Where the robots were at one moment: number and pose.
type Moment = (i64, Vec<(u8, Pose)>);

/// The cameras.
#[derive(Debug)]
pub struct CameraSet {
    threads: Vec<CameraThread>,
    history: VecDeque<Moment>,
    /// Tags that stay where they were: the fault `tracker_frozen`.
    stuck: BTreeMap<u8, Pose>,
    period_us: i64,
    exposure_us: u32,
}

#[derive(Debug)]
struct CameraThread {
    queue: SyncSender<Task>,
    next_mid_us: i64,
    lost: u64,
    _thread: JoinHandle<()>,
}

#[derive(Debug)]
enum Task {
    Expose {
        mid_exposure_us: i64,
        robots: Vec<(u8, [Pose; INSTANTS])>,
    },
    Fault(CameraFault),
}

impl CameraSet {
    /// Starts a thread and a socket for each camera. Exposures of the cameras are spread evenly over the period.
    ///
    /// - `cameras`: calibration file and socket of each, in the order of their numbers.
    pub fn start(
        cameras: &[(PathBuf, PathBuf)],
        settings: &CameraSettings,
        rate_hz: f64,
        now_us: i64,
    ) -> Result<Self, CameraSetError> {
        // Written so that what is no number is refused, too.
        if !(RATE_HZ[0]..=RATE_HZ[1]).contains(&rate_hz) {
            return Err(CameraSetError::Rate(rate_hz));
        }
        let period_us = (1e6 / rate_hz).round() as i64;
        let mut threads = Vec::with_capacity(cameras.len());
        for (number, (path, socket)) in cameras.iter().enumerate() {
            let unusable = |problem: String| CameraSetError::Calibration {
                path: path.display().to_string(),
                problem,
            };
            let text = std::fs::read_to_string(path).map_err(|error| unusable(error.to_string()))?;
            let calibration: Calibration =
                serde_json::from_str(&text).map_err(|error| unusable(format!("not robopheus.camera/1: {error}")))?;
            let camera = Camera::new(&calibration, number as u16, settings.clone()).map_err(|problem| {
                CameraSetError::Camera {
                    camera: number,
                    problem,
                }
            })?;
            let sender = FrameSender::listen(socket)?;
            let (queue, tasks) = sync_channel(WAITING);
            let thread = std::thread::Builder::new()
                .name(format!("camera-{number}"))
                .spawn(move || serve(camera, sender, &tasks))?;
            threads.push(CameraThread {
                queue,
                next_mid_us: now_us + period_us * (1 + number as i64) / cameras.len() as i64,
                lost: 0,
                _thread: thread,
            });
        }
        Ok(Self {
            threads,
            history: VecDeque::new(),
            stuck: BTreeMap::new(),
            period_us,
            exposure_us: settings.exposure_us,
        })
    }

    /// Puts a fault on a camera, or ends all of its faults.
    pub fn set_fault(&mut self, request: CameraFaultRequest) -> Result<(), CameraSetError> {
        let thread = self
            .threads
            .get(usize::from(request.camera))
            .ok_or(CameraSetError::Unknown(request.camera))?;
        // Checked here, where the caller can be told.
        super::faults::CameraFaults::default()
            .apply(request.fault.clone())
            .map_err(|problem| CameraSetError::Camera {
                camera: usize::from(request.camera),
                problem,
            })?;
        thread
            .queue
            .send(Task::Fault(request.fault))
            .map_err(|_| CameraSetError::Unknown(request.camera))
    }

    /// The plant has reached `at_us`; exposures that are over go to their cameras.
    pub fn note(&mut self, at_us: i64, units: &[Unit]) {
        let visible = self.visible(units);
        self.history.push_back((at_us, visible));
        while self
            .history
            .front()
            .is_some_and(|(time_us, _)| at_us - time_us > HISTORY_US)
        {
            self.history.pop_front();
        }
        let half_us = i64::from(self.exposure_us) / 2;
        for index in 0..self.threads.len() {
            let Some(mid_us) = self.threads.get(index).map(|thread| thread.next_mid_us) else {
                return;
            };
            if mid_us + half_us > at_us {
                continue;
            }
            // After a pause of the process the exposures of the pause are left out.
            let next_us = mid_us + self.period_us * ((at_us - mid_us) / self.period_us).max(1);
            let task = (at_us - mid_us < HISTORY_US / 2).then(|| Task::Expose {
                mid_exposure_us: mid_us,
                robots: self.during(mid_us),
            });
            let Some(thread) = self.threads.get_mut(index) else {
                return;
            };
            thread.next_mid_us = next_us;
            if let Some(task) = task
                && let Err(TrySendError::Full(_)) = thread.queue.try_send(task)
            {
                thread.lost += 1;
                if thread.lost.is_power_of_two() {
                    tracing::warn!(
                        camera = index,
                        lost = thread.lost,
                        "the camera is too slow; pictures are lost"
                    );
                }
            }
        }
    }

    /// Robots on the floor with the pose that their tag shows.
    fn visible(&mut self, units: &[Unit]) -> Vec<(u8, Pose)> {
        let mut seen = Vec::with_capacity(units.len());
        for unit in units {
            let number = unit.robot().number;
            let Some(body) = unit.on_floor().filter(|_| !unit.faults().tracker_lost) else {
                self.stuck.remove(&number);
                continue;
            };
            let pose = if unit.faults().tracker_frozen {
                *self.stuck.entry(number).or_insert_with(|| body.pose())
            } else {
                self.stuck.remove(&number);
                body.pose()
            };
            seen.push((unit.seen_as(), pose));
        }
        seen
    }

    /// Where each robot was at the instants of an exposure. A robot that was put somewhere else meanwhile is where it ended.
    fn during(&self, mid_us: i64) -> Vec<(u8, [Pose; INSTANTS])> {
        let Some((_, last)) = self.history.back() else {
            return Vec::new();
        };
        let mut instants = [0.0; INSTANTS];
        for (instant, offset_us) in instants.iter_mut().zip(instants_us(self.exposure_us, INSTANTS)) {
            *instant = mid_us as f64 + offset_us;
        }
        let path = |(number, end): &(u8, Pose)| (*number, instants.map(|at_us| self.pose_at(*number, at_us, *end)));
        last.iter().map(path).collect()
    }

    /// Between the two moments around `at_us`; `end` where they do not know the robot or it was carried.
    fn pose_at(&self, number: u8, at_us: f64, end: Pose) -> Pose {
        let of = |moment: &Moment| {
            moment
                .1
                .iter()
                .find(|(other, _)| *other == number)
                .map(|(_, pose)| *pose)
        };
        let after = self.history.iter().rposition(|(time_us, _)| (*time_us as f64) < at_us);
        let Some(before) = after else { return end };
        let (Some(first), Some(second)) = (self.history.get(before), self.history.get(before + 1)) else {
            return end;
        };
        let (Some(from), Some(to)) = (of(first), of(second)) else {
            return end;
        };
        const CARRIED_M: f64 = 0.1;
        if (to.x_m - from.x_m).hypot(to.y_m - from.y_m) > CARRIED_M {
            return end;
        }
        let share = (at_us - first.0 as f64) / (second.0 - first.0) as f64;
        Pose {
            x_m: from.x_m + share * (to.x_m - from.x_m),
            y_m: from.y_m + share * (to.y_m - from.y_m),
            // Poses of the plant are not wrapped.
            yaw_rad: from.yaw_rad + share * (to.yaw_rad - from.yaw_rad),
        }
    }
}

fn serve(mut camera: Camera, mut sender: FrameSender, tasks: &Receiver<Task>) {
    let mut tags = BTreeMap::new();
    while let Ok(task) = tasks.recv() {
        match task {
            Task::Fault(fault) => {
                if let Err(error) = camera.set_fault(fault) {
                    tracing::warn!(%error, "camera fault refused");
                }
            }
            Task::Expose {
                mid_exposure_us,
                robots,
            } => {
                if let Err(error) = expose(&mut camera, &mut sender, &mut tags, mid_exposure_us, &robots) {
                    tracing::error!(%error, "a picture cannot be sent");
                }
            }
        }
    }
}

fn expose(
    camera: &mut Camera,
    sender: &mut FrameSender,
    tags: &mut BTreeMap<u8, Option<Tag>>,
    mid_exposure_us: i64,
    robots: &[(u8, [Pose; INSTANTS])],
) -> Result<(), FrameError> {
    let mut views = Vec::with_capacity(robots.len());
    for (number, poses) in robots {
        let tag = *tags.entry(*number).or_insert_with(|| Tag::new(u16::from(*number)));
        views.push(RobotInView {
            tag,
            shape: RobotShape::default(),
            poses,
        });
    }
    match camera.expose(mid_exposure_us, &views) {
        Some(picture) => sender.send_with(&picture.header, picture.pixels, picture.damage),
        None => {
            sender.poll();
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set() -> CameraSet {
        CameraSet::start(&[], &CameraSettings::default(), 60.0, 0).expect("no cameras")
    }

    #[test]
    fn poses_within_the_exposure_lie_on_the_way_between_ticks() {
        let mut set = set();
        // 0.5 m/s along x, known every 2 ms.
        for tick in 0..10_i64 {
            let x_m = 0.001 * tick as f64;
            set.history
                .push_back((2000 * tick, vec![(7, Pose { x_m, ..Pose::default() })]));
        }
        let seen = set.during(9000);
        let [(7, poses)] = seen.as_slice() else {
            panic!("one robot: {seen:?}");
        };
        // Exposure 3 ms around 9 ms: instants 7875, 8625, 9375, 10125 us.
        for (pose, at_us) in poses.iter().zip([7875.0, 8625.0, 9375.0, 10125.0]) {
            assert!((pose.x_m - 0.5e-6 * at_us).abs() < 1e-12, "{pose:?} at {at_us}");
        }
    }

    #[test]
    fn a_robot_that_was_carried_is_where_it_ended() {
        let mut set = set();
        set.history.push_back((0, vec![(1, Pose::default())]));
        let there = Pose {
            x_m: 1.0,
            ..Pose::default()
        };
        set.history.push_back((2000, vec![(1, there)]));
        assert_eq!(set.during(1000), vec![(1, [there; INSTANTS])]);
    }

    #[test]
    fn a_rate_that_no_camera_has_is_refused() {
        for rate in [0.0, -60.0, 1e6, f64::NAN] {
            let refused = CameraSet::start(&[], &CameraSettings::default(), rate, 0);
            assert!(matches!(refused, Err(CameraSetError::Rate(_))), "{rate}");
        }
    }
}
