//! Sets: what each number of the bench is, and its runs.

use crate::background::{background, robot};
use crate::change::Change;
use crate::drawn_robot::{described, drawn_robot};
use crate::drive::{RunStart, Trace, drive};
use crate::effects::{Truth, applicable, apply, draw, wants_stiff_gears};
use crate::fit::best;
use crate::kind::{Kind, chassis, effect_name};
use crate::manoeuvre::{Style, Task, plan};
use crate::oracle::{Pair, Visible, visible};
use crate::sensing::Sensing;
use crate::telemetry::Texts;
use crate::unknown;
use anyhow::{Result, anyhow};
use emulator::noise::Noise;
use emulator::plant::Pose;
use identify::diagnose::Run;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use twin::robot::{Robot, RobotDescription};

/// What is asked of every set.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wish {
    pub kind: Option<Kind>,
    pub chassis: Option<String>,
    pub effect: Option<String>,
    /// Of a run; fewer show less.
    pub seconds: u32,
    pub references: usize,
    pub runs: usize,
    pub robots: Robots,
}

/// Whose runs they are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Robots {
    /// Drawn for every set
    #[default]
    Drawn,
    /// The reference robot of every chassis
    Reference,
}

impl Wish {
    /// About 20 s a run, four references and six runs.
    pub fn standard() -> Wish {
        Wish {
            seconds: 20,
            references: 4,
            runs: 6,
            ..Wish::default()
        }
    }

    /// Of words `KIND`, `KIND:EFFECT` or `KIND:EFFECT:RUNS`, as programs that look at single sets take them.
    pub fn named(text: &str) -> Result<Wish> {
        let mut words = text.split(':');
        let kind = words.next().unwrap_or_default();
        let effect = words.next().filter(|effect| !effect.is_empty());
        let standard = Wish::standard();
        let runs = words.next().map_or(Ok(standard.runs), runs_of_a_set);
        let runs = runs.map_err(|problem| anyhow!("{text}: {problem}, as in single:payload:8"))?;
        if words.next().is_some() {
            return Err(anyhow!("{text}: KIND:EFFECT:RUNS, as in single:payload:8"));
        }
        let kind = <Kind as clap::ValueEnum>::from_str(kind, true).map_err(|error| anyhow!("kind {kind}: {error}"))?;
        Ok(Wish {
            kind: Some(kind),
            effect: effect.map(str::to_owned),
            runs,
            ..standard
        })
    }
}

/// One set before it is driven.
#[derive(Debug, Clone)]
pub struct Set {
    pub number: u64,
    pub seed: u64,
    pub kind: Kind,
    pub chassis: String,
    pub robot: RobotDescription,
    /// The same as run bundles describe it.
    described: RobotDescription,
    pub truths: Vec<Truth>,
    pub unknown: Option<String>,
    pub wish: Wish,
    /// Where run bundles are left as files.
    pub keep: Option<PathBuf>,
    /// The same robot in the plant's words.
    plant: api::robot::RobotDescription,
    base: Change,
    changed: Change,
}

/// An effect as the plant has it, with what its oracle says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Known {
    pub drawn: Truth,
    /// As the library describes it best.
    pub best: Truth,
    pub visible: Visible,
    pub detectable: bool,
    /// Share of the change that the library's law explains with the best parameters.
    pub described: f64,
}

/// Runs of a set and what the plant knows of them.
pub struct Driven {
    pub references: Vec<Run>,
    pub runs: Vec<Run>,
    pub known: Vec<Known>,
    /// How far an unknown effect shows.
    pub unknown: Option<Visible>,
    /// The first changed run, noise-free.
    pub trace: Trace,
}

/// Runs that the oracle looks at.
const ORACLE_RUNS: usize = 2;
/// Most runs of a set: more would be those of another day.
const MOST_RUNS: usize = 100;

/// A number of runs or of references.
///
/// - Errors: none, or one that no set has, in words.
pub fn runs_of_a_set(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(runs) if (ORACLE_RUNS..=MOST_RUNS).contains(&runs) => Ok(runs),
        _ => Err(format!(
            "a set has {ORACLE_RUNS} to {MOST_RUNS} runs, and as many references"
        )),
    }
}

/// splitmix64 (Steele, Lea, Flood 2014).
fn mixed(seed: u64, number: u64) -> u64 {
    let mut z = seed.wrapping_add(number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Set {
    /// A set by its number; the same for ever.
    ///
    /// - Errors: a chassis or an effect that does not exist, or not together.
    pub fn new(seed: u64, number: u64, wish: &Wish) -> Result<Set> {
        let (kind, ordinal) = Kind::of(wish.kind, number);
        let set_seed = mixed(seed, number);
        let mut noise = Noise::new(set_seed, 11);
        let name = effect_name(kind, seed, ordinal, wish)?;
        let chassis = chassis(name, wish, &mut noise)?;
        let stiff = name.is_some_and(wants_stiff_gears);
        let mut drawn = Noise::new(set_seed, 12);
        let robot = match wish.robots {
            Robots::Drawn => drawn_robot(&chassis, stiff, &mut drawn),
            Robots::Reference => robot(&chassis, stiff),
        };
        let described = match wish.robots {
            Robots::Drawn => described(&robot, &mut drawn),
            Robots::Reference => robot.clone(),
        };
        let base = background(set_seed, &robot);
        let mut changed = base.clone();
        let mut unknown_name = None;
        let mut truths = Vec::new();
        if let Some(name) = name {
            truths.push(draw(name, &robot, &mut noise));
        }
        let more = match kind {
            Kind::Pair | Kind::Rounds => 1,
            Kind::Many => 3 + (3.0 * noise.uniform()) as usize,
            _ => 0,
        };
        while truths.len() < more + usize::from(name.is_some()) {
            let entries = applicable(&robot);
            let other = entries[((noise.uniform() * entries.len() as f64) as usize).min(entries.len() - 1)];
            let taken = truths.iter().any(|truth| truth.name == other.name);
            if !taken && !wants_stiff_gears(other.name) {
                truths.push(draw(other.name, &robot, &mut noise));
            }
        }
        for truth in &truths {
            apply(&mut changed, truth, &robot);
        }
        if kind == Kind::Unknown {
            let names = unknown::names(&robot);
            let name = names[(ordinal % names.len() as u64) as usize];
            unknown::apply(name, &mut changed, &robot, &mut noise);
            unknown_name = Some(name.to_owned());
        }
        Ok(Set {
            number,
            seed: set_seed,
            kind,
            chassis,
            plant: serde_json::from_value(serde_json::to_value(&robot)?)?,
            robot,
            described,
            truths,
            unknown: unknown_name,
            wish: wish.clone(),
            keep: None,
            base,
            changed,
        })
    }

    /// Numbers of references and runs.
    fn counts(&self) -> (usize, usize) {
        let (references, runs) = (self.wish.references, self.wish.runs);
        match self.kind {
            Kind::Many => (0, references.min(2) + runs),
            Kind::Halves => (2 * references.min(3), 2 * runs),
            _ => (references, runs),
        }
    }

    /// Drives everything and asks the plant.
    ///
    /// - `day`: other runs of the same set.
    /// - Errors: what the plant or the reader refuses.
    pub fn driven(&self, day: u64) -> Result<Driven> {
        let robot = Robot::new(self.robot.clone()).map_err(|problem| anyhow!("{}", problem.message))?;
        let (count_references, count_runs) = self.counts();
        let (mut references, mut runs, mut traces) = (Vec::new(), Vec::new(), Vec::new());
        for number in 0..count_references {
            let seed = self.run_seed(day, number as u64, true);
            let trace = self.run(&robot, &self.base, seed, true, None)?;
            let path = format!("reference-{day}-{number}");
            references.push(self.measured(&path, &trace, &self.base.sensing, seed, true)?);
        }
        for number in 0..count_runs {
            let seed = self.run_seed(day, number as u64, false);
            let trace = self.run(&robot, &self.changed, seed, false, None)?;
            let path = format!("run-{day}-{number}");
            runs.push(self.measured(&path, &trace, &self.changed.sensing, seed, false)?);
            if number < ORACLE_RUNS {
                traces.push((seed, trace));
            }
        }
        let mut known = Vec::new();
        for position in 0..self.truths.len() {
            known.push(self.ask(&robot, position, &traces)?);
        }
        let mut unknown = None;
        if self.unknown.is_some() {
            unknown = Some(self.compared(&robot, &self.base, &traces, None)?.0);
        }
        Ok(Driven {
            references,
            runs,
            known,
            unknown,
            trace: traces.into_iter().next().map(|(_, trace)| trace).unwrap_or_default(),
        })
    }

    fn measured(&self, path: &str, trace: &Trace, sensing: &Sensing, seed: u64, reference: bool) -> Result<Run> {
        let texts = Texts::new(&self.described, &self.robot, trace, sensing, seed, reference)?;
        if let Some(folder) = &self.keep {
            texts.write(&folder.join(path))?;
        }
        texts.read(path)
    }

    fn run_seed(&self, day: u64, number: u64, reference: bool) -> u64 {
        mixed(self.seed, 1000 * (day + 1) + 2 * number + u64::from(reference))
    }

    /// One run; `replayed` are set-points of another one.
    fn run(
        &self,
        robot: &Robot,
        change: &Change,
        seed: u64,
        reference: bool,
        replayed: Option<&Trace>,
    ) -> Result<Trace> {
        let mut noise = Noise::new(seed, 5);
        let pose = Pose {
            x_m: 0.6 * (noise.uniform() - 0.5),
            y_m: 0.4 * (noise.uniform() - 0.5),
            yaw_rad: std::f64::consts::TAU * (noise.uniform() - 0.5),
        };
        let start = RunStart {
            seed,
            pose,
            seconds: self.wish.seconds,
        };
        if let Some(other) = replayed {
            return drive(&self.plant, change, &start, &mut |number, _| other.sent[number]);
        }
        if self.kind == Kind::Closed {
            let mut task = Task::new(robot, seed);
            return drive(&self.plant, change, &start, &mut |_, pose| task.command(pose));
        }
        let style = match (self.kind, reference) {
            (Kind::Poor, _) => Style::Poor,
            (Kind::Shifted, true) => Style::Smooth,
            (Kind::Shifted, false) => Style::Brisk,
            _ => Style::Rich,
        };
        let planned = plan(robot, style, pose, self.wish.seconds, &mut noise);
        drive(&self.plant, change, &start, &mut |number, _| planned[number])
    }

    /// Runs with `without` in place of everything changed, on the same set-points.
    fn compared(
        &self,
        robot: &Robot,
        without: &Change,
        traces: &[(u64, Trace)],
        truth: Option<&Truth>,
    ) -> Result<(Visible, Option<(Truth, f64)>)> {
        let mut others = Vec::new();
        for (seed, trace) in traces {
            others.push(self.run(robot, without, *seed, false, Some(trace))?);
        }
        let pairs: Vec<Pair<'_>> = traces
            .iter()
            .zip(&others)
            .map(|((_, with), other)| Pair {
                with: (with, &self.changed.sensing),
                without: (other, &without.sensing),
            })
            .collect();
        let fitted = truth.and_then(|truth| pairs.first().map(|pair| best(&self.robot, truth, pair)));
        Ok((visible(&self.robot, &pairs), fitted))
    }

    fn ask(&self, robot: &Robot, position: usize, traces: &[(u64, Trace)]) -> Result<Known> {
        let mut without = self.base.clone();
        for (other, truth) in self.truths.iter().enumerate() {
            if other != position {
                apply(&mut without, truth, &self.robot);
            }
        }
        let drawn = &self.truths[position];
        let (visible, best) = self.compared(robot, &without, traces, Some(drawn))?;
        let (best, described) = best.unwrap_or_else(|| (drawn.clone(), 0.0));
        Ok(Known {
            drawn: drawn.clone(),
            best,
            described,
            detectable: visible.is_detectable(),
            visible,
        })
    }

    /// Sensors of the changed runs.
    pub fn sensing(&self) -> &Sensing {
        &self.changed.sensing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wishes_are_named_by_kind_effect_and_runs() {
        let wish = |text: &str| Wish::named(text).map(|wish| (wish.effect, wish.runs));
        assert_eq!(wish("none").expect("a kind"), (None, 6));
        assert_eq!(
            wish("single:payload:8").expect("a wish"),
            (Some("payload".to_owned()), 8)
        );
        assert_eq!(wish("none::8").expect("no effect"), (None, 8));
        for (text, problem) in [
            ("single:payload:1", "2 to 100"),
            ("single:payload:101", "2 to 100"),
            ("single:payload:8:9", "KIND:EFFECT:RUNS"),
            ("sngle", "kind sngle"),
        ] {
            let error = wish(text).expect_err(text).to_string();
            assert!(error.contains(problem), "{text}: {error}");
        }
    }
}
