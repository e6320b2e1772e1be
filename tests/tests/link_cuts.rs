//! The link to robots that drive is cut (S1): emulator and laboratory as processes, frames on UDP, the clock of the wall.
//!
//! Long cuts end the run and leave latched robots; short ones are borne. When a watchdog was fed last and what it did then is
//! told by the emulator, the way by the true poses.

mod stop_rig;

use anyhow::{Context, ensure};
use api::run::{RunState, RunView, Whose};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use stop_rig::{Service, StopRig};
use system_tests::{PoseWatch, System, instant_of, wait_for};

const LIMIT: Duration = Duration::from_secs(90);
/// Number, name, chassis, and its answer (`lab/src/delay.rs`): each in a lane of its own.
const ROBOTS: [(u8, &str, &str, f64); 4] = [
    (1, "omni-01", "omni4", 0.10),
    (5, "diff-01", "diff2", 0.10),
    (13, "diff4-01", "diff4", 0.23),
    (14, "fwd-01", "fwd", 0.10),
];
const LANES_Y_M: [f64; 4] = [-1.0, -0.34, 0.34, 1.0];
const END_X_M: f64 = 1.5;
const RAMP_MS: f64 = 100.0;
const LATCH_MS: f64 = 500.0;
/// Of the wall's clock, either way.
const SLACK_MS: f64 = 20.0;
/// Deceleration of the body that is promised (`robot/src/watchdog.rs`).
const BRAKING_M_PER_S2: f64 = 2.0;
/// Means of 6 poses with 1 mm of noise each, at both ends.
const SEEN_M: f64 = 0.003;
/// Of a speed from such means, 50 ms apart.
const SEEN_M_PER_S: f64 = 0.03;
const LOOK: Duration = Duration::from_millis(50);
/// A slower robot says nothing about the way.
const LEAST_M_PER_S: f64 = 0.1;
/// From the last cut of a run to the return of the links, and on to the last look.
const AWAY: Duration = Duration::from_millis(1100);
const AFTER: Duration = Duration::from_millis(700);
/// A laboratory believes for 0.1 s that a robot stands where it was seen.
const UNSEEN: Duration = Duration::from_millis(200);
/// From the end of a short cut to the next.
const BETWEEN: Duration = Duration::from_millis(100);
/// From a frame after a short cut to motion at the old speed.
const RESUME_MS: f64 = 1000.0;

/// Everybody drives along its lane.
fn experiment() -> Value {
    let robots = ROBOTS.iter().zip(LANES_Y_M).map(|((_, name, chassis, _), y_m)| {
        let start = json!({"x_m": -END_X_M, "y_m": y_m, "yaw_rad": 0.0});
        json!({"name": name, "chassis": chassis, "controller": "sam3x", "start": start})
    });
    let targets = ROBOTS.iter().zip(LANES_Y_M);
    let targets = targets.map(|((_, name, ..), y_m)| json!({"robot": name, "x_m": END_X_M, "y_m": y_m}));
    json!({
        "format": "robopheus.experiment/1", "mode": "physical", "arena": "reference", "floor": "lab-floor",
        "robots": robots.collect::<Value>(), "targets": targets.collect::<Value>(),
        "control": {"law": "go_to_point", "parameters": {"speed_m_per_s": 0.6, "keep_right": 0.0}},
        "duration_s": 30, "seed": 1, "model": null
    })
}

/// Numbers from a seed (splitmix64).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, least_ms: f64, most_ms: f64) -> Duration {
        Duration::from_secs_f64((least_ms + (most_ms - least_ms) * self.uniform()) * 1e-3)
    }

    /// Robots in random order.
    fn order(&mut self) -> Vec<usize> {
        let mut keyed: Vec<(f64, usize)> = (0..ROBOTS.len()).map(|place| (self.uniform(), place)).collect();
        keyed.sort_by(|one, other| one.0.total_cmp(&other.0));
        keyed.into_iter().map(|(_, place)| place).collect()
    }
}

/// A line of the emulator's log of the watchdogs.
#[derive(Debug, Clone)]
struct Change {
    robot: u8,
    state: String,
    at_us: i64,
    fed_us: i64,
    /// May be older by this.
    step_us: i64,
}

impl Change {
    fn of(line: &str) -> Option<Self> {
        let mut fields = line.split(',');
        let (robot, state) = (fields.next()?.parse().ok()?, fields.next()?.to_owned());
        let mut time = || fields.next()?.parse::<i64>().ok();
        let (at_us, fed_us, step_us) = (time()?, time()?, time()?);
        Some(Self {
            robot,
            state,
            at_us,
            fed_us,
            step_us,
        })
    }

    fn at(&self) -> Instant {
        instant_of(self.at_us)
    }

    fn after_ms(&self) -> f64 {
        (self.at_us - self.fed_us) as f64 * 1e-3
    }
}

fn changes(rig: &StopRig, since: Instant) -> anyhow::Result<Vec<Change>> {
    let changes = rig.watchdog_log()?.lines().filter_map(Change::of).collect::<Vec<_>>();
    Ok(changes.into_iter().filter(|change| change.at() >= since).collect())
}

fn first<'a>(changes: &'a [Change], robot: u8, state: &str, since: Instant) -> Option<&'a Change> {
    let of_robot = |change: &&Change| change.robot == robot && change.state == state && change.at() >= since;
    changes.iter().find(of_robot)
}

#[derive(Debug, Default)]
struct Figures {
    seed: u64,
    long: usize,
    short: usize,
    ramps_ms: Vec<f64>,
    latches_ms: Vec<f64>,
    resumes_ms: Vec<f64>,
    /// Of robots faster than [`LEAST_M_PER_S`]: way from the last frame to rest over its bound, and the way.
    ways: Vec<(f64, f64)>,
    unseen: usize,
    /// Longest time that a change may have been older than it was noted.
    step_us: i64,
    /// Runs in which the emulator itself was held up for more than 10 ms: measured anew.
    held: usize,
    /// What was not as it is asked.
    missed: Vec<String>,
}

impl Figures {
    fn in_time(&mut self, what: &str, change: &Change, limit_ms: f64) {
        let after_ms = change.after_ms();
        self.step_us = self.step_us.max(change.step_us);
        if (after_ms - limit_ms).abs() > SLACK_MS {
            self.missed.push(format!("{what} after {after_ms:.1} ms: {change:?}"));
        }
    }

    /// A robot whose link was cut for good at `cut`; `back` is when it returned.
    fn take_long(&mut self, changes: &[Change], poses: &PoseWatch, place: usize, cut: Instant, back: Instant) {
        self.long += 1;
        let (robot, name, _, answer_s) = ROBOTS[place];
        let ramp = first(changes, robot, "ramping", cut);
        let latch = ramp.and_then(|ramp| first(changes, robot, "latched", ramp.at()));
        let (Some(ramp), Some(latch)) = (ramp, latch) else {
            self.missed.push(format!("{name}: no ramp or no latch: {changes:?}"));
            return;
        };
        self.ramps_ms.push(ramp.after_ms());
        self.in_time(&format!("{name} ramps"), ramp, RAMP_MS);
        self.latches_ms.push(latch.after_ms());
        self.in_time(&format!("{name} latches"), latch, LATCH_MS);
        if latch.fed_us != ramp.fed_us {
            self.missed
                .push(format!("{name} was fed between ramp and latch: {ramp:?} {latch:?}"));
        }
        let fed = instant_of(ramp.fed_us);
        let here = poses.mean_m(robot, fed - LOOK / 2, LOOK);
        let there = poses.mean_m(robot, back - 2 * LOOK, LOOK);
        let creeps = [back - 4 * LOOK, back + AFTER - 4 * LOOK].map(|from| poses.speed_m_per_s(robot, from, 3 * LOOK));
        let (Some((here, there)), [Some(before), Some(after)]) = (here.zip(there), creeps) else {
            self.unseen += 1;
            return;
        };
        for (when, speed) in [("before", before), ("after", after)] {
            if speed > SEEN_M_PER_S {
                self.missed
                    .push(format!("{name} moves at {speed:.3} m/s {when} its link came back"));
            }
        }
        // The fastest that the last commands before the cut made it.
        let starts = (0..6).map(|step| fed + step * LOOK - 2 * LOOK);
        let speeds = starts.filter_map(|start| poses.speed_m_per_s(robot, start, 2 * LOOK));
        let v = speeds.fold(0.0, f64::max) + SEEN_M_PER_S;
        if v < LEAST_M_PER_S + SEEN_M_PER_S {
            return;
        }
        let way_m = f64::hypot(there[0] - here[0], there[1] - here[1]);
        let delay_s = (RAMP_MS + SLACK_MS) * 1e-3 + answer_s;
        let share = way_m / (v * delay_s + v * v / (2.0 * BRAKING_M_PER_S2) + SEEN_M);
        self.ways.push((share, way_m));
        if share > 1.0 {
            self.missed.push(format!(
                "{name} goes {way_m:.3} m from {v:.2} m/s, {share:.2} of its bound"
            ));
        }
    }

    /// A robot whose link was away from `cut` to `back`.
    fn take_short(&mut self, changes: &[Change], place: usize, cut: Instant, back: Instant) {
        self.short += 1;
        let (robot, name, ..) = ROBOTS[place];
        let ramp = first(changes, robot, "ramping", cut).filter(|ramp| ramp.at() <= back);
        let runs = ramp.and_then(|ramp| first(changes, robot, "running", ramp.at()));
        let (Some(ramp), Some(runs)) = (ramp, runs) else {
            self.missed
                .push(format!("{name}: no ramp or no way out of it: {changes:?}"));
            return;
        };
        self.ramps_ms.push(ramp.after_ms());
        self.in_time(&format!("{name} ramps"), ramp, RAMP_MS);
        let resumed_ms = runs.at().saturating_duration_since(back).as_secs_f64() * 1e3;
        self.resumes_ms.push(resumed_ms);
        if resumed_ms > RESUME_MS {
            self.missed
                .push(format!("{name} resumes {resumed_ms:.0} ms after its link came back"));
        }
        if let Some(latch) = first(changes, robot, "latched", cut).filter(|latch| latch.at_us < runs.at_us) {
            self.missed.push(format!("{name} latched in a short cut: {latch:?}"));
        }
    }

    fn report(&mut self, name: &str) -> anyhow::Result<()> {
        let mut of = |values: fn(&mut Self) -> &mut Vec<f64>| {
            let values = values(self);
            values.sort_by(f64::total_cmp);
            let at = |share: f64| {
                let rank = (share * values.len() as f64).ceil() as usize;
                values.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
            };
            format!("p50 {:.1} p99 {:.1} most {:.1}", at(0.5), at(0.99), at(1.0))
        };
        let (ramps, latches) = (
            of(|figures| &mut figures.ramps_ms),
            of(|figures| &mut figures.latches_ms),
        );
        let resumes = of(|figures| &mut figures.resumes_ms);
        let (share, way_m) = self
            .ways
            .iter()
            .copied()
            .fold((0.0, 0.0), |most, way| if way.0 > most.0 { way } else { most });
        println!(
            "S1 {name}: {} links cut for good, {} for less than 0.5 s, seed {}, on UDP; ms from the last frame to the ramp: {ramps}; to the latch: \
             {latches}; from the link's return to motion: {resumes}; way of {} robots faster than {LEAST_M_PER_S} m/s at most {share:.2} of its bound \
             ({way_m:.3} m), {} not seen; noted to {:.1} ms, {} runs anew; {} not as asked",
            self.long,
            self.short,
            self.seed,
            self.ways.len(),
            self.unseen,
            self.step_us as f64 * 1e-3,
            self.held,
            self.missed.len(),
        );
        ensure!(self.missed.is_empty(), "not as asked:\n{}", self.missed.join("\n"));
        ensure!(
            4 * self.ways.len() >= 3 * self.long,
            "too few robots drove: {}",
            self.ways.len()
        );
        Ok(())
    }
}

/// The system with the laboratory under test.
struct Bench {
    system: System,
    rig: StopRig,
    poses: PoseWatch,
    random: Random,
    figures: Figures,
}

impl Bench {
    async fn start(name: &str, seed: u64) -> anyhow::Result<Self> {
        let system = System::start_with(name, &["--no-lab"]).await?;
        let service = Service {
            address: system.base.clone(),
            token_file: system.data.join("tokens/lab"),
        };
        let rig = StopRig::start_for(&format!("{name}-rig"), Some(service))?;
        let poses = rig.watch_poses()?;
        Ok(Self {
            system,
            rig,
            poses,
            random: Random(seed),
            figures: Figures {
                seed,
                ..Figures::default()
            },
        })
    }

    fn cut(&self, place: usize, way: &str) -> anyhow::Result<Instant> {
        let fault = json!({"number": ROBOTS[place].0, "kind": "drop_frames", "fraction": 1.0, "way": way});
        let before = Instant::now();
        self.rig.hand(&json!({ "fault": fault }))?;
        Ok(before)
    }

    /// Before the robot hears again.
    fn mend(&self, place: usize) -> anyhow::Result<Instant> {
        let before = Instant::now();
        self.rig
            .hand(&json!({"fault": {"number": ROBOTS[place].0, "kind": "none"}}))?;
        Ok(before)
    }

    /// Robots on their way, a random time after the start.
    async fn drive(&mut self) -> anyhow::Result<uuid::Uuid> {
        // From the rack straight to the starts.
        self.rig.hand(&json!({ "place": [] }))?;
        let unseen = || async {
            let recent = Instant::now() - UNSEEN;
            let seen = |(robot, ..): &(u8, &str, &str, f64)| self.poses.mean_m(*robot, recent, UNSEEN).is_some();
            Ok((!ROBOTS.iter().any(seen)).then_some(()))
        };
        wait_for("the robots are off the floor", LIMIT, unseen).await?;
        let run = self.system.submit(&experiment(), None).await?;
        let seen = self.system.wait_for_state(run, RunState::Running, LIMIT).await?;
        ensure!(
            seen.state == RunState::Running,
            "{:?}\n{}",
            seen.fault,
            self.rig.lab_log()
        );
        tokio::time::sleep(self.random.between(800.0, 2500.0)).await;
        Ok(run)
    }

    async fn ended(&self, run: uuid::Uuid) -> anyhow::Result<RunView> {
        self.system.wait_until_ended(run, LIMIT).await
    }

    /// The emulator was on time; else the run tells nothing of robots, and is only waited for.
    async fn on_time(&mut self, changes: &[Change], run: uuid::Uuid) -> anyhow::Result<bool> {
        let held = changes.iter().any(|change| change.state == "held");
        if held {
            self.figures.held += 1;
            self.ended(run).await?;
        }
        Ok(!held)
    }

    /// One run: all four links are cut within 0.35 s, for good. `false` when it is to be measured anew.
    async fn long_cuts(&mut self) -> anyhow::Result<bool> {
        let run = self.drive().await?;
        let begun = Instant::now();
        let mut cuts = Vec::new();
        for place in self.random.order() {
            if !cuts.is_empty() {
                tokio::time::sleep(self.random.between(0.0, 110.0)).await;
            }
            let way = if self.random.uniform() < 0.5 { "both" } else { "down" };
            cuts.push((place, way, self.cut(place, way)?));
        }
        let last = Instant::now();
        tokio::time::sleep(AWAY).await;
        let back = Instant::now();
        for (place, ..) in &cuts {
            self.mend(*place)?;
        }
        tokio::time::sleep(AFTER).await;
        let changes = changes(&self.rig, begun)?;
        if !self.on_time(&changes, run).await? {
            return Ok(false);
        }
        for (place, _, cut) in &cuts {
            self.figures.take_long(&changes, &self.poses, *place, *cut, back);
        }
        let fault = self.ended(run).await?.fault.context("the run ended without a fault")?;
        ensure!(fault.whose == Whose::Robot, "{fault:?}");
        // Which of them is the first depends on the way in which its link is cut, so any will do that was cut so.
        let told = |way: &str| match fault.code.as_str() {
            "robot_silent" => way == "both",
            "robot_deaf" => way == "down",
            _ => false,
        };
        let named = |(place, way, _): &(usize, &str, Instant)| told(way) && fault.message.contains(ROBOTS[*place].1);
        ensure!(cuts.iter().any(named), "{fault:?} after {cuts:?}");
        ensure!(
            last - begun < Duration::from_millis(450),
            "the cuts took {:?}",
            last - begun
        );
        Ok(true)
    }

    /// One run: every link is cut twice, for 0.15 to 0.35 s, and the run goes on to its end.
    async fn short_cuts(&mut self) -> anyhow::Result<bool> {
        let run = self.drive().await?;
        let begun = Instant::now();
        let mut cuts = Vec::new();
        for place in [self.random.order(), self.random.order()].concat() {
            let cut = self.cut(place, "both")?;
            tokio::time::sleep(self.random.between(150.0, 350.0)).await;
            cuts.push((place, cut, self.mend(place)?));
            // The same robot may be next: it is to run again by then.
            tokio::time::sleep(BETWEEN).await;
        }
        let measured = Instant::now();
        let ended = self.ended(run).await?;
        let changes = changes(&self.rig, begun)?;
        let cutting = changes.iter().filter(|change| change.at() <= measured).cloned();
        if !self.on_time(&cutting.collect::<Vec<_>>(), run).await? {
            return Ok(false);
        }
        ensure!(
            ended.state == RunState::Done,
            "{}: {:?}\n{}",
            ended.state.as_str(),
            ended.fault,
            self.rig.lab_log()
        );
        for (place, cut, back) in cuts {
            self.figures.take_short(&changes, place, cut, back);
        }
        Ok(true)
    }
}

/// - `runs`: four long cuts each; then a run with eight short ones for every ten of them, and at least one.
async fn cut_links(name: &str, runs: usize, seed: u64) -> anyhow::Result<()> {
    let mut bench = Bench::start(name, seed).await?;
    let wanted = runs + runs.div_ceil(10);
    let mut measured = 0;
    while measured < wanted {
        let result = if measured < runs {
            bench.long_cuts().await
        } else {
            bench.short_cuts().await
        };
        match result {
            Ok(counts) => measured += usize::from(counts),
            Err(error) => {
                let report = bench.figures.report(name);
                return Err(error.context(format!("run {measured}; until then: {report:?}")));
            }
        }
        ensure!(
            bench.figures.held <= wanted,
            "the machine is too busy to measure: {} runs anew",
            bench.figures.held
        );
    }
    bench.figures.report(name)
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_without_a_link_stop_in_time_and_drive_again() -> anyhow::Result<()> {
    cut_links("cuts", 2, 1).await
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "two and a half minutes; part of the soak"]
async fn a_hundred_links_are_cut() -> anyhow::Result<()> {
    cut_links("cuts-soak", 25, 2).await
}
