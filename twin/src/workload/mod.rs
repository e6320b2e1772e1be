//! The scenario that the speed of the twin is measured with: the same natively and in the browser. It reads no clock.
//!
//! Robots of one chassis stand on a grid in an arena with walls, far enough apart that nothing touches, and every one
//! drives on set-points that change every 0.4 s. [`Workload::survey`] says how much of that time the tyres work hard.

mod grip;
mod plan;

pub use plan::HOLD_TICKS;

use crate::command::WheelCommand;
use crate::effect::Effect;
use crate::free::FreeRobot;
use crate::golden::reference_robot;
use crate::parameter::{CHASSIS, ParameterError};
use crate::pose::Pose;
use crate::robot::Robot;
use crate::world::{Arena, World, WorldError};
use crate::{CONTROL_RATE_HZ, SUBSTEPS};

/// Ticks of one lap: once through the plan, 3.2 s.
pub const LAP_TICKS: u64 = plan::PHASES as u64 * HOLD_TICKS;
/// Distance between the start poses of two neighbours, and of the outer ones from the walls, m.
const SPACING_M: f64 = 8.0;
/// Bounding radius of every robot, m.
const RADIUS_M: f64 = 0.25;
/// Grip in use from which on the tyres work hard.
const HALF: f64 = 0.5;

/// The effect that every robot has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variation {
    /// `floor_friction`: other constants, the same work.
    FloorFriction,
    /// `low_friction_patch` around the robot's start: asks every physics step where each wheel is.
    LowFrictionPatch,
}

impl Variation {
    /// Both.
    pub const ALL: [Variation; 2] = [Variation::FloorFriction, Variation::LowFrictionPatch];

    /// Name in the effect library.
    pub fn name(self) -> &'static str {
        match self {
            Variation::FloorFriction => "floor_friction",
            Variation::LowFrictionPatch => "low_friction_patch",
        }
    }

    fn effect(self, start: Pose) -> Effect {
        match self {
            Variation::FloorFriction => Effect::new(self.name(), &[("scale", 0.9)]),
            Variation::LowFrictionPatch => Effect::new(
                self.name(),
                &[("x", start.x_m), ("y", start.y_m), ("radius", 0.35), ("scale", 0.8)],
            ),
        }
    }
}

/// Why there is no such workload.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorkloadError {
    #[error("no chassis {0:?}; there are {CHASSIS:?}")]
    Chassis(String),
    #[error(transparent)]
    Robot(#[from] ParameterError),
    #[error(transparent)]
    World(#[from] WorldError),
}

/// Robots at their start and what they are told.
#[derive(Debug, Clone)]
pub struct Workload {
    robots: Vec<(Robot, Pose)>,
    start: World,
    /// By phase, then by robot.
    plan: Vec<Vec<WheelCommand>>,
}

/// What a lap is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Survey {
    /// Share of all robots' physics steps at whose end the driven wheels use more than half of their friction:
    /// sum |F_i| > 1/2 sum mu N_i.
    pub share_above_half_friction: f64,
    /// Ticks in which anything touched anything.
    pub contact_ticks: u64,
    /// Smallest gap between two bounding circles, or of one to a wall, at the end of any [`HOLD_TICKS`], m.
    pub smallest_gap_m: f64,
}

impl Workload {
    /// `count` robots of a chassis with one effect each, hashing or not.
    ///
    /// - Errors: an unknown chassis, 0 or more robots than a world holds.
    pub fn new(chassis: &str, count: usize, variation: Variation, digest: bool) -> Result<Workload, WorkloadError> {
        if !CHASSIS.contains(&chassis) {
            return Err(WorkloadError::Chassis(chassis.to_owned()));
        }
        let side = (1..=count).find(|side| side * side >= count).unwrap_or(1);
        let mut robots = Vec::with_capacity(count);
        for index in 0..count {
            let pose = start_pose(index, side);
            let effects = [variation.effect(pose)];
            robots.push((Robot::with_effects(reference_robot(chassis), &effects)?, pose));
        }
        let side_m = (side + 1) as f64 * SPACING_M;
        let arena = Arena {
            width_m: side_m,
            height_m: side_m,
        };
        let placed = robots.iter().map(|(robot, pose)| (robot.clone(), *pose, RADIUS_M));
        let world = World::new(arena, placed.collect())?;
        let robot = |index: usize| &robots[index].0;
        let plan = (0..plan::PHASES).map(|phase| {
            (0..count)
                .map(|index| plan::command(robot(index), index, phase))
                .collect()
        });
        Ok(Workload {
            plan: plan.collect(),
            start: if digest { world } else { world.without_digest() },
            robots,
        })
    }

    /// Set-points of a tick, by robot.
    pub fn commands(&self, tick: u64) -> &[WheelCommand] {
        &self.plan[(tick / HOLD_TICKS) as usize % self.plan.len()]
    }

    /// The world at the start.
    pub fn start(&self) -> &World {
        &self.start
    }

    /// Simulated robot-seconds of one lap.
    pub fn lap_robot_s(&self) -> f64 {
        self.robots.len() as f64 * LAP_TICKS as f64 / f64::from(CONTROL_RATE_HZ)
    }

    /// Laps that make about `robot_s` simulated robot-seconds; at least one.
    pub fn laps_for(&self, robot_s: f64) -> u32 {
        (robot_s / self.lap_robot_s()).ceil().max(1.0) as u32
    }

    /// Drives one lap from the start; the world at its end.
    ///
    /// - Errors: a state that left the finite range.
    pub fn lap(&self) -> Result<World, WorldError> {
        let mut world = self.start.clone();
        for tick in 0..LAP_TICKS {
            world.step(self.commands(tick))?;
        }
        Ok(world)
    }

    /// Drives a lap in the world for its contacts and gaps, and every robot alone, with the same bits, for its grip.
    ///
    /// - Errors: a state that left the finite range.
    pub fn survey(&self) -> Result<Survey, WorldError> {
        let mut world = self.start.clone();
        let (mut contact_ticks, mut smallest_gap_m) = (0, f64::INFINITY);
        for tick in 0..LAP_TICKS {
            world.step(self.commands(tick))?;
            contact_ticks += u64::from(!world.contacts_this_tick().is_empty());
            if (tick + 1).is_multiple_of(HOLD_TICKS) {
                let apart_m = world.smallest_separation_m().unwrap_or(f64::INFINITY);
                smallest_gap_m = smallest_gap_m.min(apart_m).min(world.smallest_wall_distance_m());
            }
        }
        let (mut hard, mut all) = (0_u64, 0_u64);
        for index in 0..self.robots.len() {
            self.drive_alone(index, |robot, free| {
                hard += u64::from(grip::in_use(robot.model(), &free.state()) > HALF);
                all += 1;
            });
        }
        Ok(Survey {
            share_above_half_friction: hard as f64 / all.max(1) as f64,
            contact_ticks,
            smallest_gap_m,
        })
    }

    /// A lap of one robot on an open floor; `see` is called after every physics step.
    fn drive_alone(&self, index: usize, mut see: impl FnMut(&Robot, &FreeRobot)) -> FreeRobot {
        let (robot, pose) = &self.robots[index];
        let mut free = FreeRobot::at_rest(robot, *pose);
        for step in 0..LAP_TICKS * u64::from(SUBSTEPS) {
            free.step(&self.commands(step / u64::from(SUBSTEPS))[index]);
            see(robot, &free);
        }
        free
    }
}

/// On a square grid about the origin, each turned another way.
fn start_pose(index: usize, side: usize) -> Pose {
    let place = |at: usize| (at as f64 - 0.5 * (side - 1) as f64) * SPACING_M;
    Pose {
        x_m: place(index % side),
        y_m: place(index / side),
        yaw_rad: crate::pose::wrapped_rad(index as f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_chassis_works_its_tyres_and_touches_nothing() {
        for chassis in CHASSIS {
            for variation in Variation::ALL {
                let survey = Workload::new(chassis, 7, variation, true)
                    .expect("workload")
                    .survey()
                    .expect("finite");
                println!("{chassis} {}: {survey:?}", variation.name());
                assert!(survey.share_above_half_friction >= 0.2, "{chassis}: {survey:?}");
                assert_eq!(survey.contact_ticks, 0, "{chassis}");
                assert!(survey.smallest_gap_m > 1.0, "{chassis}: {survey:?}");
            }
        }
    }

    #[test]
    fn a_robot_alone_does_what_it_does_in_the_world() {
        for variation in Variation::ALL {
            let work = Workload::new("awd", 3, variation, false).expect("workload");
            let world = work.lap().expect("finite");
            for robot in 0..3 {
                let alone = work.drive_alone(robot, |_, _| {}).state();
                assert_eq!(alone, world.state(robot), "{}", variation.name());
                let moved_m = alone.pose.x_m - work.start().state(robot).pose.x_m;
                assert!(moved_m.abs() > 1e-3, "it stood still");
            }
        }
    }

    #[test]
    fn hashing_changes_the_digest_and_nothing_else() {
        let lap = |digest| Workload::new("omni4", 2, Variation::FloorFriction, digest).and_then(|work| Ok(work.lap()?));
        let (with, without) = (lap(true).expect("finite"), lap(false).expect("finite"));
        assert_ne!(with.digest(), without.digest());
        assert_eq!(with.state(1), without.state(1));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let refused = |chassis, count| Workload::new(chassis, count, Variation::FloorFriction, true).err();
        assert_eq!(refused("tank", 1), Some(WorkloadError::Chassis("tank".to_owned())));
        assert!(matches!(refused("omni4", 0), Some(WorkloadError::World(_))));
    }
}
