//! The twin and the control code in the browser: JSON text in, JSON text out, nothing of its own.
//!
//! The same functions run in the service; equal inputs give equal trace digests.

use control::rehearsal::{Frame, Outcome, Rehearsal};
use control::scenario::{FieldProblem, Scenario};
use controllers::workload::Workload;
use serde::Serialize;
use twin::workload::{Variation, Workload as SpeedLaps};
use wasm_bindgen::JsCast;
use wasm_bindgen::prelude::wasm_bindgen;

/// Most ticks in one call of [`Simulation::advance`]; a worker must stay able to answer.
pub const MAX_TICKS_PER_CALL: u32 = 12_000;

/// Problems of a scenario as a JSON list; `[]` when it can be simulated.
#[wasm_bindgen]
pub fn check(scenario_json: &str) -> String {
    let scenario = match Scenario::from_json(scenario_json) {
        Ok(scenario) => scenario,
        Err(problems) => return text(&problems),
    };
    text(&controllers::experiment::check(&scenario))
}

/// Version of the twin; digests are comparable between equal versions.
#[wasm_bindgen]
pub fn twin_version() -> String {
    twin::VERSION.to_owned()
}

/// Digests of all gallery scenarios, effects and own controllers as a JSON object `{name: digest}`, for the comparison with the native twin.
#[wasm_bindgen]
pub fn gallery_digests() -> String {
    let mut all = control::gallery::digests();
    all.extend(controllers::gallery::digests());
    text(&all)
}

/// Scripts to start from (name, title, text) as a JSON list.
#[wasm_bindgen]
pub fn controller_gallery() -> String {
    text(&controllers::gallery::SCRIPTS)
}

/// The benchmark's workload (`docs/speed.md`), timed from outside.
#[wasm_bindgen]
pub struct SpeedWork {
    work: SpeedLaps,
}

#[wasm_bindgen]
impl SpeedWork {
    /// `count` robots of a chassis with one of the two effects of [`Variation`]; throws a sentence when there is no such work.
    #[wasm_bindgen(constructor)]
    pub fn new(chassis: &str, count: usize, effect: &str, digest: bool) -> Result<SpeedWork, String> {
        let effect = Variation::ALL.into_iter().find(|one| one.name() == effect);
        let effect = effect.ok_or("no workload with such an effect")?;
        let work = SpeedLaps::new(chassis, count, effect, digest).map_err(|error| error.to_string())?;
        Ok(SpeedWork { work })
    }

    /// Simulated robot-seconds of one lap.
    pub fn lap_robot_s(&self) -> f64 {
        self.work.lap_robot_s()
    }

    /// Drives laps from the start, as many as make about `robot_s` robot-seconds, and gives `[milliseconds, laps]`.
    pub fn run(&self, robot_s: f64) -> Result<Vec<f64>, String> {
        let laps = self.work.laps_for(robot_s);
        let begun_ms = now_ms();
        for _ in 0..laps {
            core::hint::black_box(self.work.lap().map_err(|error| error.to_string())?);
        }
        Ok(vec![now_ms() - begun_ms, f64::from(laps)])
    }

    /// Digest of a lap; that of the start without hashing.
    pub fn lap_digest(&self) -> Result<String, String> {
        Ok(self.work.lap().map_err(|error| error.to_string())?.digest().to_string())
    }
}

/// Time of a tick of every program of the gallery with so many robots: a JSON list of `{name, robots, tick_ms}`. Clocks of browsers are
/// coarse: `tick_ms` is the median of batches of 20 ticks, or null when a limit stops the program.
#[wasm_bindgen]
pub fn controller_times(robots: usize, batches: usize) -> String {
    const BATCH: usize = 20;
    let time = |source: &controllers::source::Source| {
        let mut work = Workload::new(source, robots).ok()?;
        let mut times_ms = Vec::with_capacity(batches);
        for _ in 0..batches {
            let views: Vec<_> = (0..BATCH).map(|_| work.next_view()).collect();
            let begun_ms = now_ms();
            for view in &views {
                work.step(view).ok()?;
            }
            times_ms.push((now_ms() - begun_ms) / BATCH as f64);
        }
        times_ms.sort_by(f64::total_cmp);
        times_ms.get(times_ms.len() / 2).copied()
    };
    let rows: Vec<_> = controllers::workload::programs()
        .iter()
        .map(|(name, source)| serde_json::json!({"name": name, "robots": robots, "tick_ms": time(source)}))
        .collect();
    text(&rows)
}

/// `performance.now()`; the time of day where there is none.
fn now_ms() -> f64 {
    let global = js_sys::global();
    let performance = js_sys::Reflect::get(&global, &"performance".into());
    let now = performance.and_then(|performance| {
        let function: js_sys::Function = js_sys::Reflect::get(&performance, &"now".into())?.dyn_into()?;
        function.call0(&performance)
    });
    now.ok().and_then(|now| now.as_f64()).unwrap_or_else(js_sys::Date::now)
}

/// The control laws and their parameters (key, unit, range, default, meaning) as a JSON list.
#[wasm_bindgen]
pub fn laws() -> String {
    text(control::law::LAWS)
}

/// A rehearsal that advances in pieces.
#[wasm_bindgen]
pub struct Simulation {
    state: State,
}

enum State {
    Running(Box<Rehearsal>),
    Finished {
        outcome: Box<Outcome>,
        ticks: (u64, u64),
    },
    /// Only between two states.
    Moving,
}

#[wasm_bindgen]
impl Simulation {
    /// Sets up a scenario; throws the list of problems as JSON text.
    #[wasm_bindgen(constructor)]
    pub fn new(scenario_json: &str) -> Result<Simulation, String> {
        let problems = |problems: Vec<FieldProblem>| text(&problems);
        let scenario = Scenario::from_json(scenario_json).map_err(problems)?;
        let rehearsal = controllers::experiment::rehearsal(&scenario).map_err(problems)?;
        Ok(Simulation {
            state: State::Running(Box::new(rehearsal)),
        })
    }

    /// Simulates up to `ticks` control ticks; returns the frames of this piece (30 Hz) as a JSON list.
    pub fn advance(&mut self, ticks: u32) -> String {
        let mut frames: Vec<Frame> = Vec::new();
        let mut ended = false;
        if let State::Running(rehearsal) = &mut self.state {
            for _ in 0..ticks.min(MAX_TICKS_PER_CALL) {
                ended = !rehearsal.step();
                let (tick, _) = rehearsal.progress();
                if tick.is_multiple_of(control::rehearsal::FRAME_TICKS) || ended {
                    frames.push(rehearsal.frame());
                }
                if ended {
                    break;
                }
            }
        }
        if ended {
            self.end();
        }
        text(&frames)
    }

    /// The rehearsal has ended and verdict and replay are complete.
    pub fn finished(&self) -> bool {
        matches!(self.state, State::Finished { .. })
    }

    /// Share of the longest possible duration that is simulated, 0 to 1; 1 when finished.
    pub fn fraction(&self) -> f64 {
        match &self.state {
            State::Running(rehearsal) => {
                let (tick, ticks) = rehearsal.progress();
                tick as f64 / ticks.max(1) as f64
            }
            State::Finished { .. } | State::Moving => 1.0,
        }
    }

    /// Control ticks simulated.
    pub fn tick(&self) -> f64 {
        match &self.state {
            State::Running(rehearsal) => rehearsal.progress().0 as f64,
            State::Finished { ticks, .. } => ticks.0 as f64,
            State::Moving => 0.0,
        }
    }

    /// Verdict as JSON (`robopheus.verdict/1`); `null` before the end.
    pub fn verdict(&self) -> String {
        self.outcome()
            .map_or("null".to_owned(), |outcome| text(&outcome.verdict))
    }

    /// Replay as JSON (`robopheus.replay/1`); `null` before the end.
    pub fn replay(&self) -> String {
        self.outcome()
            .map_or("null".to_owned(), |outcome| text(&outcome.replay))
    }

    /// Trace digest so far.
    pub fn digest(&self) -> String {
        match &self.state {
            State::Running(rehearsal) => rehearsal.digest(),
            State::Finished { outcome, .. } => outcome.verdict.digest.clone(),
            State::Moving => String::new(),
        }
    }

    /// What the user's own controller said and drew in the last tick, as a JSON list.
    pub fn notes(&self) -> String {
        match &self.state {
            State::Running(rehearsal) => text(rehearsal.notes()),
            State::Finished { .. } | State::Moving => "[]".to_owned(),
        }
    }

    fn outcome(&self) -> Option<&Outcome> {
        match &self.state {
            State::Finished { outcome, .. } => Some(outcome),
            State::Running(_) | State::Moving => None,
        }
    }

    fn end(&mut self) {
        self.state = match std::mem::replace(&mut self.state, State::Moving) {
            State::Running(rehearsal) => {
                let ticks = rehearsal.progress();
                State::Finished {
                    outcome: Box::new(rehearsal.finish()),
                    ticks,
                }
            }
            other => other,
        };
    }
}

fn text<T: Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_else(|_| "null".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario() -> String {
        let (_, text) = control::gallery::digest_scenarios().swap_remove(0);
        let mut scenario: serde_json::Value = serde_json::from_str(&text).expect("scenario");
        scenario["experiment"]["control"] = serde_json::json!({"law": "go_to_point", "parameters": {}});
        scenario["experiment"]["targets"] = serde_json::json!([{"x_m": 0.5, "y_m": 0.2}]);
        scenario["experiment"]["duration_s"] = serde_json::json!(10.0);
        scenario.to_string()
    }

    #[test]
    fn pieces_of_any_size_give_the_native_outcome() {
        let native = control::rehearsal::rehearse_json(&scenario()).expect("rehearsal");
        for piece in [1, 7, 120, u32::MAX] {
            let mut simulation = Simulation::new(&scenario()).expect("simulation");
            let mut frames = 0;
            while !simulation.finished() {
                assert_eq!(simulation.verdict(), "null");
                let list: Vec<serde_json::Value> = serde_json::from_str(&simulation.advance(piece)).expect("frames");
                frames += list.len() as u64;
            }
            assert_eq!(simulation.digest(), native.verdict.digest);
            assert_eq!(
                simulation.verdict(),
                serde_json::to_string(&native.verdict).expect("verdict")
            );
            assert_eq!(
                simulation.replay(),
                serde_json::to_string(&native.replay).expect("replay")
            );
            assert!(
                frames >= native.verdict.ticks / 4 && frames <= native.verdict.ticks / 4 + 1,
                "{frames} frames"
            );
            assert_eq!((simulation.fraction(), simulation.advance(10).as_str()), (1.0, "[]"));
        }
    }

    #[test]
    fn problems_come_as_a_list() {
        assert_eq!(check(&scenario()), "[]");
        let problems: Vec<FieldProblem> = serde_json::from_str(&check("{}")).expect("list");
        assert_eq!(problems.len(), 1);
        let thrown = Simulation::new("{").err().expect("problems");
        assert!(serde_json::from_str::<Vec<FieldProblem>>(&thrown).is_ok_and(|list| list.len() == 1));
    }

    #[test]
    fn speed_work_is_the_native_workload() {
        let work = SpeedWork::new("omni4", 2, "floor_friction", true).expect("work");
        let native = SpeedLaps::new("omni4", 2, Variation::FloorFriction, true).expect("work");
        assert_eq!(
            work.lap_digest(),
            Ok(native.lap().expect("finite").digest().to_string())
        );
        assert_eq!(work.lap_robot_s(), native.lap_robot_s());
        assert!(SpeedWork::new("omni4", 2, "tank", true).is_err());
        assert!(SpeedWork::new("tank", 2, "floor_friction", true).is_err());
    }

    #[test]
    fn digests_are_those_of_the_native_gallery() {
        let digests: std::collections::BTreeMap<String, String> =
            serde_json::from_str(&gallery_digests()).expect("object");
        assert!(digests.len() >= 410);
        for (name, digest) in controllers::gallery::digests() {
            assert_eq!(digests[&name], digest, "{name}");
        }
        assert_eq!(digests["head-on"], control::gallery::digest_of("head-on"));
    }
}
