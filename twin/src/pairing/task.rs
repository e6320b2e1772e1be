//! Work that a controller does periodically.
//!
//! Operations are counted by hand from the `robot` package and from the usual form of each algorithm, in single
//! precision; comparisons and conversions count. `docs/pairing-cycles.c` times the link and the loops of a motor on
//! the ATmega2560, and the counts here agree with it; the others are estimates. RAM includes buffers.

use serde::Serialize;

use super::controller::{Controller, Radio};
use crate::{CONTROL_RATE_HZ, PHYSICS_RATE_HZ};

/// Characters of a command frame and of a telemetry frame, line feeds left out.
const COMMAND_CHARACTERS: u64 = 82;
const TELEMETRY_CHARACTERS: u64 = 154;
/// 32-bit operations of one SipHash round.
const SIPHASH_ROUND_WORD_OPS: u64 = 60;
/// PI with two clamps and a check of its input.
pub const PI_LOOP_FLOAT_OPS: u64 = 11;

/// Work of one sample, and how often it is done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Task {
    pub rate_hz: u64,
    pub float_ops: u64,
    pub word_ops: u64,
    pub interrupts: u64,
}

impl Task {
    /// Saturates instead of wrapping.
    pub fn cycles_per_second(&self, controller: &Controller) -> u64 {
        let float = self.float_ops.saturating_mul(controller.cycles_per_float_op);
        let word = self.word_ops.saturating_mul(controller.cycles_per_word_op);
        let interrupt = self.interrupts.saturating_mul(controller.cycles_per_interrupt);
        float
            .saturating_add(word)
            .saturating_add(interrupt)
            .saturating_mul(self.rate_hz)
    }
}

/// Mean load in one 480 Hz step, rounded up.
pub fn cycles_per_step(tasks: &[Task], controller: &Controller) -> u64 {
    let per_second = tasks.iter().fold(0_u64, |sum, task| {
        sum.saturating_add(task.cycles_per_second(controller))
    });
    per_second.div_ceil(u64::from(PHYSICS_RATE_HZ))
}

/// The frame of the 480 Hz step: tick, watchdog, ramp.
pub const STEP: Task = Task {
    rate_hz: PHYSICS_RATE_HZ as u64,
    float_ops: 8,
    word_ops: 50,
    interrupts: 1,
};
pub const STEP_RAM_BYTES: u64 = 1536;

/// Robot link: a command at 120 Hz decoded and authenticated, telemetry encoded at the controller's rate.
///
/// SipHash-2-4 takes 14 rounds over the 36 bytes of a command and 24 over the 72 of telemetry. The rest of the word
/// operations are hexadecimal digits, CRC bit by bit, and fields; each of 17 values of telemetry is scaled,
/// limited and rounded.
pub fn link(controller: &Controller) -> [Task; 2] {
    let interrupts = |characters| match controller.radio {
        Radio::Serial => characters,
        Radio::Datagram => 1,
    };
    let command = Task {
        rate_hz: u64::from(CONTROL_RATE_HZ),
        float_ops: 10,
        word_ops: 14 * SIPHASH_ROUND_WORD_OPS + 325,
        interrupts: interrupts(COMMAND_CHARACTERS),
    };
    let telemetry = Task {
        rate_hz: controller.telemetry_rate_hz,
        float_ops: 17 * 5,
        word_ops: 24 * SIPHASH_ROUND_WORD_OPS + 540,
        interrupts: interrupts(TELEMETRY_CHARACTERS),
    };
    [command, telemetry]
}
pub const LINK_RAM_BYTES: u64 = 1024;

/// Output of a motor's voltage: scaling, PWM, direction.
pub const MOTOR: Task = Task {
    rate_hz: PHYSICS_RATE_HZ as u64,
    float_ops: 2,
    word_ops: 10,
    interrupts: 0,
};
pub const MOTOR_RAM_BYTES: u64 = 96;

/// Position loop of the steering gear with its analogue angle.
pub const STEERING_GEAR: Task = Task {
    rate_hz: PHYSICS_RATE_HZ as u64,
    float_ops: 4 + PI_LOOP_FLOAT_OPS,
    word_ops: 10,
    interrupts: 1,
};
pub const STEERING_GEAR_RAM_BYTES: u64 = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pairing::controller::CONTROLLERS;

    #[test]
    fn loads_add_up_and_saturate() {
        let [mega, ..] = &CONTROLLERS;
        assert_eq!(cycles_per_step(&[STEP], mega), 8 * 120 + 50 * 16 + 70);
        let huge = Task {
            rate_hz: 480,
            float_ops: u64::MAX,
            ..Task::default()
        };
        assert_eq!(cycles_per_step(&[huge, STEP], mega), u64::MAX.div_ceil(480));
    }

    #[test]
    fn a_serial_link_interrupts_for_every_character() {
        let [mega, sam3x, _] = &CONTROLLERS;
        assert_eq!(link(mega).map(|task| task.interrupts), [82, 154]);
        assert_eq!(link(sam3x).map(|task| task.interrupts), [1, 1]);
        let baud = |characters: u64, rate_hz: u64| characters * 10 * rate_hz;
        assert!(baud(TELEMETRY_CHARACTERS, mega.telemetry_rate_hz) < 115_200);
        assert!(baud(TELEMETRY_CHARACTERS, 120) > 115_200);
    }
}
