//! Set-points that never arrived, where nothing else explains what is left of the wheel speeds.

use super::prepared::{Prepared, prepare};
use super::taken::Taken;
use super::{Case, Run, TINY};
use crate::fit::{Member, with_members};
use crate::floor::Metric;
use crate::hypothesis::{Hypothesis, lost_set_points};
use crate::lost::{Arrived, COST, Seen, arrived};
use crate::record::{Record, Stages, residuals};
use crate::screen::all_residuals;
use crate::select::{Finalist, energies, expected};
use crate::workers::{Cancelled, Workers, gathered};

/// Position of the wheels among the channels.
const WHEEL: usize = 0;
/// Wheels that are nearer to the twin than so many times the references' energy say nothing.
const OFF: f64 = 1.3;
/// Part of what the wheels are off by that is explained, of training and of validation runs; beside others that explain as much of the wheels as is left, and
/// whose laws leave a rest of any kind, more.
const EXPLAINED: f64 = 0.3;
const BESIDE_OTHERS: f64 = 0.6;
/// Of two runs first, of all that they are off by.
const WORTH_WHILE: f64 = 0.1;
/// Losses that the references seem to have, as a share of the runs', are what is left there of laws.
const IN_REFERENCES: f64 = 0.35;
/// A share of less time says nothing, s.
const LEAST_NAMED_S: f64 = 0.3;
/// Over so much time at least, s.
const LEAST_REFERENCES_S: f64 = 1.0;
/// References that are looked at.
const REFERENCES: usize = 4;
/// Part of the runs that have a loss.
const IN_RUNS: f64 = 0.75;
/// Time over which losses would show, s: three bursts of 0.05 s are lost of it at the practical share of a twentieth.
const LEAST_S: f64 = 3.0;
/// Largest share that the effect can have.
const MOST_SHARE: f64 = 0.95;
/// Lengths within this share of each other are one.
const ALIKE: f64 = 0.15;

/// What became of the question.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Answer {
    /// It did not come to that.
    NotAsked,
    /// The wheels agree.
    Agree,
    Untestable(String),
    Rejected(String),
}

/// Runs as they arrived, with the name.
pub(super) struct Found {
    pub taken: Taken,
    pub train: Prepared,
    pub validation: Prepared,
    /// Of all runs, locked ones too.
    pub runs: Vec<Arrived>,
    /// Standard deviation of the share that is lost.
    pub sigma: f64,
}

/// What the question is asked of.
pub(super) struct Question<'a> {
    pub case: &'a Case<'a>,
    /// What is named already; `train` and `validation` are under it.
    pub members: &'a [Member],
    pub stages: &'a [Stages],
    pub train: &'a Prepared,
    pub validation: &'a Prepared,
    /// Product of the references.
    pub references: Option<&'a Metric>,
    /// Gain that training and validation runs need each.
    pub threshold: f64,
}

/// Energy of the wheels, and what it would be were they as in the references.
struct Wheels {
    own: f64,
    calm: f64,
}

impl Question<'_> {
    /// Looks for lost set-points in the open runs and in the references, and then in the locked ones.
    pub fn answer(&self, workers: &dyn Workers) -> Result<Result<Box<Found>, Answer>, Cancelled> {
        let case = self.case;
        let healthy = self.references.map_or(1.0, |metric| {
            let own = energies(metric, &case.floor.references, &case.floor.left_out)[WHEEL];
            own / expected(metric)[WHEEL].max(1.0)
        });
        let wheels = [self.train, self.validation].map(|side| Wheels {
            own: energies(&side.metric, &side.records, &side.residuals)[WHEEL],
            calm: healthy.max(1.0) * expected(&side.metric)[WHEEL],
        });
        let model = with_members(&case.floor.model, self.members);
        if wheels.iter().any(|wheels| wheels.calm <= 0.0) {
            let words = "no wheel speeds with set-points of their own on training and validation runs".to_owned();
            return Ok(Err(Answer::Untestable(words)));
        }
        if self.validation.records.is_empty() || wheels.iter().any(|wheels| wheels.own < OFF * wheels.calm) {
            // Would a loss show? One run tells.
            let first = self.train.records.first().and_then(|record| look(case, record, &model));
            let seen = first.map(|run| run.seen).unwrap_or_default();
            let runs = self.train.records.len() as f64;
            return Ok(Err(if runs * seen.open_s < LEAST_S {
                Answer::Untestable(too_little(runs * seen.open_s))
            } else {
                Answer::Agree
            }));
        }
        workers.progress("lost set-points", 0.85);
        let open: Vec<&Record> = self.train.records.iter().chain(&self.validation.records).collect();
        // One run of each side says whether it is worth while.
        let (few, others): (Vec<usize>, Vec<usize>) =
            (0..open.len()).partition(|k| [0, self.train.records.len()].contains(k));
        let looked =
            |positions: &[usize]| gathered(workers, positions.len(), &|k| look(case, open[positions[k]], &model));
        let first = looked(&few)?;
        if first.iter().any(Option::is_some) {
            let promised = promised(first.iter().flatten());
            if promised < WORTH_WHILE {
                return Ok(Err(Answer::Rejected(format!(
                    "set-points that do not arrive would explain {:.0} % of the wheel speeds' errors in the first runs",
                    100.0 * promised.max(0.0)
                ))));
            }
        }
        let mut runs: Vec<(usize, Option<Arrived>)> = few.into_iter().zip(first).collect();
        let rest = looked(&others)?;
        runs.extend(others.into_iter().zip(rest));
        if runs.iter().all(|(_, run)| run.is_none()) {
            let words = "no run has set-points of wheels over a second that can be simulated".to_owned();
            return Ok(Err(Answer::Untestable(words)));
        }
        runs.sort_by_key(|(k, _)| *k);
        // A run that says nothing is taken as it was sent.
        let runs: Option<Vec<Arrived>> = runs
            .into_iter()
            .map(|(k, run)| run.or_else(|| as_sent(case, open[k])))
            .collect();
        let Some(runs) = runs else {
            return Ok(Err(Answer::NotAsked));
        };
        let seen = pooled(&runs);
        let least = least_share(&wheels[0], self.wheels_before(workers)?);
        let gains = match self.gains(&runs, &wheels, &model, least) {
            Ok(gains) if seen.open_s >= LEAST_NAMED_S => gains,
            Err(_) if seen.open_s < LEAST_S => return Ok(Err(Answer::Untestable(too_little(seen.open_s)))),
            Err(because) => return Ok(Err(Answer::Rejected(because))),
            Ok(_) => return Ok(Err(Answer::Untestable(too_little(seen.open_s)))),
        };
        let share = seen.lost_s / seen.open_s;
        let few: Vec<&Record> = case.floor.references.iter().take(REFERENCES).collect();
        let calm = gathered(workers, few.len(), &|k| look(case, few[k], &case.floor.model))?;
        let calm = pooled(&calm.into_iter().flatten().collect::<Vec<Arrived>>());
        let in_references = calm.lost_s / calm.open_s.max(LEAST_REFERENCES_S) / share.max(1e-9);
        if in_references > IN_REFERENCES {
            return Ok(Err(Answer::Rejected(format!(
                "the references seem to have them as well, at {:.0} % of the rate",
                100.0 * in_references
            ))));
        }
        let locked = gathered(workers, case.locked.len(), &|k| look(case, &case.locked[k], &model))?;
        self.found(
            workers,
            runs,
            locked.into_iter().flatten().collect(),
            gains,
            in_references,
            &model,
        )
        .map(|found| found.ok_or(Answer::Agree))
    }

    /// Energy of the training runs' wheels before anything was named; `None` when nothing is.
    fn wheels_before(&self, workers: &dyn Workers) -> Result<Option<f64>, Cancelled> {
        if self.members.is_empty() {
            return Ok(None);
        }
        let simulated = all_residuals(workers, &self.train.records, &self.case.floor.model)?;
        let residuals: Option<Vec<Vec<f64>>> = simulated.into_iter().collect();
        let energy = |residuals: Vec<Vec<f64>>| energies(&self.train.metric, &self.train.records, &residuals)[WHEEL];
        Ok(Some(residuals.map_or(f64::INFINITY, energy)))
    }

    /// Net gains on training and validation runs, or why they are not enough.
    ///
    /// - `least`: part of what the wheels are off by that is explained, at least.
    fn gains(
        &self,
        runs: &[Arrived],
        wheels: &[Wheels; 2],
        model: &Hypothesis,
        least: f64,
    ) -> Result<[f64; 2], String> {
        let (train, validation) = runs.split_at(self.train.records.len());
        let mut gains = [0.0; 2];
        for (gain, ((side, runs), wheels)) in gains.iter_mut().zip(
            [(self.train, train), (self.validation, validation)]
                .into_iter()
                .zip(wheels),
        ) {
            let simulated = runs.iter().zip(&side.residuals).map(|(run, before)| {
                residuals(&run.record, model, Stages::BOTH, None).filter(|after| after.len() == before.len())
            });
            let after: Option<Vec<Vec<f64>>> = simulated.collect();
            let after = after.ok_or("the runs cannot be simulated without what they would have lost")?;
            let energy = |residuals: &[Vec<f64>]| {
                let views = residuals.iter().map(Vec::as_slice).collect();
                side.metric.gram(&[views]).at(0, 0)
            };
            let spans: usize = runs.iter().map(|run| run.spans.len()).sum();
            *gain = energy(&side.residuals) - energy(&after) - COST * spans as f64;
            let left = energies(&side.metric, &side.records, &after)[WHEEL];
            let share = (wheels.own - left) / (wheels.own - wheels.calm).max(1e-9);
            if share < least {
                return Err(format!(
                    "set-points that do not arrive would explain {:.0} % of what is left of the wheel speeds, {:.0} % are needed",
                    100.0 * share.max(0.0),
                    100.0 * least
                ));
            }
        }
        for (name, gain) in ["training", "validation"].iter().zip(gains) {
            if gain < self.threshold {
                return Err(format!(
                    "gain {gain:.0} on the {name} runs is below {:.0}",
                    self.threshold
                ));
            }
        }
        let concerned = runs.iter().filter(|run| !run.spans.is_empty()).count();
        if (concerned as f64) < IN_RUNS * runs.len() as f64 {
            return Err(format!("{concerned} of {} runs have a loss", runs.len()));
        }
        Ok(gains)
    }

    /// The given model loses about as much.
    fn is_known(&self, share: f64) -> bool {
        let practical = lost_set_points(&self.case.floor.given.description)
            .and_then(|candidate| candidate.axes.first().map(|axis| axis.practical));
        let given = self.case.lost_given.as_ref().map(|effect| effect.value("loss_rate"));
        given
            .zip(practical)
            .is_some_and(|(given, practical)| (share - given).abs() < TINY * practical)
    }

    fn found(
        &self,
        workers: &dyn Workers,
        runs: Vec<Arrived>,
        locked: Vec<Arrived>,
        gains: [f64; 2],
        in_references: f64,
        model: &Hypothesis,
    ) -> Result<Option<Box<Found>>, Cancelled> {
        let floor = &self.case.floor;
        let Some(candidate) = lost_set_points(&floor.given.description) else {
            return Ok(None);
        };
        let seen = pooled(&runs);
        let share = seen.lost_s / seen.open_s;
        let burst_s = usual_length_s(&runs);
        let values = vec![share.min(MOST_SHARE), burst_s];
        let agreeing = runs.iter().filter(|run| {
            let own = run.seen.lost_s / run.seen.open_s.max(1e-9);
            own > 0.5 * share && own < 2.0 * share
        });
        let finalist = Finalist {
            position: self.case.candidates.len(),
            size: candidate.size(&values),
            sure_size: candidate.size(&values),
            member: Member { candidate, values },
            gain_train: gains[0],
            weighed: gains[0],
            is_unshown: false,
            gain_validation: gains[1],
            change_validation: 0.0,
            in_references,
            is_shown_by_references: true,
            stability: agreeing.count() as f64 / runs.len() as f64,
            is_in_turn: false,
            is_but_one: false,
            harmful: 0.0,
            worse: None,
            because: None,
            cosine: 0.0,
            joint: Vec::new(),
        };
        let (train, validation) = runs.split_at(self.train.records.len());
        let prepared = |runs: &[Arrived]| -> Result<Prepared, Cancelled> {
            let records = runs.iter().map(|run| run.record.clone()).collect();
            let mut side = prepare(workers, floor, records, self.stages)?;
            side.renew(workers, floor, model)?;
            Ok(side)
        };
        let bursts = (seen.open_s / burst_s.max(1e-3)).max(1.0);
        Ok(Some(Box::new(Found {
            train: prepared(train)?,
            validation: prepared(validation)?,
            sigma: (share * (1.0 - share) / bursts).sqrt(),
            taken: Taken {
                is_absorbed: finalist.size < TINY || self.is_known(share),
                corrects_beside: None,
                finalist,
                alternatives: Vec::new(),
                excluded: Vec::new(),
                threshold: self.threshold,
                evenness: None,
                but_best: None,
                may_be_none: false,
                may_be_none_on_average: false,
                may_be_rest_of: None,
                is_beside_a_large_rest: false,
                reserved: Vec::new(),
                rivals: Vec::new(),
                trend: None,
                suspected: None,
                is_shown_together: false,
            },
            runs: runs.into_iter().chain(locked).collect(),
        })))
    }
}

/// The name is dropped: runs are what was sent.
pub(super) fn take_back(case: &mut Case) {
    if !case.arrived.is_empty() {
        case.locked = core::mem::take(&mut case.locked_as_sent);
        case.arrived.clear();
        case.lost = Answer::Rejected("was found, but too little of the gap is explained with it".to_owned());
    }
}

/// Puts runs as they arrived in the place of those that were sent.
pub(super) fn put(case: &mut Case, found: Found) -> (Prepared, Prepared) {
    let of = |record: &Record| found.runs.iter().find(|run| run.record.name == record.name);
    for record in &mut case.records {
        if let Some(run) = of(record) {
            *record = run.record.clone();
        }
    }
    case.locked_as_sent.clone_from(&case.locked);
    for record in &mut case.locked {
        if let Some(run) = of(record) {
            *record = run.record.clone();
        }
    }
    case.lost_sigma = found.sigma;
    case.taken.push(found.taken);
    case.arrived = found
        .runs
        .into_iter()
        .map(|run| (run.record.name.clone(), run.bundle))
        .collect();
    (found.train, found.validation)
}

/// Part of what the wheels are off by that losses must explain.
///
/// - `wheels`: of the training runs, with what is named.
/// - `before`: their energy without; `None` when nothing is named.
fn least_share(wheels: &Wheels, before: Option<f64>) -> f64 {
    let may_be_rest = before.is_some_and(|before| wheels.own - wheels.calm < before - wheels.own);
    if may_be_rest { BESIDE_OTHERS } else { EXPLAINED }
}

fn too_little(open_s: f64) -> String {
    format!(
        "a lost set-point would show in {open_s:.1} s of these runs; {LEAST_S:.0} s are needed, with commands that change"
    )
}

fn look(case: &Case, record: &Record, model: &Hypothesis) -> Option<Arrived> {
    let input = case.input;
    let mut runs = input.runs.iter().chain(&input.locked).chain(&input.references);
    let run: &Run = runs.find(|run| run.path == record.name)?;
    arrived(&run.path, &run.bundle, model, &case.floor.noise)
}

/// A run in which nothing was looked for.
fn as_sent(case: &Case, record: &Record) -> Option<Arrived> {
    let run = case.input.runs.iter().find(|run| run.path == record.name)?;
    Some(Arrived {
        bundle: run.bundle.clone(),
        record: record.clone(),
        spans: Vec::new(),
        seen: Seen::default(),
        wheels: [0.0; 2],
    })
}

/// Share of the energy of the wheels that is gone, costs taken off.
fn promised<'a>(runs: impl Iterator<Item = &'a Arrived> + Clone) -> f64 {
    let [sent, arrived] = [0, 1].map(|k| runs.clone().map(|run| run.wheels[k]).sum::<f64>());
    let cost = COST * runs.map(|run| run.spans.len()).sum::<usize>() as f64;
    (sent - arrived - cost) / sent.max(1e-9)
}

fn pooled(runs: &[Arrived]) -> Seen {
    Seen {
        open_s: runs.iter().map(|run| run.seen.open_s).sum(),
        lost_s: runs.iter().map(|run| run.seen.lost_s).sum(),
    }
}

/// The shortest length that many losses have, s: two bursts in a row are one loss of twice the length.
fn usual_length_s(runs: &[Arrived]) -> f64 {
    let mut lengths: Vec<f64> = runs
        .iter()
        .flat_map(|run| &run.spans)
        .map(|span| span.to_s - span.from_s)
        .collect();
    lengths.sort_by(f64::total_cmp);
    usual(&lengths)
}

/// - `lengths`: rising.
fn usual(lengths: &[f64]) -> f64 {
    let alike = |length: f64| {
        lengths
            .iter()
            .filter(move |other| (**other - length).abs() < ALIKE * length)
    };
    let most = lengths.iter().map(|length| alike(*length).count()).max().unwrap_or(0);
    let usual = lengths.iter().find(|length| 2 * alike(**length).count() >= most);
    let own: Vec<f64> = usual.map_or_else(Vec::new, |length| alike(*length).copied().collect());
    own.get(own.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_beside_a_small_name_are_asked_as_if_alone() {
        let wheels = Wheels {
            own: 900.0,
            calm: 200.0,
        };
        assert_eq!(least_share(&wheels, None), EXPLAINED);
        assert_eq!(least_share(&wheels, Some(1500.0)), EXPLAINED, "more is left");
        assert_eq!(least_share(&wheels, Some(1700.0)), BESIDE_OTHERS, "it may be a rest");
    }

    #[test]
    fn two_bursts_in_a_row_are_not_the_usual_length() {
        let lengths = [0.025, 0.05, 0.05, 0.052, 0.1, 0.1, 0.102, 0.1, 0.104, 0.3];
        assert!((usual(&lengths) - 0.05).abs() < 1e-12);
        assert_eq!(usual(&[]), 0.0);
    }
}
