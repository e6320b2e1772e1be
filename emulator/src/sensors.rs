//! From what is to what the robot's sensors say.

use crate::hidden::{HiddenMagnetometer, HiddenRobot};
use crate::noise::Noise;
use crate::plant::body::Body;
use robot::firmware::{MotorSensors, Sensors};

const ENCODER_TICKS_PER_TURN: u32 = 4096;
/// Share of a new sample in the accelerometer's low-pass filter (about 30 Hz at 480 samples per second).
const ACCEL_NEW_SHARE: f64 = 0.3;

/// One robot's sensors; a channel without a noise entry in the description is without noise.
#[derive(Debug, Clone)]
pub struct SensorSet {
    noise: api::robot::Noise,
    gyro_bias_rad_per_s: f64,
    ticks_per_turn: f64,
    magnetometer: Option<HiddenMagnetometer>,
    accel_m_per_s2: [f64; 2],
    /// Wheel angles from before the robot was last put down.
    wheel_offset_rad: [f64; robot::MAX_MOTORS],
    /// Angles of the last sample, from which the encoders make speeds.
    last_angle_rad: [f64; robot::MAX_MOTORS],
    random: Noise,
}

impl SensorSet {
    /// - `encoder_ticks`: counts of one turn of a wheel, where the motor control has an encoder.
    pub fn new(
        noise: Option<&api::robot::Noise>,
        encoder_ticks: Option<u32>,
        hidden: &HiddenRobot,
        random: Noise,
    ) -> Self {
        Self {
            noise: noise.cloned().unwrap_or_default(),
            gyro_bias_rad_per_s: hidden.gyro_bias_rad_per_s,
            ticks_per_turn: f64::from(encoder_ticks.unwrap_or(ENCODER_TICKS_PER_TURN).max(1)),
            magnetometer: hidden.magnetometer,
            accel_m_per_s2: [0.0; 2],
            wheel_offset_rad: [0.0; robot::MAX_MOTORS],
            last_angle_rad: [0.0; robot::MAX_MOTORS],
            random,
        }
    }

    /// The robot is another one now.
    pub(crate) fn change(&mut self, hidden: &HiddenRobot) {
        self.gyro_bias_rad_per_s = hidden.gyro_bias_rad_per_s;
        self.magnetometer = hidden.magnetometer;
    }

    /// Keeps the wheel angles running when the body is built anew.
    pub fn carry_angles_over(&mut self, old: &Body) {
        for (offset, wheel) in self.wheel_offset_rad.iter_mut().zip(old.driven_wheels()) {
            *offset += wheel.motor.angle_rad;
        }
    }

    /// What the motors' control reads between two firmware steps: counters, currents and bus voltage.
    pub fn motor_sample(&mut self, body: &Body) -> MotorSensors {
        let mut sensors = MotorSensors {
            bus_v: body.battery.bus_v() + self.error(self.noise.bus_v),
            ..MotorSensors::default()
        };
        for (i, wheel) in body.driven_wheels().enumerate().take(robot::MAX_MOTORS) {
            sensors.encoder_count[i] = self.count(i, wheel.motor.angle_rad);
            sensors.wheel_rad_per_s[i] = wheel.motor.speed_rad_per_s + self.error(self.noise.wheel_rad_per_s);
            sensors.current_a[i] = wheel.motor.current_a + self.error(self.noise.current_a);
        }
        sensors
    }

    /// A counter of 32 bits, which wraps.
    fn count(&self, motor: usize, angle_rad: f64) -> i32 {
        let angle_rad = self.wheel_offset_rad.get(motor).copied().unwrap_or(0.0) + angle_rad;
        (angle_rad / std::f64::consts::TAU * self.ticks_per_turn).floor() as i64 as i32
    }

    /// Samples a robot. In the air its motors are without power; it shows its battery, and the bias of its gyro.
    pub fn sample(&mut self, body: &Body, on_floor: bool) -> Sensors {
        let bus_v = body.battery.bus_v() + self.error(self.noise.bus_v);
        let mut sensors = Sensors {
            bus_v,
            wheel_rad: self.wheel_offset_rad,
            ..Sensors::default()
        };
        sensors.magnetic_field_t = self.magnetic_field_t(body, on_floor);
        if !on_floor {
            for (angle, wheel) in sensors.wheel_rad.iter_mut().zip(body.driven_wheels()) {
                *angle += wheel.motor.angle_rad;
            }
            sensors.gyro_z_rad_per_s = self.gyro_bias_rad_per_s + self.error(self.noise.gyro_rad_per_s);
            return sensors;
        }
        // Encoders sit on the motor's side of the gear. A speed is the mean over the last sample interval, by timed edges.
        let tick_rad = std::f64::consts::TAU / self.ticks_per_turn;
        for (i, wheel) in body.driven_wheels().enumerate().take(robot::MAX_MOTORS) {
            sensors.wheel_rad[i] += (wheel.motor.angle_rad / tick_rad).floor() * tick_rad;
            sensors.encoder_count[i] = self.count(i, wheel.motor.angle_rad);
            let angle_rad = self.wheel_offset_rad[i] + wheel.motor.angle_rad;
            let turned_rad = angle_rad - std::mem::replace(&mut self.last_angle_rad[i], angle_rad);
            sensors.wheel_rad_per_s[i] = turned_rad * robot::firmware::RATE_HZ + self.error(self.noise.wheel_rad_per_s);
            sensors.current_a[i] = wheel.motor.current_a + self.error(self.noise.current_a);
        }
        sensors.gyro_z_rad_per_s =
            body.yaw_rate_rad_per_s() + self.gyro_bias_rad_per_s + self.error(self.noise.gyro_rad_per_s);
        let specific_force = body.specific_force_m_per_s2();
        for (i, (filtered, now)) in self.accel_m_per_s2.iter_mut().zip(specific_force).enumerate() {
            *filtered += ACCEL_NEW_SHARE * (now - *filtered);
            sensors.accel_m_per_s2[i] = *filtered;
        }
        for acceleration in &mut sensors.accel_m_per_s2 {
            *acceleration += self.error(self.noise.accel_m_per_s2);
        }
        // At the servo, in front of play, offset and scale.
        sensors.steering_rad = body.servo_rad() + self.error(self.noise.steering_rad);
        sensors
    }

    fn magnetic_field_t(&mut self, body: &Body, on_floor: bool) -> Option<[f64; 2]> {
        let magnetometer = self.magnetometer?;
        if !on_floor {
            return None;
        }
        let angle_rad = magnetometer.north_rad - body.pose().yaw_rad;
        let noise = Some(magnetometer.noise_t);
        Some([
            magnetometer.field_t * angle_rad.cos() + magnetometer.offset_t[0] + self.error(noise),
            magnetometer.field_t * angle_rad.sin() + magnetometer.offset_t[1] + self.error(noise),
        ])
    }

    fn error(&mut self, standard_deviation: Option<f64>) -> f64 {
        standard_deviation.map_or(0.0, |deviation| deviation * self.random.normal())
    }
}
