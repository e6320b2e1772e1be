//! So many threads of the standard library, items in no particular order.

use identify::workers::Workers;
use std::sync::atomic::{AtomicUsize, Ordering};

pub struct Threads(pub usize);

impl Workers for Threads {
    fn progress(&self, stage: &str, _share: f64) {
        if std::env::var_os("LONG").is_some() {
            eprintln!("{stage}");
        }
    }

    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..self.0 {
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
