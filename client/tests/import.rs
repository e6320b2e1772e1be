//! `robopheus import`: another laboratory's table becomes bundles, or is refused with line, column, limit and remedy.

use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("robopheus-import-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let standard = |y: f64| {
        json!({"x_m": 0.0, "y_m": y, "rolling_direction_rad": 0.0, "radius_m": 0.05, "spin_inertia_kg_m2": 0.0008,
        "kind": "standard", "driven": true, "steered": false})
    };
    let caster = |x: f64| json!({"x_m": x, "y_m": 0.0, "rolling_direction_rad": 0.0, "kind": "caster", "driven": false, "steered": false});
    let robot = json!({"name": "theirs", "chassis": "diff2", "mass_kg": 6.0, "yaw_inertia_kg_m2": 0.12, "com_height_m": 0.1,
        "floor_friction": 0.8, "wheels": [standard(0.15), standard(-0.15), caster(0.12), caster(-0.12)]});
    std::fs::write(folder.join("robot.json"), robot.to_string()).expect("robot");
    folder
}

/// Imports `table` into `out` with the flags given, columns t, x, y, th, l, r mapped.
fn import(folder: &Path, table: &str, flags: &[&str]) -> Output {
    std::fs::write(folder.join("log.csv"), table).expect("table");
    let mut command = Command::new(env!("CARGO_BIN_EXE_robopheus"));
    command
        .current_dir(folder)
        .args(["import", "log.csv", "--robot", "robot.json", "--out", "out", "--json"]);
    command.args(flags).output().expect("the program")
}

const COLUMNS: [&str; 12] = [
    "--column",
    "t=time_s:ms",
    "--column",
    "x=pose_x_m:mm",
    "--column",
    "y=pose_y_m:mm",
    "--column",
    "th=pose_yaw_rad:deg",
    "--column",
    "l=wheel_0_rad_per_s:rpm",
    "--column",
    "r=wheel_1_rad_per_s:m/s",
];

/// A straight drive at 0.5 m/s with a slow turn of 9 deg/s, stamps in ms since 1970, 50 rows a second.
fn table(rows: usize, change: impl Fn(usize, &mut [String])) -> String {
    let mut text = "t,x,y,th,l,r,note\n".to_owned();
    for k in 0..rows {
        let t_s = 0.02 * k as f64;
        let (rpm, rim) = (0.5 / 0.05 * 60.0 / core::f64::consts::TAU, 0.5);
        let mut cells = vec![
            format!("{}", 1_758_790_402_123_u64 + 20 * k as u64),
            format!("{:.3}", 500.0 * t_s),
            "0".to_owned(),
            format!("{:.4}", 170.0 + 9.0 * t_s),
            format!("{rpm:.6}"),
            format!("{rim}"),
            "a".to_owned(),
        ];
        change(k, &mut cells);
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

fn with_columns<'a>(more: &[&'a str]) -> Vec<&'a str> {
    COLUMNS.iter().copied().chain(more.iter().copied()).collect()
}

/// The refusal's text; nothing may be left behind.
fn refused(folder: &Path, table: &str, flags: &[&str]) -> String {
    let done = import(folder, table, flags);
    assert!(!done.status.success(), "{}", String::from_utf8_lossy(&done.stdout));
    let left: Vec<String> = std::fs::read_dir(folder)
        .expect("folder")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.contains("out"))
        .collect();
    assert!(left.is_empty(), "left behind: {left:?}");
    String::from_utf8_lossy(&done.stderr).into_owned()
}

fn says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} missing in {text}");
    }
}

#[test]
fn units_stamps_and_angles_are_converted() {
    let folder = folder("units");
    let done = import(
        &folder,
        &table(200, |_, _| {}),
        &with_columns(&["--reference", "--label", "monday"]),
    );
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let summary: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!(summary["ignored"], json!(["note"]));
    assert_eq!(summary["bundles"][0]["rows"], 200);
    let run: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("out/run.json")).expect("run.json")).expect("JSON");
    assert_eq!(
        (&run["label"], &run["change_free_reference"]),
        (&json!("monday"), &json!(true))
    );
    let csv = std::fs::read(folder.join("out/telemetry.csv")).expect("telemetry");
    let bundle = identify::bundle::Bundle::parse(&run.to_string(), &csv).expect("a bundle");
    assert!((bundle.telemetry.time_s[199] - 3.98).abs() < 1e-9 && bundle.telemetry.time_s[0] == 0.0);
    let last = |name: &str| {
        let channel = identify::channel::Channel::parse(name).expect("a channel");
        bundle
            .telemetry
            .series(channel)
            .and_then(|series| series.values.last().copied())
            .unwrap_or(f64::NAN)
    };
    assert!((last("pose_x_m") - 1.99).abs() < 1e-9);
    // 170 deg + 35.82 deg has come round.
    assert!((last("pose_yaw_rad") - (205.82_f64 - 360.0).to_radians()).abs() < 1e-9);
    assert!((last("wheel_0_rad_per_s") - 10.0).abs() < 1e-6 && (last("wheel_1_rad_per_s") - 10.0).abs() < 1e-12);
    // Nothing is written over.
    assert!(
        !import(&folder, &table(200, |_, _| {}), &with_columns(&[]))
            .status
            .success()
    );
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn a_map_with_gain_offset_and_held_samples_is_read() {
    let folder = folder("map");
    let map = json!({"format": "robopheus.columns/1", "columns": [
        {"from": "t", "to": "time_s", "unit": "s"},
        {"from": "u", "to": "command_forward_m_per_s", "unit": "1", "gain": 1.5, "offset": 0.25},
        {"from": "w", "to": "wheel_0_rad_per_s", "fresh_with": "seq"},
        {"from": "w", "to": "wheel_1_rad_per_s", "fresh_with": "seq"}]});
    std::fs::write(folder.join("map.json"), map.to_string()).expect("map");
    let mut text = "t;u;w;seq\n".to_owned();
    for k in 0..100 {
        let _ = writeln!(text, "{};0.2;{};{}", 0.01 * f64::from(k), k / 10, k / 10);
    }
    let done = import(&folder, &text, &["--map", "map.json"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let csv = std::fs::read_to_string(folder.join("out/telemetry.csv")).expect("telemetry");
    let rows: Vec<&str> = csv.lines().collect();
    assert_eq!(
        rows[0],
        "time_s,command_forward_m_per_s,wheel_0_rad_per_s,wheel_1_rad_per_s"
    );
    assert_eq!(rows[1], "0,0.55,0,0");
    assert!(rows[2].ends_with("0.55,,"), "{}", rows[2]);
    assert!(rows[11].ends_with("0.55,1,1"), "{}", rows[11]);
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn runs_are_cut_at_gaps_and_by_a_column() {
    let folder = folder("cuts");
    // A pause of 5 s after row 150; the last piece is too short.
    let gaps = table(360, |k, cells| {
        let late = if k >= 350 {
            10_000
        } else if k >= 150 {
            5_000
        } else {
            0
        };
        cells[0] = format!("{}", 1_000_000 + 20 * k + late);
    });
    let done = import(&folder, &gaps, &with_columns(&["--cut-gap", "1"]));
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let summary: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    let rows: Vec<u64> = summary["bundles"]
        .as_array()
        .expect("bundles")
        .iter()
        .filter_map(|b| b["rows"].as_u64())
        .collect();
    assert_eq!(rows, [150, 200]);
    says(&summary["remarks"].to_string(), &["1 runs shorter than 2 s"]);
    let second = std::fs::read_to_string(folder.join("out/run-002/telemetry.csv")).expect("telemetry");
    assert!(second.lines().nth(1).is_some_and(|row| row.starts_with("0,")));
    std::fs::remove_dir_all(folder.join("out")).expect("out");
    // Time starts anew in every run.
    let by = table(400, |k, cells| {
        cells[0] = format!("{}", 20 * (k % 200));
        cells[6] = format!("trial-{}", k / 200);
    });
    let done = import(&folder, &by, &with_columns(&["--cut-by", "note"]));
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let label = |run: &str| {
        let text = std::fs::read_to_string(folder.join(run)).expect("run.json");
        serde_json::from_str::<Value>(&text).expect("JSON")["label"].clone()
    };
    assert_eq!(label("out/run-001/run.json"), "log trial-0");
    assert_eq!(label("out/run-002/run.json"), "log trial-1");
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn what_cannot_be_meant_is_refused_with_place_limit_and_remedy() {
    let folder = folder("refusals");
    let flags = with_columns(&[]);
    let jump = table(200, |k, cells| {
        if k >= 100 {
            cells[1] = "300000".to_owned();
        }
    });
    says(
        &refused(&folder, &jump, &flags),
        &["line 102", "\\\"x\\\"", "jumps", "100 m", "unit"],
    );
    // Metres that are millimetres.
    let mut wrong = flags.clone();
    wrong[3] = "x=pose_x_m";
    says(
        &refused(&folder, &table(400, |_, _| {}), &wrong),
        &["\\\"x\\\"", "50 m/s", "unit mm"],
    );
    // Degrees taken as radians: the heading comes round at 360.
    let round = table(1200, |k, cells| cells[3] = format!("{}", (3.0 * k as f64) % 360.0));
    let mut wrong = flags.clone();
    wrong[7] = "th=pose_yaw_rad";
    says(&refused(&folder, &round, &wrong), &["\\\"th\\\"", "6.283", "unit deg"]);
    // Rotations a minute taken as rad/s.
    let fast = table(50, |_, cells| cells[4] = "3000".to_owned());
    let mut wrong = flags.clone();
    wrong[9] = "l=wheel_0_rad_per_s";
    says(
        &refused(&folder, &fast, &wrong),
        &["line 2", "\\\"l\\\"", "1000 rad/s", "rpm"],
    );
    let twice = table(50, |k, cells| cells[0] = format!("{}", 20 * k.min(30)));
    says(
        &refused(&folder, &twice, &flags),
        &["line 33", "stands twice", "--drop-bad-time"],
    );
    let back = table(50, |k, cells| {
        if k == 20 {
            cells[0] = "5".to_owned();
        }
    });
    says(
        &refused(&folder, &back, &flags),
        &["line 22", "runs backward", "--cut-by"],
    );
    let text = table(50, |k, cells| {
        if k == 7 {
            cells[2] = "far".to_owned();
        }
    });
    says(
        &refused(&folder, &text, &flags),
        &["line 9", "\\\"y\\\"", "far", "empty"],
    );
    let ragged = table(20, |_, _| {}) + "1,2\n";
    says(&refused(&folder, &ragged, &flags), &["line 22", "2 cells", "7"]);
    let mut wheel = flags.clone();
    wheel[9] = "l=wheel_4_rad_per_s:rpm";
    says(
        &refused(&folder, &table(50, |_, _| {}), &wheel),
        &["wheel_4_rad_per_s", "4 wheels"],
    );
    let mut unit = flags.clone();
    unit[9] = "l=wheel_0_rad_per_s:mm";
    says(&refused(&folder, &table(50, |_, _| {}), &unit), &["no unit", "rpm"]);
    let mut absent = flags.clone();
    absent[9] = "left=wheel_0_rad_per_s";
    says(
        &refused(&folder, &table(50, |_, _| {}), &absent),
        &["no column", "left", "note"],
    );
    says(&refused(&folder, "", &flags), &["header"]);
    says(&refused(&folder, "t,x,y,th,l,r,note\n", &flags), &["no run"]);
    let endless = "t,x,y,th,l,r,note\n".to_owned() + &"1".repeat(3 << 20);
    says(&refused(&folder, &endless, &flags), &["line", "1048576"]);
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn what_is_merely_strange_is_told() {
    let folder = folder("strange");
    // Duplicate stamps left out; a dead wheel; the other wheel in turns a minute that are turns a second.
    let strange = table(400, |k, cells| {
        if k == 50 {
            cells[0] = format!("{}", 1_758_790_402_123_u64 + 20 * 49);
        }
        cells[4] = "0".to_owned();
        cells[5] = format!("{}", 30.0 + 0.001 * k as f64);
    });
    let done = import(&folder, &strange, &with_columns(&["--drop-bad-time"]));
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let summary: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    says(
        &summary["remarks"].to_string(),
        &[
            "1 rows whose time does not grow",
            "line 52",
            "constant at 0",
            "wheel 0 rolls 0.0 m",
            "wheel 1 rolls",
        ],
    );
    let _ = std::fs::remove_dir_all(&folder);
}

/// The command line of docs/how-to/import-your-logs.md.
#[test]
fn the_example_imports_without_remarks_and_can_be_diagnosed() {
    let folder = folder("example");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let guide = std::fs::read_to_string(root.join("docs/how-to/import-your-logs.md")).expect("the guide");
    let line = guide
        .lines()
        .map(str::trim)
        .find(|line| line.starts_with("robopheus import "))
        .expect("a command line");
    let out = folder.join("imported").display().to_string();
    let arguments: Vec<&str> = line
        .split_whitespace()
        .skip(1)
        .map(|word| if word == "imported" { out.as_str() } else { word })
        .collect();
    let done = Command::new(env!("CARGO_BIN_EXE_robopheus"))
        .current_dir(&root)
        .args(&arguments)
        .arg("--json")
        .output()
        .expect("the program");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let summary: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!(summary["remarks"], json!([]));
    assert_eq!(summary["bundles"].as_array().map(Vec::len), Some(2));
    let report = folder.join("report").display().to_string();
    let runs = ["run-001", "run-002"].map(|run| Path::new(&out).join(run).display().to_string());
    let done = Command::new(env!("CARGO_BIN_EXE_robopheus"))
        .args(["diagnose", "--runs", &runs[0], &runs[1], "--out", &report])
        .output()
        .expect("the program");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let _ = std::fs::remove_dir_all(&folder);
}

/// 64 MB in, with less than 48 MB resident at any time: the pass holds one row, whatever the size of the file.
#[test]
fn a_large_table_streams_through_little_memory() {
    const SIZE: usize = 64 << 20;
    const MOST_KB: u64 = 48 << 10;
    let folder = folder("large");
    let mut file = std::io::BufWriter::new(std::fs::File::create(folder.join("log.csv")).expect("table"));
    let mut bytes = 0;
    writeln!(
        file,
        "time_s,pose_x_m,pose_y_m,pose_yaw_rad,wheel_0_rad_per_s,wheel_1_rad_per_s"
    )
    .expect("header");
    for k in 0_u64.. {
        let t = 0.001 * k as f64;
        let line = format!(
            "{t:.3},{:.9},{:.9},0.123456789,{:.9},10.987654321\n",
            0.5 * t,
            0.1 * t,
            10.0 + 1e-6 * t
        );
        file.write_all(line.as_bytes()).expect("row");
        bytes += line.len();
        if bytes > SIZE {
            break;
        }
    }
    file.into_inner().expect("whole").sync_all().expect("on disk");
    let mut child = Command::new(env!("CARGO_BIN_EXE_robopheus"))
        .current_dir(&folder)
        .args([
            "import",
            "log.csv",
            "--robot",
            "robot.json",
            "--out",
            "out",
            "--cut-gap",
            "1",
        ])
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("the program");
    let status = format!("/proc/{}/status", child.id());
    let mut peak_kb = 0;
    let exit = loop {
        if let Some(exit) = child.try_wait().expect("the program") {
            break exit;
        }
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find(|line| line.starts_with("VmHWM:"));
        let now = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<u64>().ok());
        peak_kb = peak_kb.max(now.unwrap_or(0));
        std::thread::sleep(std::time::Duration::from_millis(5));
    };
    println!("{} MB in, {} MB resident at most", SIZE >> 20, peak_kb >> 10);
    assert!(exit.success());
    assert!(peak_kb > 1024 && peak_kb < MOST_KB, "{peak_kb} KB");
    let _ = std::fs::remove_dir_all(&folder);
}
