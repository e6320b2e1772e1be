//! Fills a running service (`cargo xtask up --no-lab`) with finished runs of a robot, for a look at the Gap page without
//! waiting for robots: `cargo run -p scheduler --example seed_runs -- DATABASE_URL DATA [UNCHANGED CHANGED SECONDS EFFECTS ROBOT]`.
//! The runs are driven by a twin with effects that its description does not know.

#[path = "../tests/support/recorded.rs"]
mod recorded;

use recorded::{Recipe, done_run, lab};
use std::path::PathBuf;
use store::{Store, StoreOptions};

const PATCH: &str = r#"[{"name": "low_friction_patch", "index": null,
    "parameters": {"x": 0.6, "y": -0.3, "radius": 0.4, "scale": 0.15}}]"#;

#[tokio::main]
async fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |k: usize, other: &str| arguments.get(k).cloned().unwrap_or_else(|| other.to_owned());
    let number = |k: usize, other: u64| text(k, "").parse::<u64>().unwrap_or(other);
    let data = PathBuf::from(text(1, "data"));
    let store = Store::connect(&text(0, ""), StoreOptions::default())
        .await
        .expect("the database answers");
    store.lab_register(&lab()).await.expect("registered");
    let (effects, robot) = (text(5, PATCH), text(6, "omni-03"));
    let kinds = [
        ("as always", "[]", number(2, 3)),
        ("after the floor was waxed", effects.as_str(), number(3, 6)),
    ];
    for (label, effects, count) in kinds {
        for k in 0..count {
            let label = format!("{label}, {}", k + 1);
            let recipe = Recipe {
                robot: &robot,
                label: &label,
                effects,
                duration_s: number(4, 30) as f64,
                seed: 1000 * effects.len() as u64 + k,
            };
            println!("{}  {label}", done_run(&store, &data, &recipe).await);
        }
    }
}
