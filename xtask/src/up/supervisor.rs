//! Keeps processes running: starts them again when they die, stops them in order.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::sys;

const FIRST_WAIT: Duration = Duration::from_millis(200);
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// A process that lived this long is healthy: its next death waits the first wait again.
const HEALTHY_AFTER: Duration = Duration::from_secs(10);
/// Deaths in a row, while the system starts, after which starting is given up.
const DEATHS_AT_START_MAX: u32 = 6;
/// A log larger than this is put aside at the next start of its process.
const LOG_MAX_BYTES: u64 = 64 << 20;
const LOG_TAIL_LINES: usize = 20;

/// How a process is asked to end.
#[derive(Clone, Copy, Debug)]
pub struct StopWay {
    /// Low ranks are stopped first.
    pub rank: u8,
    pub ask: libc::c_int,
    /// Sent when it has not ended after `patience`.
    pub insist: libc::c_int,
    pub patience: Duration,
}

/// How a process is started, any number of times.
pub struct Plan<'a> {
    pub name: &'static str,
    pub command: Box<dyn Fn() -> Result<Command> + 'a>,
    pub stop: StopWay,
    /// Signal it gets when the supervisor itself dies.
    pub on_our_death: libc::c_int,
}

struct Process<'a> {
    plan: Plan<'a>,
    child: Option<Child>,
    started: Instant,
    wait: Duration,
    /// When a dead process is started again; `None` before its first start.
    due: Option<Instant>,
    deaths: u32,
}

/// The processes in the order of their start.
pub struct Supervisor<'a> {
    processes: Vec<Process<'a>>,
    logs: PathBuf,
}

impl<'a> Supervisor<'a> {
    pub fn new(plans: Vec<Plan<'a>>, logs: PathBuf) -> Self {
        let now = Instant::now();
        let processes = plans.into_iter().map(|plan| Process {
            plan,
            child: None,
            started: now,
            wait: FIRST_WAIT,
            due: None,
            deaths: 0,
        });
        Self {
            processes: processes.collect(),
            logs,
        }
    }

    pub fn names(&self) -> Vec<&'static str> {
        self.processes.iter().map(|process| process.plan.name).collect()
    }

    /// Running processes.
    pub fn pids(&self) -> BTreeMap<&'static str, u32> {
        self.processes
            .iter()
            .filter_map(|process| Some((process.plan.name, process.child.as_ref()?.id())))
            .collect()
    }

    /// First start of a process. From then on it is started again whenever it dies.
    pub fn start(&mut self, name: &str) {
        for process in self.processes.iter_mut().filter(|process| process.plan.name == name) {
            process.start(&self.logs);
        }
    }

    /// Looks after all processes once. `true` when any was started or died.
    pub fn look(&mut self) -> bool {
        let mut changed = false;
        for process in &mut self.processes {
            changed |= process.bury(&self.logs);
            if process.child.is_none() && process.due.is_some_and(|due| due <= Instant::now()) {
                process.start(&self.logs);
                changed = true;
            }
        }
        changed
    }

    /// True when a process died so often in a row that waiting for it is pointless.
    pub fn has_given_up(&self, name: &str) -> bool {
        self.processes
            .iter()
            .any(|process| process.plan.name == name && process.deaths >= DEATHS_AT_START_MAX)
    }

    /// Last lines of a process's log.
    pub fn log_tail(&self, name: &str) -> String {
        let bytes = fs::read(self.logs.join(format!("{name}.log"))).unwrap_or_default();
        let text = String::from_utf8_lossy(&bytes);
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(LOG_TAIL_LINES)..].join("\n")
    }

    /// Stops all in order. `false` when one had to be killed. A further Ctrl-C meanwhile ends all patience.
    pub fn stop(&mut self) -> bool {
        let asked = sys::ends_asked();
        let mut clean = true;
        self.processes.sort_by_key(|process| process.plan.stop.rank);
        for process in &mut self.processes {
            clean &= process.stop(asked);
        }
        clean
    }
}

impl Drop for Supervisor<'_> {
    fn drop(&mut self) {
        self.stop();
    }
}

impl Process<'_> {
    fn start(&mut self, logs: &std::path::Path) {
        self.started = Instant::now();
        self.due = None;
        match self.spawn(logs) {
            Ok(child) => self.child = Some(child),
            Err(error) => {
                eprintln!("up: {} cannot start: {error:#}", self.plan.name);
                self.wait_longer();
            }
        }
    }

    fn spawn(&self, logs: &std::path::Path) -> Result<Child> {
        let log = open_log(&logs.join(format!("{}.log", self.plan.name)))?;
        let mut command = (self.plan.command)()?;
        command.stdout(log.try_clone()?).stderr(log).process_group(0);
        sys::die_with_parent(&mut command, self.plan.on_our_death);
        command
            .spawn()
            .with_context(|| format!("start {}", command.get_program().display()))
    }

    /// Notices a death and plans the next start. `true` when it died.
    fn bury(&mut self, logs: &std::path::Path) -> bool {
        let Some(child) = &mut self.child else { return false };
        let Ok(Some(status)) = child.try_wait() else {
            return false;
        };
        // Whatever it started itself goes with it.
        sys::signal_group(child.id(), libc::SIGKILL);
        self.child = None;
        if self.started.elapsed() > HEALTHY_AFTER {
            self.wait = FIRST_WAIT;
            self.deaths = 0;
        }
        let log = logs.join(format!("{}.log", self.plan.name));
        let wait = self.wait;
        self.wait_longer();
        println!(
            "up: {} ended ({}); starting it again in {:.1} s (log {})",
            self.plan.name,
            in_words(status),
            wait.as_secs_f64(),
            log.display()
        );
        true
    }

    fn wait_longer(&mut self) {
        self.deaths += 1;
        self.due = Some(Instant::now() + self.wait);
        self.wait = (self.wait * 2).min(LONGEST_WAIT);
    }

    fn stop(&mut self, asked: u32) -> bool {
        self.due = None;
        let Some(mut child) = self.child.take() else {
            return true;
        };
        let way = self.plan.stop;
        // Its own process only: a database server passes the word on to its children itself.
        sys::signal_process(child.id(), way.ask);
        let begun = Instant::now();
        while begun.elapsed() < way.patience && sys::ends_asked() == asked {
            if let Ok(Some(_)) = child.try_wait() {
                sys::signal_group(child.id(), libc::SIGKILL);
                return true;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        println!("up: {} does not end by itself; killing it", self.plan.name);
        sys::signal_process(child.id(), way.insist);
        let insisted = Instant::now();
        while insisted.elapsed() < Duration::from_millis(300) && !matches!(child.try_wait(), Ok(Some(_))) {
            std::thread::sleep(Duration::from_millis(10));
        }
        sys::signal_group(child.id(), libc::SIGKILL);
        child.wait().ok();
        false
    }
}

fn open_log(file: &std::path::Path) -> Result<File> {
    if file.metadata().is_ok_and(|meta| meta.len() > LOG_MAX_BYTES) {
        fs::rename(file, file.with_extension("log.1"))?;
    }
    OpenOptions::new()
        .create(true)
        .append(true)
        .open(file)
        .with_context(|| format!("open {}", file.display()))
}

fn in_words(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt;
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => format!("signal {signal}"),
        (None, None) => status.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(name: &'static str, script: &'static str, rank: u8) -> Plan<'static> {
        let command = move || {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            Ok(command)
        };
        let stop = StopWay {
            rank,
            ask: libc::SIGTERM,
            insist: libc::SIGKILL,
            patience: Duration::from_millis(500),
        };
        Plan {
            name,
            command: Box::new(command),
            stop,
            on_our_death: libc::SIGKILL,
        }
    }

    fn logs(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("xtask-supervisor-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn look_until(supervisor: &mut Supervisor, holds: impl Fn(&Supervisor) -> bool) {
        let begun = Instant::now();
        while !holds(supervisor) {
            assert!(begun.elapsed() < Duration::from_secs(20), "the condition never held");
            supervisor.look();
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    #[test]
    fn a_killed_process_is_started_again_with_another_number() {
        let folder = logs("again");
        let mut supervisor = Supervisor::new(vec![shell("sleeper", "sleep 60", 1)], folder.clone());
        supervisor.start("sleeper");
        let first = supervisor.pids()["sleeper"];
        assert!(sys::signal_process(first, libc::SIGKILL));
        look_until(&mut supervisor, |now| {
            now.pids().get("sleeper").is_some_and(|pid| *pid != first)
        });
        assert!(supervisor.stop());
        assert!(supervisor.pids().is_empty());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_process_that_keeps_dying_is_waited_for_longer_and_given_up() {
        let folder = logs("dying");
        let mut supervisor = Supervisor::new(
            vec![shell("broken", "echo cannot read settings; exit 3", 1)],
            folder.clone(),
        );
        supervisor.start("broken");
        let begun = Instant::now();
        look_until(&mut supervisor, |now| now.has_given_up("broken"));
        // 0.2 + 0.4 + 0.8 + 1.6 + 3.2 s between six deaths.
        assert!(begun.elapsed() > Duration::from_secs(6), "{:?}", begun.elapsed());
        assert!(supervisor.log_tail("broken").contains("cannot read settings"));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn stopping_goes_by_rank_and_kills_the_deaf_with_its_children() {
        let folder = logs("stop");
        let deaf = shell("deaf", "trap '' TERM; sleep 61 & wait; wait; sleep 61", 1);
        let good = shell("good", "trap 'echo ended; exit 0' TERM; sleep 60 & wait", 2);
        let mut supervisor = Supervisor::new(vec![good, deaf], folder.clone());
        supervisor.start("good");
        supervisor.start("deaf");
        let pids = supervisor.pids();
        std::thread::sleep(Duration::from_millis(200));
        assert!(!supervisor.stop(), "the deaf one had to be killed");
        for pid in pids.values() {
            // A killed grandchild stays in the table until process 1 takes note of it.
            let begun = Instant::now();
            while sys::signal_group(*pid, 0) {
                assert!(
                    begun.elapsed() < Duration::from_secs(10),
                    "something of group {pid} is left"
                );
                std::thread::sleep(Duration::from_millis(10));
            }
        }
        assert!(supervisor.log_tail("good").contains("ended"));
        fs::remove_dir_all(&folder).unwrap();
    }
}
