//! How much knobs vary from run to run and from day to day.

use twin::robot::RobotDescription;

use super::Floor;
use crate::hypothesis::Knob;
use crate::linear::Square;

/// From run to run and from day to day, in practical sizes: stated prior, worth this many references.
const VARIATION_SIGMA: f64 = 0.12;
pub(super) const VARIATION_RUNS: f64 = 3.0;
/// The same of what does not change by itself: what a few references seem to say of it is errors of the laws.
const RIGID_RUNS: f64 = 20.0;
/// The same for friction, as a share of the described one, and the least in practical sizes.
const FRICTION_VARIATION: f64 = 0.1;
const LEAST_VARIATION: f64 = 0.01;
/// The same for what is bolted, built in or programmed: no rigid body changes between two runs by more than a little warmth and wear, and no firmware's timing
/// by itself. Clocks do.
const RIGID_VARIATION: f64 = 0.03;
const RIGID: [&str; 17] = [
    "command_delay",
    "motor_lag",
    "steering_lag",
    "localization_latency",
    "wheel_radius",
    "wheel_radius_one",
    "track_width",
    "wheel_misalignment",
    "marker_offset",
    "imu_yaw",
    "gyro_scale",
    "pose_scale",
    "steering_offset",
    "steering_scale",
    "steering_backlash",
    "camera_seam",
    "tag_height",
];
/// The same for battery and temperature, in knobs.
const WEATHER_SIGMA: f64 = 1.0;
const EXPECTATION_STEPS: usize = 12;

/// Variance of a knob from run to run before any reference. Friction of a drive varies with what there is of it, and its practical size is many
/// times that on a robot that runs freely.
pub(super) fn prior_variation(knob: &Knob, robot: &RobotDescription) -> f64 {
    let of_friction = |nominal: Option<f64>, practical: f64| {
        let share = FRICTION_VARIATION * nominal.unwrap_or(0.0) / practical;
        share.clamp(LEAST_VARIATION, VARIATION_SIGMA)
    };
    let motor = robot.motor.as_ref();
    match knob {
        Knob::Parameter { name, practical, .. } => {
            let sigma = match *name {
                "coulomb_friction" => of_friction(motor.map(|motor| motor.coulomb_n_m), *practical),
                "viscous_friction" => of_friction(motor.map(|motor| motor.viscous_n_m_s), *practical),
                rigid if RIGID.contains(&rigid) => RIGID_VARIATION,
                _ => VARIATION_SIGMA,
            };
            sigma * sigma
        }
        Knob::Supply(_) | Knob::Resistance(_) => WEATHER_SIGMA * WEATHER_SIGMA,
        Knob::Tread(_) | Knob::SteeringFilter(_) | Knob::AccelerometerLag(_) => RIGID_VARIATION * RIGID_VARIATION,
    }
}

/// True of what no day changes by itself.
fn is_rigid(knob: &Knob) -> bool {
    match knob {
        Knob::Parameter { name, .. } => RIGID.contains(name),
        other => other.is_untold(),
    }
}

/// References that the stated variation of a knob is worth.
fn prior_runs(knob: &Knob) -> f64 {
    if is_rigid(knob) { RIGID_RUNS } else { VARIATION_RUNS }
}

impl Floor {
    /// Variances from run to run by expectation and maximisation, with the stated prior as further runs.
    pub(super) fn estimate_variation(&mut self) {
        let count = self.knobs.len();
        let moments: Vec<(Square, Vec<f64>)> = (0..self.references.len()).map(|r| self.moments(r)).collect();
        for _ in 0..EXPECTATION_STEPS {
            let mut sums: Vec<f64> = self
                .knobs
                .iter()
                .map(|knob| prior_runs(knob) * prior_variation(knob, &self.given.description))
                .collect();
            for (gram, score) in &moments {
                let mut inner = gram.clone();
                for (k, variance) in self.variation.iter().enumerate() {
                    inner.add(k, k, 1.0 / variance.max(1e-12));
                }
                let covariance = inner.cholesky().inverse();
                for (k, sum) in sums.iter_mut().enumerate() {
                    let mean: f64 = (0..count).map(|j| covariance.at(k, j) * score[j]).sum();
                    *sum += mean * mean + covariance.at(k, k);
                }
            }
            let runs = moments.len() as f64;
            let knobs = sums.into_iter().zip(&self.knobs);
            self.variation = knobs.map(|(sum, knob)| sum / (runs + prior_runs(knob))).collect();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twin::effect::library::find;

    #[test]
    fn rigid_parts_vary_least() {
        let robot = twin::golden::reference_robot("diff2");
        let of = |name: &'static str| {
            let knob = Knob::Parameter {
                name,
                index: None,
                parameter: "",
                neutral: 0.0,
                practical: 1.0,
                low: -1.0,
                high: 1.0,
            };
            prior_variation(&knob, &robot).sqrt()
        };
        for name in RIGID {
            assert!(find(name).is_some(), "{name} is no effect");
            assert!(of(name) < 0.3 * of("payload"), "{name}");
        }
    }
}
