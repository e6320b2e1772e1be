//! S5 among obstacles: adversarial runs between discs and rectangles that stand, and robots of no run that are pushed about.

use crate::attack::{Attack, Outcome};
use crate::fan::{fan, progress};
use crate::furniture::furniture;
use crate::table::{self, Row};
use crate::walkers::Walkers;
use anyhow::{Context, Result};
use emulator::noise::Noise;

const RUN_S: f64 = 10.0;
/// Numbers of these runs, away from those of the other drills.
const FIRST_ATTACK: u64 = 5_000_000;
/// Robots, obstacles and walkers of a run, at most.
const ROBOTS: u64 = 6;
const OBSTACLES: u64 = 6;
const WALKERS: u64 = 2;
const MOVED_M_PER_S: f64 = 0.05;
/// Runs that come as close as this are told on standard error.
const NOTED_M: f64 = 0.01;

/// Attack of a number: 1 to 6 robots in turn among 1 to 6 obstacles; in every second run one or two walkers as well.
pub fn attack(seed: u64, number: u64) -> Attack {
    let robots = 1 + number % ROBOTS;
    let mut attack = Attack::random(seed, FIRST_ATTACK + number, robots as usize, RUN_S);
    let mut random = Noise::new(seed, 0x0B57_AC1E ^ (number << 24));
    let starts = attack.starts();
    let count = 1 + (random.uniform() * OBSTACLES as f64) as usize;
    attack.furniture = furniture(&mut random, &starts, count);
    if number / ROBOTS % 2 == 1 {
        let count = 1 + (random.uniform() * WALKERS as f64) as usize;
        attack.walkers = Walkers::new(&mut random, &starts, count);
    }
    attack
}

/// Runs `count` attacks, numbers from `first`.
///
/// - Errors: a run that cannot be set up.
pub fn run(first: u64, count: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let one = |k: u64| {
        let number = first + k;
        let outcome = attack(seed, number).run().with_context(|| format!("run {number}"))?;
        if outcome.least_m().min(outcome.strangers_m) < NOTED_M {
            eprintln!("run {number}: {outcome:?}");
        }
        Ok(outcome)
    };
    let outcomes = fan(count, threads, one, progress("obstacles", 100, count))?;
    Ok(rows(&outcomes, first, seed))
}

fn rows(outcomes: &[Outcome], first: u64, seed: u64) -> Vec<Row> {
    let count = outcomes.len() as u64;
    let row = table::rows_of("S5", count, seed);
    let least = |what: &str, of: fn(&Outcome) -> f64| {
        let numbered = outcomes.iter().map(of).zip(first..);
        let (least_m, at) = numbered.fold(
            (f64::INFINITY, first),
            |least, one| if one.0 < least.0 { one } else { least },
        );
        let touches = outcomes.iter().filter(|outcome| of(outcome) < 0.0).count();
        let met = outcomes.iter().filter(|outcome| of(outcome).is_finite()).count();
        let figure = format!("{touches} of {met} touch; {:.1} mm, run {at}", 1e3 * least_m);
        row(what, figure, "0 touch", touches == 0 && (met > 0 || count < 2 * ROBOTS))
    };
    let close = outcomes.iter().filter(|outcome| outcome.obstacles_m < 0.1).count();
    let moved = outcomes
        .iter()
        .filter(|outcome| outcome.fastest_m_per_s > MOVED_M_PER_S)
        .count();
    let ended = outcomes.iter().filter(|outcome| outcome.ended).count();
    vec![
        least("least distance to fixed obstacles", |outcome| outcome.obstacles_m),
        least("least distance to walkers, who stop before robots", |outcome| {
            outcome.strangers_m
        }),
        least("least distance between robots", |outcome| outcome.robots_m),
        least("least distance to walls", |outcome| outcome.walls_m),
        row(
            "runs that came within 100 mm of a fixed obstacle",
            close.to_string(),
            "a third",
            close as f64 >= count as f64 / 3.0,
        ),
        row(
            "runs that moved / that ended early",
            format!("{moved} / {ended}"),
            "90 % move",
            moved as f64 >= 0.9 * count as f64,
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_four_hostile_runs_among_obstacles_touch_nothing() {
        assert!(table::print(&run(0, 24, 1, 2).expect("runs")));
    }

    /// Two robots without a solution in this run: the one ahead braked harder than the one behind it, which turned, and was touched.
    #[test]
    fn robots_that_slow_down_together_do_not_run_into_each_other() {
        assert!(table::print(&run(2_421, 1, 1, 1).expect("runs")));
    }

    #[test]
    fn obstacles_and_walkers_are_clear_of_where_robots_start() {
        let (mut obstacles, mut walking) = (0, 0);
        for number in 0..240 {
            let mut attack = attack(1, number);
            let starts = attack.starts();
            for start in &starts {
                for obstacle in &attack.furniture {
                    assert!(crate::rig::outside_m(obstacle, [start[0], start[1]]) > 0.25);
                }
            }
            let walkers = attack.walkers.step(&starts, 0.25);
            for (_, [x, y, _]) in &walkers {
                assert!(starts.iter().all(|start| (start[0] - x).hypot(start[1] - y) > 0.6));
            }
            obstacles += attack.furniture.len();
            walking += walkers.len();
        }
        assert!(obstacles > 600 && walking > 120, "{obstacles} {walking}");
    }
}
