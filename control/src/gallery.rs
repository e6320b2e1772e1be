//! Scenarios with many contacts, for tests that native and browser twin give the same digest.
//!
//! Each scenario drives robots without law and without safety filter: constant body twists straight into the twin's
//! world, so that robots run into each other and into walls, which an experiment could never do.

use std::collections::BTreeMap;

use twin::twist::BodyTwist;

use crate::law::PUSH;
use crate::rehearsal::{ticks_of, world};
use crate::scenario::{
    Control, Experiment, ExperimentRobot, FORMAT, Mode, Scenario, ScenarioArena, ScenarioRobot, Start,
};
use crate::team::robots;

/// One robot of each kind: omni4, diff2, awd.
const ROBOTS: &str = include_str!("../gallery/robots.json");

/// What happened in a gallery scenario.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trace {
    pub digest: String,
    /// Ticks with a contact between robots.
    pub robot_contact_ticks: u64,
    /// Ticks with a contact between a robot and a wall.
    pub wall_contact_ticks: u64,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Omni,
    Diff,
    Awd,
}

/// Kind, start `[x_m, y_m, yaw_rad]` and body twist `[forward, left, yaw rate]`.
type Row = (Kind, [f64; 3], [f64; 3]);

/// Names and JSON texts of all scenarios. The law is `push`; its parameter `twists` has one body twist per robot.
pub fn digest_scenarios() -> Vec<(String, String)> {
    let mut all = Vec::new();
    for (name, duration_s, rows) in named() {
        all.push((name.to_owned(), scenario_json(name, duration_s, &rows)));
    }
    for crowd in 0..8_u32 {
        let name = format!("crowd-{crowd}");
        let text = scenario_json(&name, 4.0, &crowd_rows(crowd));
        all.push((name, text));
    }
    all
}

/// Digests of all gallery scenarios, of every effect and of a learned residual on every chassis, by name.
pub fn digests() -> BTreeMap<String, String> {
    let mut all: BTreeMap<String, String> = digest_scenarios()
        .into_iter()
        .map(|(name, text)| {
            let digest = run(&text).map_or(String::new(), |trace| trace.digest);
            (name, digest)
        })
        .collect();
    // A trace that fails here fails natively too, and then the names differ.
    all.extend(twin::golden::effect_digests().unwrap_or_default());
    all.extend(twin::golden::residual_digests().unwrap_or_default());
    all
}

/// Trace digest of a gallery scenario; empty when there is none of that name.
pub fn digest_of(name: &str) -> String {
    trace_of(name).map_or(String::new(), |trace| trace.digest)
}

/// Runs a gallery scenario; `None` when there is none of that name or the twin refuses it.
pub fn trace_of(name: &str) -> Option<Trace> {
    let (_, text) = digest_scenarios().into_iter().find(|(known, _)| known == name)?;
    run(&text)
}

fn run(scenario_json: &str) -> Option<Trace> {
    let scenario = Scenario::parse(scenario_json).ok()?;
    let twists: Vec<BodyTwist> =
        serde_json::from_value(scenario.experiment.control.parameters.get("twists")?.clone()).ok()?;
    let robots = robots(&scenario).ok()?;
    let mut world = world(&scenario).ok()?;
    let commands: Vec<_> = robots
        .iter()
        .zip(&twists)
        .map(|(robot, twist)| robot.wheel_speeds(*twist))
        .collect();
    let (mut robot_contact_ticks, mut wall_contact_ticks) = (0, 0);
    for _ in 0..ticks_of(scenario.experiment.duration_s) {
        world.step(&commands).ok()?;
        let contacts = world.contacts_this_tick();
        robot_contact_ticks += u64::from(contacts.iter().any(|contact| contact.b.is_some()));
        wall_contact_ticks += u64::from(contacts.iter().any(|contact| contact.b.is_none()));
    }
    Some(Trace {
        digest: world.digest().to_string(),
        robot_contact_ticks,
        wall_contact_ticks,
    })
}

fn named() -> Vec<(&'static str, f64, Vec<Row>)> {
    use Kind::{Awd, Diff, Omni};
    let half_turn = core::f64::consts::PI;
    let quarter = core::f64::consts::FRAC_PI_2;
    vec![
        ("free-omni", 3.0, vec![(Omni, [0.0, 0.0, 0.3], [0.3, 0.1, 0.5])]),
        ("wall-right", 4.0, vec![(Omni, [1.0, 0.0, 0.0], [0.6, 0.0, 0.0])]),
        ("wall-left", 4.0, vec![(Diff, [-1.0, 0.2, half_turn], [0.5, 0.0, 0.0])]),
        (
            "wall-top-glancing",
            4.0,
            vec![(Omni, [-1.0, 0.9, 0.2], [0.5, 0.3, 0.0])],
        ),
        (
            "wall-bottom-backwards",
            4.0,
            vec![(Diff, [0.3, -0.8, quarter], [-0.5, 0.0, 0.1])],
        ),
        ("corner", 5.0, vec![(Omni, [1.2, 0.8, 0.7], [0.7, 0.0, 0.0])]),
        ("spin-on-wall", 4.0, vec![(Omni, [1.5, 0.0, 0.0], [0.5, 0.0, 2.0])]),
        ("car-into-wall", 4.0, vec![(Awd, [0.8, 0.3, 0.1], [0.7, 0.0, 0.2])]),
        (
            "head-on",
            4.0,
            vec![
                (Omni, [-0.8, 0.0, 0.0], [0.5, 0.0, 0.0]),
                (Omni, [0.8, 0.0, half_turn], [0.5, 0.0, 0.0]),
            ],
        ),
        (
            "head-on-offset",
            4.0,
            vec![
                (Diff, [-0.8, 0.1, 0.0], [0.6, 0.0, 0.0]),
                (Omni, [0.8, -0.1, half_turn], [0.4, 0.0, 0.3]),
            ],
        ),
        (
            "broadside",
            4.0,
            vec![
                (Omni, [-0.9, 0.0, 0.0], [0.6, 0.0, 0.0]),
                (Diff, [0.0, -0.5, quarter], [0.2, 0.0, 0.0]),
            ],
        ),
        (
            "rear-end",
            5.0,
            vec![
                (Awd, [-1.2, 0.0, 0.0], [0.8, 0.0, 0.0]),
                (Diff, [0.0, 0.05, 0.0], [0.2, 0.0, 0.0]),
            ],
        ),
        (
            "push-to-wall",
            5.0,
            vec![
                (Omni, [0.2, 0.1, 0.0], [0.6, 0.0, 0.0]),
                (Omni, [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ],
        ),
        (
            "pinned",
            4.0,
            vec![
                (Omni, [-0.7, 0.0, 0.0], [0.6, 0.0, 0.0]),
                (Diff, [0.0, 0.0, quarter], [0.1, 0.0, 0.0]),
                (Omni, [0.7, 0.0, half_turn], [0.6, 0.0, 0.0]),
            ],
        ),
        (
            "chain",
            5.0,
            vec![
                (Omni, [-1.5, 0.0, 0.0], [0.7, 0.0, 0.0]),
                (Omni, [-0.9, 0.0, 0.0], [0.0, 0.0, 0.0]),
                (Diff, [-0.3, 0.0, 0.0], [0.0, 0.0, 0.0]),
                (Omni, [0.3, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ],
        ),
        (
            "all-to-centre",
            5.0,
            vec![
                (Omni, [-1.2, -0.8, 0.59], [0.5, 0.0, 0.0]),
                (Omni, [1.2, -0.8, 2.55], [0.5, 0.0, 0.0]),
                (Omni, [1.2, 0.8, -2.55], [0.5, 0.0, 0.0]),
                (Omni, [-1.2, 0.8, -0.59], [0.5, 0.0, 0.0]),
            ],
        ),
        (
            "three-kinds",
            6.0,
            vec![
                (Omni, [-1.0, 0.5, 0.0], [0.4, -0.2, 0.4]),
                (Diff, [0.0, -0.6, 1.2], [0.5, 0.0, 0.4]),
                (Awd, [1.0, 0.5, half_turn], [0.5, 0.0, 0.3]),
            ],
        ),
        (
            "long-roundabout",
            20.0,
            vec![
                (Diff, [-0.6, 0.0, quarter], [0.4, 0.0, -0.5]),
                (Diff, [0.6, 0.0, -quarter], [0.4, 0.0, -0.5]),
                (Omni, [0.0, 0.0, 0.0], [0.2, 0.1, 1.0]),
            ],
        ),
    ]
}

/// Robots on a grid with twists from a small generator: the same on every machine.
fn crowd_rows(seed: u32) -> Vec<Row> {
    let mut generator = Lcg(u64::from(seed) * 2 + 1);
    let mut rows = Vec::new();
    for column in 0..5_u32 {
        for row in 0..(1 + seed % 4) {
            let kind = match generator.below(3) {
                0 => Kind::Diff,
                1 => Kind::Awd,
                _ => Kind::Omni,
            };
            let x_m = -1.5 + 0.7 * f64::from(column) + 0.05 * generator.signed();
            let y_m = -1.1 + 0.65 * f64::from(row) + 0.02 * generator.signed();
            let twist = [
                0.7 * generator.signed(),
                0.4 * generator.signed(),
                1.2 * generator.signed(),
            ];
            rows.push((kind, [x_m, y_m, 3.1 * generator.signed()], twist));
        }
    }
    rows
}

/// Knuth's multiplicative generator, upper bits.
struct Lcg(u64);

impl Lcg {
    fn next(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    /// Uniform in [-1, 1).
    fn signed(&mut self) -> f64 {
        self.next() as f64 / (1_u64 << 30) as f64 - 1.0
    }
}

fn scenario_json(name: &str, duration_s: f64, rows: &[Row]) -> String {
    let models: Vec<ScenarioRobot> = serde_json::from_str(ROBOTS).unwrap_or_default();
    let mut lab = Vec::new();
    let mut placed = Vec::new();
    let mut twists = Vec::new();
    for (i, (kind, [x_m, y_m, yaw_rad], [forward_m_per_s, left_m_per_s, yaw_rate_rad_per_s])) in rows.iter().enumerate()
    {
        let Some(model) = models.get(*kind as usize) else {
            continue;
        };
        let mut robot = model.clone();
        robot.number = i as u8 + 1;
        robot.description.name = format!("{name}-{i}");
        let chassis = robot.description.chassis.clone();
        let left_m_per_s = if matches!(kind, Kind::Omni) { *left_m_per_s } else { 0.0 };
        placed.push(ExperimentRobot {
            name: robot.description.name.clone(),
            chassis,
            controller: robot.controller.clone(),
            start: Start {
                x_m: *x_m,
                y_m: *y_m,
                yaw_rad: *yaw_rad,
            },
        });
        twists.push(BodyTwist {
            forward_m_per_s: *forward_m_per_s,
            left_m_per_s,
            yaw_rate_rad_per_s: *yaw_rate_rad_per_s,
        });
        lab.push(robot);
    }
    let scenario = Scenario {
        experiment: Experiment {
            format: FORMAT.into(),
            mode: Mode::Virtual,
            arena: "reference".into(),
            floor: "lab-floor".into(),
            robots: placed,
            control: Control {
                law: PUSH.into(),
                parameters: serde_json::json!({ "twists": twists }),
                interaction: None,
                feedback_alone: false,
            },
            targets: Vec::new(),
            duration_s,
            seed: 1,
            model: None,
        },
        robots: lab,
        arena: ScenarioArena {
            name: "reference".into(),
            width_m: 4.0,
            height_m: 3.0,
            floor: "lab-floor".into(),
            contents: Default::default(),
        },
        models: Default::default(),
    };
    serde_json::to_string(&scenario).unwrap_or_default()
}
