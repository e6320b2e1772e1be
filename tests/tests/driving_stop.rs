//! The protective stop on robots that drive (S10): four robots in a run, 30 % of all frames lost, PostgreSQL stopped.

mod stop_rig;

use anyhow::ensure;
use api::run::RunState;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use stop_rig::{Service, StopRig};
use system_tests::{PoseWatch, System, repository};

/// From the press to the first stop frame of every robot, 99 of 100 presses.
const FIRST_P99: Duration = Duration::from_millis(20);
const LOSS: f64 = 0.3;
const LIMIT: Duration = Duration::from_secs(90);
/// Of the stopping distance `v (t_link + 0.1 + t_act) + v^2 / 2a`: one way on the link, silence that a robot bears, answer of
/// rolling wheels (`lab/src/delay.rs`), ramp of the fastest wheel of 0.05 m (`robot/src/watchdog.rs`).
const LINK_S: f64 = 0.012;
const SILENCE_S: f64 = 0.1;
const ANSWER_S: f64 = 0.1;
const RAMP_M_PER_S2: f64 = 40.0 * 0.05;
/// Means of 6 poses with 1 mm of noise each, at both ends.
const SEEN_M: f64 = 0.003;
/// Of a speed from such means, 50 ms apart.
const SEEN_M_PER_S: f64 = 0.03;
const LOOK: Duration = Duration::from_millis(50);

/// Of all robots, whose way may be unknown since the tracker's poses came late to the drill.
const UNSEEN_SHARE: f64 = 0.02;

/// Four robots on their way to the opposite corners.
fn experiment() -> Value {
    let path = repository().join("examples/experiments/swap-corners.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// What was measured over all presses.
#[derive(Debug, Default)]
struct Figures {
    firsts: Vec<Duration>,
    gaps: Vec<Duration>,
    /// Robots that were faster than 0.1 m/s.
    driving: usize,
    /// Robots whose way is unknown: no pose of theirs came in one of the spans.
    unseen: usize,
    /// Way from the press to rest over its bound, the way, and the speed.
    worst: (f64, f64, f64),
}

impl Figures {
    /// Robots `1..=4` after a press.
    fn take_ways(&mut self, poses: &PoseWatch, pressed: Instant) -> anyhow::Result<()> {
        for robot in 1..=4 {
            let here = poses.mean_m(robot, pressed - LOOK / 2, LOOK);
            let there = poses.mean_m(robot, pressed + Duration::from_millis(1800), LOOK);
            let speed_after = poses.speed_m_per_s(robot, pressed + Duration::from_millis(1500), 4 * LOOK);
            // The fastest that the last commands before the stop made it: what it still does until the ramp begins.
            let starts = (0..6).map(|step| pressed + step * LOOK - 2 * LOOK);
            let speeds = starts.filter_map(|start| poses.speed_m_per_s(robot, start, 2 * LOOK));
            let speed = speeds.fold(0.0, f64::max);
            let (Some((here, there)), Some(speed_after)) = (here.zip(there), speed_after) else {
                self.unseen += 1;
                continue;
            };
            let rests = speed_after < SEEN_M_PER_S;
            ensure!(rests, "robot {robot} moves 1.5 s after the press: {speed_after} m/s");
            if speed < 0.1 {
                continue;
            }
            self.driving += 1;
            let way_m = f64::hypot(there[0] - here[0], there[1] - here[1]);
            let fastest = speed + SEEN_M_PER_S;
            let delay_s = FIRST_P99.as_secs_f64() + LINK_S + SILENCE_S + ANSWER_S;
            let bound_m = fastest * delay_s + fastest * fastest / (2.0 * RAMP_M_PER_S2) + SEEN_M;
            if way_m / bound_m > self.worst.0 {
                self.worst = (way_m / bound_m, way_m, speed);
            }
        }
        Ok(())
    }

    /// What was measured by so many presses; called before an error ends the drill as well.
    fn report(mut self, name: &str, count: usize) -> anyhow::Result<()> {
        ensure!(!self.firsts.is_empty(), "no press was measured");
        self.firsts.sort();
        self.gaps.sort();
        let at = |times: &[Duration], share: f64| times[((share * times.len() as f64).ceil() as usize).max(1) - 1];
        let p99 = at(&self.firsts, 0.99);
        let (share, way_m, speed) = self.worst;
        println!(
            "S10 {name}: {count} presses, {} of {} robots faster than 0.1 m/s, way of {} not seen, {:.0} % of frames lost, PostgreSQL stopped: first stop \
             frame p50 {:?} p99 {p99:?} most {:?}; between two at most {:?}; way at most {share:.2} of its bound ({way_m:.3} m \
             from {speed:.2} m/s)",
            self.driving,
            4 * count,
            self.unseen,
            100.0 * LOSS,
            at(&self.firsts, 0.5),
            at(&self.firsts, 1.0),
            at(&self.gaps, 1.0),
        );
        ensure!(2 * self.driving >= 4 * count, "too few robots drove: {}", self.driving);
        ensure!(
            self.unseen as f64 <= UNSEEN_SHARE * 4.0 * count as f64,
            "the ways of {} robots were not seen",
            self.unseen
        );
        ensure!(p99 <= FIRST_P99, "p99 {p99:?} of {count} presses");
        ensure!(share <= 1.0, "{way_m} m from {speed} m/s");
        Ok(())
    }
}

/// A run under way, the database stopped, a press; then everything back.
async fn one_press(
    system: &System,
    rig: &StopRig,
    poses: &PoseWatch,
    wait: Duration,
    figures: &mut Figures,
) -> anyhow::Result<()> {
    // From the rack straight to the starts.
    rig.hand(&json!({ "place": [] }))?;
    let run = system.submit(&experiment(), None).await?;
    let seen = system.wait_for_state(run, RunState::Running, LIMIT).await?;
    ensure!(seen.state == RunState::Running, "{:?}", seen.fault);
    tokio::time::sleep(wait).await;
    system.signal_all("postgres", libc::SIGSTOP)?;
    let press = rig.press();
    let obeyed = rig.until_obeyed();
    tokio::time::sleep(Duration::from_secs(2)).await;
    system.signal_all("postgres", libc::SIGCONT)?;
    obeyed?;
    let press = press?;
    figures.firsts.push(press.first);
    figures.gaps.push(press.gap);
    figures.take_ways(poses, press.at)?;
    let (_, state) = rig.ask("POST /clear")?;
    ensure!(state["stopped"] == false, "{state}");
    let ended = system.wait_until_ended(run, LIMIT).await?;
    let fault = ended.fault.map(|fault| fault.code);
    ensure!(
        ended.state == RunState::Interrupted && fault.as_deref() == Some("protective_stop"),
        "{}: {fault:?}",
        ended.state.as_str()
    );
    Ok(())
}

async fn presses(name: &str, count: usize) -> anyhow::Result<()> {
    let system = System::start_with(name, &["--no-lab"]).await?;
    let service = Service {
        address: system.base.clone(),
        token_file: system.data.join("tokens/lab"),
    };
    let rig = StopRig::start_for(&format!("{name}-rig"), Some(service))?;
    rig.lose_frames(LOSS)?;
    let poses = rig.watch_poses()?;
    let mut figures = Figures::default();
    for number in 0..count {
        // 0.8 to 3 s after the start, spread evenly.
        let wait = Duration::from_millis(800 + (number as u64 * 1361) % 2200);
        if let Err(error) = one_press(&system, &rig, &poses, wait, &mut figures).await {
            let measured = figures.firsts.len();
            let report = figures.report(name, measured);
            println!("S10 {name}: ended by press {number} of {count}; what was measured until then: {report:?}");
            return Err(error.context(format!("press {number}")));
        }
    }
    figures.report(name, count)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_press_stops_robots_that_drive_within_their_stopping_distance() -> anyhow::Result<()> {
    presses("driving", 4).await
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "five hundred runs: hours; part of the soak"]
async fn five_hundred_presses_on_robots_that_drive() -> anyhow::Result<()> {
    let count = std::env::var("ROBOPHEUS_PRESSES")
        .ok()
        .and_then(|count| count.parse().ok());
    presses("driving-soak", count.unwrap_or(500)).await
}
