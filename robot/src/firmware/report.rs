//! What a robot sends.

use super::Firmware;
use crate::frame::{self, Header, Health, Status, TELEMETRY_MAX_CHARACTERS, Telemetry};
use crate::watchdog::WatchdogState;

impl Firmware {
    /// Writes telemetry of the last step for the current commander and returns its length.
    pub fn telemetry(&mut self, now_ms: u32, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        self.write_telemetry(now_ms, self.heard_ms, out)
    }

    /// Answer to an authentic frame of somebody who is not the commander: the same without an echo, whose clock it would not be.
    pub fn probe_reply(&mut self, now_ms: u32, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        self.write_telemetry(now_ms, 0, out)
    }

    /// Writes estimate and health and returns the length.
    pub fn health_report(&mut self, now_ms: u32, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        let header = self.next_header(now_ms, self.heard_ms);
        let estimate = self.estimator.estimate();
        let health = Health {
            status: self.status(now_ms),
            battery: self.findings.battery,
            anchored: estimate.anchored,
            bounded: estimate.is_bounded(),
            stalled: self.findings.stalled,
            sensor_fault: self.findings.sensor_fault,
            x_m: estimate.x_m,
            y_m: estimate.y_m,
            yaw_rad: estimate.yaw_rad,
            forward_m_per_s: estimate.twist.forward_m_per_s,
            left_m_per_s: estimate.twist.left_m_per_s,
            yaw_rate_rad_per_s: estimate.twist.yaw_rate_rad_per_s,
            position_sd_m: estimate.position_sd_m,
            yaw_sd_rad: estimate.yaw_sd_rad,
            gyro_bias_rad_per_s: estimate.gyro_bias_rad_per_s,
            rest_v: self.battery.rest_v(),
        };
        frame::encode_health(&header, &health, &self.settings.key, out)
    }

    /// Writes the counters of frames and returns the length.
    pub fn counters_report(&mut self, now_ms: u32, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        let header = self.next_header(now_ms, self.heard_ms);
        frame::encode_counters(&header, &self.counters, &self.settings.key, out)
    }

    fn next_header(&mut self, now_ms: u32, echo_ms: u32) -> Header {
        self.sent_frames = self.sent_frames.wrapping_add(1);
        Header {
            robot: self.settings.number,
            epoch: self.acceptance.epoch(),
            sequence: self.sent_frames,
            tick: self.applied_tick,
            clock_ms: now_ms,
            echo_ms,
        }
    }

    fn status(&self, now_ms: u32) -> Status {
        let state = self.watchdog.state();
        Status {
            running: state == WatchdogState::Running && self.watchdog.is_enabled(),
            ramping: state == WatchdogState::Ramping,
            latched: state == WatchdogState::Latched,
            clock_known: self.acceptance.clock().age(now_ms, self.heard_ms).is_some(),
            stopped: self.watchdog.is_stopped(),
            saturated: self.saturated,
        }
    }

    fn write_telemetry(&mut self, now_ms: u32, echo_ms: u32, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        let header = self.next_header(now_ms, echo_ms);
        let sensors = &self.sensors;
        let telemetry = Telemetry {
            status: self.status(now_ms),
            applied_sequence: self.applied_sequence,
            wheel_rad_per_s: sensors.wheel_rad_per_s,
            wheel_rad: sensors.wheel_rad,
            current_a: sensors.current_a,
            bus_v: sensors.bus_v,
            gyro_z_rad_per_s: sensors.gyro_z_rad_per_s,
            accel_m_per_s2: sensors.accel_m_per_s2,
            steering_rad: sensors.steering_rad,
        };
        frame::encode_telemetry(&header, &telemetry, &self.settings.key, out)
    }
}
