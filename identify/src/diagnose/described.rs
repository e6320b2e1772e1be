//! Without references: which numbers of the description the runs contradict. All of them are calibrated on the runs at once, beside what is
//! named already, each believed as far as a description is; where that is not possible the effect is named.

use super::prepared::{Prepared, enough, prepare};
use super::taken::Taken;
use super::{Case, MOST_EFFECTS};
use crate::fit::{Member, Problem, fit, with_members};
use crate::floor::{Estimate, Floor, Said};
use crate::hypothesis::{Candidate, Hypothesis, Knob};
use crate::record::Stages;
use crate::screen::all_residuals;
use crate::select::{Energies, Finalist, Role, decrease, energies};
use crate::workers::{Cancelled, Workers};

/// So much likelier the runs must become when the description is not believed.
const CONTRADICTED: f64 = 16.0;
/// Practical sizes of the best value, and at least, with 95 % confidence.
const SIZE: f64 = 1.0;
const SURE_SIZE: f64 = 0.7;
const NORMAL_95: f64 = 1.645;
/// The same of training and of validation runs alone: 95 % of what chance gives.
const GAIN_OF_A_HALF: f64 = 3.84;
/// Share of the value that training and validation runs find alone, at least; a single run tells less.
const IN_EACH_HALF: f64 = 0.5;
const IN_A_RUN: f64 = 0.3;
/// An effect that gains this share of what another gains, and of whose gain only this share is left when that one is named, is another
/// name for it.
const AS_MUCH: f64 = 0.9;
const TAKEN_AWAY: f64 = 0.3;

/// What the runs said.
pub(super) struct Described {
    pub members: Vec<Member>,
    pub stages: Vec<Stages>,
    pub train: Prepared,
    pub validation: Prepared,
    /// What the members explain of the training runs.
    pub explained: Energies,
    /// Candidates that are in the calibration, positions.
    pub calibrated: Vec<usize>,
}

/// An effect whose sizes are knobs.
struct Group {
    /// Of the candidate.
    position: usize,
    knobs: Vec<usize>,
}

/// Calibrates the description on the open runs, names what it contradicts, and fits it together with the members.
pub(super) fn described(
    workers: &dyn Workers,
    case: &mut Case,
    members: &[Member],
    stages: &[Stages],
) -> Result<Option<Described>, Cancelled> {
    workers.progress("description", 0.8);
    let is_own = |knob: &Knob, members: &[Member]| {
        let of = |member: &Member| {
            let mut axes = member.candidate.axes.iter();
            axes.any(|axis| knob.is(&member.candidate, axis.name))
        };
        members.iter().any(of)
    };
    let without = |knobs: &[Knob], stages: &[Stages], members: &[Member]| -> (Vec<Knob>, Vec<Stages>) {
        let pairs = knobs.iter().cloned().zip(stages.iter().copied());
        pairs.filter(|(knob, _)| !is_own(knob, members)).unzip()
    };
    let (knobs, open_stages) = without(&case.floor.knobs, stages, members);
    let open = |role: Role| {
        let pairs = case.records.iter().zip(&case.roles);
        let own = pairs.filter(move |(_, own)| **own == role);
        own.map(|(record, _)| record.clone())
    };
    let given = with_members(&case.floor.given, members);
    let records = enough(open(Role::Train).chain(open(Role::Validation)).collect());
    let calibrated = Floor::calibrated(workers, given, knobs.clone(), &open_stages, records)?;
    let is_train: Vec<bool> = calibrated
        .references
        .iter()
        .map(|record| open(Role::Train).any(|own| own.name == record.name))
        .collect();
    let said = calibrated.said();
    let groups = groups(&case.candidates, &knobs);
    let choice = Choice {
        said: &said,
        is_train: &is_train,
        groups: &groups,
        candidates: &case.candidates,
        knobs: &knobs,
    };
    let room = MOST_EFFECTS.saturating_sub(members.len());
    let (taken, free) = choice.named(room);
    let estimate = said.estimate(0..said.len(), &free);
    let mut all = members.to_vec();
    all.extend(taken.iter().map(|taken| taken.finalist.member.clone()));
    let (left, left_stages) = without(&knobs, &open_stages, &all);
    let kept: Vec<usize> = (0..knobs.len()).filter(|k| !is_own(&knobs[*k], &all)).collect();
    let possible = kept.iter().zip(&left);
    let values: Vec<f64> = possible.map(|(k, knob)| knob.possible(estimate.values[*k])).collect();
    let mut floor = Floor::stated(case.floor.given.clone(), left).turned_to(values);
    floor.sigmas = kept.iter().map(|k| estimate.covariance.at(*k, *k).sqrt()).collect();
    let mut train = prepare(workers, &floor, open(Role::Train).collect(), &left_stages)?;
    let mut validation = prepare(workers, &floor, open(Role::Validation).collect(), &left_stages)?;
    let problem = Problem {
        records: &train.records,
        metric: &train.metric,
        bounds: &train.bounds,
        base: &floor.model,
        residuals: &train.residuals,
        wanted_gain: f64::NEG_INFINITY,
    };
    let Some(joint) = fit(&problem, all.clone()) else {
        return Ok(None);
    };
    let of = |residuals: &[Vec<f64>]| energies(&train.metric, &train.records, residuals);
    let explained = decrease(&of(&train.residuals), &of(&joint.residuals));
    let model: Hypothesis = with_members(&floor.model, &joint.members);
    if all_residuals(workers, &validation.records, &model)?
        .iter()
        .any(Option::is_none)
    {
        return Ok(None);
    }
    train.renew(workers, &floor, &model)?;
    validation.renew(workers, &floor, &model)?;
    case.taken.extend(taken);
    let tyres = core::mem::replace(&mut case.floor, floor).tyres();
    case.remarks.retain(|remark| Some(remark) != tyres.as_ref());
    case.remarks.extend(case.floor.tyres());
    Ok(Some(Described {
        members: joint.members,
        stages: left_stages,
        train,
        validation,
        explained,
        calibrated: groups.iter().map(|group| group.position).collect(),
    }))
}

fn groups(candidates: &[Candidate], knobs: &[Knob]) -> Vec<Group> {
    let of = |(position, candidate): (usize, &Candidate)| {
        let is_own = |k: &usize| candidate.axes.iter().any(|axis| knobs[*k].is(candidate, axis.name));
        let own: Vec<usize> = (0..knobs.len()).filter(is_own).collect();
        (!own.is_empty()).then_some(Group { position, knobs: own })
    };
    candidates.iter().enumerate().filter_map(of).collect()
}

struct Choice<'a> {
    said: &'a Said,
    /// Of every run that said something.
    is_train: &'a [bool],
    groups: &'a [Group],
    candidates: &'a [Candidate],
    knobs: &'a [Knob],
}

impl Choice<'_> {
    /// The effects that are named, best first, at most `room`, and their knobs.
    fn named(&self, room: usize) -> (Vec<Taken>, Vec<usize>) {
        let mut taken: Vec<Taken> = Vec::new();
        let mut free: Vec<usize> = Vec::new();
        let mut open: Vec<usize> = (0..self.groups.len()).collect();
        while taken.len() < room {
            let estimate = self.of_all(&free);
            let gain = |group: usize| self.said.gain(&estimate, &self.groups[group].knobs);
            open.sort_by(|a, b| gain(*b).total_cmp(&gain(*a)).then(a.cmp(b)));
            open.retain(|group| gain(*group) > CONTRADICTED);
            let found = open.iter().find_map(|group| {
                let finalist = self.finalist(*group, &free)?;
                Some((*group, finalist))
            });
            let Some((group, finalist)) = found else { break };
            let with = [&free[..], &self.groups[group].knobs].concat();
            let after = self.of_all(&with);
            let is_other_name = |other: &&usize| {
                **other != group
                    && gain(**other) > AS_MUCH * gain(group)
                    && self.said.gain(&after, &self.groups[**other].knobs) < TAKEN_AWAY * gain(**other)
            };
            let others = open.iter().filter(is_other_name);
            let alternatives = others.filter_map(|other| self.finalist(*other, &free)).collect();
            taken.push(Taken {
                finalist,
                alternatives,
                excluded: Vec::new(),
                threshold: CONTRADICTED,
                is_absorbed: false,
                corrects_beside: None,
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
            });
            free = with;
            open.retain(|other| *other != group);
        }
        (taken, free)
    }

    fn of_all(&self, free: &[usize]) -> Estimate {
        self.said.estimate(0..self.said.len(), free)
    }

    /// A group as a name beside others whose knobs are `free`; `None` when the runs do not bear it out.
    fn finalist(&self, group: usize, free: &[usize]) -> Option<Finalist> {
        let own = &self.groups[group].knobs;
        let candidate = &self.candidates[self.groups[group].position];
        let with = [free, own].concat();
        let estimate = self.of_all(&with);
        let size = |knob: usize| estimate.values[knob].abs();
        let largest = own.iter().copied().max_by(|a, b| size(*a).total_cmp(&size(*b)))?;
        let (value, sigma) = (
            estimate.values[largest],
            estimate.covariance.at(largest, largest).sqrt(),
        );
        if value.abs() < SIZE || value.abs() - NORMAL_95 * sigma < SURE_SIZE {
            return None;
        }
        let of = |runs: &mut dyn Iterator<Item = usize>, free: &[usize]| self.said.estimate(runs, free);
        let half = |train: bool| (0..self.said.len()).filter(move |run| self.is_train[*run] == train);
        let bears_out =
            |estimate: &Estimate, share: f64| estimate.values[largest] * value.signum() > share * value.abs();
        let halves = [true, false].map(|train| of(&mut half(train), &with));
        if !halves.iter().all(|half| bears_out(half, IN_EACH_HALF)) {
            return None;
        }
        let gains = [true, false].map(|train| {
            let believed = of(&mut half(train), free);
            self.said.gain(&believed, own)
        });
        if gains.iter().any(|gain| *gain < GAIN_OF_A_HALF) {
            return None;
        }
        let runs = 0..self.said.len();
        let agreeing = runs.filter(|run| bears_out(&of(&mut core::iter::once(*run), &with), IN_A_RUN));
        let stability = agreeing.count() as f64 / self.said.len() as f64;
        let values: Option<Vec<f64>> = candidate
            .axes
            .iter()
            .map(|axis| {
                let knob = own.iter().find(|knob| self.knobs[**knob].is(candidate, axis.name));
                let value = knob.map_or(axis.neutral, |knob| {
                    axis.neutral + axis.practical * estimate.values[*knob]
                });
                (axis.low..=axis.high).contains(&value).then_some(value)
            })
            .collect();
        let values = values?;
        Some(Finalist {
            position: self.groups[group].position,
            size: candidate.size(&values),
            sure_size: candidate.size(&values),
            member: Member {
                candidate: candidate.clone(),
                values,
            },
            gain_train: gains[0],
            weighed: gains[0],
            is_unshown: false,
            gain_validation: gains[1],
            change_validation: 0.0,
            in_references: 0.0,
            is_shown_by_references: false,
            stability,
            is_in_turn: false,
            is_but_one: false,
            harmful: 0.0,
            worse: None,
            because: None,
            cosine: 0.0,
            joint: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::{Excitation, candidates, knobs};
    use crate::linear::Square;
    use twin::golden::reference_robot;

    /// A robot of which four runs, the first two of them for training, tell some knobs well and the others not at all.
    struct Lab {
        candidates: Vec<Candidate>,
        knobs: Vec<Knob>,
    }

    const RUNS: usize = 4;
    /// Of a run on a knob, and of the description.
    const INFORMATION: f64 = 400.0;
    const TOLD: f64 = 8.0;

    impl Lab {
        fn new() -> Lab {
            let robot = reference_robot("diff2");
            let driven = Excitation {
                wheel_rad_per_s: 20.0,
                twist: [0.8, 0.0, 2.0],
                extent_m: [-1.0, 1.0, -1.0, 1.0],
            };
            let candidates = candidates(&robot, &driven);
            let knobs = knobs(&candidates, &robot);
            Lab { candidates, knobs }
        }

        fn knob(&self, name: &str) -> usize {
            let is_own = |knob: &Knob| matches!(knob, Knob::Parameter { name: own, .. } if *own == name);
            self.knobs.iter().position(is_own).unwrap_or(usize::MAX)
        }

        /// What is named when each run has its own value of some knobs.
        fn named(&self, values: &[(&str, [f64; RUNS])]) -> Vec<Taken> {
            let count = self.knobs.len();
            let run = |run: usize| {
                let (mut information, mut score) = (Square::zero(count), vec![0.0; count]);
                for (name, values) in values {
                    let knob = self.knob(name);
                    information.add(knob, knob, INFORMATION);
                    score[knob] = INFORMATION * values[run];
                }
                (information, score)
            };
            self.chosen((0..RUNS).map(run).collect())
        }

        fn chosen(&self, runs: Vec<(Square, Vec<f64>)>) -> Vec<Taken> {
            let said = Said::made(runs, vec![TOLD; self.knobs.len()]);
            let groups = groups(&self.candidates, &self.knobs);
            let choice = Choice {
                said: &said,
                is_train: &[true, true, false, false],
                groups: &groups,
                candidates: &self.candidates,
                knobs: &self.knobs,
            };
            choice.named(MOST_EFFECTS).0
        }
    }

    fn names(taken: &[Taken]) -> Vec<&'static str> {
        taken
            .iter()
            .map(|taken| taken.finalist.member.candidate.entry.name)
            .collect()
    }

    #[test]
    fn what_the_description_cannot_mean_is_named_and_what_it_can_is_not() {
        let lab = Lab::new();
        let found = lab.named(&[
            ("gyro_bias", [0.9; RUNS]),
            ("track_width", [-3.0, -3.1, -2.9, -3.0]),
            ("wheel_radius", [5.0; RUNS]),
        ]);
        assert_eq!(names(&found), ["wheel_radius", "track_width"]);
        let track = &found[1].finalist;
        assert!((track.size - 3.0).abs() < 0.05, "{}", track.size);
        assert!(track.member.values[0] < 0.0 && track.stability == 1.0);
        assert!(track.gain_train > CONTRADICTED && track.gain_validation > CONTRADICTED);
    }

    #[test]
    fn runs_that_do_not_agree_name_nothing() {
        let lab = Lab::new();
        assert_eq!(names(&lab.named(&[("track_width", [6.0, 6.0, 0.5, 0.5])])), [""; 0]);
        assert_eq!(names(&lab.named(&[("track_width", [6.0, 6.0, -3.0, -3.0])])), [""; 0]);
    }

    /// Validation runs that tell next to nothing may say anything.
    #[test]
    fn a_half_that_says_nothing_bears_nothing_out() {
        let lab = Lab::new();
        let knob = lab.knob("track_width");
        let run = |told: f64| {
            let (mut information, mut score) = (Square::zero(lab.knobs.len()), vec![0.0; lab.knobs.len()]);
            information.add(knob, knob, told);
            score[knob] = told * 4.0;
            (information, score)
        };
        let runs = |validation: f64| [INFORMATION, INFORMATION, validation, validation].map(run).to_vec();
        assert_eq!(names(&lab.chosen(runs(0.01))), [""; 0]);
        assert_eq!(names(&lab.chosen(runs(INFORMATION))), ["track_width"]);
    }

    /// A servo faster than none.
    #[test]
    fn what_no_effect_can_be_is_calibration() {
        let lab = Lab::new();
        assert_eq!(names(&lab.named(&[("motor_lag", [-4.0; RUNS])])), [""; 0]);
        assert_eq!(names(&lab.named(&[("motor_lag", [4.0; RUNS])])), ["motor_lag"]);
    }

    /// Runs that tell nothing but a sum of two knobs.
    #[test]
    fn what_runs_cannot_tell_apart_is_an_alternative() {
        let lab = Lab::new();
        let (one, other) = (lab.knob("wheel_radius"), lab.knob("pose_scale"));
        let run = || {
            let (mut information, mut score) = (Square::zero(lab.knobs.len()), vec![0.0; lab.knobs.len()]);
            for i in [one, other] {
                for j in [one, other] {
                    information.add(i, j, INFORMATION);
                }
                score[i] = INFORMATION * 4.0;
            }
            (information, score)
        };
        let found = lab.chosen((0..RUNS).map(|_| run()).collect());
        assert_eq!(found.len(), 1, "{:?}", names(&found));
        let finalist = &found[0].finalist;
        assert!((finalist.size - 4.0).abs() < 0.1, "{}", finalist.size);
        let alternatives = found[0].alternatives.iter();
        let alternatives: Vec<&str> = alternatives.map(|other| other.member.candidate.entry.name).collect();
        let both = [names(&found), alternatives].concat();
        assert!(
            both.contains(&"wheel_radius") && both.contains(&"pose_scale"),
            "{both:?}"
        );
    }
}
