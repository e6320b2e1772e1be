//! Experiment A's settings: the best of a published grid on the nominal twin, before any plant is driven.

use super::course::{Course, Setting};
use super::drive::{BAND_M, on_twin};
use crate::attack::CHASSIS;
use crate::fan::{fan, progress};
use anyhow::{Context, Result};
use std::collections::BTreeMap;

/// The committed choice: `robopheus-drills abc --settings` writes it.
pub const COMMITTED: &str = include_str!("settings.json");

/// The grid.
const SPEEDS_M_PER_S: [f64; 3] = [0.7, 0.55, 0.4];
const DISTANCE_GAINS_PER_S: [f64; 2] = [1.5, 3.0];
const INTEGRAL_GAINS_PER_S2: [f64; 2] = [0.0, 0.4];
const DERIVATIVE_GAINS: [f64; 2] = [0.0, 0.2];
const YAW_GAINS_PER_S: [f64; 2] = [3.0, 5.0];
/// Robots that can turn may start across their path.
const START_YAWS_RAD: [f64; 2] = [0.0, -std::f64::consts::FRAC_PI_4];
/// Room that the twin must leave in the band.
const SHARE_OF_BAND: f64 = 0.5;

/// Every setting of the grid at a speed.
pub fn grid(steered: bool, speed_m_per_s: f64) -> Vec<Setting> {
    let mut settings = Vec::new();
    for distance_gain_per_s in DISTANCE_GAINS_PER_S {
        for integral_gain_per_s2 in INTEGRAL_GAINS_PER_S2 {
            for derivative_gain in DERIVATIVE_GAINS {
                for yaw_gain_per_s in YAW_GAINS_PER_S {
                    let starts = if steered {
                        &START_YAWS_RAD[..1]
                    } else {
                        &START_YAWS_RAD[..]
                    };
                    settings.extend(starts.iter().map(|start_yaw_rad| Setting {
                        speed_m_per_s,
                        distance_gain_per_s,
                        integral_gain_per_s2,
                        derivative_gain,
                        yaw_gain_per_s,
                        start_yaw_rad: *start_yaw_rad,
                    }));
                }
            }
        }
    }
    settings
}

/// Car-like.
pub fn is_steered(chassis: &str) -> bool {
    ["fwd", "rwd", "awd"].contains(&chassis)
}

/// Of the fastest speed at which the nominal twin stays inside half of the band, the setting with the least RMS error.
pub fn best_on_twin(chassis: &str, threads: usize) -> Result<Setting> {
    for speed_m_per_s in SPEEDS_M_PER_S {
        let settings = grid(is_steered(chassis), speed_m_per_s);
        let count = settings.len() as u64;
        let one = |k: u64| on_twin(chassis, Course::L, settings.get(k as usize).context("a setting")?);
        let figures = fan(count, threads, one, progress("settings", 1000, count))?;
        let inside = settings.iter().zip(&figures);
        let inside = inside.filter(|(_, figures)| figures.finished && figures.largest_m <= SHARE_OF_BAND * BAND_M);
        let best = inside.min_by(|a, b| a.1.rms_m.total_cmp(&b.1.rms_m));
        if let Some((setting, _)) = best {
            return Ok(*setting);
        }
    }
    anyhow::bail!("{chassis}: no setting of the grid stays inside half of the band on the twin")
}

/// By chassis.
pub fn all(threads: usize) -> Result<BTreeMap<String, Setting>> {
    let each = CHASSIS
        .iter()
        .map(|chassis| Ok(((*chassis).to_owned(), best_on_twin(chassis, threads)?)));
    each.collect()
}

/// The committed ones.
pub fn committed() -> Result<BTreeMap<String, Setting>> {
    serde_json::from_str(COMMITTED).context("drills/src/abc/settings.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_committed_settings_are_the_best_of_the_grid_on_the_nominal_twin() {
        assert_eq!(all(2).expect("settings"), committed().expect("settings"));
    }
}
