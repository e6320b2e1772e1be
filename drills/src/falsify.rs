//! S5, the search: CMA-ES over starts, wishes, fault times, delays, losses, errors and the plant, for the smallest distance.

use crate::attack::{Attack, Outcome};
use crate::evolution::minimise;
use crate::fan::fan;
use crate::table::Row;
use anyhow::Result;

const RUN_S: f64 = 6.0;
/// Searches with so many robots, one after the other; chassis and the first point are drawn.
const TEAMS: [usize; 5] = [1, 2, 3, 2, 5];

/// Shares `evaluations` among the teams.
///
/// - Errors: a run that cannot be set up.
pub fn run(evaluations: u64, seed: u64, threads: usize) -> Result<Vec<Row>> {
    let each = evaluations.div_ceil(TEAMS.len() as u64);
    let mut rows = Vec::with_capacity(TEAMS.len());
    for (number, robots) in TEAMS.into_iter().enumerate() {
        let first = Attack::random(seed, 1_000_000 + number as u64, robots, RUN_S);
        let mut done = 0;
        let mut moved = 0_u64;
        let (best, least_m) = minimise(first.genes.clone(), each, seed + number as u64, |points| {
            let one = |k: u64| {
                let genes = points.get(k as usize).cloned().unwrap_or_default();
                Attack { genes, ..first.clone() }.run()
            };
            let outcomes = fan(points.len() as u64, threads, one, |_| {})?;
            done += outcomes.len();
            moved += outcomes.iter().filter(|outcome| outcome.fastest_m_per_s > 0.05).count() as u64;
            if done % 500 < outcomes.len() {
                eprintln!("falsify, {robots} robots: {done} of {each}");
            }
            Ok(outcomes.iter().map(Outcome::least_m).collect())
        })?;
        if least_m < 0.0 {
            eprintln!("{:?} seed {}: {best:?}", first.chassis, first.seed);
        }
        rows.push(Row {
            name: "S5",
            what: format!("search: {}", first.chassis.join(", ")),
            count: done as u64,
            seed: seed + number as u64,
            figure: format!("{:.1} mm, {moved} moved", 1e3 * least_m),
            asked: "> 0".to_owned(),
            holds: least_m > 0.0 && moved * 10 >= done as u64 * 9,
        });
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table;

    #[test]
    fn a_short_search_finds_no_collision() {
        assert!(table::print(&run(25, 1, 2).expect("a search")));
    }
}
