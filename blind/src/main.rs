//! `robopheus-blind`: runs sets of the bench and prints its table.

use anyhow::{Context, Result, bail, ensure};
use blind::bench::{append, lines, rescored, results_path, run_set};
use blind::kind::Kind;
use blind::set::{Robots, Wish, runs_of_a_set};
use blind::table::markdown;
use blind::truth::Vault;
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Time of the quick slice.
const QUICK: Duration = Duration::from_secs(170);

#[derive(Parser)]
#[command(name = "robopheus-blind", about = "Blind identification bench", version)]
struct Arguments {
    /// Shorter runs, and an end after three minutes
    #[arg(long)]
    quick: bool,
    /// Sets of the whole bench
    #[arg(long, default_value_t = 400)]
    sets: u64,
    /// This part of the sets: I/N, from 1
    #[arg(long, default_value = "1/1")]
    shard: String,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Whose runs
    #[arg(long, value_enum, default_value_t)]
    robots: Robots,
    /// Only sets of this kind
    #[arg(long)]
    kind: Option<Kind>,
    #[arg(long)]
    chassis: Option<String>,
    /// The first effect of every set
    #[arg(long)]
    effect: Option<String>,
    /// Runs of a set beside its references; the first ones are the same with any number
    #[arg(long, default_value_t = Wish::standard().runs, value_parser = runs_of_a_set)]
    runs: usize,
    /// References of a set, the same way; of halves at most three each, of many none [default: 4, with --quick 3]
    #[arg(long, value_parser = runs_of_a_set)]
    references: Option<usize>,
    /// Go on in this folder
    #[arg(long)]
    resume: Option<PathBuf>,
    /// Folder for truths, results and table
    #[arg(long)]
    out: Option<PathBuf>,
    /// Begin no set after this many minutes
    #[arg(long)]
    minutes: Option<f64>,
    /// Only these numbers, made again
    #[arg(long, num_args = 1..)]
    only: Vec<u64>,
    /// Leave run bundles and reports as files beside the truths
    #[arg(long)]
    keep: bool,
    /// Only the table of what is there
    #[arg(long)]
    table: bool,
    /// Score the reports again that --keep has left, and diagnose nothing
    #[arg(long, conflicts_with_all = ["table", "keep"])]
    rescore: bool,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let (shard, shards) = shard(&arguments.shard)?;
    let out = match (&arguments.resume, &arguments.out) {
        (Some(folder), _) => {
            ensure!(folder.is_dir(), "--resume: {} is no folder", folder.display());
            folder.clone()
        }
        (None, Some(folder)) => folder.clone(),
        (None, None) => PathBuf::from(format!("target/blind/seed-{}", arguments.seed)),
    };
    std::fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
    if !arguments.table {
        run(&arguments, shard, shards, &out)?;
    }
    let lines = lines(&out)?;
    let text = markdown(&lines);
    let path = out.join("table.md");
    std::fs::write(&path, &text)?;
    println!("{text}\n{} sets, {}", lines.len(), path.display());
    Ok(())
}

fn run(arguments: &Arguments, shard: u64, shards: u64, out: &std::path::Path) -> Result<()> {
    let mut wish = Wish {
        kind: arguments.kind,
        chassis: arguments.chassis.clone(),
        effect: arguments.effect.clone(),
        robots: arguments.robots,
        runs: arguments.runs,
        ..Wish::standard()
    };
    if arguments.quick {
        (wish.seconds, wish.references) = (12, 3);
    }
    wish.references = arguments.references.unwrap_or(wish.references);
    let wanted = format!("seed {} {wish:?}\n", arguments.seed);
    let settings = out.join("settings.txt");
    match std::fs::read_to_string(&settings) {
        Ok(found) => ensure!(
            found == wanted,
            "{} holds sets made with other settings: {found}name another folder with --out",
            out.display()
        ),
        Err(_) => std::fs::write(&settings, wanted)?,
    }
    let vault = Vault::new(out)?;
    let done = lines(out)?;
    let is_done = |number: &u64| done.iter().any(|line| line.set == *number);
    let all: Vec<u64> = if !arguments.only.is_empty() {
        arguments.only.clone()
    } else if arguments.rescore {
        done.iter().map(|line| line.set).collect()
    } else {
        (0..arguments.sets).filter(|number| !is_done(number)).collect()
    };
    let is_own = |number: &u64| number % shards == shard;
    let numbers: Vec<u64> = all.into_iter().filter(is_own).collect();
    let limit = match (arguments.quick, arguments.minutes) {
        (_, Some(minutes)) => Some(Duration::from_secs_f64(60.0 * minutes)),
        (true, None) if !arguments.rescore => Some(QUICK),
        _ => None,
    };
    let keep = arguments.keep.then(|| out.join("kept"));
    let bar = ProgressBar::new(numbers.len() as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} {elapsed} left {eta} {msg}") {
        bar.set_style(style);
    }
    let is_again = arguments.rescore || !arguments.only.is_empty();
    let (started, path) = (Instant::now(), results_path(out, (shard, shards), is_again));
    let mut longest = Duration::ZERO;
    for number in numbers {
        if limit.is_some_and(|limit| started.elapsed() + longest > limit) {
            break;
        }
        let begun = Instant::now();
        let line = if arguments.rescore {
            let old = done.iter().find(|line| line.set == number);
            let old = old.with_context(|| format!("--rescore: {} has no result of set {number}", out.display()))?;
            rescored(arguments.seed, old, &wish, &vault, &out.join("kept"))?
        } else {
            run_set(arguments.seed, number, &wish, &vault, keep.as_deref())?
        };
        append(&path, &line)?;
        longest = longest.max(begun.elapsed());
        bar.inc(1);
        bar.set_message(format!("{:?} {}", line.kind, line.chassis));
    }
    bar.finish_and_clear();
    Ok(())
}

/// Part and number of parts of `I/N`, the part from 0.
fn shard(text: &str) -> Result<(u64, u64)> {
    let numbers = text
        .split_once('/')
        .and_then(|(i, n)| Some((i.parse::<u64>().ok()?, n.parse::<u64>().ok()?)));
    match numbers {
        Some((i, n)) if 1 <= i && i <= n => Ok((i - 1, n)),
        _ => bail!("--shard {text:?}: I/N with 1 <= I <= N, as 1/4"),
    }
}
