//! How much two runs with the same commands differ: the plant driven again by what it was told.

use super::course::{Course, Setting};
use super::drive::{Driven, plant_settings};
use crate::Rig;
use anyhow::{Result, anyhow};
use control::law::{Demand, Law, Observation};
use emulator::hidden::Hidden;
use lab::record::Record;
use twin::twist::BodyTwist;

/// Windows, as in the gap of a model.
const WINDOW_TICKS: usize = 240;

/// Says what was sent before, whatever it sees.
#[derive(Debug)]
struct Again {
    twists: Vec<BodyTwist>,
}

impl Law for Again {
    fn name(&self) -> &'static str {
        "again"
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        let twist = self.twists.get(observation.tick as usize).copied();
        if let Some(demand) = demands.first_mut() {
            demand.twist = twist.unwrap_or_default();
            demand.finished = twist.is_none();
        }
    }
}

/// True poses of a run with the commands of another one.
///
/// - `seed`: of the plant's variation; another one than that of `driven`.
pub fn again(
    chassis: &str,
    course: Course,
    setting: &Setting,
    hidden: &Hidden,
    seed: u64,
    driven: &Driven,
) -> Result<Vec<[f64; 3]>> {
    let twists = driven.records.iter().filter_map(|record| match record {
        Record::Command(command) if command.target_m.is_some() => Some(BodyTwist {
            forward_m_per_s: command.twist[0],
            left_m_per_s: command.twist[1],
            yaw_rate_rad_per_s: command.twist[2],
        }),
        _ => None,
    });
    let law = Again {
        twists: twists.collect(),
    };
    let ticks = law.twists.len();
    let scene = course.scene(chassis, setting)?;
    let mut settings = plant_settings(hidden, seed);
    settings.looks_ahead = false;
    settings.learns = false;
    let mut rig = Rig::with_law(&scene, &settings, Box::new(law))?;
    rig.keep_records = false;
    let mut poses = Vec::with_capacity(ticks);
    for _ in 0..ticks {
        poses.push(*rig.poses().first().ok_or_else(|| anyhow!("no robot"))?);
        if !rig.tick() {
            break;
        }
    }
    Ok(poses)
}

/// RMS distance between the places to which two runs come from a common pose within 2 s, m.
pub fn apart_m(one: &[[f64; 3]], other: &[[f64; 3]]) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    let ticks = one.len().min(other.len());
    for from in (0..ticks.saturating_sub(WINDOW_TICKS)).step_by(WINDOW_TICKS) {
        let way = |poses: &[[f64; 3]]| -> Option<[f64; 2]> {
            let (a, b) = (poses.get(from)?, poses.get(from + WINDOW_TICKS)?);
            let (sin, cos) = a[2].sin_cos();
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            Some([cos * dx + sin * dy, cos * dy - sin * dx])
        };
        if let (Some(a), Some(b)) = (way(one), way(other)) {
            squares += (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
            count += 1.0;
        }
    }
    (squares / f64::max(count, 1.0)).sqrt()
}
