//! Work items of a diagnosis on threads of this process, with progress and an end from outside.

use identify::workers::{Queue, Workers};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Shared by the thread that diagnoses and the task that keeps the lease.
#[derive(Debug)]
pub struct Threads {
    count: usize,
    cancelled: AtomicBool,
    progress: Mutex<(String, f64)>,
}

impl Threads {
    pub fn new(count: usize) -> Self {
        Self {
            count: count.max(1),
            cancelled: AtomicBool::new(false),
            progress: Mutex::new(("read".to_owned(), 0.0)),
        }
    }

    /// Ends the diagnosis at its next work item.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Stage and share of the work that is behind.
    pub fn so_far(&self) -> (String, f64) {
        match self.progress.lock() {
            Ok(progress) => progress.clone(),
            Err(poisoned) => poisoned.into_inner().clone(),
        }
    }
}

impl Workers for Threads {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let queue = Queue::new(count, work);
        std::thread::scope(|scope| {
            for _ in 0..self.count.min(count) {
                scope.spawn(|| queue.help());
            }
        });
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn progress(&self, stage: &str, share: f64) {
        if let Ok(mut progress) = self.progress.lock() {
            *progress = (stage.to_owned(), share);
        }
    }
}
