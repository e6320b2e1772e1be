//! What a diagnosis comes to, before unused runs are asked.

use super::energy::Energies;
use super::louder::{Louder, all_louder, louder, share_left};
use super::nearest::unchecked;
use super::opening::ALIKE;
use super::taken::Taken;
use super::{Case, Levels};
use crate::record::CHANNELS;
use crate::report::schema::Verdict;
use crate::select::Role;

/// Validation and unused runs without which nothing is confirmed.
pub(super) const FEWEST_RUNS: usize = 2;
/// Excess that remains, as a share of the excess before, that still counts as explained.
const REST: f64 = 0.3;
/// Names that leave more are no explanation, unless they are proven by themselves ([`Taken::is_proven`]).
const NEXT_TO_NOTHING: f64 = 0.8;
/// Nor are those that leave half of it with residuals of ten times the limit: that twin and these runs have little to do with each other.
const HALF: f64 = 0.5;
const FAR: f64 = 100.0;

pub(super) fn verdict(case: &Case) -> Verdict {
    let levels = &case.levels;
    let all = &case.energies.all;
    // Without references the description was calibrated on these runs, and what that leaves counts; of losses that are no news, what they leave,
    // as of names.
    let real = if !case.arrived.is_empty() {
        left_louder(levels).is_some() || all.after > all.limit && all.left() > REST
    } else if case.floor.references.is_empty() {
        all.after > all.limit || louder(&levels.after).is_some()
    } else {
        let is_disagreement = |pair: &(&str, String)| pair.1 != ALIKE;
        let is_open = unchecked(case).is_some() || case.withdrawn.iter().any(is_disagreement);
        let (energies, levels) = &case.unnamed;
        is_open || energies.all.before > energies.all.limit || louder(levels).is_some()
    };
    let naming: Vec<&Taken> = case.taken.iter().filter(|taken| !taken.is_absorbed).collect();
    if naming.is_empty() {
        return if real {
            Verdict::Unexplained
        } else {
            Verdict::NoDiscrepancy
        };
    }
    let remains = all.after > all.limit && all.left() > REST;
    let is_proven = || naming.iter().all(|taken| taken.is_proven());
    if is_far_off(&case.energies) || is_hardly_explained(&case.energies) && !is_proven() {
        return Verdict::Unexplained;
    }
    let remains = remains || left_louder(levels).is_some();
    if naming.iter().any(|taken| taken.suspected.is_some()) {
        return Verdict::Partial;
    }
    if naming.iter().any(|taken| !taken.other_names().is_empty()) {
        return Verdict::Ambiguous;
    }
    // Without references an effect may be an error of the description itself.
    let is_sure = naming.iter().all(|taken| taken.is_sure(&case.floor));
    if remains || !is_sure || !validated(case) || case.locked.len() < FEWEST_RUNS || case.floor.noise.is_prior {
        return Verdict::Partial;
    }
    Verdict::Confirmed
}

/// Nearly all is left of what runs are off by. A few loud windows are a disagreement of their own, and no reason to disbelieve a name after which the others
/// are like the references.
pub(super) fn is_hardly_explained(Energies { all, quiet }: &Energies) -> bool {
    all.after > all.limit && all.left() > NEXT_TO_NOTHING && quiet.after > quiet.limit
}

/// Half is left, and twin and these runs have little to do with each other.
fn is_far_off(Energies { all, quiet }: &Energies) -> bool {
    all.after > FAR * all.limit && all.left() > HALF && quiet.after > quiet.limit
}

/// The channel that is louder than in the references most clearly with what is named, if much is left of what it was before.
fn left_louder(levels: &Levels) -> Option<Louder> {
    louder(&levels.after).filter(|louder| is_left(levels, louder))
}

/// The same of one channel.
pub(super) fn left_louder_on(levels: &Levels, channel: &str) -> Option<Louder> {
    let mut all = all_louder(&levels.after).into_iter();
    all.find(|louder| CHANNELS[louder.class] == channel && is_left(levels, louder))
}

fn is_left(levels: &Levels, louder: &Louder) -> bool {
    share_left(&levels.before, &levels.after, louder.class) > REST
}

/// There are validation runs enough to confirm a name.
pub(super) fn validated(case: &Case) -> bool {
    case.roles.iter().filter(|role| **role == Role::Validation).count() >= FEWEST_RUNS
}

#[cfg(test)]
mod tests {
    use super::super::energy::Energy;
    use super::super::louder::{Compared, RunLevel};
    use super::*;
    use crate::record::CLASSES;

    /// Wheels that were 400 times as loud as in the references, while currents are louder still.
    #[test]
    fn wheels_are_left_louder_whatever_else_is() {
        let runs = |wheel: f64, current: f64| {
            let mut log_energy = [Some(0.0); CLASSES];
            (log_energy[0], log_energy[2]) = (Some(wheel), Some(current));
            vec![RunLevel::sample(log_energy); 3]
        };
        let compared = |wheel: f64, current: f64| Compared {
            references: runs(0.0, 0.0),
            runs: runs(wheel, current),
        };
        let left = |wheel: f64| {
            let levels = Levels {
                before: compared(6.0, 8.0),
                after: compared(wheel, 7.9),
            };
            left_louder_on(&levels, "wheel").is_some()
        };
        assert!(left(5.5), "six tenths are left");
        assert!(!left(4.0), "a seventh is left");
        assert!(!left(0.1), "as loud as in the references");
    }

    #[test]
    fn little_is_explained_when_loud_and_quiet_windows_are_left_as_they_were() {
        let energy = |before: f64, after: f64| Energy {
            before,
            after,
            floor: 1.0,
            limit: 2.0,
        };
        let hardly = |all: Energy, quiet: Energy| is_hardly_explained(&Energies { all, quiet });
        assert!(hardly(energy(20.0, 18.0), energy(10.0, 9.0)));
        assert!(!hardly(energy(20.0, 12.0), energy(10.0, 9.0)), "two fifths are gone");
        let far = |all: Energy, quiet: Energy| is_far_off(&Energies { all, quiet });
        assert!(
            far(energy(600.0, 350.0), energy(90.0, 60.0)),
            "beyond what any effect is"
        );
        assert!(!far(energy(600.0, 250.0), energy(90.0, 60.0)), "most is explained");
        assert!(!far(energy(300.0, 190.0), energy(90.0, 60.0)));
        assert!(
            !hardly(energy(20.0, 18.0), energy(10.0, 1.5)),
            "a few loud windows are left"
        );
        assert!(!hardly(energy(1.8, 1.7), energy(1.8, 1.7)), "no gap");
    }
}
