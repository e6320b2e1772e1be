//! How far apart manoeuvres are expected to set models.

use super::manoeuvre::{CATALOGUE, TRIAL_S};
use super::trial::Trials;
use super::{Case, knob_stages};
use crate::fit::{Member, with_members};
use crate::hypothesis::LOST;
use crate::record::Stages;
use crate::workers::{Cancelled, Workers};

/// Standard deviations from which a run tells two models apart.
const SURE_SIGMAS: f64 = 5.0;
/// So often an experiment of the catalogue is to be driven.
pub(super) const REPEAT: u32 = 3;

/// What a manoeuvre is expected to tell.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Apart<'a> {
    /// Position in the catalogue.
    pub number: usize,
    /// Names that it tells from the model.
    pub told: Vec<&'a str>,
    /// The name that it sets furthest apart.
    pub furthest: &'a str,
    /// Of the nearest of those that it tells; where there is none of the furthest.
    pub sigmas: f64,
    /// No manoeuvre tells anything, not even as long and as often as the catalogue has it.
    pub is_vain: bool,
}

impl Apart<'_> {
    /// - `whom`: what it sets apart, in words.
    pub fn words(&self, whom: &str) -> String {
        let figure = |sigmas: f64| format!("{sigmas:.0$}", usize::from(sigmas < 10.0));
        let all_s = whole_s(self.number);
        let words = format!(
            "{TRIAL_S:.0} s of it would set {whom} {} standard deviations apart",
            figure(self.sigmas)
        );
        match self.told.is_empty() {
            true => format!(
                "{words}, all {all_s:.0} s at most {}",
                figure(whole(self.number, self.sigmas))
            ),
            false => words,
        }
    }
}

/// How long a manoeuvre is to be driven in all, s.
fn whole_s(number: usize) -> f64 {
    f64::from(REPEAT) * CATALOGUE[number].duration_s
}

/// What all of a manoeuvre tells if a trial tells so much: as much as if nothing but noise were in the way.
fn whole(number: usize, sigmas: f64) -> f64 {
    sigmas * libm::sqrt((whole_s(number) / TRIAL_S).max(1.0))
}

/// The manoeuvre that sets a model furthest apart from others, all driven by the twin from the middle of where the open runs were.
///
/// - `own`: what the model has beyond the floor's.
/// - `others`: the same of the others, with a name each; of several with one name it is told when all are.
/// - Returns `None` where nothing can be simulated, or set-points were lost.
pub(super) fn furthest<'a>(
    workers: &dyn Workers,
    case: &Case,
    own: &[Member],
    others: &[(&'a str, Vec<Member>)],
) -> Result<Option<Apart<'a>>, Cancelled> {
    let is_lost = |members: &[Member]| members.iter().any(|member| member.candidate.entry.name == LOST);
    if others.is_empty() || is_lost(own) || others.iter().any(|(_, members)| is_lost(members)) {
        return Ok(None);
    }
    workers.progress("next experiment", 0.95);
    let base = with_members(&case.floor.model, own);
    let knobs = case.floor.knobs.iter();
    let stages: Vec<Stages> = knobs.map(|knob| knob_stages(knob, &case.candidates)).collect();
    let most = |run: &&super::Run| run.bundle.telemetry.channels.len();
    let Some(like) = case.input.runs.iter().rev().max_by_key(most) else {
        return Ok(None);
    };
    let driven = (&like.bundle, &case.records[..]);
    let Some(trials) = Trials::of(workers, &case.floor, driven, &base, &stages)? else {
        return Ok(None);
    };
    let mut sigmas = Vec::with_capacity(others.len());
    for (name, members) in others {
        let model = with_members(&case.floor.model, members);
        sigmas.push((*name, trials.sigmas(workers, &model)?));
    }
    Ok(best(&sigmas))
}

/// The manoeuvre that tells most names, and sets these furthest apart.
///
/// - `sigmas`: for each other model its name and, by manoeuvre, how far apart it is.
fn best<'a>(sigmas: &[(&'a str, Vec<Option<f64>>)]) -> Option<Apart<'a>> {
    let of = |number: usize| -> Option<Vec<(&'a str, f64)>> {
        let mut names: Vec<(&str, f64)> = Vec::new();
        for (name, sigmas) in sigmas {
            let own = sigmas[number]?;
            match names.iter_mut().find(|(other, _)| other == name) {
                Some((_, least)) => *least = least.min(own),
                None => names.push((name, own)),
            }
        }
        Some(names)
    };
    let known: Vec<(usize, Vec<(&str, f64)>)> = (0..CATALOGUE.len()).filter_map(|k| Some((k, of(k)?))).collect();
    let is_vain = known
        .iter()
        .all(|(k, names)| names.iter().all(|(_, own)| whole(*k, *own) < SURE_SIGMAS));
    let all = known.into_iter().filter_map(|(number, names)| {
        let told: Vec<(&str, f64)> = names.iter().copied().filter(|(_, own)| *own >= SURE_SIGMAS).collect();
        let (furthest, most) = names.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let least = told.iter().map(|(_, own)| *own).fold(f64::INFINITY, f64::min);
        Some(Apart {
            number,
            furthest,
            sigmas: if told.is_empty() { most } else { least },
            told: told.into_iter().map(|(name, _)| name).collect(),
            is_vain,
        })
    });
    all.max_by(|a, b| {
        let by_count = a.told.len().cmp(&b.told.len());
        // Of equal ones the first of the catalogue.
        by_count
            .then(a.sigmas.total_cmp(&b.sigmas))
            .then(b.number.cmp(&a.number))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sigmas that are `least` but for some manoeuvres.
    fn sigmas(least: f64, others: &[(usize, f64)]) -> Vec<Option<f64>> {
        let mut all = vec![Some(least); CATALOGUE.len()];
        others.iter().for_each(|(number, own)| all[*number] = Some(*own));
        all
    }

    #[test]
    fn more_names_told_come_before_one_that_is_far_apart() {
        let one = ("gyro_scale", sigmas(0.0, &[(3, 90.0), (6, 7.0)]));
        let other = ("track_width", sigmas(0.0, &[(6, 6.0)]));
        let apart = best(&[one.clone(), other]).expect("something is known");
        assert_eq!(
            (apart.number, &apart.told[..], apart.sigmas),
            (6, &["gyro_scale", "track_width"][..], 6.0)
        );
        assert_eq!(
            apart.words("them"),
            "12 s of it would set them 6.0 standard deviations apart"
        );
        let apart = best(&[one]).expect("something is known");
        assert_eq!((apart.number, apart.sigmas, apart.is_vain), (3, 90.0, false));
    }

    /// Of a name on several wheels it is told when all of them are.
    #[test]
    fn a_name_is_told_when_every_wheel_of_it_is() {
        let wheels = [
            ("weak_motor", sigmas(0.0, &[(1, 20.0), (2, 8.0)])),
            ("weak_motor", sigmas(0.0, &[(2, 6.0)])),
        ];
        let apart = best(&wheels).expect("something is known");
        assert_eq!(
            (apart.number, &apart.told[..], apart.sigmas),
            (2, &["weak_motor"][..], 6.0)
        );
    }

    /// What is just not told in 12 s may be in three times 20 s, and what is far from it is not.
    #[test]
    fn nothing_is_vain_that_the_whole_experiment_may_tell() {
        let nearly = best(&[("encoder_scale", sigmas(0.1, &[(8, 3.0)]))]).expect("something is known");
        assert!(nearly.told.is_empty() && !nearly.is_vain && nearly.number == 8 && nearly.furthest == "encoder_scale");
        assert_eq!(
            nearly.words("them"),
            "12 s of it would set them 3.0 standard deviations apart, all 60 s at most 6.7"
        );
        let never = best(&[("encoder_scale", sigmas(0.1, &[(8, 1.0)]))]).expect("something is known");
        assert!(never.is_vain);
        let unknown = vec![None; CATALOGUE.len()];
        assert_eq!(best(&[("encoder_scale", unknown)]), None);
    }
}
