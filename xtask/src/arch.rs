//! The architecture's invariants, as far as the dependency graph and names can show them.

mod naming;

use std::collections::BTreeMap;

use anyhow::Result;

use crate::End;
use crate::metadata::{HOST_TRIPLE, Member, WASM_TRIPLE, members};
use crate::paths;

/// Which package may depend directly on which others of the workspace.
const EDGES: &[(&str, &[&str])] = &[
    ("api", &[]),
    // The diagnosis on runs of the plant, scored.
    ("blind", &["api", "emulator", "identify", "robot", "twin"]),
    ("bundles", &["identify"]),
    (
        "client",
        &[
            "api",
            "bundles",
            "control",
            "controllers",
            "identify",
            "sandbox",
            "twin",
        ],
    ),
    ("control", &["twin"]),
    // What users write, as a law.
    ("controllers", &["control", "onnx", "twin"]),
    // The laboratory in virtual time: its own code against the plant; for the paper's experiments what learns from its runs, too.
    (
        "drills",
        &[
            "api", "control", "emulator", "identify", "lab", "learn", "localise", "robot", "sandbox", "twin",
        ],
    ),
    ("emulator", &["api", "robot"]),
    ("identify", &["twin"]),
    (
        "lab",
        &["api", "control", "learn", "localise", "robot", "sandbox", "twin"],
    ),
    ("learn", &["bundles", "identify", "onnx", "twin"]),
    ("onnx", &[]),
    ("localise", &[]),
    ("robot", &[]),
    ("sandbox", &["control", "controllers"]),
    (
        "scheduler",
        &["api", "bundles", "control", "identify", "sandbox", "store", "twin"],
    ),
    // Bundles and identify: two models on a stored run while a person waits.
    (
        "server",
        &["api", "bundles", "control", "identify", "learn", "store", "twin"],
    ),
    ("sim-wasm", &["control", "controllers", "twin"]),
    ("store", &["api"]),
    ("system-tests", &["api"]),
    ("twin", &[]),
    // Of control only the tables of the laws' parameters, of controllers only gallery, vocabulary and limits: labels, units and
    // limits stand in one place.
    ("web-ui", &["api", "control", "controllers"]),
    ("xtask", &[]),
];

/// Further packages that only the tests of a package may use.
const TEST_EDGES: &[(&str, &[&str])] = &[
    ("control", &["api"]),
    ("controllers", &["api"]),
    // The emulated plant against the nominal twin.
    ("identify", &["api", "emulator", "robot"]),
    // Hidden plants.
    ("learn", &["blind", "controllers", "emulator"]),
    ("sandbox", &["twin"]),
    ("system-tests", &["control", "controllers", "robot"]),
    // The twin's motor control against the firmware's, bit for bit.
    ("twin", &["robot"]),
];

/// Which packages alone may depend directly on a given package.
const OWNERS: &[(&str, &[&str])] = &[
    ("axum", &["server"]),
    ("eframe", &["web-ui"]),
    ("egui", &["web-ui"]),
    ("egui_plot", &["web-ui"]),
    ("ort", &["client", "lab", "learn", "scheduler"]),
    ("rapier2d-f64", &["twin"]),
    ("rhai", &["controllers"]),
    ("sqlx", &["store"]),
    ("wasm-bindgen", &["sim-wasm", "web-ui"]),
    ("wasmi", &["controllers"]),
];

/// Packages without IO, clock, threads or randomness of their own.
const PURE: &[&str] = &["control", "controllers", "identify", "onnx", "robot", "twin"];

/// What a pure package may not be linked with, not even through others.
const IMPURE: &[&str] = &[
    "async-std",
    "axum",
    "chrono",
    "crossbeam-channel",
    "fastrand",
    "futures",
    "getrandom",
    "hyper",
    "mio",
    "num_cpus",
    "ort",
    "rand",
    "rayon",
    "reqwest",
    "rustix",
    "smol",
    "socket2",
    "sqlx",
    "tempfile",
    "time",
    "tokio",
    "tracing-subscriber",
    "uuid",
    "walkdir",
    "web-time",
];

/// Linked, and never asked: the script engine's hash tables could draw their seeds; they are given one (`controllers/src/script/mod.rs`).
const HARMLESS: &[(&str, &str)] = &[("controllers", "getrandom")];

/// A law of the emulator's own: the plant cannot be the model.
const NEVER_LINKED: &[(&str, &[&str])] = &[
    ("emulator", &["control", "identify", "twin"]),
    ("api", &["tokio", "sqlx", "axum"]),
    ("client", &["axum", "eframe", "egui", "sqlx", "store"]),
    ("lab", &["axum", "sqlx", "store"]),
    ("web-ui", &["axum", "sqlx", "store", "tokio"]),
];

type Graph = BTreeMap<String, Member>;

/// `cargo xtask arch`.
pub fn arch() -> Result<End> {
    let problems = problems()?;
    for problem in &problems {
        eprintln!("arch: {problem}");
    }
    println!("arch: {} packages, {} broken rules", EDGES.len(), problems.len());
    Ok(if problems.is_empty() { End::Good } else { End::Failed })
}

/// Every broken rule in a sentence.
pub fn problems() -> Result<Vec<String>> {
    let native = members(HOST_TRIPLE)?;
    let browser = members(WASM_TRIPLE)?;
    let mut problems = edge_problems(&native);
    problems.extend(owner_problems(&native));
    problems.extend(purity_problems(&native));
    problems.extend(never_linked_problems(&native));
    for shell in ["web-ui", "sim-wasm"] {
        problems.extend(linked_problems(
            &browser,
            shell,
            &["tokio", "sqlx", "axum", "mio"],
            "cannot run in a browser",
        ));
    }
    let robot = std::fs::read_to_string(paths::root().join("robot/src/lib.rs")).unwrap_or_default();
    problems.extend(no_std_problem(&robot));
    problems.extend(naming::problems()?);
    Ok(problems)
}

fn edge_problems(graph: &Graph) -> Vec<String> {
    let mut problems = Vec::new();
    for (name, member) in graph {
        let Some((_, allowed)) = EDGES.iter().find(|(package, _)| package == name) else {
            problems.push(format!(
                "package {name} is not in the table of allowed edges (xtask/src/arch.rs): decide what it may depend on"
            ));
            continue;
        };
        let is_inner = |other: &&String| graph.contains_key(*other) && *other != name;
        for other in member
            .direct
            .iter()
            .filter(is_inner)
            .filter(|other| !allowed.contains(&other.as_str()))
        {
            problems.push(format!("{name} depends on {other}; it may depend on {allowed:?} only"));
        }
        let in_tests = TEST_EDGES
            .iter()
            .find(|(package, _)| package == name)
            .map_or(&[] as &[&str], |(_, more)| more);
        for other in member.for_tests.iter().filter(is_inner) {
            if !allowed.contains(&other.as_str()) && !in_tests.contains(&other.as_str()) {
                problems.push(format!(
                    "the tests of {name} depend on {other}; they may also depend on {in_tests:?} only"
                ));
            }
        }
    }
    problems
}

fn owner_problems(graph: &Graph) -> Vec<String> {
    let mut problems = Vec::new();
    for (package, owners) in OWNERS {
        let uses = |member: &&Member| member.direct.contains(*package) || member.for_tests.contains(*package);
        let users = graph.values().filter(uses);
        for user in users.filter(|user| !owners.contains(&user.name.as_str())) {
            problems.push(format!(
                "{} depends on {package}, which belongs to {} only",
                user.name,
                owners.join(", ")
            ));
        }
    }
    problems
}

fn purity_problems(graph: &Graph) -> Vec<String> {
    PURE.iter()
        .flat_map(|name| {
            let without = |package: &&str| !HARMLESS.contains(&(*name, *package));
            let banned: Vec<&str> = IMPURE.iter().copied().filter(without).collect();
            linked_problems(
                graph,
                name,
                &banned,
                "brings IO, a clock, threads or randomness into a pure package",
            )
        })
        .collect()
}

fn never_linked_problems(graph: &Graph) -> Vec<String> {
    NEVER_LINKED
        .iter()
        .flat_map(|(name, banned)| linked_problems(graph, name, banned, "must stay out of it"))
        .collect()
}

fn linked_problems(graph: &Graph, name: &str, banned: &[&str], why: &str) -> Vec<String> {
    let Some(member) = graph.get(name) else {
        return vec![format!("package {name} is missing")];
    };
    let found = banned.iter().filter(|package| member.linked.contains(**package));
    found
        .map(|package| {
            format!("{name} is linked with {package}, which {why} (`cargo tree -p {name} -i {package}` shows how)")
        })
        .collect()
}

fn no_std_problem(text: &str) -> Option<String> {
    let found = text
        .lines()
        .any(|line| line.trim_start().starts_with("#![") && line.contains("no_std"));
    (!found).then(|| "robot/src/lib.rs does not say #![no_std]".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(rows: &[(&str, &[&str], &[&str])]) -> Graph {
        let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let member = |(name, direct, linked): &(&str, &[&str], &[&str])| Member {
            name: (*name).to_owned(),
            direct: set(direct),
            linked: set(linked),
            ..Member::default()
        };
        rows.iter().map(|row| (row.0.to_owned(), member(row))).collect()
    }

    #[test]
    fn the_plant_may_not_become_the_model() {
        let bad = graph(&[("emulator", &["twin"], &["twin"]), ("twin", &[], &[])]);
        assert_eq!(edge_problems(&bad).len(), 1);
        assert!(!linked_problems(&bad, "emulator", &["twin"], "").is_empty());
        let good = graph(&[("emulator", &["robot"], &["robot"]), ("robot", &[], &[])]);
        assert!(edge_problems(&good).is_empty());
    }

    #[test]
    fn what_tests_may_use_the_package_itself_may_not() {
        let mut graph = graph(&[("control", &[], &[]), ("api", &[], &[])]);
        let control = graph.get_mut("control").unwrap();
        control.for_tests.insert("api".to_owned());
        assert!(edge_problems(&graph).is_empty());
        graph.get_mut("control").unwrap().direct.insert("api".to_owned());
        assert_eq!(edge_problems(&graph).len(), 1);
    }

    #[test]
    fn a_pure_package_is_caught_through_another_one() {
        let mut rows: Vec<(&str, &[&str], &[&str])> = PURE
            .iter()
            .map(|name| (*name, &[] as &[&str], &[] as &[&str]))
            .collect();
        assert!(purity_problems(&graph(&rows)).is_empty());
        rows[0].2 = &["innocent", "getrandom"];
        let problems = purity_problems(&graph(&rows));
        assert_eq!(problems.len(), 1);
        assert!(problems[0].contains("getrandom"), "{problems:?}");
    }

    #[test]
    fn sql_outside_the_store_is_caught() {
        assert_eq!(
            owner_problems(&graph(&[("server", &["sqlx"], &[]), ("store", &["sqlx"], &[])])).len(),
            1
        );
    }

    #[test]
    fn a_new_package_must_be_given_its_place() {
        assert!(edge_problems(&graph(&[("newcomer", &[], &[])]))[0].contains("newcomer"));
    }

    #[test]
    fn a_comment_about_no_std_is_not_enough() {
        assert!(no_std_problem("//! no_std, no heap\n").is_some());
        assert!(no_std_problem("//! x\n#![cfg_attr(not(test), no_std)]\n").is_none());
    }
}
