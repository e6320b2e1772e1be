//! Sensors that a controller may carry, and what each takes of it.
//!
//! Reference parts and counts are this project's choice and estimate; a part's figure has its data sheet beside it.

use serde::Serialize;

use super::controller::{Controller, Ports};
use super::task::{PI_LOOP_FLOAT_OPS, Task};
use crate::robot::Motor;
use crate::{CONTROL_RATE_HZ, PHYSICS_RATE_HZ};

/// Counts per turn of the motor's shaft: 16 lines, both edges of both channels.
pub const ENCODER_COUNTS_PER_REV: f64 = 64.0;
/// Range sensors around the robot.
pub const RANGE_SENSORS: u64 = 7;

/// 32-bit operations that find the direction of a count and add it up.
const COUNT_WORD_OPS: u64 = 3;

/// No-load speed of the reference motor, 24 V / 0.031 N m/A, for descriptions without a motor.
const REFERENCE_MOTOR_RAD_PER_S: f64 = 24.0 / 0.031;

/// Kind of sensor, as in the `sensors` of a robot document.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorKind {
    /// Wheel encoders of all motors, and the speed loops that use them.
    Encoder,
    /// Motor currents, and the current loops that use them.
    Current,
    BusVoltage,
    Gyro,
    Accelerometer,
    Magnetometer,
    /// A ring of [`RANGE_SENSORS`].
    Range,
    /// Distances to fixed radio anchors.
    Uwb,
    /// Planar, matched against a map of the arena.
    Lidar,
    Gnss,
    DepthCamera,
}

/// All sensors, in the order of documents.
pub const SENSORS: [SensorKind; 11] = [
    SensorKind::Encoder,
    SensorKind::Current,
    SensorKind::BusVoltage,
    SensorKind::Gyro,
    SensorKind::Accelerometer,
    SensorKind::Magnetometer,
    SensorKind::Range,
    SensorKind::Uwb,
    SensorKind::Lidar,
    SensorKind::Gnss,
    SensorKind::DepthCamera,
];

/// What one sensor takes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SensorDemand {
    pub ports: Ports,
    pub tasks: Vec<Task>,
    pub ram_bytes: u64,
}

/// What the robot around a sensor is like.
#[derive(Debug, Clone, Copy)]
pub struct Drive<'a> {
    pub motor_count: u64,
    pub motor: Option<&'a Motor>,
}

const fn analog(inputs: u64) -> Ports {
    Ports {
        analog_inputs: inputs,
        ..NONE
    }
}

const NONE: Ports = Ports {
    pwm_outputs: 0,
    encoder_inputs: 0,
    analog_inputs: 0,
    serial_ports: 0,
    i2c_buses: 0,
    usb3_ports: 0,
};
const I2C: Ports = Ports { i2c_buses: 1, ..NONE };
const SERIAL: Ports = Ports {
    serial_ports: 1,
    ..NONE
};
const USB3: Ports = Ports { usb3_ports: 1, ..NONE };

impl SensorKind {
    pub fn name(self) -> &'static str {
        match self {
            SensorKind::Encoder => "encoder",
            SensorKind::Current => "current",
            SensorKind::BusVoltage => "bus_voltage",
            SensorKind::Gyro => "gyro",
            SensorKind::Accelerometer => "accelerometer",
            SensorKind::Magnetometer => "magnetometer",
            SensorKind::Range => "range",
            SensorKind::Uwb => "uwb",
            SensorKind::Lidar => "lidar",
            SensorKind::Gnss => "gnss",
            SensorKind::DepthCamera => "depth_camera",
        }
    }

    /// The sensor of that name in documents.
    pub fn from_name(name: &str) -> Option<SensorKind> {
        SENSORS.into_iter().find(|sensor| sensor.name() == name)
    }

    /// What this sensor takes of `controller` on a robot with `drive`.
    pub fn demand(self, drive: Drive, controller: &Controller) -> SensorDemand {
        let control_hz = u64::from(CONTROL_RATE_HZ);
        match self {
            SensorKind::Encoder => encoders(drive, controller),
            SensorKind::Current => currents(drive),
            SensorKind::BusVoltage => demand(analog(1), 16, [control_hz, 2, 4, 1]),
            // One inertial unit on a bus: an address, a register and the values, an interrupt a byte.
            SensorKind::Gyro => demand(I2C, 32, [control_hz, 2, 10, 5]),
            SensorKind::Accelerometer => demand(I2C, 32, [control_hz, 4, 10, 7]),
            SensorKind::Magnetometer => demand(I2C, 32, [control_hz, 10, 10, 9]),
            // Analogue infrared, a new value every 38 ms [Sharp GP2Y0A21YK], read at a divisor of the other rates.
            SensorKind::Range => demand(
                analog(RANGE_SENSORS),
                64,
                [30, 6 * RANGE_SENSORS, 10 * RANGE_SENSORS, RANGE_SENSORS],
            ),
            // Position from four anchors by least squares.
            SensorKind::Uwb => demand(SERIAL, 256, [10, 300, 200, 60]),
            // 8000 points a second in ten turns, 5 bytes a point [Slamtec RPLIDAR A1]; each scan is matched in ten
            // iterations against a map of 4 x 3 m in cells of 2 cm, a byte a cell, beside two scans.
            SensorKind::Lidar => demand(SERIAL, 30_000 + 12_000, [10, 800 * 10 * 30, 800 * 20, 800 * 5]),
            SensorKind::Gnss => demand(SERIAL, 512, [10, 60, 1000, 100]),
            // 640 x 480 x 16 bit at 30 Hz, two frames in memory; halved, then turned into points.
            SensorKind::DepthCamera => demand(USB3, 2 * 640 * 480 * 2, [30, 320 * 240 * 12, 640 * 480 * 2, 100]),
        }
    }
}

fn demand(ports: Ports, ram_bytes: u64, task: [u64; 4]) -> SensorDemand {
    let [rate_hz, float_ops, word_ops, interrupts] = task;
    let task = Task {
        rate_hz,
        float_ops,
        word_ops,
        interrupts,
    };
    SensorDemand {
        ports,
        tasks: vec![task],
        ram_bytes,
    }
}

/// Speed loops on all motors; motors beyond the hardware decoders take an interrupt a count at no-load speed.
fn encoders(drive: Drive, controller: &Controller) -> SensorDemand {
    let speed_loops = Task {
        rate_hz: u64::from(PHYSICS_RATE_HZ),
        float_ops: (2 + PI_LOOP_FLOAT_OPS) * drive.motor_count,
        word_ops: 5 * drive.motor_count,
        interrupts: 0,
    };
    let counted_by_interrupt = drive.motor_count.saturating_sub(controller.quadrature_decoders);
    let counts = Task {
        rate_hz: counts_per_second(drive.motor),
        word_ops: COUNT_WORD_OPS * counted_by_interrupt,
        interrupts: counted_by_interrupt,
        ..Task::default()
    };
    SensorDemand {
        ports: Ports {
            encoder_inputs: drive.motor_count,
            ..NONE
        },
        tasks: vec![speed_loops, counts],
        ram_bytes: 16 * drive.motor_count,
    }
}

/// Current loops on all motors.
fn currents(drive: Drive) -> SensorDemand {
    let motors = drive.motor_count;
    let loops = [
        u64::from(PHYSICS_RATE_HZ),
        (3 + PI_LOOP_FLOAT_OPS) * motors,
        5 * motors,
        motors,
    ];
    demand(analog(motors), 16 * motors, loops)
}

/// Counts of one encoder at V_bus / k_t.
fn counts_per_second(motor: Option<&Motor>) -> u64 {
    let no_load = motor.map_or(REFERENCE_MOTOR_RAD_PER_S, |motor| {
        motor.supply_v / motor.torque_constant_n_m_per_a
    });
    let counts = no_load.abs() / (2.0 * core::f64::consts::PI) * ENCODER_COUNTS_PER_REV;
    counts.ceil() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pairing::controller::CONTROLLERS;

    #[test]
    fn names_lead_back() {
        for sensor in SENSORS {
            assert_eq!(SensorKind::from_name(sensor.name()), Some(sensor));
            let written = serde_json::to_value(sensor).unwrap();
            assert_eq!(written, sensor.name());
        }
        assert_eq!(SensorKind::from_name("sonar"), None);
    }

    #[test]
    fn the_reference_motor_counts_7886_a_second() {
        assert_eq!(counts_per_second(None), 7886);
    }

    #[test]
    fn hardware_decoders_count_for_nothing() {
        let [mega, sam3x, tx2] = &CONTROLLERS;
        let drive = Drive {
            motor_count: 4,
            motor: None,
        };
        let counted = [mega, sam3x, tx2].map(|controller| encoders(drive, controller).tasks[1].interrupts);
        assert_eq!(counted, [4, 1, 0]);
    }
}
