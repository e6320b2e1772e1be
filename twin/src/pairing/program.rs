//! Programs that a controller may run beside its loops, if the pair leaves room.

use super::Pairing;
use super::budget::{Budget, items};
use super::task::{self, Task};
use crate::{CONTROL_RATE_HZ, PHYSICS_RATE_HZ};

/// A program and its cost; operations and RAM are estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Program {
    pub name: &'static str,
    pub task: Task,
    pub ram_bytes: u64,
}

/// All programs, in the order in which room is given to them.
pub const PROGRAMS: [Program; 4] = [
    // Position, velocity and orientation: a Kalman filter of five states.
    Program {
        name: "estimator",
        task: Task {
            rate_hz: CONTROL_RATE_HZ as u64,
            float_ops: 600,
            word_ops: 100,
            interrupts: 0,
        },
        ram_bytes: 512,
    },
    // Wheel torques from the body's equations and friction.
    Program {
        name: "dynamic control",
        task: Task {
            rate_hz: PHYSICS_RATE_HZ as u64,
            float_ops: 80,
            word_ops: 20,
            interrupts: 0,
        },
        ram_bytes: 256,
    },
    // A control law on the robot with authenticated messages of eight neighbours.
    Program {
        name: "law on the robot",
        task: Task {
            rate_hz: CONTROL_RATE_HZ as u64,
            float_ops: 1500,
            word_ops: 7000,
            interrupts: 8,
        },
        ram_bytes: 4096,
    },
    // A user's controller in a sandbox.
    Program {
        name: "user code",
        task: Task {
            rate_hz: CONTROL_RATE_HZ as u64,
            float_ops: 20_000,
            word_ops: 20_000,
            interrupts: 0,
        },
        ram_bytes: 1 << 20,
    },
];

/// Programs for which this pair leaves compute and memory, together, in the order of [`PROGRAMS`].
///
/// - Empty if the pair itself does not fit.
pub fn programs(pair: &Pairing) -> Vec<&'static Program> {
    let controller = pair.controller.controller();
    let items = items(pair, controller);
    let left = |budget: Budget| budget.available(controller).checked_sub(budget.total(items.iter()));
    let (Some(mut cycles), Some(mut ram_bytes)) = (left(Budget::Compute), left(Budget::Memory)) else {
        return Vec::new();
    };
    let mut fitting = Vec::new();
    for program in &PROGRAMS {
        let need = task::cycles_per_step(&[program.task], controller);
        if need <= cycles && program.ram_bytes <= ram_bytes {
            cycles -= need;
            ram_bytes -= program.ram_bytes;
            fitting.push(program);
        }
    }
    fitting
}
