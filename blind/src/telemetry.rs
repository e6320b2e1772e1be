//! From the truth to a run bundle: sampling, coloured noise, drop-outs and flips, through the public reader.

use crate::drive::{TICKS_A_SET_POINT, Trace};
use crate::sensing::Sensing;
use anyhow::{Result, anyhow};
use emulator::noise::Noise;
use emulator::plant::TICK_HZ;
use identify::bundle::Bundle;
use identify::diagnose::Run;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::path::Path;
use twin::robot::RobotDescription;

/// Ticks between the robot's own samples: 96 a second.
const BOARD_TICKS: u32 = 5;
/// Board samples from one of the battery's voltage to the next.
const BUS_SAMPLES: u32 = 5;
/// Variance share of the noise that has a memory, and that memory.
const COLOURED_SHARE: f64 = 0.3;
const COLOUR_S: f64 = 0.08;
/// Poses that are another tag's or turned round.
const FLIPS: f64 = 0.02;
/// Drop-outs a second, and their longest.
const DROPS_HZ: f64 = 0.15;
const LONGEST_DROP_S: f64 = 0.4;

/// White noise and noise with a memory (AR(1)) of together one standard deviation.
struct Coloured {
    state: f64,
    keep: f64,
}

impl Coloured {
    fn new(period_s: f64, noise: &mut Noise) -> Self {
        Self {
            state: noise.normal(),
            keep: (-period_s / COLOUR_S).exp(),
        }
    }

    fn next(&mut self, sigma: Option<f64>, noise: &mut Noise) -> f64 {
        self.state = self.keep * self.state + (1.0 - self.keep * self.keep).sqrt() * noise.normal();
        let white = (1.0 - COLOURED_SHARE).sqrt() * noise.normal();
        sigma.unwrap_or(0.0) * (white + COLOURED_SHARE.sqrt() * self.state)
    }
}

/// The two files of a run bundle.
pub struct Texts {
    run_json: String,
    telemetry_csv: String,
}

impl Texts {
    /// What was measured in a run.
    ///
    /// - `described`: the robot as the bundle describes it; `robot`: as it is, with the noise that its sensors have.
    /// - Errors: a description that JSON cannot hold.
    pub fn new(
        described: &RobotDescription,
        robot: &RobotDescription,
        trace: &Trace,
        sensing: &Sensing,
        seed: u64,
        reference: bool,
    ) -> Result<Texts> {
        let description = serde_json::to_string(described)?;
        let run_json = format!(
            "{{\"format\":\"robopheus.run/1\",\"robot\":{description},\"floor\":\"hall\",\"label\":\"blind\",\"started\":\"2026-01-01T00:00:00Z\",\"change_free_reference\":{reference}}}"
        );
        Ok(Texts {
            run_json,
            telemetry_csv: csv(robot, trace, sensing, seed),
        })
    }

    /// Through the public reader.
    ///
    /// - Errors: what the reader refuses.
    pub fn read(&self, path: &str) -> Result<Run> {
        let mut hash = Sha256::new();
        hash.update(self.run_json.as_bytes());
        hash.update(self.telemetry_csv.as_bytes());
        let bundle = Bundle::parse(&self.run_json, self.telemetry_csv.as_bytes());
        Ok(Run {
            path: path.to_owned(),
            sha256: hex(&hash.finalize()),
            bundle: bundle.map_err(|error| anyhow!("{path}: {error}"))?.from_start(),
        })
    }

    /// As a folder that `robopheus diagnose` takes.
    ///
    /// - Errors: the disk's.
    pub fn write(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join("run.json"), &self.run_json)?;
        std::fs::write(folder.join("telemetry.csv"), &self.telemetry_csv)?;
        Ok(())
    }
}

/// Lower-case hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn csv(description: &RobotDescription, trace: &Trace, sensing: &Sensing, seed: u64) -> String {
    let mut noise = Noise::new(seed, 3);
    let driven: Vec<usize> = (0..description.wheels.len())
        .filter(|wheel| description.wheels[*wheel].driven)
        .collect();
    let steered = description.steering.is_some();
    let mut csv = "time_s".to_owned();
    for k in &driven {
        let _ = write!(csv, ",command_wheel_{k}_rad_per_s");
    }
    if steered {
        csv.push_str(",command_steering_rad,steering_rad");
    }
    for k in &driven {
        let _ = write!(csv, ",wheel_{k}_rad_per_s,wheel_{k}_rad,current_{k}_a");
    }
    csv.push_str(",bus_v,gyro_z_rad_per_s,accel_x_m_per_s2,accel_y_m_per_s2,pose_x_m,pose_y_m,pose_yaw_rad\n");
    let mut board = Board::new(description, trace, sensing, &mut noise);
    let mut tracker = Tracker::new(description, trace, sensing, &mut noise);
    for tick in 0..trace.ticks.len() as u32 {
        let (commands, robot) = (tick % TICKS_A_SET_POINT == 0, tick % BOARD_TICKS == 0);
        if !commands && !robot {
            continue;
        }
        let time_s = f64::from(tick) / f64::from(TICK_HZ);
        let _ = write!(csv, "{time_s:.6}");
        let sent = &trace.sent[(tick / TICKS_A_SET_POINT) as usize];
        for m in 0..driven.len() {
            let _ = match commands {
                true => write!(csv, ",{:.5}", sent.wheel_rad_per_s[m]),
                false => write!(csv, ","),
            };
        }
        if steered {
            let _ = match commands {
                true => write!(csv, ",{:.5}", sent.steering_rad),
                false => write!(csv, ","),
            };
        }
        board.write(&mut csv, robot.then_some(time_s), driven.len(), steered, &mut noise);
        tracker.write(&mut csv, commands.then_some(time_s), &mut noise);
        csv.push('\n');
    }
    csv
}

/// The robot's own channels.
struct Board<'a> {
    trace: &'a Trace,
    sensing: &'a Sensing,
    sigma: twin::robot::Noise,
    colours: Vec<Coloured>,
    samples: u32,
}

impl<'a> Board<'a> {
    fn new(description: &RobotDescription, trace: &'a Trace, sensing: &'a Sensing, noise: &mut Noise) -> Self {
        let period_s = f64::from(BOARD_TICKS) / f64::from(TICK_HZ);
        Self {
            trace,
            sensing,
            sigma: description.noise.clone().unwrap_or_default(),
            colours: (0..2 * robot::MAX_MOTORS + 5)
                .map(|_| Coloured::new(period_s, noise))
                .collect(),
            samples: 0,
        }
    }

    fn write(&mut self, csv: &mut String, time_s: Option<f64>, motors: usize, steered: bool, noise: &mut Noise) {
        let Some(time_s) = time_s else {
            let empty = 3 * motors + 4 + usize::from(steered);
            csv.extend(std::iter::repeat_n(',', empty));
            return;
        };
        let values = self.sensing.values(self.trace, time_s);
        let sigma = self.sigma.clone();
        let mut colours = self.colours.iter_mut();
        let mut next = |sigma: Option<f64>| colours.next().map_or(0.0, |colour| colour.next(sigma, noise));
        let steering = values.steering_rad + next(sigma.steering_rad);
        if steered {
            let _ = write!(csv, ",{steering:.5}");
        }
        for m in 0..motors {
            let speed = values.wheel_rad_per_s[m] + next(sigma.wheel_rad_per_s);
            let current = values.current_a[m] + next(sigma.current_a);
            let _ = write!(csv, ",{speed:.4},{:.4},{current:.4}", values.wheel_rad[m]);
        }
        let bus_v = values.bus_v + next(sigma.bus_v);
        let _ = match self.samples.is_multiple_of(BUS_SAMPLES) {
            true => write!(csv, ",{bus_v:.3}"),
            false => write!(csv, ","),
        };
        self.samples += 1;
        let _ = write!(
            csv,
            ",{:.5},{:.4},{:.4}",
            values.gyro_rad_per_s + next(sigma.gyro_rad_per_s),
            values.accel_m_per_s2[0] + next(sigma.accel_m_per_s2),
            values.accel_m_per_s2[1] + next(sigma.accel_m_per_s2)
        );
    }
}

/// Poses.
struct Tracker<'a> {
    trace: &'a Trace,
    sensing: &'a Sensing,
    sigma: twin::robot::Noise,
    colours: [Coloured; 3],
    blind_until_s: f64,
}

impl<'a> Tracker<'a> {
    fn new(description: &RobotDescription, trace: &'a Trace, sensing: &'a Sensing, noise: &mut Noise) -> Self {
        let period_s = f64::from(TICKS_A_SET_POINT) / f64::from(TICK_HZ);
        Self {
            trace,
            sensing,
            sigma: description.noise.clone().unwrap_or_default(),
            colours: [0; 3].map(|_| Coloured::new(period_s, noise)),
            blind_until_s: 0.0,
        }
    }

    fn write(&mut self, csv: &mut String, time_s: Option<f64>, noise: &mut Noise) {
        let Some(time_s) = time_s else {
            csv.push_str(",,,");
            return;
        };
        let period_s = f64::from(TICKS_A_SET_POINT) / f64::from(TICK_HZ);
        if noise.uniform() < DROPS_HZ * period_s {
            self.blind_until_s = time_s + LONGEST_DROP_S * noise.uniform();
        }
        let mut pose = self.sensing.pose(self.trace, time_s);
        let sigmas = [self.sigma.pose_xy_m, self.sigma.pose_xy_m, self.sigma.pose_yaw_rad];
        for ((value, colour), sigma) in pose.iter_mut().zip(&mut self.colours).zip(sigmas) {
            *value += colour.next(sigma, noise);
        }
        if noise.uniform() < FLIPS {
            if noise.uniform() < 0.5 {
                pose[2] += std::f64::consts::PI;
            } else {
                pose[0] += 0.4 * noise.normal();
                pose[1] += 0.4 * noise.normal();
            }
        }
        if time_s < self.blind_until_s {
            csv.push_str(",,,");
        } else {
            let yaw = twin::pose::wrapped_rad(pose[2]);
            let _ = write!(csv, ",{:.5},{:.5},{yaw:.5}", pose[0], pose[1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coloured_noise_has_its_size_and_its_memory() {
        let mut noise = Noise::new(3, 4);
        let mut colour = Coloured::new(0.01, &mut noise);
        let values: Vec<f64> = (0..60_000).map(|_| colour.next(Some(2.0), &mut noise)).collect();
        let mean = |f: &dyn Fn(usize) -> f64| (0..59_000).map(f).sum::<f64>() / 59_000.0;
        let variance = mean(&|k| values[k] * values[k]);
        assert!((variance - 4.0).abs() < 0.15, "{variance}");
        // 30 % of the variance, e^(-0.01 / 0.08) a step.
        let lagged = mean(&|k| values[k] * values[k + 8]) / variance;
        assert!((lagged - 0.3 * (-1.0f64).exp()).abs() < 0.02, "{lagged}");
    }
}
