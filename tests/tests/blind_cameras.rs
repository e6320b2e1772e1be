//! Cameras that freeze, go dark, send wrong pictures or die while robots drive (S3), on the running system with rendered pictures.
//!
//! Robots to the left are seen by camera 0 alone, those to the right by camera 1. What the laboratory sent is read from the run's
//! record, where robots really were from a tracker that the laboratory does not hear.

use anyhow::{Context, ensure};
use api::run::{RunState, RunView, Whose};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};
use system_tests::{Archive, PoseWatch, System, instant_of, wait_for};

const LIMIT: Duration = Duration::from_secs(90);
/// Number, name and lane, along which it drives to and fro: one for each camera.
const ROBOTS: [(u8, &str, f64); 2] = [(1, "omni-01", -1.0), (2, "omni-02", 1.0)];
const LANE_Y_M: f64 = 0.9;
/// Oldest pose that a robot may be driven by.
const STALE_US: i64 = 100_000;
/// From the last picture, and from the first frozen one, to the stop; a tick, and slack of the wall's clock.
const UNSEEN_S: f64 = 0.1;
const FROZEN_S: f64 = 0.2;
const TICK_S: f64 = 1.0 / 120.0;
const SLACK_S: f64 = 0.02;
/// Way of a frame to the robot, answer of rolling wheels (`lab/src/delay.rs`), ramp of a wheel of 0.05 m (`robot/src/watchdog.rs`).
const LINK_S: f64 = 0.012;
const ANSWER_S: f64 = 0.1;
const RAMP_M_PER_S2: f64 = 40.0 * 0.05;
/// Means of 6 poses with 1 mm of noise each, at both ends.
const SEEN_M: f64 = 0.003;
const SEEN_M_PER_S: f64 = 0.03;
const LOOK: Duration = Duration::from_millis(50);
/// A robot that is worth a fault.
const DRIVES_M_PER_S: f64 = 0.3;
/// A fault that a run must bear: less than a second with all that it takes to see again.
const SHORT: Duration = Duration::from_millis(600);
/// From the end of such a fault to motion.
const RESUME: Duration = Duration::from_millis(1000);
/// Into a fault, when cameras have long been judged.
const JUDGED: Duration = Duration::from_millis(350);
/// From the beginning of a fault that stays to robots that must be at rest.
const RESTING: Duration = Duration::from_millis(1500);

/// Both robots to and fro along their lanes.
fn experiment(duration_s: f64) -> Value {
    let (mut robots, mut targets) = (Vec::new(), Vec::new());
    for (_, name, x_m) in ROBOTS {
        let start = json!({"x_m": x_m, "y_m": -LANE_Y_M, "yaw_rad": 0.0});
        robots.push(json!({"name": name, "chassis": "omni4", "controller": "sam3x", "start": start}));
        targets.extend((0..16).map(|leg| {
            let y_m = if leg % 2 == 0 { LANE_Y_M } else { -LANE_Y_M };
            json!({"robot": name, "x_m": x_m, "y_m": y_m})
        }));
    }
    json!({
        "format": "robopheus.experiment/1", "mode": "physical", "arena": "reference", "floor": "lab-floor",
        "robots": robots, "targets": targets, "control": {"law": "waypoints", "parameters": {"speed_m_per_s": 0.5}},
        "duration_s": duration_s, "seed": 1, "model": null
    })
}

/// What is done to cameras.
#[derive(Debug, Clone)]
enum Act {
    /// An entry of the emulator's fault menu.
    Menu(Value),
    /// Their processes are held.
    Hold,
}

#[derive(Debug, Clone)]
struct Fault {
    name: &'static str,
    cameras: &'static [u16],
    act: Act,
    /// What the stop port says of these cameras meanwhile.
    health: &'static str,
}

fn fault(name: &'static str, cameras: &'static [u16], kind: Value, health: &'static str) -> Fault {
    let act = Act::Menu(kind);
    Fault {
        name,
        cameras,
        act,
        health,
    }
}

fn held(name: &'static str) -> Fault {
    let (cameras, health): (&[u16], _) = (&[0], "stalled");
    Fault {
        name,
        cameras,
        act: Act::Hold,
        health,
    }
}

fn damaged(part: &str) -> Value {
    json!({"kind": "damage_frames", "fraction": 1.0, "part": part})
}

/// A fault as it was.
#[derive(Debug, Clone)]
struct Past {
    fault: Fault,
    /// Surely off until, surely on from, surely on until.
    before: Instant,
    on: Instant,
    until: Instant,
    /// Way of each robot from `before` to `until`, and the fastest that it was; unknown without true poses.
    ways: [Option<(f64, f64)>; 2],
}

/// A command as the laboratory recorded it.
#[derive(Debug, Clone, Copy)]
struct Sent {
    at: Instant,
    /// The machine gave the loop its turn too late for a new command.
    late: bool,
    /// Wheels are told to turn.
    moves: bool,
    pose_age_us: i64,
}

fn sent(archive: &Archive, robot: u8) -> anyhow::Result<Vec<Sent>> {
    let (mut all, mut late_ticks) = (Vec::new(), BTreeSet::new());
    for message in mcap::MessageStream::new(archive.member("run.mcap")?)? {
        let message = message?;
        if message.channel.topic == "/safety" {
            let intervention: Value = serde_json::from_slice(&message.data)?;
            if intervention["cause"] == "late" {
                late_ticks.insert(intervention["tick"].as_i64());
            }
        }
        if !message.channel.topic.ends_with("/command") {
            continue;
        }
        let command: Value = serde_json::from_slice(&message.data)?;
        if command["robot"] != robot || command["tick"].as_i64() < Some(0) {
            continue;
        }
        let number = |name: &str| command[name].as_i64().with_context(|| format!("no {name}: {command}"));
        let mut wheels = command["wheel_rad_per_s"].as_array().into_iter().flatten();
        let sent = Sent {
            at: instant_of(number("sent_us")?),
            late: false,
            moves: command["enable"] == true && wheels.any(|wheel| wheel.as_f64().unwrap_or(0.0).abs() > 1e-9),
            pose_age_us: number("pose_age_us")?,
        };
        all.push((Some(number("tick")?), sent));
    }
    ensure!(all.len() > 100, "robot {robot}: {} commands", all.len());
    let sent = all.into_iter().map(|(tick, sent)| Sent {
        late: late_ticks.contains(&tick),
        ..sent
    });
    Ok(sent.collect())
}

/// Longest that the machine kept the loop from a tick.
fn stall_s(all: &[Sent], from: Instant, to: Instant) -> f64 {
    let gaps = all.windows(2).filter_map(|pair| match pair {
        [one, next] if next.at > from && one.at <= to => Some((next.at - one.at).as_secs_f64() - TICK_S),
        _ => None,
    });
    gaps.fold(0.0, f64::max)
}

/// The system, where robots really are, and what is to be reported.
struct Bench {
    system: System,
    truth: PoseWatch,
    /// Longest from a fault to the stop, longest from its end to motion, largest share of the stopping way.
    stop_s: f64,
    /// Longest that the machine kept the loop from a tick meanwhile.
    stall_s: f64,
    resume_s: f64,
    share: f64,
    oldest_us: i64,
    faults: usize,
}

impl Bench {
    async fn start(name: &str) -> anyhow::Result<Self> {
        let system = System::start_with(name, &["--truth"]).await?;
        let truth = PoseWatch::start(&system.data.join("tracker.sock"))?;
        Ok(Self {
            system,
            truth,
            stop_s: 0.0,
            stall_s: 0.0,
            resume_s: 0.0,
            share: 0.0,
            oldest_us: 0,
            faults: 0,
        })
    }

    async fn begin(&self, duration_s: f64) -> anyhow::Result<uuid::Uuid> {
        let run = self.system.submit(&experiment(duration_s), None).await?;
        let seen = self.system.wait_for_state(run, RunState::Running, LIMIT).await?;
        ensure!(seen.state == RunState::Running, "{:?}", seen.fault);
        Ok(run)
    }

    async fn end(&self, run: uuid::Uuid) -> anyhow::Result<(RunView, Archive)> {
        let ended = self.system.wait_until_ended(run, LIMIT).await?;
        let path = format!("/api/v1/runs/{run}/archive");
        let archive = wait_for("the archive", LIMIT, || async {
            Ok(self.system.download(&path).await.and_then(Archive::open).ok())
        });
        Ok((ended, archive.await?))
    }

    /// Both robots are well on their way.
    async fn driving(&self, run: uuid::Uuid) -> anyhow::Result<()> {
        let drive = || async {
            let seen = self.system.run(run).await?;
            ensure!(
                seen.state == RunState::Running,
                "the run is {}: {:?}",
                seen.state.as_str(),
                seen.fault
            );
            let from = Instant::now() - 3 * LOOK;
            let fast =
                |(robot, ..): &(u8, &str, f64)| self.truth.speed_m_per_s(*robot, from, 2 * LOOK) > Some(DRIVES_M_PER_S);
            Ok(ROBOTS.iter().all(fast).then_some(()))
        };
        wait_for("robots that drive", LIMIT, drive).await
    }

    fn set(&self, fault: &Fault, on: bool) -> anyhow::Result<()> {
        for camera in fault.cameras {
            match &fault.act {
                Act::Menu(kind) => {
                    let mut kind = if on { kind.clone() } else { json!({"kind": "none"}) };
                    kind["camera"] = (*camera).into();
                    self.system.hand(&json!({ "camera_fault": kind }))?;
                }
                Act::Hold => {
                    let signal = if on { libc::SIGSTOP } else { libc::SIGCONT };
                    self.system.signal(&format!("camera-{camera}"), signal)?;
                }
            }
        }
        Ok(())
    }

    /// Puts a fault on, looks at the stop port, and lets `until` pass; the fault stays.
    async fn suffer(&self, fault: &Fault, until: Duration) -> anyhow::Result<Past> {
        let before = Instant::now();
        self.set(fault, true)?;
        let on = Instant::now();
        tokio::time::sleep_until((on + JUDGED).into()).await;
        let state = self.system.stop_port("GET /state")?;
        for camera in 0..2_u16 {
            let wanted = if fault.cameras.contains(&camera) {
                fault.health
            } else {
                "live"
            };
            let found = &state["edge"]["cameras"][usize::from(camera)]["health"];
            ensure!(
                found == wanted,
                "{}: camera {camera} is {found}, not {wanted}: {state}",
                fault.name
            );
        }
        tokio::time::sleep_until((on + until).into()).await;
        Ok(Past {
            fault: fault.clone(),
            before,
            on,
            until: Instant::now(),
            ways: ROBOTS.map(|(robot, ..)| self.way(robot, before, on + SHORT)),
        })
    }

    /// How far a robot went, and the fastest that it was at the beginning.
    fn way(&self, robot: u8, from: Instant, to: Instant) -> Option<(f64, f64)> {
        let here = self.truth.mean_m(robot, from - LOOK / 2, LOOK)?;
        let there = self.truth.mean_m(robot, to - LOOK, LOOK)?;
        let starts = (0..6).map(|step| from + step * LOOK - 2 * LOOK);
        let speeds = starts.filter_map(|start| self.truth.speed_m_per_s(robot, start, 2 * LOOK));
        let way_m = f64::hypot(there[0] - here[0], there[1] - here[1]);
        Some((way_m, speeds.fold(0.0, f64::max)))
    }

    /// Nobody was driven by an old pose, whatever happened.
    fn check_ages(&mut self, archive: &Archive) -> anyhow::Result<()> {
        for (robot, name, _) in ROBOTS {
            for sent in sent(archive, robot)?.iter().filter(|sent| sent.moves) {
                self.oldest_us = self.oldest_us.max(sent.pose_age_us);
                ensure!(
                    sent.pose_age_us <= STALE_US,
                    "{name} was driven by an old pose: {sent:?}"
                );
            }
        }
        Ok(())
    }

    /// Robots that were not seen stopped in time, the others drove on.
    fn check_stop(&mut self, archive: &Archive, past: &Past) -> anyhow::Result<()> {
        self.faults += 1;
        let Past {
            fault,
            before,
            on,
            until,
            ..
        } = past;
        let name = fault.name;
        for (place, (robot, who, _)) in ROBOTS.iter().enumerate() {
            let all = sent(archive, *robot)?;
            let meanwhile: Vec<&Sent> = all.iter().filter(|sent| sent.at >= *on && sent.at < *until).collect();
            if !fault.cameras.contains(&(place as u16)) {
                let share = |sent: &[&Sent]| sent.iter().filter(|sent| sent.moves).count() as f64 / sent.len() as f64;
                let in_time = |sent: &&&Sent| !sent.late;
                let kept: Vec<&Sent> = meanwhile.iter().filter(in_time).copied().collect();
                ensure!(
                    share(&kept) > 0.98 && share(&meanwhile) > 0.8,
                    "{name}: {who} is seen and was told to move on {:.2} of the ticks, {:.2} of those with a deadline kept",
                    share(&meanwhile),
                    share(&kept)
                );
                continue;
            }
            let stop = meanwhile.iter().find(|sent| !sent.moves && !sent.late);
            let stop = stop.with_context(|| format!("{name}: {who} was not told to stop"))?;
            let asked_s = if fault.health == "frozen" { FROZEN_S } else { UNSEEN_S };
            let stop_s = (stop.at - *on).as_secs_f64();
            let stall_s = stall_s(&all, *on, stop.at);
            self.stop_s = self.stop_s.max(stop_s);
            self.stall_s = self.stall_s.max(stall_s);
            ensure!(
                stop_s <= asked_s + TICK_S + SLACK_S + stall_s,
                "{name}: {who} was told to stop after {stop_s:.3} s, the loop held up for {stall_s:.3} s"
            );
            let again = meanwhile.iter().any(|sent| sent.moves && sent.at > stop.at);
            ensure!(!again, "{name}: {who} was told to move while nobody saw it");
            // The first stop is that of old poses, not of anything else.
            let late_us = stop.pose_age_us - STALE_US;
            ensure!(
                (0..=((TICK_S + SLACK_S + stall_s) * 1e6) as i64).contains(&late_us),
                "{name}: {who}: {stop:?}"
            );
            let (way_m, seen) = past.ways[place].with_context(|| format!("{name}: no true poses of {who}"))?;
            let v = seen + SEEN_M_PER_S;
            let delay_s = UNSEEN_S + TICK_S + SLACK_S + stall_s + LINK_S + ANSWER_S + (*on - *before).as_secs_f64();
            let bound_m = v * delay_s + v * v / (2.0 * RAMP_M_PER_S2) + SEEN_M;
            self.share = self.share.max(way_m / bound_m);
            ensure!(
                way_m <= bound_m,
                "{name}: {who} went {way_m:.3} m from {v:.2} m/s, bound {bound_m:.3} m"
            );
        }
        Ok(())
    }

    fn check_resume(&mut self, archive: &Archive, past: &Past) -> anyhow::Result<()> {
        for camera in past.fault.cameras {
            let (robot, who, _) = ROBOTS[usize::from(*camera)];
            let all = sent(archive, robot)?;
            let again = all.iter().find(|sent| sent.moves && sent.at >= past.until);
            let again = again.with_context(|| format!("{}: {who} never moved again", past.fault.name))?;
            self.resume_s = self.resume_s.max((again.at - past.until).as_secs_f64());
            ensure!(
                again.at - past.until <= RESUME,
                "{}: {who} moved again after {again:?}",
                past.fault.name
            );
        }
        Ok(())
    }
}

/// Faults one after the other in one run, which ends as if nothing had been.
async fn bears_short_faults(bench: &mut Bench) -> anyhow::Result<()> {
    let faults = [
        fault("frozen", &[0], json!({"kind": "frozen"}), "frozen"),
        fault("dark", &[0], json!({"kind": "light_off"}), "live"),
        fault("wrong size", &[0], json!({"kind": "wrong_size"}), "stalled"),
        fault("damaged pixels", &[0], damaged("pixels"), "stalled"),
        fault("damaged headers", &[0], damaged("header"), "stalled"),
        fault("cut-off frames", &[0], damaged("rest"), "stalled"),
        fault(
            "swapped tags",
            &[0],
            json!({"kind": "swap_tags", "tags": [1, 2]}),
            "live",
        ),
        held("process held"),
        fault("both frozen", &[0, 1], json!({"kind": "frozen"}), "frozen"),
    ];
    let run = bench.begin(42.0).await?;
    let mut pasts = Vec::new();
    for fault in &faults {
        bench.driving(run).await.context(fault.name)?;
        pasts.push(bench.suffer(fault, SHORT).await?);
        bench.set(fault, false)?;
    }
    let (ended, archive) = bench.end(run).await?;
    ensure!(
        ended.state == RunState::Done,
        "{}: {:?}",
        ended.state.as_str(),
        ended.fault
    );
    bench.check_ages(&archive)?;
    for past in &pasts {
        bench.check_stop(&archive, past)?;
        bench.check_resume(&archive, past)?;
    }
    let edge = &archive.manifest["edge"];
    let count = |value: &Value| value.as_u64().unwrap_or(0);
    let [left, right] = [0, 1].map(|camera| &edge["cameras"][camera]);
    println!("S3 short camera faults: {} {}", edge["fusion"], edge["cameras"]);
    ensure!(left["health"] == "live" && right["health"] == "live", "{edge}");
    // A picture in sixty a second, less those before a fault is on.
    let least = (0.8 * SHORT.as_secs_f64() * 60.0) as u64;
    ensure!(count(&edge["fusion"]["frozen_frames"]) >= 3 * least, "{edge}");
    // Of the swapped tags; seeing again after half a second takes three more each time.
    ensure!(count(&edge["fusion"]["jumps"]) >= 2 * least, "{edge}");
    ensure!(count(&edge["fusion"]["too_old_frames"]) > 0, "{edge}");
    ensure!(count(&left["refused"]["size"]) >= least, "{edge}");
    ensure!(count(&left["refused"]["pixels"]) >= least, "{edge}");
    ensure!(right["refused"] == json!({"size": 0, "pixels": 0}), "{edge}");
    for (process, words) in [
        ("lab", "the camera repeats its picture; not used"),
        ("camera-0", "the pictures cannot be used"),
        ("camera-0", "pixels damaged on the way; not used"),
        ("camera-0", "the header's checksum is wrong"),
        ("camera-0", "the header begins with"),
    ] {
        let log = bench.system.process_log(process);
        ensure!(log.contains(words), "{words:?} is not in the log of {process}:\n{log}");
    }
    Ok(())
}

/// A fault that stays ends the run with words, and robots rest.
async fn ends_by(bench: &mut Bench, fault: &Fault) -> anyhow::Result<()> {
    let run = bench.begin(45.0).await?;
    bench.driving(run).await.context(fault.name)?;
    let past = bench.suffer(fault, RESTING + 5 * LOOK).await?;
    for (robot, who, _) in ROBOTS {
        let speed = bench.truth.speed_m_per_s(robot, past.on + RESTING, 4 * LOOK);
        let speed = speed.with_context(|| format!("{}: no true poses of {who}", fault.name))?;
        ensure!(
            speed < SEEN_M_PER_S,
            "{}: {who} moves at {speed:.3} m/s after {RESTING:?}",
            fault.name
        );
    }
    let (ended, archive) = bench.end(run).await?;
    bench.set(fault, false)?;
    let told = ended.fault.with_context(|| format!("{}: no fault", fault.name))?;
    println!(
        "S3 {}: {} {:?}: {}",
        fault.name,
        ended.state.as_str(),
        told.code,
        told.message
    );
    ensure!(
        ended.state == RunState::Failed && told.whose == Whose::Platform && told.message.contains("1000 ms"),
        "{}: {told:?}",
        fault.name
    );
    let mut unseen = fault.cameras.iter().map(|camera| ROBOTS[usize::from(*camera)].1);
    let named = told.code == "pose_lost" && unseen.any(|robot| told.message.contains(robot));
    // With all cameras out the last picture and the last pose of a robot may be the same.
    let silent = told.code == "tracker_silent" && fault.cameras.len() == ROBOTS.len();
    ensure!(named || silent, "{}: {told:?}", fault.name);
    bench.check_ages(&archive)?;
    // The run is over after a second, so all who are seen stop then.
    let first = Past {
        until: past.on + Duration::from_millis(800),
        ..past
    };
    bench.check_stop(&archive, &first)?;
    let health = &archive.manifest["edge"]["cameras"][0]["health"];
    ensure!(health == fault.health, "{}: the manifest says {health}", fault.name);
    Ok(())
}

/// A camera's process is killed: the run goes on if it is back within a second, and else ends because of it.
async fn dies(bench: &mut Bench) -> anyhow::Result<()> {
    let run = bench.begin(8.0).await?;
    bench.driving(run).await?;
    let before = bench.system.pid("camera-0")?;
    bench.system.kill_9("camera-0")?;
    let (ended, archive) = bench.end(run).await?;
    bench.check_ages(&archive)?;
    let ages = sent(&archive, ROBOTS[0].0)?;
    let oldest_us = ages.iter().map(|sent| sent.pose_age_us).max().unwrap_or(0);
    println!(
        "S3 camera killed: {}, poses at most {} ms old",
        ended.state.as_str(),
        oldest_us / 1000
    );
    let code = ended.fault.as_ref().map(|fault| fault.code.as_str());
    let wanted = if oldest_us > 1_000_000 {
        (RunState::Failed, Some("pose_lost"))
    } else {
        (RunState::Done, None)
    };
    ensure!(
        (ended.state, code) == wanted,
        "{oldest_us} us: {} {code:?}",
        ended.state.as_str()
    );
    ensure!(oldest_us > STALE_US, "the camera was not missed: {oldest_us} us");
    ensure!(
        bench.system.pid("camera-0")? != before,
        "the process was not started again"
    );
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_that_no_camera_sees_stop_and_the_run_goes_on_or_ends_with_words() -> anyhow::Result<()> {
    let mut bench = Bench::start("camera-faults").await?;
    bears_short_faults(&mut bench).await?;
    for fault in [
        fault("frozen for good", &[0], json!({"kind": "frozen"}), "frozen"),
        fault("dark for good", &[0], json!({"kind": "light_off"}), "live"),
        held("process held for good"),
        fault("both frozen for good", &[0, 1], json!({"kind": "frozen"}), "frozen"),
    ] {
        ends_by(&mut bench, &fault).await?;
    }
    dies(&mut bench).await?;
    let run = bench.begin(6.0).await?;
    let (ended, archive) = bench.end(run).await?;
    ensure!(ended.state == RunState::Done, "{:?}", ended.fault);
    bench.check_ages(&archive)?;
    println!(
        "S3 cameras: {} faults on rendered video; stop at most {:.0} ms after the fault, motion at most {:.0} ms after its end; way at most {:.2} of \
         its bound; no robot driven by a pose older than {} ms; \
         the loop held up for at most {:.0} ms",
        bench.faults,
        1e3 * bench.stop_s,
        1e3 * bench.resume_s,
        bench.share,
        bench.oldest_us / 1000,
        1e3 * bench.stall_s
    );
    let left = bench.system.stop()?;
    ensure!(left.is_empty(), "left behind: {left:?}");
    Ok(())
}
