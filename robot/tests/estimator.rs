//! The estimator against closed forms, against a dense filter with numeric derivatives, and for consistency.
#![allow(clippy::disallowed_methods, reason = "an oracle may use the platform's functions")]

mod kit;

use kit::Random;
use robot::estimator::{Estimate, Estimator, EstimatorSettings, FixOutcome, Magnetometer, Measurement, PoseFix};
use robot::kinematics::Twist;

const STEP_S: f64 = 1.0 / 480.0;

fn exact() -> EstimatorSettings {
    EstimatorSettings::default()
}

fn fix_at(x_m: f64, y_m: f64, yaw_rad: f64, age_ms: f64) -> PoseFix {
    PoseFix {
        x_m,
        y_m,
        yaw_rad,
        position_sd_m: 0.001,
        yaw_sd_rad: 0.003,
        age_ms,
    }
}

/// What a robot on a circle of speed `u` and yaw rate `r` measures, without noise.
fn on_circle(u: f64, r: f64, bias: f64) -> Measurement {
    Measurement {
        gyro_z_rad_per_s: r + bias,
        accel_m_per_s2: [0.0, u * r],
        wheel_twist: Twist {
            forward_m_per_s: u,
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: r,
        },
        sees_sideways: true,
        standing: false,
        magnetic_field_t: None,
    }
}

fn standing(bias: f64) -> Measurement {
    Measurement {
        standing: true,
        ..on_circle(0.0, 0.0, bias)
    }
}

#[test]
fn a_standing_robot_learns_its_bias_as_a_mean_would() {
    // One scalar measured n times: bias sd = gyro sd / sqrt(n), from a prior of 0.02.
    let (bias, n) = (0.0123, 960);
    let mut estimator = Estimator::new(exact());
    let mut random = Random(5);
    let mut sum = 0.0;
    for _ in 0..n {
        let sample = bias + 0.006 * random.normal();
        sum += sample;
        estimator.step(&Measurement {
            gyro_z_rad_per_s: sample,
            ..standing(0.0)
        });
    }
    let estimate = estimator.estimate();
    let (prior, sample) = (1.0 / (0.02f64 * 0.02), f64::from(n) / (0.006 * 0.006));
    let by_hand = (sum / f64::from(n)) * sample / (prior + sample);
    println!("bias {} by the filter, {by_hand} by hand", estimate.gyro_bias_rad_per_s);
    // The walk of the bias makes the filter forget by a few parts in a thousand.
    assert!((estimate.gyro_bias_rad_per_s - by_hand).abs() < 2e-5);
    assert!((estimate.gyro_bias_rad_per_s - bias).abs() < 3.0 * 0.006 / f64::from(n).sqrt());
}

#[test]
fn dead_reckoning_follows_a_circle_in_closed_form() {
    let (u, r, bias) = (0.5, 0.8, 0.01);
    let mut estimator = Estimator::new(exact());
    for _ in 0..960 {
        estimator.step(&standing(bias));
    }
    assert_eq!(estimator.fix(&fix_at(1.0, -0.5, 0.3, 0.0)), FixOutcome::Anchored);
    // The wheels start at once; the velocity of the filter needs a moment, so the clock starts when it is there.
    for _ in 0..960 {
        estimator.step(&on_circle(u, r, bias));
    }
    let start = estimator.estimate();
    for _ in 0..4800 {
        estimator.step(&on_circle(u, r, bias));
    }
    let end = estimator.estimate();
    let angle = start.yaw_rad + r * 10.0;
    let x_m = start.x_m + u / r * (angle.sin() - start.yaw_rad.sin());
    let y_m = start.y_m - u / r * (angle.cos() - start.yaw_rad.cos());
    let error_m = (end.x_m - x_m).hypot(end.y_m - y_m);
    println!(
        "5 m on a circle: {error_m} m off the closed form, said sd {}",
        end.position_sd_m
    );
    assert!(error_m < 5e-3, "{error_m}");
    assert!((end.twist.forward_m_per_s - u).abs() < 1e-3 && end.twist.left_m_per_s.abs() < 1e-3);
    assert!(end.position_sd_m > 0.02 && end.position_sd_m < 0.2);
}

#[test]
fn a_late_fix_corrects_as_if_it_had_come_in_time() {
    let run = |age_steps: usize| -> Estimate {
        let mut estimator = Estimator::new(exact());
        estimator.step(&standing(0.0));
        estimator.fix(&fix_at(0.0, 0.0, 0.0, 0.0));
        for _ in 0..960 {
            estimator.step(&on_circle(0.5, 0.0, 0.0));
        }
        let seen = estimator.estimate();
        for _ in 0..age_steps {
            estimator.step(&on_circle(0.5, 0.0, 0.0));
        }
        // 8 mm off to the left of where the filter was at the exposure.
        let age_ms = 1000.0 * age_steps as f64 * STEP_S;
        let outcome = estimator.fix(&fix_at(seen.x_m, seen.y_m + 0.008, seen.yaw_rad, age_ms));
        assert_eq!(outcome, FixOutcome::Used);
        for _ in age_steps..48 {
            estimator.step(&on_circle(0.5, 0.0, 0.0));
        }
        estimator.estimate()
    };
    let (prompt, late) = (run(0), run(48));
    println!("prompt {prompt:?}\nlate   {late:?}");
    assert!(prompt.y_m > 0.006, "the fix counts");
    assert!((prompt.x_m - late.x_m).abs() < 2e-4 && (prompt.y_m - late.y_m).abs() < 5e-4);
}

#[test]
fn wild_fixes_are_left_out_until_they_insist() {
    let mut estimator = Estimator::new(exact());
    for _ in 0..10 {
        estimator.step(&standing(0.0));
    }
    estimator.fix(&fix_at(0.0, 0.0, 0.0, 0.0));
    estimator.step(&standing(0.0));
    for _ in 0..12 {
        assert_eq!(estimator.fix(&fix_at(1.0, 0.0, 0.0, 0.0)), FixOutcome::Outlier);
    }
    assert!(estimator.estimate().x_m.abs() < 1e-6);
    assert_eq!(estimator.fix(&fix_at(1.0, 0.0, 0.0, 0.0)), FixOutcome::Anchored);
    assert!((estimator.estimate().x_m - 1.0).abs() < 1e-9);
    assert_eq!(estimator.fix(&fix_at(f64::NAN, 0.0, 0.0, 0.0)), FixOutcome::Unusable);
    assert_eq!(estimator.fix(&fix_at(1.0, 0.0, 0.0, 5000.0)), FixOutcome::Unusable);
}

#[test]
fn a_magnetometer_holds_the_yaw_and_a_disturbed_one_is_left_out() {
    let north_rad: f64 = 0.7;
    let settings = EstimatorSettings {
        magnetometer: Some(Magnetometer {
            north_rad,
            field_t: 2e-5,
            heading_rad: 0.05,
            correlation_s: 0.5,
        }),
        ..exact()
    };
    let yaw_rad: f64 = -2.0;
    let field = |scale: f64| {
        let angle = north_rad - yaw_rad;
        Some([2e-5 * scale * angle.cos(), 2e-5 * scale * angle.sin()])
    };
    let run = |scale: f64| {
        let mut estimator = Estimator::new(settings);
        for k in 0..48_000 {
            // A bias that nobody has told: yaw would run away by 0.5 rad in 100 s.
            estimator.step(&Measurement {
                magnetic_field_t: if k == 0 { field(1.0) } else { field(scale) },
                ..on_circle(0.0, 0.0, 0.005)
            });
        }
        estimator.estimate()
    };
    let (held, disturbed) = (run(1.0), run(1.6));
    println!("held {held:?}\ndisturbed {disturbed:?}");
    assert!((held.yaw_rad - yaw_rad).abs() < 0.02 && (held.gyro_bias_rad_per_s - 0.005).abs() < 1e-3);
    assert!((disturbed.yaw_rad - yaw_rad - 0.5).abs() < 0.02);
}

/// The same filter written densely: numeric derivatives, general matrices, no shortcuts.
struct Dense {
    s: Vec<f64>,
    p: Vec<Vec<f64>>,
}

impl Dense {
    fn new(from: &Estimator) -> Self {
        let (s, p) = from.state();
        Self {
            s: s.to_vec(),
            p: p.iter().map(|row| row.to_vec()).collect(),
        }
    }

    fn moved(s: &[f64], m: &Measurement) -> Vec<f64> {
        let r = m.gyro_z_rad_per_s - s[3];
        let q = s[2] + 0.5 * r * STEP_S;
        vec![
            s[0] + (s[4] * q.cos() - s[5] * q.sin()) * STEP_S,
            s[1] + (s[4] * q.sin() + s[5] * q.cos()) * STEP_S,
            s[2] + r * STEP_S,
            s[3],
            s[4] + (m.accel_m_per_s2[0] + r * s[5]) * STEP_S,
            s[5] + (m.accel_m_per_s2[1] - r * s[4]) * STEP_S,
        ]
    }

    fn step(&mut self, m: &Measurement) {
        let set = EstimatorSettings::default();
        let mut f = vec![vec![0.0; 6]; 6];
        for j in 0..6 {
            let (mut more, mut less) = (self.s.clone(), self.s.clone());
            more[j] += 1e-5;
            less[j] -= 1e-5;
            let (more, less) = (Self::moved(&more, m), Self::moved(&less, m));
            for i in 0..6 {
                f[i][j] = (more[i] - less[i]) / 2e-5;
            }
        }
        let r = m.gyro_z_rad_per_s - self.s[3];
        let speed = self.s[4].hypot(self.s[5]);
        self.s = Self::moved(&self.s, m);
        let mut p = vec![vec![0.0; 6]; 6];
        for i in 0..6 {
            for j in 0..6 {
                for k in 0..6 {
                    for l in 0..6 {
                        p[i][j] += f[i][k] * self.p[k][l] * f[j][l];
                    }
                }
            }
        }
        let way = set.odometry_walk_m.powi(2) * speed * STEP_S;
        let walk = set.accel_walk_m_per_s.powi(2) * STEP_S;
        let noise = [
            way,
            way,
            (set.gyro_rad_per_s * STEP_S).powi(2),
            set.bias_walk_rad_per_s.powi(2) * STEP_S,
            walk,
            walk,
        ];
        for i in 0..6 {
            p[i][i] += noise[i];
        }
        self.p = p;
        let slips = (m.wheel_twist.yaw_rate_rad_per_s - r).abs() > 0.3;
        let sd = set.wheel_velocity_m_per_s * if slips { 10.0 } else { 1.0 };
        let variance = sd * sd * set.wheel_correlation_s / STEP_S;
        self.take(4, m.wheel_twist.forward_m_per_s, variance);
        self.take(5, m.wheel_twist.left_m_per_s, variance);
    }

    /// Joseph's form, which stays symmetric and positive by itself.
    fn take(&mut self, i: usize, z: f64, variance: f64) {
        let gain: Vec<f64> = (0..6).map(|k| self.p[k][i] / (self.p[i][i] + variance)).collect();
        let innovation = z - self.s[i];
        let a = |j: usize, k: usize| f64::from(u8::from(j == k)) - if k == i { gain[j] } else { 0.0 };
        let mut p = vec![vec![0.0; 6]; 6];
        for j in 0..6 {
            self.s[j] += gain[j] * innovation;
            for k in 0..6 {
                for l in 0..6 {
                    for n in 0..6 {
                        p[j][k] += a(j, l) * self.p[l][n] * a(k, n);
                    }
                }
                p[j][k] += gain[j] * variance * gain[k];
            }
        }
        self.p = p;
    }
}

#[test]
fn the_filter_equals_a_dense_one_with_numeric_derivatives() {
    let mut estimator = Estimator::new(exact());
    estimator.step(&standing(0.0));
    estimator.fix(&fix_at(0.3, -0.2, 1.0, 0.0));
    let mut dense = Dense::new(&estimator);
    let mut random = Random(11);
    let (mut state_gap, mut covariance_gap): (f64, f64) = (0.0, 0.0);
    for k in 0..4800 {
        let t = f64::from(k) * STEP_S;
        let mut m = on_circle(0.6 * (0.7 * t).sin(), 1.1 * (0.4 * t).cos(), 0.004);
        m.gyro_z_rad_per_s += 0.006 * random.normal();
        m.accel_m_per_s2[0] += 0.05 * random.normal();
        m.wheel_twist.left_m_per_s = 0.2 * (0.9 * t).sin();
        estimator.step(&m);
        dense.step(&m);
        let (s, p) = estimator.state();
        for i in 0..6 {
            state_gap = state_gap.max((s[i] - dense.s[i]).abs());
            for j in 0..6 {
                let scale = (p[i][i] * p[j][j]).sqrt();
                covariance_gap = covariance_gap.max((p[i][j] - dense.p[i][j]).abs() / scale);
            }
        }
    }
    println!("after 10 s: states differ by {state_gap}, covariances by {covariance_gap} of their size");
    assert!(
        state_gap < 1e-8 && covariance_gap < 1e-6,
        "{state_gap} {covariance_gap}"
    );
}

#[test]
fn the_said_deviation_covers_the_error() {
    // 200 robots drive for 5 s with noisy sensors and a fix a second; the normalised squared error of a position has mean 2.
    let (mut worst_share, mut sum, mut count, mut outside) = (0.0f64, 0.0, 0, 0);
    for seed in 1..=200 {
        let mut random = Random(seed * 7919);
        let mut estimator = Estimator::new(exact());
        let bias = 0.005 * random.normal();
        let (mut x, mut y, mut yaw) = (0.0f64, 0.0f64, 0.0f64);
        // An error of the wheel radii stays for the whole run.
        let wheel_scale = 1.0 + 0.01 * random.normal();
        for k in 0..480 {
            let mut m = standing(bias);
            m.gyro_z_rad_per_s += 0.006 * random.normal();
            estimator.step(&m);
            if k == 479 {
                estimator.fix(&fix_at(
                    0.001 * random.normal(),
                    0.001 * random.normal(),
                    0.003 * random.normal(),
                    0.0,
                ));
            }
        }
        for k in 1..=2400 {
            let t = f64::from(k) * STEP_S;
            let ramp = (2.0 * t).min(1.0);
            let (u, r) = (0.5 * ramp, 0.9 * (0.8 * t).sin());
            let mut m = on_circle(u, r, bias);
            m.accel_m_per_s2[0] = if ramp < 1.0 { 1.0 } else { 0.0 };
            m.wheel_twist.forward_m_per_s *= wheel_scale;
            m.gyro_z_rad_per_s += 0.006 * random.normal();
            for a in &mut m.accel_m_per_s2 {
                *a += 0.05 * random.normal();
            }
            let q = yaw + 0.5 * r * STEP_S;
            x += u * q.cos() * STEP_S;
            y += u * q.sin() * STEP_S;
            yaw += r * STEP_S;
            estimator.step(&m);
            if k % 480 == 0 {
                let (s, p) = estimator.state();
                let (ex, ey) = (s[0] - x, s[1] - y);
                let determinant = p[0][0] * p[1][1] - p[0][1] * p[0][1];
                let squared = (p[1][1] * ex * ex - 2.0 * p[0][1] * ex * ey + p[0][0] * ey * ey) / determinant;
                let said = estimator.estimate();
                worst_share = worst_share.max(ex.hypot(ey) / said.position_sd_m);
                outside += u32::from(ex.hypot(ey) > 3.0 * said.position_sd_m);
                sum += squared;
                count += 1;
                estimator.fix(&fix_at(
                    x + 0.001 * random.normal(),
                    y + 0.001 * random.normal(),
                    yaw + 0.003 * random.normal(),
                    0.0,
                ));
            }
        }
    }
    let mean = sum / f64::from(count);
    println!("{count} checks: mean squared normalised error {mean}, worst error {worst_share} of the said deviation");
    // Safe rather than sharp: never much too sure, and not ten times too modest.
    assert!(mean < 2.0 && mean > 0.02, "{mean}");
    assert_eq!(outside, 0);
}
