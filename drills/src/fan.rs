//! Independent runs over the processor's cores, results in the order of their numbers.

use anyhow::{Result, anyhow};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Runs `of(0)` to `of(count - 1)` on some threads; the first error in the order of the numbers comes out.
///
/// - `watch`: called now and then with how many are done, from any thread.
pub fn fan<R: Send>(
    count: u64,
    threads: usize,
    of: impl Fn(u64) -> Result<R> + Sync,
    watch: impl Fn(u64) + Sync,
) -> Result<Vec<R>> {
    let (next, done) = (AtomicU64::new(0), AtomicU64::new(0));
    let slots: Mutex<Vec<Option<Result<R>>>> = Mutex::new((0..count).map(|_| None).collect());
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count {
                        return;
                    }
                    let result = of(number);
                    let mut slots = slots.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                    if let Some(slot) = slots.get_mut(number as usize) {
                        *slot = Some(result);
                    }
                    drop(slots);
                    watch(done.fetch_add(1, Ordering::Relaxed) + 1);
                }
            });
        }
    });
    let slots = slots.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    let missing = || Err(anyhow!("a run was not made"));
    slots.into_iter().map(|slot| slot.unwrap_or_else(missing)).collect()
}

/// A line on standard error for every `each` runs.
pub fn progress(what: &'static str, each: u64, count: u64) -> impl Fn(u64) + Sync {
    move |done| {
        if done % each.max(1) == 0 {
            eprintln!("{what}: {done} of {count}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_order_whatever_the_threads() {
        let squares = |threads| fan(100, threads, |k| Ok(k * k), |_| {}).expect("squares");
        assert_eq!(squares(1), (0..100).map(|k| k * k).collect::<Vec<_>>());
        assert_eq!(squares(3), squares(1));
        let odd = fan(9, 2, |k| if k == 5 { Err(anyhow!("five")) } else { Ok(k) }, |_| {});
        assert_eq!(odd.expect_err("the fifth fails").to_string(), "five");
    }
}
