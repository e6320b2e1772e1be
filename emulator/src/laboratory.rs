//! All robots, the floor and what the tracker sees, without IO: time and bytes are arguments.

use crate::faults::{FaultKind, FaultRequest};
use crate::hidden::change::ChangeProblem;
use crate::hidden::{Change, Hidden};
use crate::keys::Keys;
use crate::noise::Noise;
use crate::plant::Pose;
use crate::plant::arena::{Arena, Occupant};
use crate::plant::body::BodyError;
use crate::plant::contents::{ContentsError, PlantContents};
use crate::tracker::{TrackedPose, TrackerModel};
use crate::unit::{Seat, Unit};
use api::docks::Docks;
use api::lab::LabDescription;
use serde::{Deserialize, Serialize};

/// Where the hand puts a robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    pub number: u8,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

/// Why the hand or the fault menu refuses.
#[derive(Debug, thiserror::Error)]
pub enum HandError {
    #[error("there is no robot {0}")]
    Unknown(u8),
    #[error("robot {0} is listed twice")]
    Twice(u8),
    #[error("robot {0} would not stand on the floor: its circle crosses a wall or its pose is no number")]
    Outside(u8),
    #[error("robot {0} would stand in a fixed obstacle")]
    Blocked(u8),
    #[error("robots {0} and {1} would overlap")]
    Overlap(u8, u8),
    #[error("{name} {value} is outside {range}")]
    Parameter {
        name: &'static str,
        value: f64,
        range: &'static str,
    },
    #[error("there is no robot {0:?}")]
    UnknownName(String),
    #[error("{0} has no {1}")]
    Part(String, String),
    #[error(transparent)]
    Change(#[from] ChangeProblem),
    #[error(transparent)]
    Body(#[from] BodyError),
}

/// Why a laboratory cannot be emulated.
#[derive(Debug, thiserror::Error)]
pub enum LaboratoryError {
    #[error("no key for robot {0}; add it to the key file or run with --make-keys and without the file")]
    KeyMissing(u8),
    #[error("robot number {0} stands twice in the laboratory's file")]
    NumberTwice(u8),
    #[error("there is a dock for {0:?}, but no such robot; name one of the laboratory's file")]
    DockOfNobody(String),
    #[error(transparent)]
    Contents(#[from] ContentsError),
    #[error(transparent)]
    Body(#[from] BodyError),
}

/// The emulated laboratory.
#[derive(Debug)]
pub struct Laboratory {
    units: Vec<Unit>,
    arena: Arena,
    floor: String,
    hidden: Hidden,
    /// What the emulator was started with.
    unchanged: Hidden,
    tracker: TrackerModel,
}

impl Laboratory {
    /// All robots on their shelves.
    pub fn new(description: &LabDescription, hidden: Hidden, keys: &Keys, seed: u64) -> Result<Self, LaboratoryError> {
        let mut units: Vec<Unit> = Vec::with_capacity(description.robots.len());
        for robot in &description.robots {
            if units.iter().any(|unit| unit.robot().number == robot.number) {
                return Err(LaboratoryError::NumberTwice(robot.number));
            }
            let key = keys
                .get(robot.number)
                .ok_or(LaboratoryError::KeyMissing(robot.number))?;
            units.push(Unit::new(robot, key, &hidden, seed)?);
        }
        let arena = Arena {
            width_m: description.arena.width_m,
            height_m: description.arena.height_m,
            floor: hidden.floor(&description.arena.floor),
            contents: PlantContents::new(description.arena.contents.as_ref())?,
        };
        Ok(Self {
            units,
            arena,
            floor: description.arena.floor.clone(),
            unchanged: hidden.clone(),
            hidden,
            tracker: TrackerModel::new(Noise::new(seed, u64::MAX)),
        })
    }

    /// Puts chargers on the floor.
    ///
    /// - Errors: a robot that is not here.
    pub fn set_docks(&mut self, docks: &Docks) -> Result<(), LaboratoryError> {
        for dock in &docks.docks {
            let named = |unit: &&mut Unit| unit.robot().description.name == dock.robot;
            let unit = self.units.iter_mut().find(named);
            let unit = unit.ok_or_else(|| LaboratoryError::DockOfNobody(dock.robot.clone()))?;
            unit.set_dock(Pose {
                x_m: dock.pose.x_m,
                y_m: dock.pose.y_m,
                yaw_rad: dock.pose.yaw_rad,
            });
        }
        Ok(())
    }

    pub fn units(&self) -> &[Unit] {
        &self.units
    }

    /// In the order of the laboratory's file.
    pub fn unit_mut(&mut self, index: usize) -> Option<&mut Unit> {
        self.units.get_mut(index)
    }

    pub fn is_floor_empty(&self) -> bool {
        self.units.iter().all(|unit| unit.on_floor().is_none())
    }

    /// One 480 Hz step of all firmware and of the robots on the floor.
    pub fn tick(&mut self, now_us: i64) {
        self.units.iter_mut().for_each(|unit| unit.step_firmware(now_us));
        let mut seats: Vec<_> = self.units.iter_mut().filter_map(Unit::seat).collect();
        let mut occupants: Vec<Occupant<'_>> = seats.iter_mut().map(Seat::occupant).collect();
        if !occupants.is_empty() {
            self.arena.tick(&mut occupants);
        }
    }

    /// What the tracker makes of a picture taken now.
    pub fn expose(&mut self) -> Vec<TrackedPose> {
        let mut poses = self.tracker.expose(&self.units);
        for pose in &mut poses {
            let unit = self.units.iter().find(|unit| unit.robot().number == pose.number);
            pose.number = unit.map_or(pose.number, Unit::seen_as);
        }
        poses
    }

    /// Puts these robots on the floor and takes all others off it; nothing changes when it is refused.
    pub fn place(&mut self, placements: &[Placement]) -> Result<(), HandError> {
        self.place_some(placements, &[])
    }

    /// As [`Self::place`], but robots in `keep` stay as they are.
    pub fn place_some(&mut self, placements: &[Placement], keep: &[u8]) -> Result<(), HandError> {
        let mut all = placements.to_vec();
        for number in keep {
            let unit = self.units.iter().find(|unit| unit.robot().number == *number);
            let body = unit.ok_or(HandError::Unknown(*number))?.on_floor();
            if let Some(pose) = body.map(crate::plant::body::Body::pose) {
                all.push(Placement {
                    number: *number,
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    yaw_rad: pose.yaw_rad,
                });
            }
        }
        self.check_placements(&all)?;
        for unit in &mut self.units {
            if keep.contains(&unit.robot().number) {
                continue;
            }
            match placements
                .iter()
                .find(|placement| placement.number == unit.robot().number)
            {
                Some(placement) => unit.place(
                    Pose {
                        x_m: placement.x_m,
                        y_m: placement.y_m,
                        yaw_rad: placement.yaw_rad,
                    },
                    &self.hidden,
                )?,
                None => unit.lift(),
            }
        }
        Ok(())
    }

    pub fn set_fault(&mut self, request: FaultRequest) -> Result<(), HandError> {
        if let Some((name, value, range)) = request.kind.problem() {
            return Err(HandError::Parameter { name, value, range });
        }
        self.pair_up(request)?;
        self.numbered(request.number)?.set_fault(request.kind);
        Ok(())
    }

    /// What robots and floor really are now, changes included.
    pub fn hidden(&self) -> &Hidden {
        &self.hidden
    }

    /// Changes a robot or the floor, on top of the changes before; [`Change::None`] takes all of them away. Robots on the
    /// floor that are changed come to rest where they are.
    pub fn hide(&mut self, change: &Change) -> Result<(), HandError> {
        change.check()?;
        let name = change.robot();
        if let Some(name) = name {
            let mut robots = self.units.iter().map(|unit| &unit.robot().description);
            let robot = robots
                .find(|robot| robot.name == name)
                .ok_or_else(|| HandError::UnknownName(name.to_owned()))?;
            if let Some(part) = change.missing_part(robot) {
                return Err(HandError::Part(name.to_owned(), part));
            }
        }
        if *change == Change::None {
            self.hidden = self.unchanged.clone();
        } else {
            self.hidden.change(change, &self.floor);
        }
        self.arena.floor = self.hidden.floor(&self.floor);
        let changed = |unit: &&mut Unit| match name {
            Some(name) => unit.robot().description.name == name,
            None => *change == Change::None,
        };
        for unit in self.units.iter_mut().filter(changed) {
            unit.change(&self.hidden)?;
        }
        Ok(())
    }

    fn numbered(&mut self, number: u8) -> Result<&mut Unit, HandError> {
        self.units
            .iter_mut()
            .find(|unit| unit.robot().number == number)
            .ok_or(HandError::Unknown(number))
    }

    /// The other side of a swap of identities, and the end of one.
    fn pair_up(&mut self, request: FaultRequest) -> Result<(), HandError> {
        let seen_as = self.numbered(request.number)?.seen_as();
        match request.kind {
            FaultKind::SwapIdentity { with } => self
                .numbered(with)?
                .set_fault(FaultKind::SwapIdentity { with: request.number }),
            FaultKind::None if seen_as != request.number => self.numbered(seen_as)?.end_swap(),
            _ => {}
        }
        Ok(())
    }

    fn check_placements(&self, placements: &[Placement]) -> Result<(), HandError> {
        let mut standing: Vec<(&Placement, f64)> = Vec::with_capacity(placements.len());
        for placement in placements {
            let number = placement.number;
            let unit = self
                .units
                .iter()
                .find(|unit| unit.robot().number == number)
                .ok_or(HandError::Unknown(number))?;
            let radius_m = unit.robot().bounding_radius_m;
            let inside = placement.x_m.abs() <= self.arena.width_m / 2.0 - radius_m
                && placement.y_m.abs() <= self.arena.height_m / 2.0 - radius_m;
            if !inside || !placement.yaw_rad.is_finite() {
                return Err(HandError::Outside(number));
            }
            let pose = Pose {
                x_m: placement.x_m,
                y_m: placement.y_m,
                yaw_rad: placement.yaw_rad,
            };
            if self.arena.contents.is_blocked(&pose, radius_m) {
                return Err(HandError::Blocked(number));
            }
            for (other, other_radius_m) in &standing {
                if other.number == number {
                    return Err(HandError::Twice(number));
                }
                if (other.x_m - placement.x_m).hypot(other.y_m - placement.y_m) < radius_m + other_radius_m {
                    return Err(HandError::Overlap(other.number, number));
                }
            }
            standing.push((placement, radius_m));
        }
        Ok(())
    }
}
