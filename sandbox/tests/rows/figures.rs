//! What the rows measure: times, and what the operating system says about processes.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

static ALONE: Mutex<()> = Mutex::new(());

/// One row at a time, where all tests run in one process: they look at its children.
pub fn leave_alone() -> MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Times and their quantiles.
#[derive(Debug, Default)]
pub struct Spread(Vec<Duration>);

impl Spread {
    pub fn add(&mut self, time: Duration) {
        self.0.push(time);
    }

    pub fn append(&mut self, others: Spread) {
        self.0.extend(others.0);
    }

    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// The time that this share of all is not above, ms; 0 when there is none.
    pub fn ms(&self, share: f64) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort();
        let at = (share * sorted.len() as f64) as usize;
        let time = sorted.get(at.min(sorted.len().saturating_sub(1)));
        time.map_or(0.0, |time| time.as_secs_f64() * 1e3)
    }
}

/// A line of a process's status that holds kilobytes, in bytes: `VmRSS` now, `VmHWM` at most; 0 when it is gone.
pub fn memory_bytes(process: u32, line: &str) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let found = status
        .lines()
        .find_map(|text| text.strip_prefix(line)?.strip_prefix(':'));
    let number = found.and_then(|text| text.split_whitespace().next()?.parse::<u64>().ok());
    number.unwrap_or(0) * 1024
}

/// Processes that this one has started and that are there still, dead ones that nobody has asked after included.
pub fn children() -> Vec<u32> {
    let own = std::process::id().to_string();
    let all = std::fs::read_dir("/proc").expect("processes").flatten();
    let numbers = all.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    let is_ours = |number: &u32| {
        let stat = std::fs::read_to_string(format!("/proc/{number}/stat")).unwrap_or_default();
        // Behind the name in brackets: the state and the parent.
        let rest = stat.rsplit_once(") ").map(|(_, rest)| rest).unwrap_or_default();
        rest.split(' ').nth(1) == Some(own.as_str())
    };
    numbers.filter(is_ours).collect()
}

/// Files that this process has open.
pub fn file_count() -> usize {
    std::fs::read_dir("/proc/self/fd").expect("files").count()
}

/// Looks at the memory of this process's controllers all the time: those that are refused are gone before one could ask.
#[derive(Debug)]
pub struct Watch {
    ends: Arc<AtomicBool>,
    most_bytes: Arc<AtomicU64>,
    thread: JoinHandle<()>,
}

impl Watch {
    pub fn start() -> Watch {
        let (ends, most_bytes) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (its_ends, its_most) = (ends.clone(), most_bytes.clone());
        let work = move || {
            while !its_ends.load(Ordering::Relaxed) {
                for child in children() {
                    // Before it has another program it is this one still.
                    let name = std::fs::read_to_string(format!("/proc/{child}/comm")).unwrap_or_default();
                    if name.starts_with("robopheus-contr") {
                        its_most.fetch_max(memory_bytes(child, "VmHWM"), Ordering::Relaxed);
                    }
                }
                std::thread::sleep(Duration::from_millis(1));
            }
        };
        Watch {
            ends,
            most_bytes,
            thread: std::thread::spawn(work),
        }
    }

    /// Most memory of any of them, bytes.
    pub fn most_bytes(self) -> u64 {
        self.ends.store(true, Ordering::Relaxed);
        self.thread.join().expect("it only looks");
        self.most_bytes.load(Ordering::Relaxed)
    }
}

/// Processor time of all children that have ended.
pub fn processor_of_children() -> Duration {
    #[allow(unsafe_code, reason = "the operating system's count")]
    // SAFETY: zeroes are a valid value, and it outlives the call.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_CHILDREN, &mut usage);
        usage
    };
    let time = |value: libc::timeval| Duration::new(value.tv_sec as u64, value.tv_usec as u32 * 1000);
    time(usage.ru_utime) + time(usage.ru_stime)
}
