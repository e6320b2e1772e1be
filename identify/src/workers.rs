//! Independent work items: who runs them, how far they are, whether they should go on.
//!
//! This crate spawns nothing: it hands out items and reduces their results in the order of the items, so that any number
//! of threads of the caller gives the same bits.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs work items for the diagnosis.
pub trait Workers: Sync {
    /// Calls `work(0..count)`, each once, in any order and on any thread, and returns when all are done.
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync));

    /// Called between work items; true ends the diagnosis with [`Cancelled`].
    fn is_cancelled(&self) -> bool {
        false
    }

    /// What is being done, and the share of the whole that is behind, 0 to 1.
    fn progress(&self, _stage: &str, _share: f64) {}
}

/// The caller asked for the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// All items on the calling thread, in order.
#[derive(Debug, Clone, Copy, Default)]
pub struct Serial;

impl Workers for Serial {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        (0..count).for_each(work);
    }
}

/// Items that several threads of the caller take one after the other, each once.
pub struct Queue<'a> {
    next: AtomicUsize,
    count: usize,
    work: &'a (dyn Fn(usize) + Sync),
}

impl<'a> Queue<'a> {
    pub fn new(count: usize, work: &'a (dyn Fn(usize) + Sync)) -> Queue<'a> {
        Queue {
            next: AtomicUsize::new(0),
            count,
            work,
        }
    }

    /// Takes items until none is left; called on every thread that helps.
    pub fn help(&self) {
        loop {
            let item = self.next.fetch_add(1, Ordering::Relaxed);
            if item >= self.count {
                break;
            }
            (self.work)(item);
        }
    }
}

/// Results of `count` items in their order.
pub fn gathered<T: Send>(
    workers: &dyn Workers,
    count: usize,
    work: &(dyn Fn(usize) -> T + Sync),
) -> Result<Vec<T>, Cancelled> {
    let slots: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    workers.run(count, &|item| {
        if workers.is_cancelled() {
            return;
        }
        let result = work(item);
        if let Ok(mut slot) = slots[item].lock() {
            *slot = Some(result);
        }
    });
    if workers.is_cancelled() {
        return Err(Cancelled);
    }
    slots
        .into_iter()
        .map(|slot| slot.into_inner().ok().flatten().ok_or(Cancelled))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_done_once_however_many_help() {
        let done: Vec<AtomicUsize> = (0..100).map(|_| AtomicUsize::new(0)).collect();
        let work = |item: usize| _ = done[item].fetch_add(1, Ordering::Relaxed);
        let queue = Queue::new(done.len(), &work);
        std::thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| queue.help());
            }
        });
        queue.help();
        assert!(done.iter().all(|times| times.load(Ordering::Relaxed) == 1));
    }
}
