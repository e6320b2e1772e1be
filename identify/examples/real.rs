//! Diagnoses logs of real robots and prints what was found.
//!
//! `cargo run -p identify --example real -- dart|husky|husky-slip-free|mrclam`

#[path = "../tests/real_logs/mod.rs"]
mod real_logs;

use real_logs::{dart, found, husky, mrclam, told};

fn main() {
    let which = std::env::args().nth(1).unwrap_or_default();
    let number = |k: usize, other: usize| std::env::args().nth(k).and_then(|n| n.parse().ok()).unwrap_or(other);
    let (count, most) = (number(2, 6), number(3, 10));
    if which == "dart-gap" {
        dart_gap();
        return;
    }
    let result = match which.as_str() {
        "dart" | "dart-alone" | "dart-slip-free" | "dart-slip-free-alone" => (|| {
            let mut references = Vec::new();
            let robot = if which.contains("slip-free") {
                dart::slip_free()
            } else {
                dart::ROBOT.to_owned()
            };
            if !which.ends_with("alone") {
                for name in dart::STEERING {
                    references.extend(dart::runs_of(&robot, name, 1)?);
                }
            }
            let mut runs = dart::runs_of(&robot, dart::FREE[0], 2)?;
            runs.extend(dart::runs_of(&robot, dart::FREE[2], 2)?);
            let mut locked = dart::runs_of(&robot, dart::FREE[1], 1)?;
            locked.extend(dart::runs_of(&robot, dart::FREE[3], 1)?);
            Some((references, runs, locked))
        })(),
        "husky" => husky::runs(husky::ROBOT, &[true, false, true, false], count, most, true)
            .map(|runs| (Vec::new(), runs, Vec::new())),
        "husky-slip-free" => {
            husky::runs(husky::SLIP_FREE, &[true, false], count, most, true).map(|runs| (Vec::new(), runs, Vec::new()))
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
}

/// Lateral gap 2 s ahead of the free files under some models: `name:parameter=value,...` each.
fn dart_gap() {
    use identify::bundle::Bundle;
    use identify::gap::{ANCHOR_PERIOD_S, RobotClock, end_to_end_with};
    use twin::effect::Effect;
    use twin::robot::Robot;
    let bundles: Vec<Vec<Bundle>> = dart::FREE
        .iter()
        .filter_map(|name| Some(dart::runs(name, 1)?.into_iter().map(|run| run.bundle).collect()))
        .collect();
    for argument in std::env::args().skip(2) {
        let mut effects = Vec::new();
        for part in argument.split('+').filter(|part| !part.is_empty()) {
            let (name, values) = part.split_once(':').unwrap_or((part, ""));
            let pairs: Vec<(&str, f64)> = values
                .split(',')
                .filter_map(|pair| pair.split_once('='))
                .map(|(key, value)| (key, value.parse().unwrap_or(0.0)))
                .collect();
            effects.push(Effect::new(name, &pairs));
        }
        let robot = Robot::with_effects(bundles[0][0].run.robot.clone(), &effects);
        let Ok(robot) = robot else {
            println!("{argument}: {robot:?}");
            continue;
        };
        let rms: Vec<String> = bundles
            .iter()
            .map(|file| {
                let samples = file
                    .iter()
                    .filter_map(|bundle| end_to_end_with(bundle, &robot, RobotClock::default(), ANCHOR_PERIOD_S).ok())
                    .flat_map(|gap| gap.samples);
                let squares: Vec<f64> = samples
                    .filter(|s| s.horizon_s == 2.0)
                    .map(|s| s.left_m * s.left_m)
                    .collect();
                format!(
                    "{:.3}",
                    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
                )
            })
            .collect();
        println!("{argument}: {}", rms.join(" "));
    }
}
