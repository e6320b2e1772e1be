//! From what is to what the robot's sensors say.

use crate::hidden::HiddenRobot;
use crate::noise::Noise;
use crate::plant::body::Body;
use robot::firmware::Sensors;

const ENCODER_TICKS_PER_TURN: f64 = 4096.0;
/// Share of a new sample in the accelerometer's low-pass filter (about 30 Hz at 480 samples per second).
const ACCEL_NEW_SHARE: f64 = 0.3;

/// One robot's sensors; a channel without a noise entry in the description is without noise.
#[derive(Debug, Clone)]
pub struct SensorSet {
    noise: api::robot::Noise,
    gyro_bias_rad_per_s: f64,
    accel_m_per_s2: [f64; 2],
    /// Wheel angles from before the robot was last put down.
    wheel_offset_rad: [f64; robot::MAX_MOTORS],
    /// Angles of the last sample, from which the encoders make speeds.
    last_angle_rad: [f64; robot::MAX_MOTORS],
    random: Noise,
}

impl SensorSet {
    pub fn new(noise: Option<&api::robot::Noise>, hidden: &HiddenRobot, random: Noise) -> Self {
        Self {
            noise: noise.cloned().unwrap_or_default(),
            gyro_bias_rad_per_s: hidden.gyro_bias_rad_per_s,
            accel_m_per_s2: [0.0; 2],
            wheel_offset_rad: [0.0; robot::MAX_MOTORS],
            last_angle_rad: [0.0; robot::MAX_MOTORS],
            random,
        }
    }

    /// Keeps the wheel angles running when the body is built anew.
    pub fn carry_angles_over(&mut self, old: &Body) {
        for (offset, wheel) in self.wheel_offset_rad.iter_mut().zip(old.driven_wheels()) {
            *offset += wheel.motor.angle_rad;
        }
    }

    /// Samples a robot. In the air its motors are without power and it shows only its battery.
    pub fn sample(&mut self, body: &Body, on_floor: bool) -> Sensors {
        let bus_v = body.battery.bus_v() + self.error(self.noise.bus_v);
        let mut sensors = Sensors {
            bus_v,
            wheel_rad: self.wheel_offset_rad,
            ..Sensors::default()
        };
        if !on_floor {
            return sensors;
        }
        // Encoders sit on the motor's side of the gear. A speed is the mean over the last sample interval, by timed edges.
        let tick_rad = std::f64::consts::TAU / ENCODER_TICKS_PER_TURN;
        for (i, wheel) in body.driven_wheels().enumerate().take(robot::MAX_MOTORS) {
            sensors.wheel_rad[i] += (wheel.motor.angle_rad / tick_rad).floor() * tick_rad;
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
        sensors.steering_rad = body.steering_rad() + self.error(self.noise.steering_rad);
        sensors
    }

    fn error(&mut self, standard_deviation: Option<f64>) -> f64 {
        standard_deviation.map_or(0.0, |deviation| deviation * self.random.normal())
    }
}
