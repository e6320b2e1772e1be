//! From runs to a report and a model version.

mod absorb;
mod apart;
mod arrived;
mod assemble;
mod beside;
mod calibrate;
mod described;
mod energy;
mod error;
mod evenness;
mod exchange;
mod excited;
mod final_fit;
mod gap_table;
mod interval;
mod louder;
mod loudness;
mod manoeuvre;
mod nearest;
mod next;
mod opening;
mod prepared;
mod range_end;
mod suspected;
mod taken;
mod trend;
mod trial;
mod usable;
mod validation_gap;
mod verdict;
mod verified;

pub use calibrate::{calibrated, calibrated_floor};
pub use error::DiagnoseError;

use twin::effect::Effect;
use twin::model_document::ModelDocument;

use crate::bundle::Bundle;
use crate::fit::{Fit, Member, Problem, fit, with_members};
use crate::floor::{Floor, Metric};
use crate::hypothesis::{Candidate, Hypothesis, Knob, LOST, candidates, knobs};
use crate::locate::{Located, locate};
use crate::record::{Record, Stages};
use crate::report::Report;
use crate::screen::{Score, all_residuals};
use crate::select::{Explained, Kept, Role, Round, Stop, decrease, energies, roles, round};
use crate::workers::{Cancelled, Workers};
use absorb::absorb_one;
use arrived::{Answer, Question};
use described::described;
use energy::Energies;
use exchange::Exchange;
use final_fit::finish;
use gap_table::ValidationGap;
use louder::Compared;
use opening::{ALIKE, Opening, otherwise_calibrated, otherwise_calibrated_beside};
use prepared::{Prepared, Whole, enough};
use suspected::{drop_doubtful, take_suspect};
use taken::Taken;
use usable::{check, usable};
use validation_gap::{adds_nothing, prefer};

/// Version of the effect library and of this workflow.
pub const LIBRARY_VERSION: &str = "1";
/// Most effects that are named.
const MOST_EFFECTS: usize = 6;
/// Most effects of the references that are absorbed.
const MOST_ABSORBED: usize = 5;
const MOST_ROUNDS: usize = MOST_EFFECTS + MOST_ABSORBED;
/// Changes below this part of the practical size are calibration.
const TINY: f64 = 0.7;

/// A bundle and where it came from.
#[derive(Debug, Clone)]
pub struct Run {
    /// As given.
    pub path: String,
    /// Of its files, in hexadecimal.
    pub sha256: String,
    pub bundle: Bundle,
}

/// What is to be diagnosed.
#[derive(Debug, Clone)]
pub struct Input {
    pub references: Vec<Run>,
    pub runs: Vec<Run>,
    pub locked: Vec<Run>,
    /// The model that should explain the runs; the nominal twin when absent.
    pub model: Option<ModelDocument>,
    pub seed: u64,
}

/// What came out.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    pub report: Report,
    pub model: ModelDocument,
}

/// Everything that the report is made of.
struct Case<'a> {
    input: &'a Input,
    floor: Floor,
    candidates: Vec<Candidate>,
    roles: Vec<Role>,
    records: Vec<Record>,
    locked: Vec<Record>,
    taken: Vec<Taken>,
    fit: Option<Fit>,
    /// Standard errors from the scatter of runs, by (member, axis).
    scatter: Vec<((usize, usize), f64)>,
    /// What the fit leaves beyond the noise, over what it explains.
    law_rest: f64,
    first_scores: Vec<Score>,
    first_threshold: f64,
    last: Option<Stop>,
    located: Located,
    /// The same before names were fitted.
    located_unnamed: Located,
    energies: Energies,
    levels: Levels,
    /// Energies and levels before anything was named, in the noise of then.
    unnamed: (Energies, Compared),
    /// What became of the question whether set-points were lost; the runs as they arrived where they were, by path, the locked ones as
    /// they were sent, and the standard deviation of the share that was lost.
    lost: Answer,
    /// What the given model says of it.
    lost_given: Option<Effect>,
    arrived: Vec<(String, Bundle)>,
    locked_as_sent: Vec<Record>,
    lost_sigma: f64,
    /// The references were calibrated anew where an effect pointed.
    has_begun_again: bool,
    /// What was suspected under another floor, and the present one does without; the runs kept for checking had a part in its calibration.
    alike: Option<&'static str>,
    /// Places of a patch before those that the gap tells.
    places_given: Option<usize>,
    /// Names that unused runs spoke against, and what they said.
    withdrawn: Vec<(&'static str, String)>,
    remarks: Vec<String>,
}

impl Case<'_> {
    /// A run with the set-points that arrived, where some were lost.
    fn arrived<'a>(&'a self, record: &Record, sent: &'a Bundle) -> &'a Bundle {
        let own = self.arrived.iter().find(|(path, _)| *path == record.name);
        own.map_or(sent, |(_, bundle)| bundle)
    }
}

/// How loud the channels are, run by run, before anything is named and with what was.
#[derive(Debug, Clone, Default)]
struct Levels {
    before: Compared,
    after: Compared,
}

/// Diagnoses runs.
///
/// - Errors: runs of different robots, runs without usable data, a model that does not fit; [`Cancelled`].
pub fn diagnose(workers: &dyn Workers, input: &Input) -> Result<Diagnosis, DiagnoseError> {
    check(input)?;
    let description = input
        .model
        .as_ref()
        .map_or_else(|| input.runs[0].bundle.run.robot.clone(), |model| model.robot.clone());
    let effects = input
        .model
        .as_ref()
        .map_or_else(Vec::new, |model| model.effects.clone());
    // Which set-points are lost is asked of each run anew.
    let (lost_given, effects): (Vec<Effect>, Vec<Effect>) = effects.into_iter().partition(|effect| effect.name == LOST);
    let lost_given = lost_given.into_iter().next();
    let given = Hypothesis {
        description: description.clone(),
        effects,
        residual: input.model.as_ref().and_then(|model| model.residual.clone()),
    };
    if let Err(problem) =
        twin::robot::Robot::with_model(given.description.clone(), &given.effects, given.residual.as_ref())
    {
        return Err(DiagnoseError::Model(format!("{}: {}", problem.field, problem.message)));
    }
    workers.progress("read", 0.02);
    let (records, mut remarks) = usable(&input.runs)?;
    let references = usable(&input.references)?.0;
    let locked_records = usable(&input.locked)?.0;
    let excitation = excited::excitation(&records, &given);
    let candidates = candidates(&description, &excitation);
    let knobs = knobs(&candidates, &description);
    let stages: Vec<Stages> = knobs.iter().map(|knob| knob_stages(knob, &candidates)).collect();
    workers.progress("calibrate", 0.05);
    let liveliness: Vec<f64> = records.iter().map(|record| record.largest_command_rad_per_s).collect();
    let roles = roles(&liveliness, !input.locked.is_empty());
    let train = records.iter().zip(&roles).filter(|(_, role)| **role == Role::Train);
    let train: Vec<Record> = train.map(|(record, _)| record.clone()).collect();
    let floor = if references.is_empty() {
        remarks.push("no references: the robot description and its noise are taken at their word".to_owned());
        Floor::told_by_runs(workers, given, knobs, &stages, enough(train))?
    } else {
        let mut floor = Floor::calibrated(workers, given, knobs, &stages, references)?;
        if floor.is_driven_otherwise(&train) {
            remarks.push(floor.shown_by_runs(workers, &stages, enough(train))?.to_owned());
        }
        floor
    };
    remarks.extend(floor.tyres());
    let mut case = Case {
        input,
        floor,
        candidates,
        roles,
        records,
        locked: locked_records,
        taken: Vec::new(),
        fit: None,
        scatter: Vec::new(),
        law_rest: 0.0,
        first_scores: Vec::new(),
        first_threshold: 0.0,
        last: None,
        located: Located::default(),
        located_unnamed: Located::default(),
        energies: Energies::NOTHING,
        levels: Levels::default(),
        unnamed: (Energies::NOTHING, Compared::default()),
        lost: Answer::NotAsked,
        lost_given,
        arrived: Vec::new(),
        locked_as_sent: Vec::new(),
        lost_sigma: 0.0,
        has_begun_again: false,
        alike: None,
        places_given: None,
        withdrawn: Vec::new(),
        remarks,
    };
    case.locked.extend(case.of_role(Role::Locked));
    search(workers, &mut case, &stages)?;
    workers.progress("report", 0.95);
    assemble::assemble(workers, &mut case)
}

/// How loud the runs are under the model of their residuals, beside references: noise where these were driven otherwise, and windows that are too loud to be trusted.
fn hear(floor: &mut Floor, train: &mut Prepared, validation: &mut Prepared) {
    if floor.references.is_empty() {
        return;
    }
    floor.hear(&train.records, &train.residuals);
    floor.doubt_references();
    for side in [train, validation] {
        floor.doubt(&mut side.records, &side.residuals);
        side.weigh(floor);
    }
}

fn knob_stages(knob: &Knob, candidates: &[Candidate]) -> Stages {
    match knob {
        Knob::Supply(_) | Knob::Resistance(_) => Stages {
            drive: true,
            rolling: false,
        },
        Knob::AccelerometerLag(_) => Stages {
            drive: true,
            rolling: false,
        },
        Knob::Tread(_) | Knob::SteeringFilter(_) => Stages::BOTH,
        Knob::Parameter { name, .. } => candidates
            .iter()
            .find(|candidate| candidate.entry.name == *name)
            .map_or(Stages::BOTH, |candidate| candidate.stages),
    }
}

fn search(workers: &dyn Workers, case: &mut Case, given: &[Stages]) -> Result<(), DiagnoseError> {
    let Opening {
        mut train,
        mut validation,
        mut coarse,
        mut reference_metric,
    } = Opening::of(workers, case, given)?;
    let mut members: Vec<Member> = Vec::new();
    let mut kept = Kept::default();
    let mut gap = ValidationGap::default();
    let mut explained = Explained::default();
    let mut stages = given.to_vec();
    let mut is_asked_for_losses = false;
    let mut is_described = !case.floor.references.is_empty();
    for number in 0..MOST_ROUNDS {
        workers.progress(
            &format!("round {}", number + 1),
            0.2 + 0.7 * number as f64 / MOST_ROUNDS as f64,
        );
        let model = with_members(&case.floor.model, &members);
        let stop = round(
            workers,
            &Round {
                floor: &case.floor,
                reference_metric: reference_metric.as_ref(),
                train: train.side(),
                coarse: coarse.as_ref().map_or_else(|| train.side(), Prepared::side),
                validation: validation.side(),
                model: &model,
                candidates: &case.candidates,
                members: &members,
                explained: explained.clone(),
                seed: case.input.seed,
            },
            &mut kept,
        )?;
        if case.first_scores.is_empty() {
            case.first_scores = stop.scores.clone();
            case.first_threshold = stop.threshold;
        }
        if validation.records.is_empty() {
            case.remarks.push(
                "one run: nothing is named, since nothing could be checked on a run that was not used".to_owned(),
            );
            case.last = Some(stop);
            break;
        }
        let is_absorbed = match &reference_metric {
            Some(metric) => absorb_one(&mut case.floor, metric, &stop, &train.records),
            None => false,
        };
        if is_absorbed {
            kept.refuse(&stop);
            kept.absorb();
            let model = with_members(&case.floor.model, &members);
            train.renew(workers, &case.floor, &model)?;
            validation.renew(workers, &case.floor, &model)?;
            hear(&mut case.floor, &mut train, &mut validation);
            reference_metric = opening::reference_metric(&case.floor);
            coarse = train.thinned(&case.floor);
            if members.is_empty() {
                case.located = locate(&case.floor, &train.records, &train.residuals);
                levels(case, reference_metric.as_ref(), &train, &validation);
            }
            case.last = Some(stop);
            continue;
        }
        let mut stop = stop;
        prefer(case, &mut gap, &members, &mut stop);
        let Some(accepted) = stop.accepted.filter(|_| members.len() < MOST_EFFECTS) else {
            let threshold = stop.threshold;
            case.last = Some(stop);
            let is_room = members.len() < MOST_EFFECTS && number + 1 < MOST_ROUNDS;
            if is_room && kept.reconsider(!members.is_empty()) {
                continue;
            }
            if is_described && (is_asked_for_losses || members.len() >= MOST_EFFECTS) {
                break;
            }
            if is_described {
                is_asked_for_losses = true;
                let mut whole = Whole::of(&case.floor, &train, &validation);
                let question = Question {
                    case,
                    members: &members,
                    stages: &stages,
                    train: &whole.train,
                    validation: &whole.validation,
                    references: whole.references.as_ref(),
                    threshold,
                };
                match question.answer(workers)? {
                    Ok(found) => {
                        for side in [&mut whole.train, &mut whole.validation] {
                            side.renew(workers, &case.floor, &case.floor.model)?;
                        }
                        levels(case, whole.references.as_ref(), &whole.train, &whole.validation);
                        members.push(found.taken.finalist.member.clone());
                        (train, validation) = arrived::put(case, *found);
                        hear(&mut case.floor, &mut train, &mut validation);
                        coarse = train.thinned(&case.floor);
                        kept.outdate();
                        continue;
                    }
                    Err(answer) => case.lost = answer,
                }
                break;
            }
            // With what is named in the model the description can be held against the runs, and then there may be more to be seen.
            is_described = true;
            let Some(found) = described(workers, case, &members, &stages)? else {
                break;
            };
            (members, stages, explained.gain) = (found.members, found.stages, found.explained);
            (train, validation) = (found.train, found.validation);
            coarse = train.thinned(&case.floor);
            kept.leave(&found.calibrated);
            kept.outdate();
            continue;
        };
        let about = (&stop.finalists[accepted], stop.threshold);
        if let Some(floor) = otherwise_calibrated(workers, case, &stages, &train.records, &members, about)? {
            if !case.has_begun_again {
                case.begin_again(stop.finalists[accepted].member.candidate.entry.name, floor);
                return search(workers, case, given);
            }
            let finalist = &mut stop.finalists[accepted];
            finalist.because = Some(ALIKE.to_owned());
            kept.leave(&[finalist.position]);
            case.deny(&[finalist.member.candidate.entry.name]);
            case.last = Some(stop);
            continue;
        }
        let before = (members.clone(), case.taken.clone());
        case.taken.push(Taken::accepted(&stop, accepted));
        let finalist = &stop.finalists[accepted];
        let is_agreed = finalist.gain_train >= stop.threshold && finalist.is_agreed(stop.threshold);
        if finalist.joint.is_empty() {
            members.push(finalist.member.clone());
        } else {
            members.clone_from(&finalist.joint);
        }
        // Of long data the exact fit takes longest: what adds nothing by that of some windows is not worth it.
        let early = match coarse {
            Some(_) => adds_nothing(workers, case, &mut gap, &validation, [&before.0, &members], is_agreed)?,
            None => None,
        };
        if let Some(because) = early {
            (members, case.taken) = before;
            stop.finalists[accepted].because = Some(because);
            kept.refuse(&stop);
            case.last = Some(stop);
            continue;
        }
        let base: Option<Vec<Vec<f64>>> = all_residuals(workers, &train.records, &case.floor.model)?
            .into_iter()
            .collect();
        let Some(base) = base else {
            case.last = Some(stop);
            break;
        };
        let problem = Problem {
            records: &train.records,
            metric: &train.metric,
            bounds: &train.bounds,
            base: &case.floor.model,
            residuals: &base,
            wanted_gain: f64::NEG_INFINITY,
        };
        let Some(joint) = fit(&problem, members.clone()) else {
            case.last = Some(stop);
            break;
        };
        let mut taken = core::mem::take(&mut case.taken);
        let about = Exchange {
            workers,
            case,
            problem: &problem,
            train: &train,
            coarse: coarse.as_ref().unwrap_or(&train),
            validation: &validation,
            reference_metric: reference_metric.as_ref(),
            kept: &kept,
        };
        let joint = about.best(&mut taken, joint)?;
        case.taken = taken;
        if let Some(because) = adds_nothing(
            workers,
            case,
            &mut gap,
            &validation,
            [&before.0, &joint.members],
            is_agreed,
        )? {
            (members, case.taken) = before;
            stop.finalists[accepted].because = Some(because);
            kept.refuse(&stop);
            case.last = Some(stop);
            continue;
        }
        case.last = Some(stop);
        members = joint.members.clone();
        let model = with_members(&case.floor.model, &members);
        train.renew(workers, &case.floor, &model)?;
        validation.renew(workers, &case.floor, &model)?;
        hear(&mut case.floor, &mut train, &mut validation);
        reference_metric = opening::reference_metric(&case.floor);
        let of = |residuals: &[Vec<f64>]| energies(&train.metric, &train.records, residuals);
        explained.gain = decrease(&of(&base), &of(&train.residuals));
        coarse = train.thinned(&case.floor);
        kept.outdate();
    }
    if let Some((name, floor)) = otherwise_calibrated_beside(workers, case, &stages, &train.records, &members)? {
        case.begin_again(name, floor);
        return search(workers, case, given);
    }
    case.located_unnamed.clone_from(&case.located);
    let alike = take_suspect(
        workers,
        case,
        &stages,
        reference_metric.as_ref(),
        &mut members,
        [&mut train, &mut validation],
    )?;
    if let Some((name, floor)) = alike {
        case.begin_again(name, floor);
        case.alike = Some(name);
        return search(workers, case, given);
    }
    loop {
        if case.arrived.is_empty() {
            reference_metric = opening::reference_metric(&case.floor);
            if case.floor.hears_runs() {
                let [train, validation] = unnamed(workers, &case.floor, [&train, &validation])?;
                let references = reference_metric.as_ref();
                case.energies = Energies::before(&case.floor, references, &train, &validation);
                case.levels.before = compared(&case.floor, references, &train, &validation);
            }
            case.energies.name(&train, &validation);
            case.levels.after = compared(&case.floor, reference_metric.as_ref(), &train, &validation);
        } else {
            let whole = Whole::of(&case.floor, &train, &validation);
            case.energies.name(&whole.train, &whole.validation);
            case.levels.after = compared(&case.floor, whole.references.as_ref(), &whole.train, &whole.validation);
        }
        finish(workers, case, &stages, members.clone(), [&train, &validation])?;
        if !drop_doubtful(workers, case, &mut members, [&mut train, &mut validation])? {
            return Ok(());
        }
        case.located.clone_from(&case.located_unnamed);
    }
}

/// The runs before anything was named, in the noise that is heard now: it was louder while nothing explained what is named.
fn unnamed(
    workers: &dyn Workers,
    floor: &Floor,
    [train, validation]: [&Prepared; 2],
) -> Result<[Prepared; 2], Cancelled> {
    Ok([
        train.under(workers, floor, &floor.model)?,
        validation.under(workers, floor, &floor.model)?,
    ])
}

/// Levels of the references, and of training and validation runs.
fn compared(floor: &Floor, reference_metric: Option<&Metric>, train: &Prepared, validation: &Prepared) -> Compared {
    let of = |side: &Prepared| louder::levels(&side.metric, &side.records, &side.residuals);
    let mut runs = of(train);
    runs.extend(of(validation));
    let references = reference_metric.map_or_else(Vec::new, |metric| {
        louder::levels(metric, &floor.references, &floor.left_out)
    });
    Compared { references, runs }
}

/// Energies and levels of the runs before anything is named, in the noise of then.
fn levels(case: &mut Case, reference_metric: Option<&Metric>, train: &Prepared, validation: &Prepared) {
    case.energies = Energies::before(&case.floor, reference_metric, train, validation);
    case.levels.before = compared(&case.floor, reference_metric, train, validation);
    case.unnamed = (case.energies, case.levels.before.clone());
}
