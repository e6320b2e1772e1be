//! The three on-board controllers.
//!
//! Sources: ATmega2560 data sheet (Microchip DS40002211); SAM3X/SAM3A data sheet (Atmel-11057); Jetson TX2 module
//! data sheet v1.1 (NVIDIA 2017). A figure without a source named here is an estimate of this project.

use serde::Serialize;

use crate::PHYSICS_RATE_HZ;

/// Share of the clock that tasks may use, percent.
///
/// All periods (480, 120, 60, 30, 10 Hz) are multiples of each other, so that rate-monotonic scheduling could use the
/// whole clock [Kuo and Mok 1991], of which interrupts, short and frequent, take their part first. A tenth is kept
/// for what is not counted.
pub const USABLE_PERCENT: u64 = 90;

/// Name of a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ControllerKind {
    Mega2560,
    Sam3x,
    Tx2,
}

/// How frames of the robot link arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Radio {
    /// A serial radio: one interrupt a character.
    Serial,
    /// A network module with direct memory access: one interrupt a frame.
    Datagram,
}

/// Inputs and outputs besides the connector. Also what an actuator or a sensor needs of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Ports {
    pub pwm_outputs: u64,
    /// Lines for encoders, in hardware or by interrupts.
    pub encoder_inputs: u64,
    pub analog_inputs: u64,
    pub serial_ports: u64,
    /// A bus takes any number of sensors.
    pub i2c_buses: u64,
    pub usb3_ports: u64,
}

/// What one controller has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Controller {
    pub kind: ControllerKind,
    pub processor: &'static str,
    /// Of the one core that runs the robot's program.
    pub clock_hz: u64,
    pub has_fpu: bool,
    /// Program memory.
    pub flash_bytes: u64,
    pub ram_bytes: u64,
    /// Actuator pins of the connector that its board wires.
    pub actuator_pins: u64,
    pub ports: Ports,
    /// Encoders that are counted without the processor.
    pub quadrature_decoders: u64,
    pub radio: Radio,
    pub telemetry_rate_hz: u64,
    /// Mean of additions, multiplications, comparisons and conversions in single precision.
    pub cycles_per_float_op: u64,
    /// Load, operate and store 32 bits.
    pub cycles_per_word_op: u64,
    /// Entry, a short handler, return.
    pub cycles_per_interrupt: u64,
}

/// All controllers, the smallest first.
pub const CONTROLLERS: [Controller; 3] = [MEGA2560, SAM3X, TX2];

/// 8-bit AVR. No floating-point unit, no quadrature decoder.
///
/// - Data sheet: 16 MHz, 256 KiB flash, 8 KiB SRAM, 4 USART, one TWI, 16 ADC inputs of 10 bits; 12 PWM outputs on
///   the 16-bit timers and 4 on the 8-bit ones, of which timer 0 (two outputs) keeps the tick; 8 external interrupts,
///   two of them on the TWI pins, and 24 pin-change interrupts: lines for four encoders. Interrupt entry and return
///   take 5 cycles each.
/// - Measured in a simulator with `docs/pairing-cycles.c`: cycles of single-precision arithmetic in software, of a
///   32-bit operation on 8-bit registers, of a handler that stores a byte. Double precision takes about three times
///   as long: a multiplication 526 cycles in the benchmarks of fp64lib.
/// - Telemetry at 60 Hz: 154 characters at 120 Hz exceed 115 200 baud.
const MEGA2560: Controller = Controller {
    kind: ControllerKind::Mega2560,
    processor: "ATmega2560, 8-bit AVR",
    clock_hz: 16_000_000,
    has_fpu: false,
    flash_bytes: 256 << 10,
    ram_bytes: 8 << 10,
    actuator_pins: 31,
    ports: Ports {
        pwm_outputs: 14,
        encoder_inputs: 4,
        analog_inputs: 16,
        serial_ports: 4,
        i2c_buses: 1,
        usb3_ports: 0,
    },
    quadrature_decoders: 0,
    radio: Radio::Serial,
    telemetry_rate_hz: 60,
    cycles_per_float_op: 120,
    cycles_per_word_op: 16,
    cycles_per_interrupt: 70,
};

/// 32-bit Cortex-M3. No floating-point unit.
///
/// - Data sheet (SAM3X8E): 84 MHz, 512 KiB flash, 96 KiB SRAM, 8 PWM channels, three timer blocks with a quadrature
///   decoder each, 4 USART and a UART, 2 TWI, a 12-bit ADC with 15 outer inputs, input-change interrupts on every
///   line. USB is 2.0. Interrupt entry takes 12 cycles (Cortex-M3 technical reference manual).
/// - Estimated: encoder lines of the board, cycles of single-precision arithmetic in software, flash wait states
///   in the word operation.
const SAM3X: Controller = Controller {
    kind: ControllerKind::Sam3x,
    processor: "ATSAM3X8E, 32-bit Cortex-M3",
    clock_hz: 84_000_000,
    has_fpu: false,
    flash_bytes: 512 << 10,
    ram_bytes: 96 << 10,
    actuator_pins: 31,
    ports: Ports {
        pwm_outputs: 8,
        encoder_inputs: 6,
        analog_inputs: 15,
        serial_ports: 5,
        i2c_buses: 2,
        usb3_ports: 0,
    },
    quadrature_decoders: 3,
    radio: Radio::Datagram,
    telemetry_rate_hz: 120,
    cycles_per_float_op: 50,
    cycles_per_word_op: 3,
    cycles_per_interrupt: 40,
};

/// 64-bit Linux module on a carrier that holds the connector, an ADC, PWM outputs and encoder counters.
///
/// - Data sheet: four Cortex-A57 cores (up to 2 GHz) and two Denver 2, 8 GB LPDDR4, 32 GB eMMC, 256-core GPU, USB 3.0.
///   The module has no ADC.
/// - Estimated: the carrier's ports; cycles per operation (no vector instructions, dependent chains); an interrupt
///   through the kernel. One Cortex-A57 core is counted; the others and the GPU are not promised to anyone.
const TX2: Controller = Controller {
    kind: ControllerKind::Tx2,
    processor: "Jetson TX2, 64-bit Cortex-A57",
    clock_hz: 2_000_000_000,
    has_fpu: true,
    flash_bytes: 32_000_000_000,
    ram_bytes: 8_000_000_000,
    actuator_pins: 31,
    ports: Ports {
        pwm_outputs: 8,
        encoder_inputs: 4,
        analog_inputs: 16,
        serial_ports: 4,
        i2c_buses: 1,
        usb3_ports: 1,
    },
    quadrature_decoders: 4,
    radio: Radio::Datagram,
    telemetry_rate_hz: 120,
    cycles_per_float_op: 5,
    cycles_per_word_op: 1,
    cycles_per_interrupt: 2000,
};

impl ControllerKind {
    /// As in documents: `mega2560`, `sam3x` or `tx2`.
    pub fn name(self) -> &'static str {
        match self {
            ControllerKind::Mega2560 => "mega2560",
            ControllerKind::Sam3x => "sam3x",
            ControllerKind::Tx2 => "tx2",
        }
    }

    /// The controller of that name in documents.
    pub fn from_name(name: &str) -> Option<ControllerKind> {
        let named = CONTROLLERS.iter().find(|controller| controller.kind.name() == name);
        named.map(|controller| controller.kind)
    }

    /// Its row of [`CONTROLLERS`].
    pub fn controller(self) -> &'static Controller {
        match self {
            ControllerKind::Mega2560 => &CONTROLLERS[0],
            ControllerKind::Sam3x => &CONTROLLERS[1],
            ControllerKind::Tx2 => &CONTROLLERS[2],
        }
    }
}

impl Controller {
    /// Cycles that tasks may use in one 480 Hz step.
    pub fn usable_cycles_per_step(&self) -> u64 {
        self.clock_hz * USABLE_PERCENT / 100 / u64::from(PHYSICS_RATE_HZ)
    }
}
