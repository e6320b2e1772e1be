//! The scenarios that native and browser twin compare.

use std::collections::BTreeSet;

use control::gallery::{digest_of, digest_scenarios, trace_of};

#[test]
fn at_least_twenty_scenarios_with_contacts_of_both_kinds_repeat_bit_for_bit() {
    let scenarios = digest_scenarios();
    assert!(scenarios.len() >= 20, "{}", scenarios.len());
    let (mut with_robots, mut with_walls, mut digests) = (0, 0, BTreeSet::new());
    for (name, _) in &scenarios {
        let trace = trace_of(name).unwrap_or_else(|| panic!("{name} cannot run"));
        println!(
            "{name}: {} robots {} walls {}",
            trace.digest, trace.robot_contact_ticks, trace.wall_contact_ticks
        );
        with_robots += u32::from(trace.robot_contact_ticks > 0);
        with_walls += u32::from(trace.wall_contact_ticks > 0);
        assert_eq!(digest_of(name), trace.digest);
        assert!(
            digests.insert(trace.digest),
            "{name} has the digest of another scenario"
        );
    }
    println!(
        "{with_robots} with robot contacts, {with_walls} with wall contacts, of {}",
        scenarios.len()
    );
    assert!(with_robots >= 10 && with_walls >= 8);
    assert_eq!(digest_of("no such scenario"), "");
}
