//! The committed digests hold in this build.

use twin::golden::{TABLE, run};

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
