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
mod quantity;
mod simulate;

pub use input::{Line, RollingInput, WheelLine};
pub use quantity::{CHANNELS, CLASSES, Quantity, UNITS};
pub use simulate::{Stages, residuals};

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
}

impl Window {
    /// Largest change of a measured wheel speed (without encoders: of the gyro) in 0.15 s up to a time, rad/s: slip happens
    /// then, and a path keeps its errors.
    fn harshness(&self, until_s: f64) -> f64 {
        let rolling = self.rolling.iter().flat_map(|chain| &chain.cells);
        let cells = || self.drive.cells.iter().chain(rolling.clone());
        let largest = |wanted: &dyn Fn(Quantity) -> bool| {
            cells()
                .filter(|cell| cell.time_s <= until_s && wanted(cell.quantity))
                .fold(0.0, |most: f64, cell| most.max(cell.activity))
        };
        let wheels = largest(&|quantity| matches!(quantity, Quantity::Wheel(_)));
        if wheels > 0.0 {
            wheels
        } else {
            largest(&|quantity| quantity == Quantity::Gyro)
        }
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
        self.windows
            .iter()
            .map(|window| window.drive.len() + window.rolling.as_ref().map_or(0, Chain::len))
            .sum()
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
                        places.push(Place {
                            quantity: Some(quantity),
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
                for pose in &chain.poses {
                    out.extend([window.harshness(pose.time_s); 3]);
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
