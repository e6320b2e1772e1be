//! `cargo xtask demo gap`: effects hidden one after the other in the emulated robots of a system of its own, and what the
//! service makes of them. Prints a table; the exit status says whether all rows held.

use anyhow::{Context, ensure};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Instant;
use system_tests::System;
use uuid::Uuid;

/// Runs with nothing changed of each robot: their documents.
const REFERENCES: [usize; 6] = [1, 2, 3, 4, 5, 6];
const CHANGED: [usize; 6] = [1, 2, 3, 4, 5, 6];
/// Driven again after the model was accepted.
const AGAIN: [usize; 6] = [1, 2, 3, 4, 5, 6];
/// A gap up to this multiple of that of unchanged runs is chance: the service's own margin.
const MARGIN: f64 = 1.5;

/// An effect and how it is hidden.
struct Case {
    name: &'static str,
    size: &'static str,
    robot: &'static str,
    /// Requests to the hand.
    hide: Value,
    /// Position of the wheel in the description, where one wheel is changed.
    index: Option<u64>,
}

/// An effect of which no wheel is told.
fn case(name: &'static str, size: &'static str, robot: &'static str, hide: Value) -> Case {
    Case {
        name,
        size,
        robot,
        hide,
        index: None,
    }
}

/// An effect of one robot.
fn of_robot(name: &'static str, size: &'static str, robot: &'static str, sizes: &Value) -> Case {
    let mut change = json!({ "effect": name, "robot": robot });
    if let (Some(change), Some(sizes)) = (change.as_object_mut(), sizes.as_object()) {
        change.extend(sizes.clone());
    }
    case(name, size, robot, json!({ "hide": change }))
}

/// An effect of one of its wheels.
fn of_wheel(name: &'static str, size: &'static str, robot: &'static str, wheel: u64, sizes: &Value) -> Case {
    Case {
        index: Some(wheel),
        ..of_robot(name, size, robot, sizes)
    }
}

/// An effect of the floor, seen by one robot.
fn of_floor(name: &'static str, size: &'static str, robot: &'static str, mut sizes: Value) -> Case {
    sizes["effect"] = json!(name);
    case(name, size, robot, json!({ "hide": sizes }))
}

/// In the order of the table.
fn cases() -> Vec<Case> {
    vec![
        of_floor("floor_friction", "x 0.5", "omni-01", json!({"scale": 0.5})),
        of_robot("payload", "+30 % of the mass", "omni-01", &json!({"mass_share": 0.3})),
        of_wheel(
            "weak_motor",
            "motor 1 x 0.8",
            "omni-01",
            0,
            &json!({"motor": 0, "gain": 0.8}),
        ),
        of_robot(
            "viscous_friction",
            "0.06 N m s",
            "omni-01",
            &json!({"coefficient_n_m_s": 0.06}),
        ),
        of_robot(
            "roller_drag",
            "3 N s/m each",
            "omni-01",
            &json!({"per_wheel_n_s_per_m": 3.0}),
        ),
        of_floor("floor_tilt", "3 % along x", "omni-01", json!({"x": 0.03, "y": 0.0})),
        of_robot("wheel_radius", "+4 %", "diff-01", &json!({"relative": 0.04})),
        of_wheel(
            "wheel_radius_one",
            "wheel 2 -2 %",
            "diff-01",
            1,
            &json!({"wheel": 1, "relative": -0.02}),
        ),
        // More, and the robot refuses: it knows the laboratory's clock to half the way there and back, at most 15 ms.
        case(
            "command_delay",
            "11 ms each way",
            "diff-01",
            json!({"fault": {"number": 5, "kind": "delay_frames", "delay_ms": 11.0}}),
        ),
        of_robot("motor_lag", "0.05 s", "diff-01", &json!({"time_constant_s": 0.05})),
        of_robot("gyro_bias", "0.03 rad/s", "diff-01", &json!({"bias_rad_per_s": 0.03})),
        of_robot(
            "center_of_mass_offset",
            "3 cm forward",
            "diff-01",
            &json!({"x_m": 0.03, "y_m": 0.0}),
        ),
        of_robot("gear_backlash", "0.05 rad", "diff-01", &json!({"play_rad": 0.05})),
        of_robot("battery_sag", "0.2 ohm", "diff4-01", &json!({"resistance_ohm": 0.2})),
        of_robot("coulomb_friction", "0.4 N m", "diff4-01", &json!({"torque_n_m": 0.4})),
        of_floor(
            "rolling_resistance",
            "0.03 of the load",
            "diff4-01",
            json!({"coefficient": 0.03}),
        ),
        of_robot("track_width", "+6 %", "diff4-01", &json!({"relative": 0.06})),
        of_floor(
            "low_friction_patch",
            "x 0.2 within 0.5 m",
            "diff4-01",
            json!({"x_m": 0.4, "y_m": 0.2, "radius_m": 0.5, "scale": 0.2}),
        ),
        of_robot("steering_offset", "0.04 rad", "rwd-01", &json!({"offset_rad": 0.04})),
        of_robot("steering_scale", "x 0.9", "rwd-01", &json!({"scale": 0.9})),
        of_robot("steering_lag", "0.08 s", "rwd-01", &json!({"time_constant_s": 0.08})),
        of_robot("steering_backlash", "0.05 rad", "rwd-01", &json!({"play_rad": 0.05})),
        of_wheel(
            "wheel_misalignment",
            "wheel 1 by 0.04 rad",
            "rwd-01",
            0,
            &json!({"wheel": 0, "toe_rad": 0.04}),
        ),
    ]
}

/// One line of the table.
struct Row {
    hidden: String,
    named: String,
    verdict: String,
    gaps_m: [f64; 3],
    failures: Vec<String>,
    seconds: f64,
}

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let chosen: Vec<Case> = cases()
        .into_iter()
        .filter(|case| wanted.is_empty() || wanted.iter().any(|name| name == case.name))
        .collect();
    let names: Vec<&str> = cases().iter().map(|case| case.name).collect();
    for name in &wanted {
        ensure!(
            names.contains(&name.as_str()),
            "no effect {name:?}; there are {}",
            names.join(", ")
        );
    }
    let clock = Instant::now();
    let system = System::start_with("gap-demo", &["--quick"]).await?;
    let mut references = BTreeMap::new();
    let mut rows = Vec::new();
    for case in &chosen {
        let row = match circle(&system, case, &mut references).await {
            Ok(row) => row,
            Err(error) => Row {
                hidden: hidden(case),
                named: "-".to_owned(),
                verdict: "-".to_owned(),
                gaps_m: [f64::NAN; 3],
                failures: vec![format!("{error:#}")],
                seconds: f64::NAN,
            },
        };
        print_row(&row);
        rows.push(row);
    }
    let left = system.stop()?;
    ensure!(left.is_empty(), "left behind: {left:?}");
    println!();
    print_header();
    rows.iter().for_each(print_row);
    let failed = rows.iter().filter(|row| !row.failures.is_empty()).count();
    println!(
        "\n{} of {} held, {:.0} s in all. Gaps: position 2 s ahead; before: changed runs against the nominal twin; after: runs driven \
         again against the accepted model; floor: unchanged runs against the nominal twin.",
        rows.len() - failed,
        rows.len(),
        clock.elapsed().as_secs_f64()
    );
    std::process::exit(i32::from(failed > 0))
}

/// Drive, hide, drive, diagnose, accept, drive again.
async fn circle(
    system: &System,
    case: &Case,
    references: &mut BTreeMap<&'static str, (Vec<Uuid>, f64)>,
) -> anyhow::Result<Row> {
    let clock = Instant::now();
    let number = robot_number(system, case.robot).await?;
    let everything_back = || -> anyhow::Result<()> {
        system.hand(&json!({"hide": {"effect": "none"}}))?;
        system.hand(&json!({"fault": {"number": number, "kind": "none"}}))
    };
    everything_back()?;
    system.use_nominal(case.robot).await?;
    if !references.contains_key(case.robot) {
        let runs = system.drive(case.robot, &REFERENCES, "as always").await?;
        let floor_m = system.position_gap_m(case.robot, &runs).await?;
        references.insert(case.robot, (runs, floor_m));
    }
    let (unchanged, floor_m) = references.get(case.robot).context("references")?;
    let mut request = case.hide.clone();
    if let Some(fault) = request.get_mut("fault") {
        fault["number"] = json!(number);
    }
    system.hand(&request)?;
    let changed = system.drive(case.robot, &CHANGED, &hidden(case)).await?;
    let before_m = system.position_gap_m(case.robot, &changed).await?;
    let (id, report) = system.diagnose(case.robot, unchanged, &changed).await?;
    // For a look afterwards, with ROBOPHEUS_KEEP.
    let file = system.data.join(format!("report-{}-{}.json", case.name, case.robot));
    std::fs::write(file, serde_json::to_vec_pretty(&report)?)?;
    system.accept(id).await?;
    let again = system.drive(case.robot, &AGAIN, "with the new model").await?;
    let after_m = system.position_gap_m(case.robot, &again).await?;
    everything_back()?;
    let mut failures = name_failures(case, &report);
    if after_m > MARGIN * floor_m {
        failures.push(format!("the gap after is above {MARGIN} floors"));
    }
    Ok(Row {
        hidden: hidden(case),
        named: named(&report),
        verdict: text(&report["verdict"]),
        gaps_m: [before_m, after_m, *floor_m],
        failures,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

fn hidden(case: &Case) -> String {
    format!("{} {} ({})", case.name, case.size, case.robot)
}

/// The hidden effect must be named, or stand in the set that these runs cannot tell apart, and nothing beside it; in words where
/// that is not so.
fn name_failures(case: &Case, report: &Value) -> Vec<String> {
    let effects = report["effects"].as_array().cloned().unwrap_or_default();
    let names_it = |effect: &Value| {
        effect["name"] == case.name && case.index.is_none_or(|index| effect["index"].as_u64() == Some(index))
    };
    let lists_it = |effect: &Value| {
        let others = effect["alternatives"].as_array();
        others.is_some_and(|others| others.iter().any(|other| other == case.name))
    };
    let right = |effect: &Value| names_it(effect) || lists_it(effect);
    let mut failures = Vec::new();
    if !effects.iter().any(right) {
        failures.push("not named".to_owned());
    }
    let wrong: Vec<String> = effects
        .iter()
        .filter(|effect| !right(effect))
        .map(|effect| text(&effect["name"]))
        .collect();
    if !wrong.is_empty() {
        failures.push(format!("named as well: {}", wrong.join(", ")));
    }
    failures
}

/// Effects with their values, as the report has them.
fn named(report: &Value) -> String {
    let one = |effect: &Value| {
        let parameters = effect["parameters"].as_array().cloned().unwrap_or_default();
        let values: Vec<String> = parameters
            .iter()
            .filter_map(|parameter| {
                Some(format!(
                    "{} {:.4}",
                    text(&parameter["name"]),
                    parameter["value"].as_f64()?
                ))
            })
            .collect();
        let index = effect["index"]
            .as_u64()
            .map_or_else(String::new, |index| format!("[{index}]"));
        let others = effect["alternatives"].as_array().cloned().unwrap_or_default();
        let others: String = others.iter().map(|other| format!(" or {}", text(other))).collect();
        format!("{}{index} {}{others}", text(&effect["name"]), values.join(" "))
    };
    let effects = report["effects"].as_array().cloned().unwrap_or_default();
    if effects.is_empty() {
        return "nothing".to_owned();
    }
    effects.iter().map(one).collect::<Vec<_>>().join("; ")
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or("-").to_owned()
}

async fn robot_number(system: &System, name: &str) -> anyhow::Result<u64> {
    let robots = system.get("/api/v1/robots").await?;
    let all = robots.as_array().context("the list of robots")?;
    let robot = all.iter().find(|robot| robot["name"] == name);
    let number = robot.and_then(|robot| robot["robot"]["number"].as_u64().or_else(|| robot["number"].as_u64()));
    number.with_context(|| format!("the number of {name}"))
}

fn print_header() {
    println!(
        "{:<44} {:<44} {:<14} {:>9} {:>9} {:>9} {:>6}  status",
        "effect hidden", "effect named", "verdict", "before", "after", "floor", "s"
    );
}

fn print_row(row: &Row) {
    let [before, after, floor] = row.gaps_m.map(|gap_m| format!("{:.1} mm", 1000.0 * gap_m));
    let status = if row.failures.is_empty() {
        "held".to_owned()
    } else {
        format!("FAILED: {}", row.failures.join("; "))
    };
    println!(
        "{:<44} {:<44} {:<14} {before:>9} {after:>9} {floor:>9} {:>6.0}  {status}",
        row.hidden, row.named, row.verdict, row.seconds
    );
}
