//! So many threads of the standard library, items in no particular order.

use identify::workers::{Queue, Workers};

pub struct Threads(pub usize);

impl Workers for Threads {
    fn progress(&self, stage: &str, _share: f64) {
        if std::env::var_os("LONG").is_some() {
            eprintln!("{stage}");
        }
    }

    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let queue = Queue::new(count, work);
        std::thread::scope(|scope| {
            for _ in 0..self.0 {
                scope.spawn(|| queue.help());
            }
        });
    }
}
