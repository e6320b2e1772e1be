//! `docs/laws.md` is what the laws say. `UPDATE_DOCS=1` writes it anew.

use std::fmt::Write as _;
use std::path::Path;

use control::law::{LAWS, LawSpec, Owner, YawUse};

const HEAD: &str = "# Control laws

The laws that an experiment can name under `control.law`, with their parameters (`control.parameters`) and what `targets`
mean to each. The page is written from the tables beside the laws in `control/src/law/`. Parameters that are left out have
their default. A parameter that chooses takes the number of its choice. Laws ask for velocities; limits, walls and other
robots are the safety filter's business, which follows every law.

Every law drives all six chassis: robots that move sideways do what it asks at once; those that turn in place point first;
car-like ones drive arcs and back off where a point lies inside their turning circle, which takes room and time. Paths and
trajectories that a car-like robot cannot drive are refused with the radius that it needs. An `omni4` on two driven wheels
is refused by all laws: nothing holds it across the axis of these wheels.

A law does not see poses of the past but where each robot will be when the command of this tick takes effect: the measured pose, moved on by the
commands that are on their way (`control/src/prediction.rs`; at most 0.35 s). The laboratory measures the delay of each robot, a rehearsal takes
the answer that the robot's description has in the twin. What that changes at 20, 50 and 80 ms stands in `docs/drills.md`.

";

fn targets(law: &LawSpec) -> String {
    let rule = law.targets;
    let whose = match rule.owner {
        Owner::Robot => "each names its robot",
        Owner::First => "of the first robot",
        Owner::Team => "of the team, without a robot",
    };
    let yaw = match rule.yaw {
        YawUse::Free => "yaw may be given",
        YawUse::Needed => "yaw must be given",
        YawUse::Unused => "no yaw",
    };
    let most = if rule.most_each == u32::MAX {
        String::new()
    } else if rule.owner == Owner::Robot {
        format!(", at most {} for a robot", rule.most_each)
    } else {
        format!(", at most {}", rule.most_each)
    };
    format!(
        "{} ({whose}; at least {}{most}; {yaw})",
        rule.meaning.trim_end_matches('.'),
        rule.least
    )
}

fn page() -> String {
    let mut page = HEAD.to_owned();
    for law in LAWS {
        let _ = writeln!(
            page,
            "## `{}`\n\n{}.\n\n* Source: {}.\n* Targets: {}.\n\n| parameter | unit | range | default | meaning |\n|---|---|---|---|---|",
            law.name,
            law.title,
            law.source,
            targets(law)
        );
        for parameter in law.parameters {
            let range = if parameter.choices.is_empty() {
                format!("{} .. {}", parameter.min, parameter.max)
            } else {
                parameter.limit()
            };
            let _ = writeln!(
                page,
                "| `{}` | {} | {range} | {} | {} |",
                parameter.key, parameter.unit, parameter.default, parameter.meaning
            );
        }
        page.push('\n');
    }
    page.trim_end().to_owned() + "\n"
}

#[test]
fn the_page_is_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/laws.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, page()).expect("docs/laws.md");
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == page(),
        "docs/laws.md is not what the laws say: run with UPDATE_DOCS=1"
    );
}

#[test]
fn every_law_has_names_a_source_and_whole_sentences() {
    for (position, law) in LAWS.iter().enumerate() {
        assert!(
            LAWS[..position].iter().all(|before| before.name != law.name),
            "{}",
            law.name
        );
        assert!(
            !law.source.is_empty() && !law.title.is_empty() && law.targets.meaning.ends_with('.'),
            "{}",
            law.name
        );
        for parameter in law.parameters {
            assert!(parameter.meaning.ends_with('.'), "{} {}", law.name, parameter.key);
            let units = [
                ("_m_per_s", "m/s"),
                ("_per_s2", "1/s2"),
                ("_per_m2", "1/m2"),
                ("_per_s", "1/s"),
                ("_rad", "rad"),
                ("_m", "m"),
                ("_s", "s"),
            ];
            let unit = units
                .iter()
                .find(|(end, _)| parameter.key.ends_with(end))
                .map_or("", |(_, unit)| unit);
            assert_eq!(parameter.unit, unit, "{} {}", law.name, parameter.key);
        }
    }
}
