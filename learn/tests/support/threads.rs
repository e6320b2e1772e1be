//! Work items on two threads.

use std::sync::atomic::{AtomicUsize, Ordering};

use identify::workers::Workers;

pub struct Threads;

impl Workers for Threads {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    loop {
                        let item = next.fetch_add(1, Ordering::Relaxed);
                        if item >= count {
                            break;
                        }
                        work(item);
                    }
                });
            }
        });
    }
}
