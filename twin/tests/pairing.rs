//! The reference set of robots: which controller drives which chassis, and why not.

use std::fs;
use std::path::{Path, PathBuf};

use twin::pairing::budget::BUDGETS;
use twin::pairing::connector::{Actuator, Line};
use twin::pairing::controller::CONTROLLERS;
use twin::pairing::program::programs;
use twin::pairing::sensor::{Drive, SENSORS};
use twin::pairing::task::{Task, link};
use twin::pairing::{Budget, ControllerKind, Pairing, PairingProblem, RobotDocument, SensorKind, check};
use twin::robot::Robot;

/// The six chassis and the mode of `omni4` in which two opposite wheels roll freely.
const CHASSIS: [&str; 7] = ["omni4", "omni4-two-wheel", "diff2", "diff4", "fwd", "rwd", "awd"];
/// Actuator pins of each, in the order of [`CHASSIS`].
const PINS: [usize; 7] = [28, 14, 14, 28, 17, 17, 31];
/// Outcome of each chassis with each controller; `None` is accepted.
const OUTCOMES: [(&str, [Option<Budget>; 3]); 7] = [
    ("omni4", [Some(Budget::Compute), None, None]),
    ("omni4-two-wheel", [None, None, None]),
    ("diff2", [None, None, None]),
    ("diff4", [Some(Budget::Compute), None, None]),
    ("fwd", [None, None, None]),
    ("rwd", [None, None, None]),
    ("awd", [Some(Budget::Compute), None, None]),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn document(chassis: &str, controller: &str) -> RobotDocument {
    let path = root().join(format!("examples/robots/{chassis}-{controller}.json"));
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn pair(chassis: &str, controller: &str) -> Pairing {
    let document = document(chassis, controller);
    assert_eq!(document.robot.chassis, chassis.trim_end_matches("-two-wheel"));
    assert_eq!(document.robot.name, format!("{chassis}-{controller}"));
    assert_eq!(document.controller, controller);
    document.pairing().unwrap_or_else(|problems| panic!("{problems:?}"))
}

fn reference_set() -> Vec<Pairing> {
    let names = CONTROLLERS.map(|controller| controller.kind.name());
    CHASSIS
        .iter()
        .flat_map(|chassis| names.map(|controller| pair(chassis, controller)))
        .collect()
}

fn problems(pair: &Pairing) -> Vec<PairingProblem> {
    check(pair).err().unwrap_or_default()
}

fn budgets(pair: &Pairing) -> Vec<Budget> {
    problems(pair).into_iter().map(|problem| problem.budget).collect()
}

/// Numbers add up, somebody can be blamed, and the remedy, where it names a controller, helps.
fn assert_explained(pair: &Pairing, problem: &PairingProblem) {
    let text = problem.to_string();
    assert!(problem.needed > problem.available, "{text}");
    for number in [problem.needed, problem.available] {
        assert!(text.contains(&number.to_string()), "{text}");
    }
    assert!(
        text.contains(problem.budget.unit()) && text.contains(&problem.remedy),
        "{text}"
    );
    assert!(
        text.contains(problem.controller) && text.starts_with(&problem.field),
        "{text}"
    );
    assert!(!problem.remedy.is_empty());
    let parts: u64 = problem.consumers.iter().map(|consumer| consumer.needed).sum();
    assert_eq!(parts, problem.needed, "{text}");
    for other in CONTROLLERS {
        if problem.remedy.contains(other.kind.name()) {
            let other = Pairing {
                controller: other.kind,
                ..pair.clone()
            };
            assert!(check(&other).is_ok(), "{text}");
        }
    }
    if let Some((_, sensor)) = problem.remedy.split_once("leave out ") {
        let mut fewer = pair.clone();
        let place = fewer.sensors.iter().rposition(|carried| carried.name() == sensor);
        fewer.sensors.remove(place.unwrap());
        let still = problems(&fewer);
        let again = still.iter().filter(|other| other.budget == problem.budget);
        assert!(
            again.count()
                < problems(pair)
                    .iter()
                    .filter(|other| other.budget == problem.budget)
                    .count(),
            "{text}"
        );
    }
}

#[test]
fn every_reference_pair_works_or_is_refused_as_expected() {
    for ((chassis, outcomes), pins) in OUTCOMES.into_iter().zip(PINS) {
        for (controller, expected) in CONTROLLERS.iter().zip(outcomes) {
            let pair = pair(chassis, controller.kind.name());
            assert!(Robot::new(pair.robot.clone()).is_ok());
            assert_eq!(Budget::ConnectorPins.needed(&pair), pins as u64);
            match check(&pair) {
                Ok(assignment) => {
                    assert_eq!(expected, None, "{chassis} {controller:?}");
                    let mut numbers: Vec<u8> = assignment.pins.iter().map(|pin| pin.number).collect();
                    assert!(numbers.iter().all(|number| (5..=35).contains(number)));
                    numbers.dedup();
                    assert!(numbers.is_sorted());
                    assert_eq!(numbers.len(), pins);
                }
                Err(problems) => {
                    assert_eq!(
                        problems.iter().map(|problem| Some(problem.budget)).collect::<Vec<_>>(),
                        [expected],
                        "{chassis}"
                    );
                    problems.iter().for_each(|problem| assert_explained(&pair, problem));
                }
            }
        }
    }
}

/// The outcomes are the same for any reserve up to an eighth.
#[test]
fn the_smallest_controller_has_clock_for_two_motors_and_not_for_four() {
    for chassis in CHASSIS {
        let pair = pair(chassis, "mega2560");
        let clock = pair.controller.controller().clock_hz / u64::from(twin::PHYSICS_RATE_HZ);
        let percent = Budget::Compute.needed(&pair) * 100 / clock;
        assert!(
            if check(&pair).is_ok() {
                percent <= 87
            } else {
                percent >= 115
            },
            "{chassis}: {percent} % of the clock"
        );
    }
    let mut blind = pair("omni4", "mega2560");
    blind.sensors.retain(|sensor| *sensor != SensorKind::Current);
    assert_eq!(budgets(&blind), [Budget::Compute]);
}

#[test]
fn the_set_holds_nothing_else() {
    let mut found: Vec<String> = fs::read_dir(root().join("examples/robots"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".json"))
        .collect();
    found.sort();
    let mut expected: Vec<String> = reference_set()
        .iter()
        .map(|pair| format!("{}.json", pair.robot.name))
        .collect();
    expected.sort();
    assert_eq!(found, expected);
}

#[test]
fn a_motor_has_three_power_and_four_feedback_pins_and_a_gear_two_and_one() {
    let assignment = check(&pair("awd", "sam3x")).unwrap();
    let of = |actuator: Actuator| -> Vec<Line> {
        let pins = assignment.pins.iter().filter(|pin| pin.actuator == actuator);
        pins.map(|pin| pin.line).collect()
    };
    let power = |lines: &[Line]| {
        let power = [
            Line::PhaseU,
            Line::PhaseV,
            Line::PhaseW,
            Line::GearPositive,
            Line::GearNegative,
        ];
        lines.iter().filter(|line| power.contains(line)).count()
    };
    for wheel in 0..4 {
        let lines = of(Actuator::Motor { wheel });
        assert_eq!((power(&lines), lines.len() - power(&lines)), (3, 4));
    }
    let lines = of(Actuator::SteeringGear);
    assert_eq!((power(&lines), lines.len() - power(&lines)), (2, 1));
}

#[test]
fn the_same_place_has_the_same_pins_on_every_chassis() {
    let rwd = check(&pair("rwd", "tx2")).unwrap();
    let awd = check(&pair("awd", "tx2")).unwrap();
    for pin in &rwd.pins {
        let same = awd.pins.iter().find(|other| other.number == pin.number).unwrap();
        assert_eq!(same.line, pin.line);
    }
    assert_eq!(rwd.pins[0].actuator, Actuator::Motor { wheel: 2 });
}

#[test]
fn another_sensor_never_makes_a_refused_pair_work() {
    for reference in reference_set() {
        let with = |subset: usize| Pairing {
            sensors: SENSORS
                .into_iter()
                .enumerate()
                .filter(|(i, _)| subset >> i & 1 == 1)
                .map(|(_, sensor)| sensor)
                .collect(),
            ..reference.clone()
        };
        let subsets = 1 << SENSORS.len();
        let works: Vec<bool> = (0..subsets).map(|subset| check(&with(subset)).is_ok()).collect();
        for subset in 0..subsets {
            for i in 0..SENSORS.len() {
                let more = subset | 1 << i;
                assert!(works[subset] || !works[more], "{:?}", with(more).sensors);
            }
        }
        assert!(works[0], "the bare chassis works with every controller");
    }
}

#[test]
fn every_refusal_names_what_is_needed_and_what_there_is() {
    for reference in reference_set() {
        for sensor in SENSORS {
            for copies in [1, 3] {
                let mut pair = reference.clone();
                pair.sensors.extend([sensor].repeat(copies));
                problems(&pair)
                    .iter()
                    .for_each(|problem| assert_explained(&pair, problem));
            }
        }
    }
}

#[test]
fn too_many_motors_name_their_pins() {
    let mut pair = pair("diff4", "sam3x");
    let wheel = pair.robot.wheels[0].clone();
    pair.robot.wheels.extend([wheel.clone(), wheel]);
    let problems = problems(&pair);
    let pins = &problems[0];
    assert_eq!(
        (pins.budget, pins.needed, pins.available),
        (Budget::ConnectorPins, 42, 31)
    );
    assert_eq!(pins.field, "robot.wheels");
    assert_eq!(pins.consumers[0].name, "motor of wheels[0]");
    assert_explained(&pair, pins);
    pair.controller = ControllerKind::Tx2;
    assert_eq!(budgets(&pair), [Budget::ConnectorPins, Budget::EncoderInputs]);
}

#[test]
fn ports_run_out() {
    let mut rich = pair("awd", "tx2");
    rich.sensors.push(SensorKind::Gnss);
    assert_eq!(budgets(&rich), [Budget::SerialPorts]);
    rich.sensors.push(SensorKind::DepthCamera);
    assert_eq!(budgets(&rich), [Budget::SerialPorts, Budget::Usb3Ports]);
    let mut ranging = pair("awd", "sam3x");
    ranging.sensors.push(SensorKind::Range);
    assert_eq!(budgets(&ranging), [Budget::AnalogInputs]);
}

#[test]
fn a_sensor_that_is_too_much_by_itself_is_named() {
    let mut small = pair("diff2", "mega2560");
    small.sensors.push(SensorKind::Lidar);
    small.sensors.push(SensorKind::DepthCamera);
    let problems = problems(&small);
    let named: Vec<(&str, Budget)> = problems
        .iter()
        .map(|problem| (problem.subject.as_str(), problem.budget))
        .collect();
    let expected = [
        ("depth_camera", Budget::Usb3Ports),
        ("lidar", Budget::Compute),
        ("depth_camera", Budget::Compute),
        ("lidar", Budget::Memory),
        ("depth_camera", Budget::Memory),
    ];
    assert_eq!(named, expected);
    assert!(problems.iter().all(|problem| problem.remedy.starts_with("use tx2")));
    assert_eq!(problems[0].field, "sensors[6]");
}

#[test]
fn a_faster_motor_takes_more_of_a_processor_that_counts_itself() {
    let mut fast = pair("diff2", "mega2560");
    if let Some(motor) = &mut fast.robot.motor {
        motor.torque_constant_n_m_per_a /= 2.0;
    }
    assert_eq!(budgets(&fast), [Budget::Compute]);
    fast.controller = ControllerKind::Sam3x;
    assert_eq!(budgets(&fast), []);
}

#[test]
fn numbers_without_sense_do_not_slip_through() {
    let mut broken = pair("diff2", "mega2560");
    if let Some(motor) = &mut broken.robot.motor {
        motor.torque_constant_n_m_per_a = 0.0;
    }
    assert_eq!(budgets(&broken), [Budget::Compute]);
}

#[test]
fn a_wrong_document_is_refused_by_field() {
    let refused = |change: fn(&mut RobotDocument)| -> Vec<String> {
        let mut document = document("omni4", "sam3x");
        change(&mut document);
        let problems = document.pairing().unwrap_err();
        assert!(
            problems
                .iter()
                .all(|problem| !problem.limit.is_empty() && !problem.remedy.is_empty())
        );
        problems.into_iter().map(|problem| problem.field).collect()
    };
    assert_eq!(refused(|d| d.format = "robopheus.robot/2".to_owned()), ["format"]);
    assert_eq!(refused(|d| d.controller = "esp32".to_owned()), ["controller"]);
    assert_eq!(refused(|d| d.sensors[1] = "sonar".to_owned()), ["sensors[1]"]);
    assert_eq!(refused(|d| d.sensors[2] = "encoder".to_owned()), ["sensors[2]"]);
    assert_eq!(refused(|d| d.robot.mass_kg = 0.0), ["robot.mass_kg"]);
    let extra = r#"{"format":"robopheus.robot/1","controller":"tx2","sensors":[],"pins":31}"#;
    assert!(serde_json::from_str::<RobotDocument>(extra).is_err());
}

#[test]
fn only_the_smallest_controller_runs_loops_alone() {
    let names = |chassis, controller| -> Vec<&str> {
        let pair = pair(chassis, controller);
        programs(&pair).iter().map(|program| program.name).collect()
    };
    assert!(names("rwd", "mega2560").is_empty());
    assert_eq!(
        names("awd", "sam3x"),
        ["estimator", "dynamic control", "law on the robot"]
    );
    assert_eq!(names("awd", "tx2").last(), Some(&"user code"));
}

/// Cycles on the ATmega2560, printed by `docs/pairing-cycles.c`, each without the 12 of an empty call.
#[test]
fn counted_operations_agree_with_measured_cycles() {
    let mega = ControllerKind::Mega2560.controller();
    let one_motor = Drive {
        motor_count: 1,
        motor: None,
    };
    let cycles = |task: Task| task.cycles_per_second(mega) / task.rate_hz;
    let sensor = |sensor: SensorKind, task: usize| cycles(sensor.demand(one_motor, mega).tasks[task]);
    let [command, telemetry] = link(mega);
    let (pi_loop, to_field) = (1281, 574);
    let parts = [
        ("speed loop", sensor(SensorKind::Encoder, 0), 273 + pi_loop),
        ("count", sensor(SensorKind::Encoder, 1), 112 + 5),
        ("current loop", sensor(SensorKind::Current, 0), 428 + pi_loop + 58 + 5),
        (
            "command",
            cycles(command),
            13_445 + 2983 + 1539 + 5 * 273 + 82 * (58 + 5),
        ),
        (
            "telemetry",
            cycles(telemetry),
            22_969 + 6134 + 1758 + 17 * to_field + 154 * (58 + 5),
        ),
    ];
    for (name, counted, measured) in parts {
        let percent = counted * 100 / measured;
        assert!((98..=110).contains(&percent), "{name}: {counted} of {measured}");
    }
}

/// The tables of the document, as the code says them.
fn tables() -> [Vec<String>; 3] {
    let pairs = reference_set()
        .iter()
        .map(|pair| {
            let programs: Vec<&str> = programs(pair).iter().map(|program| program.name).collect();
            let reasons: Vec<String> = problems(pair).iter().map(PairingProblem::to_string).collect();
            let outcome = if reasons.is_empty() {
                "works".to_owned()
            } else {
                format!("refused: {}", reasons.join("; "))
            };
            format!(
                "| `{}` | `{}` | {} | {} of {} | {} | {} |",
                pair.robot
                    .name
                    .trim_end_matches(&format!("-{}", pair.controller.name())),
                pair.controller.name(),
                Budget::ConnectorPins.needed(pair),
                Budget::Compute.needed(pair),
                Budget::Compute.available(pair.controller.controller()),
                if programs.is_empty() {
                    "-".to_owned()
                } else {
                    programs.join(", ")
                },
                outcome,
            )
        })
        .collect();
    let controllers = CONTROLLERS
        .iter()
        .map(|controller| {
            let budgets = BUDGETS.map(|budget| budget.available(controller).to_string());
            format!(
                "| `{}` | {} | {} | {} | {} | {} | {} |",
                controller.kind.name(),
                controller.processor,
                controller.clock_hz / 1_000_000,
                if controller.has_fpu { "yes" } else { "no" },
                controller.flash_bytes,
                controller.quadrature_decoders,
                budgets.join(" | "),
            )
        })
        .collect();
    let sensors = SENSORS
        .iter()
        .map(|sensor| {
            let carried = CONTROLLERS.map(|controller| {
                let mut pair = pair("diff2", controller.kind.name());
                pair.sensors = vec![SensorKind::Encoder];
                if *sensor != SensorKind::Encoder {
                    pair.sensors.push(*sensor);
                }
                match check(&pair) {
                    Ok(_) => "yes".to_owned(),
                    Err(problems) => problems
                        .iter()
                        .map(|problem| format!("{} of {} {}", problem.needed, problem.available, problem.budget.unit()))
                        .collect::<Vec<_>>()
                        .join("; "),
                }
            });
            format!("| `{}` | {} |", sensor.name(), carried.join(" | "))
        })
        .collect();
    [pairs, controllers, sensors]
}

#[test]
fn the_document_says_what_the_code_says() {
    let text = fs::read_to_string(root().join("docs/pairing.md")).unwrap_or_default();
    for table in tables() {
        let table = table.join("\n");
        println!("{table}\n");
        assert!(
            text.contains(&table),
            "docs/pairing.md lacks this table; paste it:\n{table}"
        );
    }
}
