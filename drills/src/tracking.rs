//! How well one robot follows what its law wants, with and without looking ahead, at three total delays.
//!
//! Four fifths of a delay are the pictures', one fifth is the radio's; the robot's own answer comes on top of it.

use crate::attack::CHASSIS;
use crate::fan::{fan, progress};
use crate::{AirSettings, LightSettings, Rig, RigSettings, Scene, SceneRobot};
use anyhow::{Context, Result};
use lab::record::Record;
use serde_json::{Value, json};

/// Mid-exposure to the robot's ear.
pub const DELAYS_MS: [i64; 3] = [20, 50, 80];
const TICK_HZ: f64 = 120.0;
/// A robot that comes this close to its goal has come there for the first time.
const THERE_M: f64 = 0.02;
/// Every course ends further from its start than this; on a link that is too slow a robot does not know the clock and stands.
const LEAST_WAY_M: f64 = 0.3;
/// A radian is as much way as this.
const LEVER_M: f64 = 0.25;
/// Differences below this are none.
const NOTED_M: f64 = 0.000_5;

/// What is driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    Trajectory,
    /// The same with gains of 8/s.
    StiffTrajectory,
    Path,
    Pose,
}

impl Course {
    pub const ALL: [Self; 4] = [Self::Trajectory, Self::StiffTrajectory, Self::Path, Self::Pose];

    /// What is told of it.
    pub const fn figure(self) -> &'static str {
        match self {
            Self::Trajectory => "trajectory_tracking, error (RMS)",
            Self::StiffTrajectory => "the same, gains of 8/s, error (RMS)",
            Self::Path => "path_following, distance to the path (RMS)",
            Self::Pose => "go_to_pose, way to and fro at the goal",
        }
    }

    fn law(self) -> (&'static str, Value) {
        match self {
            Self::Trajectory => ("trajectory_tracking", json!({"interval_s": 6.0})),
            Self::StiffTrajectory => (
                "trajectory_tracking",
                json!({"interval_s": 6.0, "tracking_gain_per_s": 8.0, "yaw_gain_per_s": 8.0, "lateral_gain_per_m2": 100.0}),
            ),
            Self::Path => ("path_following", json!({})),
            Self::Pose => ("go_to_pose", json!({})),
        }
    }

    fn targets(self) -> &'static [[f64; 2]] {
        match self {
            Self::Trajectory | Self::StiffTrajectory => &[[0.3, -1.3], [1.7, -0.1], [0.2, 1.3], [-1.6, 1.0]],
            Self::Path => &[[0.6, -0.8], [1.3, 0.6], [-1.2, 0.9]],
            Self::Pose => &[[0.2, -0.1]],
        }
    }

    /// Start of the run of this number.
    fn start(self, number: u64) -> [f64; 3] {
        match self {
            Self::Trajectory | Self::StiffTrajectory => [-1.4, -1.0, -0.3],
            Self::Path => [-1.4, -0.7, 0.2],
            Self::Pose => {
                let around = std::f64::consts::TAU * (number % 8) as f64 / 8.0;
                [0.3 + 1.1 * around.cos(), -0.1 + 0.9 * around.sin(), 2.4 * number as f64]
            }
        }
    }

    const fn longest_s(self) -> f64 {
        match self {
            Self::Trajectory | Self::StiffTrajectory => 30.0,
            Self::Path | Self::Pose => 60.0,
        }
    }

    fn scene(self, chassis: &str, number: u64) -> Result<Scene> {
        let start = self.start(number);
        let robot = SceneRobot {
            start,
            goal: [start[0], start[1]],
        };
        let mut scene = Scene::new(chassis, &[robot], self.longest_s())?;
        scene.laboratory.arena.width_m = 5.0;
        scene.laboratory.arena.height_m = 4.0;
        let (law, parameters) = self.law();
        let name = scene.experiment()["robots"][0]["name"].clone();
        let target = |[x_m, y_m]: &[f64; 2]| match self {
            Self::Pose => json!({"robot": name, "x_m": x_m, "y_m": y_m, "yaw_rad": 0.8}),
            _ => json!({"robot": name, "x_m": x_m, "y_m": y_m}),
        };
        let targets: Vec<Value> = self.targets().iter().map(target).collect();
        let experiment = scene.experiment_mut();
        experiment["control"] = json!({"law": law, "parameters": parameters});
        experiment["targets"] = json!(targets);
        Ok(scene)
    }
}

/// Sums of one run, in the unit of the course's figure.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Sums {
    squares_m2: f64,
    ticks: f64,
    way_m: f64,
    runs: f64,
    /// To the end of the run.
    time_s: f64,
}

impl Sums {
    fn with(self, other: Self) -> Self {
        Self {
            squares_m2: self.squares_m2 + other.squares_m2,
            ticks: self.ticks + other.ticks,
            way_m: self.way_m + other.way_m,
            runs: self.runs + other.runs,
            time_s: self.time_s + other.time_s,
        }
    }

    fn figure_m(&self, course: Course) -> f64 {
        match course {
            Course::Pose => self.way_m / self.runs,
            _ => (self.squares_m2 / self.ticks.max(1.0)).sqrt(),
        }
    }
}

/// One line of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    pub chassis: &'static str,
    pub course: Course,
    pub delay_ms: i64,
    /// Without and with looking ahead.
    pub figures_m: [f64; 2],
    /// Mean length of the runs.
    pub times_s: [f64; 2],
}

impl Line {
    /// Looking ahead makes it worse by more than what counts as a difference.
    pub fn is_worse(&self) -> bool {
        let [without_m, with_m] = self.figures_m;
        with_m > 1.05 * without_m + NOTED_M
    }
}

fn one(course: Course, chassis: &str, delay_ms: i64, looks_ahead: bool, number: u64, seed: u64) -> Result<Sums> {
    let scene = course.scene(chassis, number)?;
    let fixed = |us: i64| [us, us];
    let air = AirSettings {
        delay_us: fixed(delay_ms * 200),
        ..AirSettings::default()
    };
    let settings = RigSettings {
        seed: seed ^ (number << 8),
        light: LightSettings {
            delay_us: fixed(delay_ms * 800),
            ..LightSettings::default()
        },
        up: air,
        down: AirSettings::default(),
        phase: (number % 4) as i64,
        looks_ahead,
        ..RigSettings::default()
    };
    let mut rig = Rig::new(&scene, &settings)?;
    let start = course.start(number);
    let mut sums = Sums {
        runs: 1.0,
        ..Sums::default()
    };
    // The pose of the tick before, once the robot has come to its goal.
    let mut before: Option<[f64; 3]> = None;
    let mut corners = vec![[start[0], start[1]]];
    corners.extend_from_slice(course.targets());
    while (rig.slot() as f64) < TICK_HZ * (course.longest_s() + 2.0) {
        let now_s = rig.slot() as f64 / TICK_HZ;
        let pose = *rig.poses().first().context("no robot")?;
        rig.records.clear();
        let more = rig.tick();
        let target = rig.records.iter().find_map(|record| match record {
            Record::Command(command) => command.target_m,
            _ => None,
        });
        let Some(target) = target else {
            if more {
                continue;
            }
            break;
        };
        let off_m = match course {
            Course::Trajectory | Course::StiffTrajectory => (pose[0] - target[0]).hypot(pose[1] - target[1]),
            Course::Path => distance_m(pose, &corners),
            Course::Pose => corners
                .last()
                .map_or(0.0, |goal| (pose[0] - goal[0]).hypot(pose[1] - goal[1])),
        };
        // The trajectory begins at 2 s and ends at 26 s.
        if (2.0..26.0).contains(&now_s) || course == Course::Path {
            sums.squares_m2 += off_m * off_m;
            sums.ticks += 1.0;
        }
        if let Some(before) = before {
            let turned = lab::estimator::wrap_rad(pose[2] - before[2]).abs();
            sums.way_m += (pose[0] - before[0]).hypot(pose[1] - before[1]) + LEVER_M * turned;
        }
        if before.is_some() || off_m <= THERE_M {
            before = Some(pose);
        }
        if !more {
            break;
        }
    }
    let [x, y, _] = *rig.poses().first().context("no robot")?;
    let moved_m = (x - start[0]).hypot(y - start[1]);
    anyhow::ensure!(moved_m > LEAST_WAY_M, "the robot did not move");
    sums.time_s = rig.slot() as f64 / TICK_HZ;
    Ok(sums)
}

fn distance_m(pose: [f64; 3], corners: &[[f64; 2]]) -> f64 {
    let legs = corners.iter().zip(corners.iter().skip(1));
    let each = legs.map(|(from, to)| {
        let along = [to[0] - from[0], to[1] - from[1]];
        let here = [pose[0] - from[0], pose[1] - from[1]];
        let square = along[0] * along[0] + along[1] * along[1];
        let share = ((here[0] * along[0] + here[1] * along[1]) / square).clamp(0.0, 1.0);
        (here[0] - share * along[0]).hypot(here[1] - share * along[1])
    });
    each.fold(f64::INFINITY, f64::min)
}

/// Every course with every chassis at every delay, `count` runs each way.
///
/// - Errors: a scene that cannot be set up.
pub fn run(count: u64, seed: u64, threads: usize, courses: &[Course]) -> Result<Vec<Line>> {
    let mut cases = Vec::new();
    for course in courses {
        for chassis in CHASSIS {
            cases.extend(DELAYS_MS.map(|delay_ms| (*course, chassis, delay_ms)));
        }
    }
    let of = |k: u64| {
        let (case, rest) = ((k / (2 * count)) as usize, k % (2 * count));
        let (course, chassis, delay_ms) = *cases.get(case).context("a case")?;
        one(course, chassis, delay_ms, rest % 2 == 1, rest / 2, seed)
            .with_context(|| format!("{chassis}, {course:?}, {delay_ms} ms"))
    };
    let total = 2 * count * cases.len() as u64;
    let sums = fan(total, threads, of, progress("tracking", 100, total))?;
    let lines = cases.iter().zip(sums.chunks(2 * count as usize));
    let line = |(&(course, chassis, delay_ms), sums): (&(Course, &'static str, i64), &[Sums])| {
        let both = [0, 1].map(|with| {
            let mine = sums.iter().skip(with).step_by(2);
            mine.fold(Sums::default(), |all, sums| all.with(*sums))
        });
        Line {
            chassis,
            course,
            delay_ms,
            figures_m: both.map(|sums| sums.figure_m(course)),
            times_s: both.map(|sums| sums.time_s / sums.runs),
        }
    };
    Ok(lines.map(line).collect())
}

/// Prints the table, a course after the other; `true` when looking ahead makes nothing worse.
pub fn print(lines: &[Line]) -> bool {
    for course in Course::ALL {
        let mine: Vec<&Line> = lines.iter().filter(|line| line.course == course).collect();
        if mine.is_empty() {
            continue;
        }
        println!("{}, mm: without -> with looking ahead (mean time, s)", course.figure());
        print!("{:<8}", "chassis");
        DELAYS_MS.iter().for_each(|ms| print!(" {:>32}", format!("{ms} ms")));
        println!();
        for chassis in CHASSIS {
            print!("{chassis:<8}");
            for line in mine.iter().filter(|line| line.chassis == chassis) {
                let [without, with] = line.figures_m.map(|m| 1e3 * m);
                let [time, time_with] = line.times_s;
                let mark = if line.is_worse() { " WORSE" } else { "" };
                let cell = format!("{without:.1} -> {with:.1} ({time:.1}, {time_with:.1}){mark}");
                print!(" {cell:>32}");
            }
            println!();
        }
        println!();
    }
    lines.iter().all(|line| !line.is_worse())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_ahead_halves_the_error_on_a_trajectory_at_80_ms() {
        for chassis in ["omni4", "diff2"] {
            let rms_m = |ahead| {
                one(Course::Trajectory, chassis, 80, ahead, 0, 1)
                    .expect("a run")
                    .figure_m(Course::Trajectory)
            };
            let (without_m, with_m) = (rms_m(false), rms_m(true));
            println!("{chassis}: {without_m} m, {with_m} m");
            assert!(with_m < 0.5 * without_m, "{chassis}: {without_m} m, {with_m} m");
        }
    }

    #[test]
    fn distances_to_a_path_are_those_to_its_nearest_leg() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]];
        for (pose, asked_m) in [([1.0, 0.3, 0.0], 0.3), ([2.5, 1.0, 0.0], 0.5), ([-3.0, 4.0, 0.0], 5.0)] {
            assert!((distance_m(pose, &corners) - asked_m).abs() < 1e-12, "{pose:?}");
        }
    }
}
