//! Runs cut into windows, ready to be simulated and compared.
//!
//! Every window starts anew from the measurements ([`crate::anchor`]), runs in for 0.5 s and is compared for 2 s. Two
//! chains share it: **drive** (commands in; wheel speeds, steering, currents, bus voltage and accelerations compared)
//! and **rolling** (measured wheels and steering in; gyro and pose compared), so that an error in one cannot leak into the
//! other. Samples are averaged over short bins ("cells") on both sides alike. The start pose of a window is not known: the
//! twin's path is laid on the measured one before the poses are compared.

mod build;
mod cell_shares;
mod input;
#[cfg(test)]
pub(crate) mod made;
mod quantity;
mod simulate;
mod smooth;
mod touch;

pub use input::{Line, RollingInput, WheelLine};
pub use quantity::{CHANNELS, CLASSES, Quantity, UNITS};
pub use simulate::{Stages, residuals, residuals_with};
pub use smooth::smoothed;
pub(crate) use touch::Added;

use core::ops::Range;
use twin::free::Start;
use twin::replay::{CommandRow, HeldCommand};

use crate::bundle::Bundle;

/// Length of the compared part of a window, s.
pub const WINDOW_S: f64 = 2.0;
/// Time that the twin runs before it is compared, s.
pub const RUN_IN_S: f64 = 0.5;
/// Time before a window whose set-points effects of commands remember, s.
pub const MEMORY_S: f64 = 1.5;
/// Rate of the rows that simulations are read out at, Hz.
pub const GRID_HZ: f64 = 240.0;
/// Width of a cell of an on-board channel, s.
pub const CELL_S: f64 = 0.05;
/// Width of a cell of the pose, s.
pub const POSE_CELL_S: f64 = 0.1;

/// Weighted mean of a channel over a bin and half of either neighbour.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    pub quantity: Quantity,
    pub time_s: f64,
    pub measured: f64,
    /// Change of the measured value over the neighbouring cells: where models are worst.
    pub activity: f64,
    /// Its samples, positions in [`Chain::samples`].
    pub samples: (u32, u32),
}

/// Mean of the pose over a bin; gives three residuals.
#[derive(Debug, Clone, Copy)]
pub struct PoseCell {
    pub time_s: f64,
    pub x_m: f64,
    pub y_m: f64,
    /// Not wrapped.
    pub yaw_rad: f64,
    pub samples: (u32, u32),
}

/// Poses so near to the line between the two cameras' fields (x = 0 in the library) are not compared: a tag above the floor is seen up to
/// some centimetres aside, to the other side by the other camera, and nobody knows which one saw it.
const SEAM_M: f64 = 0.05;

/// So far beyond that line one of the cameras may still have seen a start, m: starts are smoothed over the jump from one to the other.
pub(crate) const BEYOND_THE_LINE_M: f64 = 0.05;

impl PoseCell {
    /// Which camera saw it is not known.
    pub fn is_near_seam(&self) -> bool {
        self.x_m.abs() < SEAM_M
    }
}

/// Where a measured sample lies among a simulation's rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SamplePlace {
    /// Position of the row before it.
    pub row: u32,
    /// Part of the way to the next row.
    pub part: f64,
    /// Its share in a channel's cell, of all together 1; samples of a pose count alike.
    pub weight: f64,
}

/// A simulation of a window and what is compared with it.
#[derive(Debug, Clone, Default)]
pub struct Chain {
    pub rows: Vec<CommandRow>,
    /// In force at the start.
    pub held: HeldCommand,
    /// Set-points of the time before the start, and what was in force before them: effects of commands remember them.
    pub earlier: Vec<CommandRow>,
    pub before: HeldCommand,
    pub samples: Vec<SamplePlace>,
    pub cells: Vec<Cell>,
    pub poses: Vec<PoseCell>,
}

impl Chain {
    /// Residuals it gives.
    pub fn len(&self) -> usize {
        self.cells.len() + 3 * self.poses.len()
    }

    /// True when nothing is compared.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A span of a run that is simulated on its own.
#[derive(Debug, Clone)]
pub struct Window {
    /// Start of the run-in.
    pub start_s: f64,
    /// Start of the comparison.
    pub from_s: f64,
    pub to_s: f64,
    /// Since the run's first row.
    pub elapsed_s: f64,
    pub start: Start,
    pub drive: Chain,
    pub rolling: Option<Chain>,
    /// Measured wheel angles at the start, by position in `wheels`.
    pub wheel_angle_rad: Vec<f64>,
    /// Mean over the motors of (i / i_max)^2 in cells of a second since the run's start, newest last.
    pub load: Vec<f64>,
    /// Share of its weight that counts ([`crate::floor::Floor::doubt`]).
    pub trust: f64,
}

impl Window {
    /// How harshly the wheels were driven as far as a pose's error feels it, pose by pose, rad/s.
    ///
    /// Where a wheel's speed (without encoders: the gyro) changes in 0.15 s the robot slips, and its path keeps the error. Simulated and measured
    /// paths are laid upon each other, so of an error that comes when a share f of the poses has been a share 1 - f is in the poses before and f in
    /// those after it. Errors of different moments are independent; the harshest wheel counts.
    fn harshness(&self) -> Vec<f64> {
        let posed = self.rolling.as_ref().filter(|chain| !chain.poses.is_empty());
        let poses = &posed.unwrap_or(&self.drive).poses;
        let times: Vec<f64> = poses.iter().map(|pose| pose.time_s).collect();
        let rolling = self.rolling.iter().flat_map(|chain| &chain.cells);
        let cells: Vec<&Cell> = self.drive.cells.iter().chain(rolling).collect();
        let mut wanted: Vec<Quantity> = cells
            .iter()
            .map(|cell| cell.quantity)
            .filter(|q| matches!(q, Quantity::Wheel(_)))
            .collect();
        wanted.sort();
        wanted.dedup();
        let of = |quantity: Quantity| self::felt(&times, cells.iter().filter(|cell| cell.quantity == quantity));
        let mut most = vec![0.0_f64; times.len()];
        for quantity in wanted {
            most.iter_mut()
                .zip(of(quantity))
                .for_each(|(most, value)| *most = most.max(value));
        }
        if most.iter().all(|value| *value == 0.0) {
            most = of(Quantity::Gyro);
        }
        most
    }
}

/// State of the robot and command in a cell: what residuals are sorted by.
#[derive(Debug, Clone, Copy, Default)]
pub struct Place {
    pub quantity: Option<Quantity>,
    pub window: usize,
    pub time_s: f64,
    pub x_m: f64,
    pub y_m: f64,
}

/// Activity of one quantity's cells as far as poses at these times feel it.
fn felt<'a>(times: &[f64], cells: impl Iterator<Item = &'a &'a Cell>) -> Vec<f64> {
    let mut squares = vec![0.0; times.len()];
    for cell in cells {
        let before = times.partition_point(|time_s| *time_s < cell.time_s);
        let share = before as f64 / times.len().max(1) as f64;
        for (k, square) in squares.iter_mut().enumerate() {
            let own = if k < before { 1.0 - share } else { share };
            *square += own * own * cell.activity * cell.activity;
        }
    }
    squares.into_iter().map(f64::sqrt).collect()
}

/// A run, cut.
#[derive(Debug, Clone)]
pub struct Record {
    /// Name in the report.
    pub name: String,
    pub windows: Vec<Window>,
    pub input: Option<RollingInput>,
    /// Bus voltage at rest at the start of the run over the description's supply: the battery's charge is a start state.
    pub supply_ratio: f64,
    /// Largest |set-point| of a wheel, rad/s.
    pub largest_command_rad_per_s: f64,
    /// Poses left out as flips or jumps of the tracker.
    pub outliers: u32,
    /// Windows that the measurements did not carry.
    pub skipped: u32,
}

impl Record {
    /// Cuts a run. `first_s`: where the first window begins, in seconds after the first pose.
    pub fn of(name: &str, bundle: &Bundle) -> Record {
        build::record(name, bundle)
    }

    /// The same with all windows at their weight.
    pub fn trusted(&self) -> Record {
        let mut trusted = self.clone();
        trusted.windows.iter_mut().for_each(|window| window.trust = 1.0);
        trusted
    }

    /// Some of its windows, by their positions.
    pub fn with_windows(&self, kept: &[bool]) -> Record {
        let pairs = self.windows.iter().zip(kept);
        Record {
            windows: pairs
                .filter(|(_, kept)| **kept)
                .map(|(window, _)| window.clone())
                .collect(),
            name: self.name.clone(),
            input: self.input.clone(),
            ..*self
        }
    }

    /// Number of residuals.
    pub fn len(&self) -> usize {
        self.cells_of_windows().last().map_or(0, |cells| cells.end)
    }

    /// Where every window's residuals are among the record's.
    pub fn cells_of_windows(&self) -> Vec<Range<usize>> {
        let mut end = 0;
        let windows = self.windows.iter().map(|window| {
            let from = end;
            end += window.drive.len() + window.rolling.as_ref().map_or(0, Chain::len);
            from..end
        });
        windows.collect()
    }

    /// True when no window could be made.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Measured positions `[x, y]` of all windows, m, means of short spans of time.
    pub fn positions_m(&self) -> impl Iterator<Item = [f64; 2]> {
        let chains = self
            .windows
            .iter()
            .flat_map(|window| window.rolling.iter().chain([&window.drive]));
        chains.flat_map(|chain| chain.poses.iter().map(|pose| [pose.x_m, pose.y_m]))
    }

    /// What every residual is, in their order.
    pub fn places(&self) -> Vec<Place> {
        let mut places = Vec::with_capacity(self.len());
        for (number, window) in self.windows.iter().enumerate() {
            for chain in [Some(&window.drive), window.rolling.as_ref()].into_iter().flatten() {
                let poses = || {
                    let other = window.rolling.as_ref().map_or(&[][..], |chain| &chain.poses);
                    if window.drive.poses.is_empty() {
                        other
                    } else {
                        &window.drive.poses
                    }
                };
                let near = |time_s: f64| {
                    let after = poses().partition_point(|pose| pose.time_s < time_s);
                    poses().get(after).or_else(|| poses().last())
                };
                for cell in &chain.cells {
                    let pose = near(cell.time_s);
                    places.push(Place {
                        quantity: Some(cell.quantity),
                        window: number,
                        time_s: cell.time_s,
                        x_m: pose.map_or(0.0, |pose| pose.x_m),
                        y_m: pose.map_or(0.0, |pose| pose.y_m),
                    });
                }
                for pose in &chain.poses {
                    for quantity in [Quantity::Forward, Quantity::Left, Quantity::Yaw] {
                        let is_open = quantity == Quantity::Yaw || !pose.is_near_seam();
                        places.push(Place {
                            quantity: is_open.then_some(quantity),
                            window: number,
                            time_s: pose.time_s,
                            x_m: pose.x_m,
                            y_m: pose.y_m,
                        });
                    }
                }
            }
        }
        places
    }

    /// Activity of every residual's cell, in their order; for poses how harshly the wheels were driven in the window.
    pub fn activities(&self) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.len());
        for window in &self.windows {
            for chain in [Some(&window.drive), window.rolling.as_ref()].into_iter().flatten() {
                out.extend(chain.cells.iter().map(|cell| cell.activity));
                if !chain.poses.is_empty() {
                    out.extend(window.harshness().into_iter().flat_map(|value| [value; 3]));
                }
            }
        }
        out
    }

    /// Quantities that are compared somewhere in the run.
    pub fn quantities(&self) -> Vec<Quantity> {
        let mut found: Vec<Quantity> = self.places().iter().filter_map(|place| place.quantity).collect();
        found.sort();
        found.dedup();
        found
    }

    /// Bounding box of the poses: least and largest x and y, m.
    pub fn extent_m(&self) -> [f64; 4] {
        let mut extent = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        for place in self.places() {
            extent[0] = extent[0].min(place.x_m);
            extent[1] = extent[1].max(place.x_m);
            extent[2] = extent[2].min(place.y_m);
            extent[3] = extent[3].max(place.y_m);
        }
        extent
    }
}

#[cfg(test)]
mod tests {
    use super::made::{cell, pose, record, window};
    use super::*;

    /// The paths are laid upon each other: a slip between the third and the fourth pose moves the first three by a quarter of what it is, the
    /// other way, and the last by three quarters; one before all poses moves none.
    #[test]
    fn poses_feel_a_slip_by_the_share_of_poses_on_its_other_side() {
        let wheel = Quantity::Wheel(1);
        let driven = vec![cell(wheel, 0.51, 20.0), cell(wheel, 2.0, 8.0)];
        let poses = [0.55, 1.0, 1.5, 2.2].map(pose).to_vec();
        let slipped = record(vec![window(driven, Vec::new(), poses)]);
        let poses: Vec<f64> = slipped.activities()[2..].iter().step_by(3).copied().collect();
        assert_eq!(poses, [2.0, 2.0, 2.0, 6.0]);
    }

    #[test]
    fn the_harshest_wheel_counts_and_the_gyro_where_no_wheel_is_measured() {
        let gyro = cell(Quantity::Gyro, 1.0, 30.0);
        let wheels = vec![cell(Quantity::Wheel(0), 1.0, 4.0), cell(Quantity::Wheel(1), 1.0, 6.0)];
        let of = |drive: Vec<Cell>| {
            let first_pose = drive.len() + 1;
            let poses = [0.6, 1.2].map(pose).to_vec();
            record(vec![window(drive, vec![gyro], poses)]).activities()[first_pose]
        };
        assert_eq!((of(wheels), of(Vec::new())), (3.0, 15.0));
    }
}
