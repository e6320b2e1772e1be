//! One run of the plant: set-points in, the truth at every tick out.

use crate::change::Change;
use crate::firmware::{Running, SetPoint};
use crate::sensing::Values;
use anyhow::{Result, anyhow};
use api::robot::RobotDescription;
use emulator::hidden::RunVariation;
use emulator::noise::Noise;
use emulator::plant::body::{Body, Drive, Ground};
use emulator::plant::contents::PlantContents;
use emulator::plant::{Pose, SUBSTEPS, Step, TICK_HZ};
use robot::MAX_MOTORS;

/// Ticks of the plant's firmware from one set-point to the next: 120 a second.
pub const TICKS_A_SET_POINT: u32 = 4;
pub const SET_POINTS_HZ: u32 = TICK_HZ / TICKS_A_SET_POINT;

/// The truth at every tick and the set-points as sent.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    pub ticks: Vec<Values>,
    pub sent: Vec<SetPoint>,
}

impl Trace {
    pub fn duration_s(&self) -> f64 {
        self.sent.len() as f64 / f64::from(SET_POINTS_HZ)
    }

    /// Linear between two ticks; the ends hold.
    pub fn at(&self, time_s: f64) -> Values {
        let position = (time_s * f64::from(TICK_HZ)).clamp(0.0, (self.ticks.len() - 1) as f64);
        let (index, part) = (position as usize, position.fract());
        let a = &self.ticks[index];
        let Some(b) = self.ticks.get(index + 1).filter(|_| part > 0.0) else {
            return *a;
        };
        let mix = |from: f64, to: f64| from + part * (to - from);
        let mut out = *a;
        for (to, end) in out.pose.iter_mut().zip(b.pose) {
            *to = mix(*to, end);
        }
        for m in 0..MAX_MOTORS {
            out.wheel_rad_per_s[m] = mix(a.wheel_rad_per_s[m], b.wheel_rad_per_s[m]);
            out.wheel_rad[m] = mix(a.wheel_rad[m], b.wheel_rad[m]);
            out.current_a[m] = mix(a.current_a[m], b.current_a[m]);
        }
        out.gyro_rad_per_s = mix(a.gyro_rad_per_s, b.gyro_rad_per_s);
        out.accel_m_per_s2 = [0, 1].map(|axis| mix(a.accel_m_per_s2[axis], b.accel_m_per_s2[axis]));
        out.velocity_m_per_s = [0, 1].map(|axis| mix(a.velocity_m_per_s[axis], b.velocity_m_per_s[axis]));
        out.bus_v = mix(a.bus_v, b.bus_v);
        out.steering_rad = mix(a.steering_rad, b.steering_rad);
        out
    }
}

/// What a run starts with.
#[derive(Debug, Clone, Copy)]
pub struct RunStart {
    /// Draws the variation of the run, its losses and its noise.
    pub seed: u64,
    pub pose: Pose,
    pub seconds: u32,
}

/// Everyday differences from run to run, one standard deviation each.
const VARIATION: RunVariation = RunVariation {
    friction: 0.02,
    mass: 0.003,
    torque_constant: 0.004,
    battery_charge: 0.08,
};

/// Bumper; nothing stands around here.
const RADIUS_M: f64 = 0.25;
/// Share of a new sample in the accelerometer's filter, a tick.
const ACCEL_FILTER: f64 = 0.3;

/// Drives a robot.
///
/// - `commander`: the set-point of a number, from the pose at that time.
/// - Errors: a description that the plant cannot be.
pub fn drive(
    description: &RobotDescription,
    change: &Change,
    start: &RunStart,
    commander: &mut dyn FnMut(usize, Pose) -> SetPoint,
) -> Result<Trace> {
    let mut noise = Noise::new(start.seed, 1);
    let mut body =
        Body::new(description, RADIUS_M, &change.hidden, &VARIATION, &mut noise).map_err(|error| anyhow!("{error}"))?;
    body.place(start.pose);
    let mut running = Running::new(&change.firmware, description, Noise::new(start.seed, 2));
    let contents = PlantContents::default();
    let ground = Ground {
        floor: &change.floor,
        contents: &contents,
    };
    let step = Step {
        dt_s: 1.0 / f64::from(TICK_HZ * SUBSTEPS),
    };
    let mut trace = Trace::default();
    let (mut accel, mut sent) = ([0.0; 2], SetPoint::default());
    for tick in 0..start.seconds * TICK_HZ {
        let time_s = f64::from(tick) / f64::from(TICK_HZ);
        if tick % TICKS_A_SET_POINT == 0 {
            sent = commander((tick / TICKS_A_SET_POINT) as usize, body.pose());
            trace.sent.push(sent);
        }
        let values = values(&body, change, accel);
        trace.ticks.push(values);
        let acting = running.act(sent, body.velocity_m_per_s()[0].hypot(body.velocity_m_per_s()[1]));
        let count = body.driven_wheels().count();
        let voltage = running.voltages(&acting, &values.wheel_rad_per_s[..count], values.bus_v);
        let command = Drive {
            motor_v: Some(voltage),
            steering_rad: acting.steering_rad,
            stuck_wheel: None,
        };
        body.battery.nominal_v -= change.droop_v_per_s / f64::from(TICK_HZ);
        let push = change.forces.push(&body, time_s);
        for _ in 0..SUBSTEPS {
            body.step(&command, &ground, &push, step);
        }
        let force = body.specific_force_m_per_s2();
        for axis in 0..2 {
            accel[axis] += ACCEL_FILTER * (force[axis] - accel[axis]);
        }
    }
    Ok(trace)
}

fn values(body: &Body, change: &Change, accel: [f64; 2]) -> Values {
    let pose = body.pose();
    let mut out = Values {
        pose: [pose.x_m, pose.y_m, pose.yaw_rad],
        velocity_m_per_s: body.velocity_m_per_s(),
        gyro_rad_per_s: body.yaw_rate_rad_per_s(),
        accel_m_per_s2: accel,
        bus_v: body.battery.bus_v(),
        steering_rad: body.servo_rad(),
        ..Values::default()
    };
    for (m, wheel) in body.driven_wheels().enumerate() {
        let scale = change.firmware.encoder_scale[m];
        out.wheel_rad_per_s[m] = scale * wheel.motor.speed_rad_per_s;
        out.wheel_rad[m] = scale * wheel.motor.angle_rad;
        out.current_a[m] = wheel.motor.current_a;
    }
    out
}
