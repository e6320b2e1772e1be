//! Work items on two threads.

use identify::workers::{Queue, Workers};

pub struct Threads;

impl Workers for Threads {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let queue = Queue::new(count, work);
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| queue.help());
            }
        });
    }
}
