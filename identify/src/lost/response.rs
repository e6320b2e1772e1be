//! How wheels answer to their set-points.

use twin::replay::{CommandRow, ReplayRow, replay_after};
use twin::robot::Robot;

use crate::record::{CELL_S, Quantity, Record, Window};

/// Rate of the table, Hz, and its length, s.
const RATE_HZ: f64 = 480.0;
const LENGTH_S: f64 = 0.8;
/// Step of all set-points, rad/s, and when it comes in a window's comparison, s.
const STEP_RAD_PER_S: f64 = 0.5;
const AT_S: f64 = 0.3;

/// Change of a wheel's speed per rad/s of a step of the set-points, as cells show it.
#[derive(Debug, Clone)]
pub struct StepResponse {
    /// From one cell before the step on.
    values: Vec<f64>,
}

impl StepResponse {
    /// Of the twin, where the wheels of a run are driven most evenly.
    pub fn of(record: &Record, robot: &Robot) -> Option<StepResponse> {
        let long = record
            .windows
            .iter()
            .filter(|window| window.to_s - window.from_s > AT_S + LENGTH_S + CELL_S);
        let calmest = long.min_by(|a, b| unrest(a).total_cmp(&unrest(b)))?;
        let chain = &calmest.drive;
        let wheels: Vec<usize> = (0..robot.description().wheels.len())
            .filter(|wheel| robot.description().wheels[*wheel].driven)
            .collect();
        let at_s = calmest.from_s + AT_S;
        let states = |step: f64| -> Option<Vec<ReplayRow>> {
            let mut held = chain.held;
            let rows: Vec<CommandRow> = chain
                .rows
                .iter()
                .map(|row| {
                    held.apply(robot, row);
                    let command = held.command();
                    let mut told = CommandRow {
                        time_s: row.time_s,
                        steering_rad: Some(command.steering_rad),
                        ..CommandRow::default()
                    };
                    let own = if row.time_s >= at_s { step } else { 0.0 };
                    for wheel in &wheels {
                        told.wheel_rad_per_s[*wheel] = Some(command.wheel_rad_per_s[*wheel] + own);
                    }
                    told
                })
                .collect();
            let before = if chain.earlier.is_empty() {
                chain.held
            } else {
                chain.before
            };
            replay_after(robot, &calmest.start, before, &chain.earlier, &rows).ok()
        };
        let (base, stepped) = (states(0.0)?, states(STEP_RAD_PER_S)?);
        // The step is in force from the first row at or after its time.
        let first_s = base.iter().map(|row| row.time_s).find(|time_s| *time_s >= at_s)?;
        let answers: Vec<(f64, f64)> = base
            .iter()
            .zip(&stepped)
            .map(|(a, b)| {
                let change = |wheel: &usize| b.state.wheel_rad_per_s[*wheel] - a.state.wheel_rad_per_s[*wheel];
                let mean = wheels.iter().map(change).sum::<f64>() / wheels.len().max(1) as f64;
                (a.time_s - first_s, mean / STEP_RAD_PER_S)
            })
            .collect();
        let raw = |time_s: f64| -> f64 {
            let after = answers.partition_point(|answer| answer.0 <= time_s);
            match (after.checked_sub(1).map(|k| answers[k]), answers.get(after)) {
                (Some(a), Some(b)) => a.1 + (time_s - a.0) / (b.0 - a.0) * (b.1 - a.1),
                (Some(last), None) => last.1,
                _ => 0.0,
            }
        };
        // As cells weigh their samples: a triangle over twice a cell.
        let count = ((LENGTH_S + CELL_S) * RATE_HZ) as usize;
        let half = (CELL_S * RATE_HZ) as i32;
        let values = (0..count).map(|k| {
            let time_s = k as f64 / RATE_HZ - CELL_S;
            let (mut sum, mut all) = (0.0, 0.0);
            for offset in -half..=half {
                let share = 1.0 - f64::from(offset.abs()) / f64::from(half + 1);
                sum += share * raw(time_s + f64::from(offset) / RATE_HZ);
                all += share;
            }
            sum / all
        });
        Some(StepResponse {
            values: values.collect(),
        })
    }

    /// So long after a step; 0 before it, and what it ends at much later.
    pub fn at(&self, time_s: f64) -> f64 {
        let place = (time_s + CELL_S) * RATE_HZ;
        if place <= 0.0 {
            return 0.0;
        }
        let last = self.values.len() - 1;
        self.values[(place as usize).min(last)]
    }
}

/// Changes of the measured wheel speeds in a window; much where the wheels hardly turn, since friction is not linear there.
fn unrest(window: &Window) -> f64 {
    let cells = || {
        window
            .drive
            .cells
            .iter()
            .filter(|cell| matches!(cell.quantity, Quantity::Wheel(_)))
    };
    let count = cells().count().max(1) as f64;
    let activity: f64 = cells().map(|cell| cell.activity).sum();
    let slow = cells().filter(|cell| cell.measured.abs() < 1.0).count() as f64;
    activity / count + 10.0 * slow / count
}
