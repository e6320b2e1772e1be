//! The parent's side: a program behind a pipe, asked with a deadline.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use control::law::{Fault, FaultKind};
use controllers::answer::{Answer, readable};
use controllers::program::{Program, Reply};
use controllers::source::Source;
use controllers::view::{Setup, View};

use crate::message::{Ask, MAX_LINE_BYTES, Told};

/// Longest time from the start of the process until its program is ready.
pub const START_PATIENCE: Duration = Duration::from_secs(10);

/// A program in another process. Dropped, it is killed.
#[derive(Debug)]
pub struct PipeProgram {
    child: Child,
    to: ChildStdin,
    from: ChildStdout,
    /// Longest wait for an answer.
    patience: Duration,
    robots: usize,
    /// What is still to be written; nothing new is asked before it is gone.
    unsent: Vec<u8>,
    /// What was read of the next line.
    line: Vec<u8>,
    /// Tick that has been asked and not answered.
    open: Option<u64>,
    confined: Vec<String>,
}

impl PipeProgram {
    /// Starts a process and gives it the setup.
    ///
    /// - `patience`: longest wait for the answer of a tick.
    /// - Errors: it cannot be started, is not ready in time, or refuses the program.
    pub fn start(
        mut command: Command,
        source: Option<&Source>,
        setup: &Setup,
        patience: Duration,
    ) -> Result<PipeProgram, Fault> {
        let none = |what: String| Fault::new(FaultKind::Died, None, what);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command
            .spawn()
            .map_err(|error| none(format!("its process cannot be started: {error}")))?;
        let (Some(to), Some(from)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(none("its process has no pipes".into()));
        };
        let mut program = PipeProgram {
            child,
            to,
            from,
            patience,
            robots: setup.robots.len(),
            unsent: Vec::new(),
            line: Vec::new(),
            open: None,
            confined: Vec::new(),
        };
        for fd in [program.to.as_raw_fd(), program.from.as_raw_fd()] {
            unblock(fd).map_err(|error| none(format!("its pipe cannot be used: {error}")))?;
        }
        let setup = Ask::Setup {
            team: setup.clone(),
            source: source.cloned(),
        };
        program.write(&setup, None)?;
        match program.read(Instant::now() + START_PATIENCE, None)? {
            Some(Told::Ready { confined }) => program.confined = confined,
            Some(Told::Fault(fault)) => return Err(readable(fault)),
            Some(Told::Answer { .. }) => return Err(none("it answers before it is asked".into())),
            None => return Err(none(format!("not ready within {} s", START_PATIENCE.as_secs()))),
        }
        Ok(program)
    }

    /// Layers of confinement that the process says are in force.
    pub fn confined(&self) -> &[String] {
        &self.confined
    }

    /// Number of the process.
    pub fn process_id(&self) -> u32 {
        self.child.id()
    }

    fn died(&mut self, tick: Option<u64>, what: &str) -> Fault {
        let status = self.child.try_wait().ok().flatten();
        let status = status.map_or(String::new(), |status| format!(" ({status})"));
        Fault::new(FaultKind::Died, tick, format!("{what}{status}"))
    }

    fn write(&mut self, ask: &Ask, tick: Option<u64>) -> Result<(), Fault> {
        let text = serde_json::to_vec(ask);
        self.unsent = text.map_err(|error| Fault::new(FaultKind::Died, tick, error.to_string()))?;
        self.unsent.push(b'\n');
        self.flush(tick)
    }

    /// Writes as much as the pipe takes at once.
    fn flush(&mut self, tick: Option<u64>) -> Result<(), Fault> {
        while !self.unsent.is_empty() {
            match self.to.write(&self.unsent) {
                Ok(written) => drop(self.unsent.drain(..written)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(self.died(tick, "its process ended")),
            }
        }
        Ok(())
    }

    /// The next message, or `None` at the deadline.
    fn read(&mut self, until: Instant, tick: Option<u64>) -> Result<Option<Told>, Fault> {
        let mut piece = [0; 16 * 1024];
        loop {
            if let Some(end) = self.line.iter().position(|byte| *byte == b'\n') {
                let rest = self.line.split_off(end + 1);
                let line = std::mem::replace(&mut self.line, rest);
                let told = serde_json::from_slice(&line);
                let bad = |error: serde_json::Error| {
                    let reason = format!("it says something that is no message: {error}");
                    Fault::new(FaultKind::BadCommand, tick, reason)
                };
                return told.map(Some).map_err(bad);
            }
            if self.line.len() > MAX_LINE_BYTES {
                return Err(Fault::new(FaultKind::Exhausted, tick, "its answer is too long"));
            }
            self.flush(tick)?;
            match self.from.read(&mut piece) {
                Ok(0) => return Err(self.died(tick, "its process ended")),
                Ok(count) => self.line.extend_from_slice(&piece[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    let left = until.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return Ok(None);
                    }
                    self.wait(left);
                }
                Err(_) => return Err(self.died(tick, "its process ended")),
            }
        }
    }

    /// Until there is something to read or, where something is unsent, room to write; at most so long.
    fn wait(&self, left: Duration) {
        let entry = |fd: i32, events: i16| libc::pollfd { fd, events, revents: 0 };
        let mut fds = [
            entry(self.from.as_raw_fd(), libc::POLLIN),
            entry(self.to.as_raw_fd(), libc::POLLOUT),
        ];
        let count = if self.unsent.is_empty() { 1 } else { 2 };
        let limit = libc::timespec {
            tv_sec: left.as_secs() as libc::time_t,
            tv_nsec: left.subsec_nanos().into(),
        };
        #[allow(unsafe_code)]
        // SAFETY: the array outlives the call and holds at least `count` entries; no signal mask is given.
        unsafe {
            libc::ppoll(fds.as_mut_ptr(), count, &limit, std::ptr::null());
        }
    }
}

impl Program for PipeProgram {
    fn step(&mut self, view: &View, answer: &mut Answer) -> Result<Reply, Fault> {
        let tick = Some(view.tick);
        let until = Instant::now() + self.patience;
        // An answer that is owed is waited for first: a program that is behind is not asked more.
        loop {
            if self.open.is_none() {
                self.write(&Ask::View(view.clone()), tick)?;
                self.open = tick;
            }
            match self.read(until, tick)? {
                None => return Ok(Reply::Late),
                Some(Told::Fault(fault)) => return Err(readable(fault)),
                Some(Told::Ready { .. }) => {}
                Some(Told::Answer { tick: of, answer: told }) => {
                    if Some(of) != self.open {
                        let reason = format!("it answers tick {of}, which is not asked");
                        return Err(Fault::new(FaultKind::BadCommand, tick, reason));
                    }
                    self.open = None;
                    if of == view.tick {
                        *answer = told.admit(view.tick, self.robots)?;
                        return Ok(Reply::InTime);
                    }
                }
            }
        }
    }
}

impl Drop for PipeProgram {
    fn drop(&mut self) {
        // Without mercy, and waited for: no process is left behind. Both fail when it is gone already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn unblock(fd: i32) -> std::io::Result<()> {
    #[allow(unsafe_code)]
    // SAFETY: plain calls on an open descriptor.
    let done = unsafe {
        let flags = libc::fcntl(fd, libc::F_GETFL);
        flags >= 0 && libc::fcntl(fd, libc::F_SETFL, flags | libc::O_NONBLOCK) == 0
    };
    if done {
        Ok(())
    } else {
        Err(std::io::Error::last_os_error())
    }
}
