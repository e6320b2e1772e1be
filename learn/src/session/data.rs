//! Which run is for what, and the windows of each role.

use identify::bundle::Bundle;
use identify::gap::{RobotClock, delayed_rows};
use identify::select::{Role, roles};
use twin::replay::HeldCommand;
use twin::robot::RobotDescription;

use super::{COMPARED, LEAST_OTHER, LEAST_TRAINING, MOST_WINDOWS, Request, TRAINING, TWIST_TRAINING};
use crate::linear::Target;
use crate::problem::LearnError;
use crate::report::{Counts, Data};
use crate::window::Collection;

/// Fewest runs when none was locked apart, and when some were.
const LEAST_RUNS: usize = 3;
const LEAST_RUNS_APART: usize = 2;

/// What is known of the runs before they are cut.
#[derive(Debug, Clone)]
pub struct Survey {
    pub description: RobotDescription,
    pub floor: String,
    /// Path, digest and role of `runs`, then of those locked apart.
    entries: Vec<(String, String, Role)>,
    /// Of `runs`.
    count: usize,
}

/// Windows by their use.
pub struct Windows {
    pub training: Collection,
    /// The same as `training` when that is by path.
    pub black_box: Collection,
    pub stopping: Collection,
    pub validation: Collection,
    pub validation_far: Collection,
    pub locked: Collection,
}

impl Survey {
    /// Reads every run once.
    ///
    /// - Errors: too few runs, different robots, runs without poses or commands.
    pub fn of(request: &Request<'_>) -> Result<Survey, LearnError> {
        let least = if request.locked.is_some() {
            LEAST_RUNS_APART
        } else {
            LEAST_RUNS
        };
        if request.runs.count() < least {
            return Err(LearnError::TooFewRuns {
                found: request.runs.count(),
                least,
            });
        }
        let first = request.runs.read(0)?;
        let description = match &request.model {
            Some(model) => model.robot.clone(),
            None => first.bundle.run.robot.clone(),
        };
        let mut survey = Survey {
            floor: first.bundle.run.floor.clone(),
            description,
            entries: Vec::new(),
            count: request.runs.count(),
        };
        let owner = if request.model.is_some() {
            "the model"
        } else {
            &first.path
        };
        for reference in request.references {
            survey.same_robot(&reference.path, &reference.bundle, owner)?;
        }
        let mut liveliness = Vec::new();
        for shelf in [Some(request.runs), request.locked].into_iter().flatten() {
            for position in 0..shelf.count() {
                let run = shelf.read(position)?;
                survey.same_robot(&run.path, &run.bundle, owner)?;
                liveliness.push(lively(&run.path, &run.bundle)?);
                survey.entries.push((run.path, run.sha256, Role::Locked));
            }
        }
        let dealt = roles(&liveliness[..survey.count], request.locked.is_some());
        for (entry, role) in survey.entries.iter_mut().zip(dealt) {
            entry.2 = role;
        }
        Ok(survey)
    }

    fn same_robot(&self, path: &str, bundle: &Bundle, other: &str) -> Result<(), LearnError> {
        let found = &bundle.run.robot;
        if found.wheels.len() != self.description.wheels.len() {
            return Err(LearnError::OtherRobot {
                path: path.to_owned(),
                other: other.to_owned(),
                found: found.wheels.len(),
                expected: self.description.wheels.len(),
            });
        }
        if found.chassis != self.description.chassis {
            return Err(LearnError::OtherChassis {
                path: path.to_owned(),
                other: other.to_owned(),
                found: found.chassis.clone(),
                expected: self.description.chassis.clone(),
            });
        }
        Ok(())
    }

    /// Names by position.
    pub fn paths(&self) -> Vec<String> {
        self.entries.iter().map(|(path, ..)| path.clone()).collect()
    }

    /// All runs with their roles, references first.
    pub fn data(&self, request: &Request<'_>) -> Vec<Data> {
        let references = request.references.iter().map(|run| Data {
            path: run.path.clone(),
            sha256: run.sha256.clone(),
            role: Role::Reference.name(),
        });
        let runs = self.entries.iter().map(|(path, sha256, role)| Data {
            path: path.clone(),
            sha256: sha256.clone(),
            role: role.name(),
        });
        references.chain(runs).collect()
    }

    /// Runs of a role.
    fn runs_of(&self, role: Role) -> usize {
        self.entries.iter().filter(|(.., other)| *other == role).count()
    }

    /// Reads every run once more and cuts it.
    ///
    /// - Errors: too few windows of a role, states that no robot has.
    pub fn windows(&self, request: &Request<'_>, clock: RobotClock) -> Result<Windows, LearnError> {
        let cut = match request.target {
            Target::Path => TRAINING,
            Target::Twist => TWIST_TRAINING,
        };
        let most = |cut: &crate::window::Cut| {
            // Short windows are cheap and there must be more of them.
            if cut.horizon_s < TRAINING.horizon_s {
                4 * MOST_WINDOWS
            } else {
                MOST_WINDOWS
            }
        };
        let new = |cut| Collection::new(cut, most(&cut));
        let mut windows = Windows {
            training: new(cut),
            black_box: new(TRAINING),
            stopping: new(cut),
            validation: new(TRAINING),
            validation_far: new(COMPARED),
            locked: new(COMPARED),
        };
        for (number, (path, _, role)) in self.entries.iter().enumerate() {
            let run = match number.checked_sub(self.count) {
                None => request.runs.read(number)?,
                Some(apart) => match request.locked {
                    Some(shelf) => shelf.read(apart)?,
                    None => continue,
                },
            };
            let mine: Vec<&mut Collection> = match role {
                Role::Train => vec![&mut windows.training, &mut windows.black_box],
                Role::Validation => vec![
                    &mut windows.stopping,
                    &mut windows.validation,
                    &mut windows.validation_far,
                ],
                _ => vec![&mut windows.locked],
            };
            for collection in mine {
                collection.add(number, path, &run.bundle, clock)?;
            }
        }
        for (collection, role, least) in [
            (&windows.training, Role::Train, LEAST_TRAINING),
            (&windows.validation, Role::Validation, LEAST_OTHER),
            (&windows.validation_far, Role::Validation, LEAST_OTHER),
            (&windows.locked, Role::Locked, LEAST_OTHER),
        ] {
            if collection.windows.len() < least {
                return Err(LearnError::TooShort {
                    role: role.name(),
                    found: collection.windows.len(),
                    least,
                    horizon_s: collection.cut.horizon_s,
                });
            }
        }
        Ok(windows)
    }
}

impl Windows {
    /// For the report.
    pub fn counts(&self, survey: &Survey) -> Vec<Counts> {
        let of = |role: Role, collection: &Collection| Counts {
            role: role.name(),
            runs: survey.runs_of(role),
            windows: collection.windows.len(),
            seen: collection.seen,
            stride: collection.stride,
            skipped: collection.skipped,
        };
        vec![
            of(Role::Train, &self.training),
            of(Role::Validation, &self.validation),
            of(Role::Locked, &self.locked),
        ]
    }

    /// Sentences for the report.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.training.stride > 1 {
            remarks.push(format!(
                "every {}th of {} training windows is used: at most {MOST_WINDOWS} are kept in memory",
                self.training.stride, self.training.seen
            ));
        }
        if self.training.windows.iter().all(|window| window.poses.is_empty()) {
            remarks.push("no poses: twist and wheels only".to_owned());
        }
        remarks
    }
}

/// Largest set-point of a wheel or of the steering.
fn lively(path: &str, bundle: &Bundle) -> Result<f64, LearnError> {
    let missing = |missing: &'static str| LearnError::Channels {
        path: path.to_owned(),
        missing,
    };
    if identify::anchor::Track::of(bundle).poses.is_empty() {
        return Err(missing(
            "no measured poses (pose_x_m, pose_y_m, pose_yaw_rad in one row)",
        ));
    }
    if !bundle.telemetry.channels.keys().any(|channel| channel.is_command()) {
        return Err(missing("no commands"));
    }
    let mut held = HeldCommand::default();
    let mut largest = 0.0_f64;
    for row in delayed_rows(bundle) {
        held.apply(&bundle.robot, &row);
        let command = held.command();
        largest = command.wheel_rad_per_s.iter().fold(largest, |m, w| m.max(w.abs()));
    }
    Ok(largest)
}
