//! Diagnoses logs of real robots and prints what was found.
//!
//! `cargo run -p identify --example real -- dart|husky|husky-slip-free|mrclam`

#[path = "../tests/real_logs/mod.rs"]
mod real_logs;

use real_logs::{dart, found, husky, mrclam, told};

fn main() {
    let which = std::env::args().nth(1).unwrap_or_default();
    let begin = std::time::Instant::now();
    let result = match which.as_str() {
        "dart" | "dart-alone" => (|| {
            let mut references = Vec::new();
            if which == "dart" {
                for name in dart::STEERING {
                    references.extend(dart::runs(name, 1)?);
                }
            }
            let mut runs = dart::runs(dart::FREE[0], 2)?;
            runs.extend(dart::runs(dart::FREE[2], 2)?);
            let mut locked = dart::runs(dart::FREE[1], 1)?;
            locked.extend(dart::runs(dart::FREE[3], 1)?);
            Some((references, runs, locked))
        })(),
        "husky" => husky::runs(husky::ROBOT, &[true, false, true, false], 8).map(|runs| (Vec::new(), runs, Vec::new())),
        "husky-slip-free" => {
            husky::runs(husky::SLIP_FREE, &[true, false], 8).map(|runs| (Vec::new(), runs, Vec::new()))
        }
        "mrclam" => mrclam::runs(1, 20.0, 60.0, 8).map(|runs| (Vec::new(), runs, Vec::new())),
        "mrclam-2" => mrclam::runs(2, 20.0, 60.0, 8).map(|runs| (Vec::new(), runs, Vec::new())),
        other => {
            eprintln!("{other:?}: dart, dart-alone, husky, husky-slip-free, mrclam or mrclam-2");
            return;
        }
    };
    let Some((references, runs, locked)) = result else {
        return;
    };
    println!("{}", told(&found(references, runs, locked)));
    println!("{:.1} s", begin.elapsed().as_secs_f64());
}
