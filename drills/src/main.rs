//! `robopheus-drills`: figures of the laboratory without a laboratory's clock.

use anyhow::Result;
use clap::{Parser, Subcommand};
use drills::adversary::{self, Aim};
use drills::{
    agent, approach, audit, blind, closest, deadlock, falsify, ladder, link_loss, obstacles, sight, stale, strangers,
    table, tracking,
};
use emulator::camera::CameraSettings;
use std::process::ExitCode;

/// Drives the laboratory's own code against the emulated plant in virtual time, and prints figures.
#[derive(Debug, Parser)]
#[command(name = "robopheus-drills", version)]
struct Arguments {
    #[command(subcommand)]
    drill: Drill,
}

#[derive(Debug, Subcommand)]
enum Drill {
    /// S5: hostile runs of 10 s on the emulated plant; collisions and smallest distances
    Adversary(Runs),
    /// S5: the same among obstacles that stand and robots that are pushed about
    Obstacles(Runs),
    /// How the closest two robots of a run of S5 came there, tick by tick
    Closest {
        number: u64,
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Of the runs among obstacles
        #[arg(long)]
        obstacles: bool,
    },
    /// S7: the same, driving at walls
    Geofence(Runs),
    /// S5: search for a collision by CMA-ES
    Falsify(Runs),
    /// S1: cuts of the link to a robot
    LinkLoss(Runs),
    /// S2: robot-hours on a bursty link
    Nuisance(Runs),
    /// S3: the localisation goes blind or lies, so many times in each of five ways
    Blind(Runs),
    /// S4: frames that must not move a robot
    Stale(Runs),
    /// S8: every frame that leaves the laboratory against the order of its tick; so many frames
    Audit(Runs),
    /// Robots drive from anywhere to the starts of an experiment
    Approach(Runs),
    /// How a ride of `approach` goes, second by second
    Ride {
        number: u64,
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// S9: antipodal swaps
    Deadlock(Runs),
    /// S13: so many words of a law that lies
    Liar(Runs),
    /// S14: batteries that run down, wheels that are held, gyros that lie
    Ladder(Runs),
    /// S11: the laboratory's process killed or stopped
    Agent(Runs),
    /// A robot that is not in the run stands in the way or is pushed about
    Strangers(Runs),
    /// Laws with and without looking ahead at total delays of 20, 50 and 80 ms, so many runs of each
    Tracking(Runs),
    /// The paper's experiments A, A+, B and C; a table, and everything as JSON
    Abc(Abc),
    /// Localisation on rendered video with twelve moving tags
    Sight {
        #[arg(long, default_value_t = 6000)]
        frames: u64,
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
}

/// What of the paper's experiments.
#[derive(Debug, Clone, clap::Args)]
struct Abc {
    /// All six when left out
    #[arg(long)]
    chassis: Vec<String>,
    /// Hidden floors of each
    #[arg(long, default_value_t = 3)]
    floors: u64,
    /// Number of the first floor
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// On the paper's path
    #[arg(long, default_value_t = 2)]
    rounds: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Writes everything here
    #[arg(long)]
    json: Option<std::path::PathBuf>,
    /// Writes A's settings, the best of the grid on the nominal twin, here; drives no plant
    #[arg(long)]
    settings: Option<std::path::PathBuf>,
}

/// How many runs, and which.
#[derive(Debug, Clone, Copy, clap::Args)]
struct Runs {
    /// 0: as many as the reliability table asks for
    #[arg(long, default_value_t = 0)]
    count: u64,
    /// Number of the first run
    #[arg(long, default_value_t = 0)]
    first: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[arg(long, default_value_t = 2)]
    threads: usize,
}

impl Runs {
    fn or(&self, full: u64) -> u64 {
        if self.count == 0 { full } else { self.count }
    }
}

fn main() -> Result<ExitCode> {
    let holds = match Arguments::parse().drill {
        Drill::Adversary(runs) => {
            let rows = adversary::run(Aim::Anything, runs.first, runs.or(30_000), runs.seed, runs.threads)?;
            table::print(&rows)
        }
        Drill::Obstacles(runs) => table::print(&obstacles::run(runs.first, runs.or(3000), runs.seed, runs.threads)?),
        Drill::Closest {
            number,
            seed,
            obstacles,
        } => {
            closest::print(&if obstacles {
                obstacles::attack(seed, number)
            } else {
                adversary::attack(Aim::Anything, seed, number)
            })?;
            true
        }
        Drill::Ride { number, seed } => {
            approach::print(number, seed)?;
            true
        }
        Drill::Geofence(runs) => {
            let rows = adversary::run(Aim::Walls, runs.first, runs.or(3000), runs.seed, runs.threads)?;
            table::print(&rows)
        }
        Drill::Liar(runs) => {
            let tens = runs.or(1_000_000).div_ceil(adversary::WORDS_PER_TEN_RUNS);
            let rows = adversary::run(Aim::Lies, runs.first, 10 * tens, runs.seed, runs.threads)?;
            table::print(&rows)
        }
        Drill::Falsify(runs) => table::print(&falsify::run(runs.or(5000), runs.seed, runs.threads)?),
        Drill::LinkLoss(runs) => table::print(&link_loss::cuts(runs.or(10_000), runs.seed, runs.threads)?),
        Drill::Nuisance(runs) => table::print(&link_loss::nuisance(runs.or(1000), runs.seed, runs.threads)?),
        Drill::Blind(runs) => table::print(&blind::run(runs.or(2000), runs.seed, runs.threads)?),
        Drill::Stale(runs) => table::print(&stale::run(runs.or(1_000_000), runs.seed, runs.threads)?),
        Drill::Deadlock(runs) => table::print(&deadlock::run(runs.first, runs.or(1000), runs.seed, runs.threads)?),
        Drill::Audit(runs) => table::print(&audit::run(runs.or(1_000_000), runs.seed, runs.threads)?),
        Drill::Approach(runs) => table::print(&approach::run(runs.first, runs.or(500), runs.seed, runs.threads)?),
        Drill::Ladder(runs) => table::print(&ladder::run(runs.or(100), runs.seed, runs.threads)?),
        Drill::Agent(runs) => table::print(&agent::run(runs.or(200), runs.seed, runs.threads)?),
        Drill::Strangers(runs) => table::print(&strangers::run(runs.or(300), runs.seed, runs.threads)?),
        Drill::Tracking(runs) => {
            let lines = tracking::run(runs.or(4), runs.seed, runs.threads, &tracking::Course::ALL)?;
            tracking::print(&lines)
        }
        Drill::Abc(arguments) => abc(&arguments)?,
        Drill::Sight { frames, seed } => sight(frames, seed)?,
    };
    Ok(ExitCode::from(u8::from(!holds)))
}

fn abc(arguments: &Abc) -> Result<bool> {
    use drills::abc::{experiment, learned::Threads, settings, table};
    if let Some(path) = &arguments.settings {
        let text = serde_json::to_string_pretty(&settings::all(arguments.threads)?)?;
        std::fs::write(path, text + "\n")?;
        return Ok(true);
    }
    let chosen = settings::committed()?;
    let mut outcomes = Vec::new();
    for (chassis, setting) in &chosen {
        if !(arguments.chassis.is_empty() || arguments.chassis.contains(chassis)) {
            continue;
        }
        for floor in arguments.first..arguments.first + arguments.floors {
            let clock = std::time::Instant::now();
            let workers = Threads(arguments.threads);
            let mut outcome = experiment::run(chassis, floor, arguments.rounds, arguments.seed, setting, &workers)?;
            outcome.seconds = clock.elapsed().as_secs_f64();
            eprintln!(
                "{chassis}, floor {floor}: {:.0} s; {}",
                outcome.seconds, outcome.sentence
            );
            eprintln!("  {}; {}", outcome.effects.join(", "), outcome.residual);
            outcomes.push(outcome);
            if let Some(path) = &arguments.json {
                std::fs::write(path, serde_json::to_string_pretty(&outcomes)? + "\n")?;
            }
        }
    }
    Ok(table::print(&outcomes))
}

/// Paper's time for finding the tags of one picture.
const PAPER_MS: f64 = 6.0;

/// `true` when every figure is as asked.
fn sight(frames: u64, seed: u64) -> Result<bool> {
    let settings = CameraSettings {
        seed,
        ..CameraSettings::default()
    };
    // A thousand timed frames give a quantile; more only cost time.
    let timed = (frames / 1000).max(1);
    let seen = sight::run(frames, timed, settings, &mut |done| {
        if done % 10_000 == 0 {
            eprintln!("{done} of {frames} frames");
        }
    })?;
    let share = seen.found as f64 / seen.tags as f64;
    let p95_ms = seen.quantile_ms(0.95);
    let yaw_deg = seen.yaw_rms_rad.to_degrees();
    println!(
        "{:<44} {:>22} {:>12}",
        "localisation, 640 x 480, 12 moving tags", "figure", "asked"
    );
    let row = |what: &str, figure: String, asked: &str| println!("{what:<44} {figure:>22} {asked:>12}");
    row(
        "find the tags, p50 / p95 / p99, ms",
        format!(
            "{:.2} / {p95_ms:.2} / {:.2}",
            seen.quantile_ms(0.5),
            seen.quantile_ms(0.99)
        ),
        "p95 <= 3",
    );
    row("the paper's, ms", format!("{PAPER_MS:.0}"), "");
    row(
        "tags found",
        format!("{:.3} % of {}", 100.0 * share, seen.tags),
        ">= 99.5 %",
    );
    row(
        "position, root mean square / worst, mm",
        format!("{:.2} / {:.2}", seen.position_rms_m * 1e3, seen.position_worst_m * 1e3),
        "<= 2",
    );
    row("yaw, root mean square, deg", format!("{yaw_deg:.3}"), "<= 0.5");
    row(
        "false identities",
        format!("{} in {} frames", seen.false_identities, seen.frames),
        "0",
    );
    let holds =
        p95_ms <= 3.0 && share >= 0.995 && seen.position_rms_m <= 0.002 && yaw_deg <= 0.5 && seen.false_identities == 0;
    if !holds {
        println!("a figure is not what is asked");
    }
    Ok(holds)
}
