//! `cargo xtask up`: the whole system on this machine, from nothing.

mod keys;
mod lock;
mod ports;
mod programs;
mod record;
mod supervisor;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::cluster::{Cluster, Durability};
use crate::setup::{Found, Needs, set_up};
use crate::{End, bundle, paths, run, sys};
use lock::Lock;
use ports::Ports;
use programs::{Choice, Programs};
use record::Record;
use supervisor::Supervisor;

/// Longest wait for one process to be ready, database migrations and crash recovery included.
const READY_LIMIT: Duration = Duration::from_secs(60);
/// How often the processes are looked after.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// The laboratory that is started when none is named.
pub const REFERENCE: &str = "examples/lab/reference.json";

#[derive(Args, Clone)]
pub struct UpArguments {
    /// Port of the service on 127.0.0.1; 0 takes any free one
    #[arg(long, default_value_t = 8080)]
    pub port: u16,
    /// Folder for everything that is kept: database, files, tokens, logs
    #[arg(long, default_value = "data")]
    pub data: PathBuf,
    /// Start the service without a laboratory
    #[arg(long)]
    pub no_lab: bool,
    /// Let a tracker tell the robots' poses instead of cameras
    #[arg(long)]
    pub tracker: bool,
    /// Document of the laboratory (for example examples/lab/furnished.json, a room with obstacles)
    #[arg(long, default_value = REFERENCE)]
    pub lab: PathBuf,
    /// Docks: robots of a finished run drive home and charge (for example examples/lab/docks.json)
    #[arg(long)]
    pub docks: Option<PathBuf>,
    /// The emulated laboratory in virtual time: a run takes a second or two instead of its duration
    #[arg(long, conflicts_with_all = ["no_lab", "tracker", "measure", "truth"])]
    pub quick: bool,
    /// Write down when robots applied commands (logs/applied.csv)
    #[arg(long, hide = true)]
    pub measure: bool,
    /// A tracker tells the robots' true poses beside the cameras (tracker.sock); the laboratory does not hear it
    #[arg(long, hide = true)]
    pub truth: bool,
    /// Take the programs and bundles as they are
    #[arg(long, hide = true)]
    pub skip_build: bool,
}

/// Runs until Ctrl-C or SIGTERM.
pub fn up(arguments: &UpArguments) -> Result<End> {
    let data = make_data_folder(&arguments.data)?;
    let Some(_lock) = Lock::take(&data)? else {
        eprintln!("{}", lock::already_running(&data));
        return Ok(End::Failed);
    };
    let ports = match Ports::choose(arguments.port) {
        Ok(ports) => ports,
        Err(words) => {
            eprintln!("{words}");
            return Ok(End::Failed);
        }
    };
    let own_database = std::env::var("DATABASE_URL").ok().filter(|url| !url.is_empty());
    let needs = Needs {
        wasm: !arguments.skip_build,
        postgres: own_database.is_none(),
        browser: false,
        python: false,
    };
    let Some(found) = set_up(needs)? else {
        return Ok(End::Missing);
    };
    if !arguments.skip_build {
        build(&found)?;
    }
    let cluster = match (&found.postgres, &own_database) {
        (Some(binaries), None) => Some(Cluster::prepare(binaries, &data, Durability::Safe)?),
        _ => None,
    };
    let programs = Programs::new(&data, ports, cluster, own_database, Choice::of(arguments)?)?;
    sys::catch_end_signals();
    serve(&data, &programs)
}

fn make_data_folder(folder: &Path) -> Result<PathBuf> {
    fs::create_dir_all(folder.join("logs")).with_context(|| format!("make the data folder {}", folder.display()))?;
    folder
        .canonicalize()
        .with_context(|| format!("find {}", folder.display()))
}

/// Native programs and browser bundles. One package selection for `up` and `test`: nothing is built twice.
fn build(found: &Found) -> Result<()> {
    println!("up: building the programs");
    run::succeed(&mut run::cargo(["build", "--locked", "--bins"]))?;
    bundle::build(found.wasm.as_ref().context("no wasm toolchain after setup")?)
}

fn serve(data: &Path, programs: &Programs) -> Result<End> {
    let record = Record::new(data, programs.ports());
    record.remove();
    let mut supervisor = Supervisor::new(programs.plans()?, data.join("logs"));
    let started = start(&mut supervisor, programs, &record);
    if let Err(error) = &started {
        eprintln!("up: {error:#}");
    } else if sys::ends_asked() == 0 {
        announce(data, programs);
        while sys::ends_asked() == 0 {
            if supervisor.look() {
                record.write(&supervisor.pids())?;
            }
            sys::doze(LOOK_PERIOD);
        }
    }
    println!("up: stopping");
    let clean = supervisor.stop();
    programs.remove_sockets();
    record.remove();
    println!("up: stopped");
    Ok(if started.is_ok() && clean {
        End::Good
    } else {
        End::Failed
    })
}

/// Starts one process after the other, each once the one before it is ready.
fn start(supervisor: &mut Supervisor, programs: &Programs, record: &Record) -> Result<()> {
    for name in supervisor.names() {
        println!("up: starting {name}");
        supervisor.start(name);
        let begun = std::time::Instant::now();
        while !programs.is_ready(name) {
            if sys::ends_asked() > 0 {
                return Ok(());
            }
            supervisor.look();
            if begun.elapsed() > READY_LIMIT || supervisor.has_given_up(name) {
                bail!(
                    "{name} does not become ready; the end of its log:\n{}",
                    supervisor.log_tail(name)
                );
            }
            sys::doze(LOOK_PERIOD);
        }
        if programs.serves(name) {
            record.write(&supervisor.pids())?;
        }
    }
    record.write(&supervisor.pids())
}

fn announce(data: &Path, programs: &Programs) {
    let ports = programs.ports();
    println!("\nRobopheus is ready: http://127.0.0.1:{}/", ports.server);
    if programs.is_quick() {
        println!("  emulated laboratory in virtual time (--quick): runs take as long as the machine needs");
    } else if programs.has_lab() {
        println!(
            "  emulated laboratory: stop button http://127.0.0.1:{}/, robots on UDP from {}",
            ports.lab_stop,
            ports.robot_udp_base + 1
        );
    } else {
        println!("  without a laboratory (--no-lab)");
    }
    println!("  data {}, logs {}", data.display(), data.join("logs").display());
    println!("  Ctrl-C stops everything\n");
    if !bundle::folder().join("web_ui.js").is_file() {
        println!("  The dashboard is not built: run `cargo xtask wasm`.");
    }
    if !paths::root().join("static/index.html").is_file() {
        println!("  static/index.html is missing: the page cannot open.");
    }
}
