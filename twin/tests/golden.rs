//! The committed digests hold in this build.

use std::collections::BTreeMap;
use std::path::Path;
use twin::golden::{TABLE, effect_digests, run};

#[test]
fn digests_are_those_of_the_table() {
    let mut wrong = Vec::new();
    for golden in TABLE {
        match run(golden.name) {
            Ok(digest) if digest.to_string() == golden.digest => {}
            got => wrong.push(format!(
                "{}: {} against {}",
                golden.name,
                got.map_or_else(|error| error.to_string(), |digest| digest.to_string()),
                golden.digest
            )),
        }
    }
    assert!(
        wrong.is_empty(),
        "these bits changed; if that is meant, change twin::VERSION and the table:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn unknown_scenarios_are_refused() {
    assert!(run("moon").is_err());
}

/// `UPDATE_GOLDEN=1` writes the file anew.
#[test]
fn every_effect_on_every_chassis_gives_its_committed_digest() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/effects.json");
    let now = effect_digests().expect("traces");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        let text = serde_json::to_string_pretty(&now).expect("JSON");
        std::fs::write(&path, text + "\n").expect("written");
    }
    let committed: BTreeMap<String, String> =
        serde_json::from_str(&std::fs::read_to_string(&path).expect("golden/effects.json")).expect("JSON");
    let changed: Vec<&String> = now
        .keys()
        .chain(committed.keys())
        .filter(|name| now.get(*name) != committed.get(*name))
        .collect();
    assert!(now.len() > 200, "{}", now.len());
    assert!(
        changed.is_empty(),
        "these bits changed; if that is meant, change twin::VERSION and run with UPDATE_GOLDEN=1: {changed:?}"
    );
    // An effect that leaves the trace as it is would be no effect.
    for (name, digest) in &now {
        let chassis = name.split('/').next().unwrap_or_default();
        let nominal = &now[&format!("{chassis}/nominal")];
        assert!(
            name.ends_with("/nominal") || digest != nominal,
            "{name} changes nothing"
        );
    }
}
