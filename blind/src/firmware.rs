//! Set-points on their way to the motors: what the robot's firmware and link do to them, and its speed loop.

use api::robot::RobotDescription;
use emulator::noise::Noise;
use emulator::plant::TICK_HZ;
use robot::MAX_MOTORS;
use std::collections::VecDeque;

/// Wheel set-points of the driven wheels and the steering angle.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SetPoint {
    pub wheel_rad_per_s: [f64; MAX_MOTORS],
    pub steering_rad: f64,
}

#[derive(Debug, Clone)]
pub struct Firmware {
    pub delay_ticks: usize,
    /// Share of the bursts in which nothing new arrives, and their length.
    pub loss_rate: f64,
    pub loss_burst_s: f64,
    pub dead_band_rad_per_s: f64,
    pub wheel_limit_rad_per_s: f64,
    /// Forward, left, yaw rate.
    pub body_limit: [f64; 3],
    /// At the rim.
    pub slew_m_per_s2: f64,
    pub lag_s: f64,
    /// Of each motor's encoder, for the log and for the loop.
    pub encoder_scale: [f64; MAX_MOTORS],
    /// Gain of the speed loop while the error is negative.
    pub braking_gain: f64,
    /// The steering moves only when the set-point has left it by this much, less at speed; it remembers where it stuck.
    pub steering_stiction_rad: f64,
}

impl Default for Firmware {
    fn default() -> Self {
        Self {
            delay_ticks: 0,
            loss_rate: 0.0,
            loss_burst_s: 0.05,
            dead_band_rad_per_s: 0.0,
            wheel_limit_rad_per_s: f64::INFINITY,
            body_limit: [f64::INFINITY; 3],
            slew_m_per_s2: f64::INFINITY,
            lag_s: 0.0,
            encoder_scale: [1.0; MAX_MOTORS],
            braking_gain: 1.0,
            steering_stiction_rad: 0.0,
        }
    }
}

/// A firmware at work on one robot.
pub struct Running<'a> {
    firmware: &'a Firmware,
    description: &'a RobotDescription,
    driven: Vec<usize>,
    sent: VecDeque<SetPoint>,
    held: SetPoint,
    losses: Noise,
    lost: bool,
    slewed: [f64; MAX_MOTORS],
    lagged: [f64; MAX_MOTORS],
    stuck_rad: f64,
    integral: [f64; MAX_MOTORS],
    tick: u32,
}

const PERIOD_S: f64 = 1.0 / TICK_HZ as f64;

impl<'a> Running<'a> {
    /// - `losses`: which bursts are lost.
    pub fn new(firmware: &'a Firmware, description: &'a RobotDescription, losses: Noise) -> Self {
        let driven = (0..description.wheels.len())
            .filter(|wheel| description.wheels[*wheel].driven)
            .collect();
        Self {
            firmware,
            description,
            driven,
            sent: VecDeque::new(),
            held: SetPoint::default(),
            losses,
            lost: false,
            slewed: [0.0; MAX_MOTORS],
            lagged: [0.0; MAX_MOTORS],
            stuck_rad: 0.0,
            integral: [0.0; MAX_MOTORS],
            tick: 0,
        }
    }

    /// What acts a tick after all delays and limits.
    pub fn act(&mut self, sent: SetPoint, speed_m_per_s: f64) -> SetPoint {
        let firmware = self.firmware;
        let burst_ticks = ((firmware.loss_burst_s / PERIOD_S) as u32).max(1);
        if self.tick.is_multiple_of(burst_ticks) {
            self.lost = firmware.loss_rate > 0.0 && self.losses.uniform() < firmware.loss_rate;
        }
        self.tick += 1;
        if !self.lost {
            self.held = sent;
        }
        self.sent.push_back(self.held);
        while self.sent.len() > firmware.delay_ticks + 1 {
            self.sent.pop_front();
        }
        let mut acting = self.clipped(self.sent[0]);
        for (m, wheel) in self.driven.iter().enumerate() {
            let w = &mut acting.wheel_rad_per_s[m];
            if w.abs() < firmware.dead_band_rad_per_s {
                *w = 0.0;
            }
            *w = w.clamp(-firmware.wheel_limit_rad_per_s, firmware.wheel_limit_rad_per_s);
            if firmware.slew_m_per_s2.is_finite() {
                let radius_m = self.description.wheels[*wheel].radius_m.unwrap_or(0.05);
                let most = firmware.slew_m_per_s2 * PERIOD_S / radius_m;
                self.slewed[m] += (*w - self.slewed[m]).clamp(-most, most);
                *w = self.slewed[m];
            }
            if firmware.lag_s > 0.0 {
                self.lagged[m] += (1.0 - (-PERIOD_S / firmware.lag_s).exp()) * (*w - self.lagged[m]);
                *w = self.lagged[m];
            }
        }
        if firmware.steering_stiction_rad > 0.0 {
            let hold_rad = firmware.steering_stiction_rad / (1.0 + 4.0 * speed_m_per_s.abs());
            if (acting.steering_rad - self.stuck_rad).abs() > hold_rad {
                self.stuck_rad = acting.steering_rad;
            }
            acting.steering_rad = self.stuck_rad;
        }
        acting
    }

    /// Each axis of the body's velocity within its limit.
    fn clipped(&self, wanted: SetPoint) -> SetPoint {
        let limit = self.firmware.body_limit;
        if limit.iter().all(|limit| limit.is_infinite()) {
            return wanted;
        }
        let rim =
            |m: usize| wanted.wheel_rad_per_s[m] * self.description.wheels[self.driven[m]].radius_m.unwrap_or(0.05);
        let count = self.driven.len() as f64;
        let mut out = wanted;
        if self.description.steering.is_some() {
            let length_m = wheelbase_m(self.description);
            let forward = (0..self.driven.len()).map(rim).sum::<f64>() / count;
            let slow = forward.clamp(-limit[0], limit[0]);
            // Of the velocity that is wanted: a car that may not drive so fast turns as fast as before, in a narrower circle.
            let turn = (forward * wanted.steering_rad.tan() / length_m).clamp(-limit[2], limit[2]);
            let share = if forward.abs() > 1e-9 { slow / forward } else { 1.0 };
            out.wheel_rad_per_s.iter_mut().for_each(|w| *w *= share);
            if slow.abs() > 1e-6 {
                out.steering_rad = (length_m * turn / slow).atan();
            }
            return out;
        }
        // Every layout here is orthogonal: each axis is the projection of the rim speeds on its own pattern.
        let omni = self.description.wheels.iter().any(|wheel| wheel.kind == "omni");
        let pattern = |axis: usize, m: usize| {
            let wheel = &self.description.wheels[self.driven[m]];
            let (sin, cos) = wheel.rolling_direction_rad.sin_cos();
            [cos, sin, wheel.x_m * sin - wheel.y_m * cos][axis]
        };
        let mut change = [0.0; MAX_MOTORS];
        for (axis, most) in limit.iter().enumerate() {
            if axis == 1 && !omni {
                continue;
            }
            let square: f64 = (0..self.driven.len()).map(|m| pattern(axis, m).powi(2)).sum();
            let speed = (0..self.driven.len()).map(|m| pattern(axis, m) * rim(m)).sum::<f64>() / square;
            let over = speed.clamp(-most, *most) - speed;
            for (m, change) in change.iter_mut().enumerate().take(self.driven.len()) {
                *change += over * pattern(axis, m);
            }
        }
        for (m, change) in change.iter().enumerate().take(self.driven.len()) {
            out.wheel_rad_per_s[m] += change / self.description.wheels[self.driven[m]].radius_m.unwrap_or(0.05);
        }
        out
    }

    /// Voltages of the speed loop for what the encoders say.
    pub fn voltages(&mut self, wanted: &SetPoint, measured_rad_per_s: &[f64], bus_v: f64) -> [f64; MAX_MOTORS] {
        let mut voltage = [0.0; MAX_MOTORS];
        let Some(motor) = &self.description.motor else {
            return voltage;
        };
        for (m, speed) in measured_rad_per_s.iter().enumerate().take(MAX_MOTORS) {
            let error = wanted.wheel_rad_per_s[m] - speed;
            let gain = if error < 0.0 { self.firmware.braking_gain } else { 1.0 };
            let most = bus_v / motor.speed_loop_ki_v_per_rad;
            self.integral[m] = (self.integral[m] + gain * error * PERIOD_S).clamp(-most, most);
            voltage[m] = (gain * motor.speed_loop_kp_v_s_per_rad * error
                + motor.speed_loop_ki_v_per_rad * self.integral[m])
                .clamp(-bus_v, bus_v);
        }
        voltage
    }
}

/// Distance of the axles.
pub fn wheelbase_m(description: &RobotDescription) -> f64 {
    let axle = |steered: bool| {
        let of = description
            .wheels
            .iter()
            .filter(|wheel| wheel.steered == steered && wheel.kind != "caster");
        let (sum, count) = of.fold((0.0, 0.0), |(sum, count), wheel| (sum + wheel.x_m, count + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    };
    axle(true) - axle(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(chassis: &str) -> RobotDescription {
        let text = serde_json::to_value(crate::background::robot(chassis, false)).expect("json");
        serde_json::from_value(text).expect("a description")
    }

    fn acted(firmware: &Firmware, chassis: &str, sent: &[SetPoint]) -> Vec<SetPoint> {
        let robot = robot(chassis);
        let mut running = Running::new(firmware, &robot, Noise::new(1, 2));
        sent.iter().map(|sent| running.act(*sent, 0.0)).collect()
    }

    fn wheels(wheel_rad_per_s: [f64; MAX_MOTORS]) -> SetPoint {
        SetPoint {
            wheel_rad_per_s,
            steering_rad: 0.0,
        }
    }

    #[test]
    fn each_stage_by_hand() {
        let steps = vec![wheels([3.0, -3.0, 0.0, 0.0]); 6];
        let delay = Firmware {
            delay_ticks: 2,
            ..Firmware::default()
        };
        let first: Vec<f64> = acted(
            &delay,
            "diff2",
            &[[SetPoint::default(); 2].to_vec(), steps.clone()].concat(),
        )
        .iter()
        .map(|point| point.wheel_rad_per_s[0])
        .collect();
        assert_eq!(first, [0.0, 0.0, 0.0, 0.0, 3.0, 3.0, 3.0, 3.0]);
        let slew = Firmware {
            slew_m_per_s2: 2.4,
            ..Firmware::default()
        };
        // 2.4 m/s2 at 0.05 m is 48 rad/s2, 0.1 rad/s a tick.
        let ramp = acted(&slew, "diff2", &steps);
        assert!((ramp[4].wheel_rad_per_s[0] - 0.5).abs() < 1e-12 && (ramp[4].wheel_rad_per_s[1] + 0.5).abs() < 1e-12);
        let band = Firmware {
            dead_band_rad_per_s: 3.5,
            ..Firmware::default()
        };
        assert_eq!(acted(&band, "diff2", &steps)[0], SetPoint::default());
        let lost = Firmware {
            loss_rate: 1.0,
            ..Firmware::default()
        };
        assert_eq!(acted(&lost, "diff2", &steps)[5], SetPoint::default());
    }

    #[test]
    fn each_axis_of_the_body_is_clipped_by_itself() {
        let limits = Firmware {
            body_limit: [0.5, 0.2, 1.0],
            ..Firmware::default()
        };
        // Forward 0.8 m/s and 0.5 rad/s on a track of 0.3 m: only the forward part is too fast.
        let sent = wheels([(0.8 - 0.075) / 0.05, (0.8 + 0.075) / 0.05, 0.0, 0.0]);
        let [left, right, ..] = acted(&limits, "diff2", &[sent])[0].wheel_rad_per_s;
        assert!((left - (0.5 - 0.075) / 0.05).abs() < 1e-9 && (right - (0.5 + 0.075) / 0.05).abs() < 1e-9);
        // Strafing of an omni robot: all wheels by the same share, signs of the rolling directions.
        let robot = robot("omni4");
        let strafe = |speed: f64| {
            let mut out = [0.0; MAX_MOTORS];
            for (out, wheel) in out.iter_mut().zip(&robot.wheels) {
                *out = speed * wheel.rolling_direction_rad.sin() / 0.05;
            }
            wheels(out)
        };
        let clipped = acted(&limits, "omni4", &[strafe(0.7)])[0];
        for (found, wanted) in clipped.wheel_rad_per_s.iter().zip(strafe(0.2).wheel_rad_per_s) {
            assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
        }
    }

    /// A car at 1 m/s and 1 rad/s of which both axes are clipped by half, or forward speed alone: the yaw rate stays.
    #[test]
    fn a_car_that_may_not_drive_so_fast_turns_as_fast() {
        let car = |limit: [f64; 3]| {
            let firmware = Firmware {
                body_limit: limit,
                ..Firmware::default()
            };
            let length_m = wheelbase_m(&robot("rwd"));
            let mut sent = wheels([1.0 / 0.05; MAX_MOTORS]);
            sent.steering_rad = length_m.atan();
            let acting = acted(&firmware, "rwd", &[sent])[0];
            (acting.wheel_rad_per_s[0] * 0.05, acting.steering_rad.tan() / length_m)
        };
        let (speed, curvature) = car([0.5, f64::INFINITY, 0.5]);
        assert!(
            (speed - 0.5).abs() < 1e-9 && (curvature - 1.0).abs() < 1e-9,
            "{speed} {curvature}"
        );
        let (speed, curvature) = car([0.5, f64::INFINITY, f64::INFINITY]);
        assert!(
            (speed - 0.5).abs() < 1e-9 && (curvature - 2.0).abs() < 1e-9,
            "{speed} {curvature}"
        );
    }
}
