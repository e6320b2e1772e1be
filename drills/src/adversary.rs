//! S5 and S7: sampled adversarial runs on the emulated plant.

use crate::attack::{Attack, Outcome};
use crate::fan::{fan, progress};
use crate::table::{self, Row};
use anyhow::{Context, Result};

/// Seconds of a run.
const RUN_S: f64 = 10.0;
/// A run in which nobody was faster moved nothing.
const MOVED_M_PER_S: f64 = 0.05;
/// Runs that come as close as this are told on standard error.
const NOTED_M: f64 = 0.01;
/// Words of the law in ten runs, of 1 to 10 robots.
pub const WORDS_PER_TEN_RUNS: u64 = 55 * 1200;

/// What a drill looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// S5: each other, and walls.
    Anything,
    /// S7: walls.
    Walls,
    /// S13: as `Anything`, by a law that lies.
    Lies,
}

impl Aim {
    fn name(self) -> &'static str {
        match self {
            Self::Anything => "S5",
            Self::Walls => "S7",
            Self::Lies => "S13",
        }
    }
}

/// Attack of a number: 1 to 10 robots in turn.
pub fn attack(aim: Aim, seed: u64, number: u64) -> Attack {
    let robots = 1 + (number % 10) as usize;
    let mut attack = Attack::random(seed, number, robots, RUN_S);
    attack.walls_only = aim == Aim::Walls;
    attack.liar = aim == Aim::Lies;
    attack
}

/// Runs `count` attacks with 1 to 10 robots in turn, numbers from `first`.
///
/// - Errors: a run that cannot be set up.
pub fn run(aim: Aim, first: u64, count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let attack = |number: u64| attack(aim, seed, number);
    let one = |k: u64| {
        let number = first + k;
        let outcome = attack(number).run().with_context(|| format!("run {number}"))?;
        if outcome.least_m() < NOTED_M {
            eprintln!("run {number}: {outcome:?} {:?}", attack(number));
        }
        Ok(outcome)
    };
    let outcomes = fan(count, threads, one, progress("adversary", 500, count))?;
    let least = |of: fn(&Outcome) -> f64| {
        let pairs = outcomes
            .iter()
            .enumerate()
            .map(|(k, outcome)| (of(outcome), first + k as u64));
        pairs.fold(
            (f64::INFINITY, 0),
            |least, one| if one.0 < least.0 { one } else { least },
        )
    };
    let (robots_m, robots_at) = least(|outcome| outcome.robots_m);
    let (walls_m, walls_at) = least(|outcome| outcome.walls_m);
    let hits = outcomes.iter().filter(|outcome| outcome.least_m() < 0.0).count();
    let moved = outcomes
        .iter()
        .filter(|outcome| outcome.fastest_m_per_s > MOVED_M_PER_S)
        .count();
    let ended = outcomes.iter().filter(|outcome| outcome.ended).count();
    let row = table::rows_of(aim.name(), count, seed);
    let mm = |(m, at): (f64, u64)| {
        if m.is_finite() {
            format!("{:.1} mm, run {at}", 1e3 * m)
        } else {
            "nobody".to_owned()
        }
    };
    let mut rows = vec![
        row("runs with a collision", hits.to_string(), "0", hits == 0),
        row("least distance to walls", mm((walls_m, walls_at)), "> 0", walls_m > 0.0),
        row(
            "least distance between robots",
            mm((robots_m, robots_at)),
            "> 0",
            robots_m > 0.0,
        ),
    ];
    let moving = moved as f64 >= 0.9 * outcomes.len() as f64;
    rows.push(row(
        "runs that moved / that ended early",
        format!("{moved} / {ended}"),
        "90 % move",
        moving,
    ));
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_hostile_runs_collide_with_nothing() {
        assert!(table::print(&run(Aim::Anything, 0, 20, 1, 2).expect("runs")));
    }

    /// Robot 7 of this run hears nothing for half a second, switches itself off and is still heard: another robot counted on the room
    /// that it was told to make, and touched it.
    #[test]
    fn nobody_counts_on_a_robot_that_switched_itself_off() {
        let outcome = attack(Aim::Anything, 1, 16_076).run().expect("a run");
        assert!(outcome.ended && outcome.least_m() > NOTED_M, "{outcome:?}");
    }

    #[test]
    fn garbage_from_the_law_collides_with_nothing() {
        assert!(table::print(&run(Aim::Lies, 0, 10, 1, 2).expect("runs")));
    }

    #[test]
    fn robots_that_drive_at_walls_stay_inside() {
        assert!(table::print(&run(Aim::Walls, 0, 20, 1, 2).expect("runs")));
    }
}
