//! Errors of runs under a model, as a report's gap table reckons them: what `days` and `worse` hold against the truth.

use identify::diagnose::Run;
use identify::errors::{Errors, add_poses, add_windows};
use identify::floor::Floor;
use identify::gap::{CLOSE_ANCHOR_PERIOD_S, RobotClock, end_to_end_with};
use identify::hypothesis::Hypothesis;
use identify::record::Record;

/// Runs that a diagnosis locks away of six.
pub const LOCKED: usize = 2;

/// By channel and horizon; positions are left out where the model cannot be simulated.
pub fn errors(floor: &Floor, runs: &[Run], model: &Hypothesis) -> Errors {
    let mut errors: Errors = Vec::new();
    for run in runs {
        let record = Record::of(&run.path, &run.bundle);
        let clock = RobotClock::of(&model.effects);
        let gap = model
            .robot()
            .and_then(|robot| end_to_end_with(&run.bundle, &robot, clock, CLOSE_ANCHOR_PERIOD_S).ok());
        if let Some(gap) = gap {
            add_poses(&mut errors, &record, &gap.samples);
        }
        add_windows(&mut errors, Some(&floor.noise), &record, model);
    }
    errors
}
