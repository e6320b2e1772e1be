//! From a manoeuvre of a report's catalogue to an experiment that can be submitted.
//!
//! Every manoeuvre is a row of waypoints inside the arena, so that every chassis can drive it and the safety filter keeps
//! it there; car-like robots turn on arcs where others turn on the spot.

use super::error::AppError;
use api::arena::Arena;
use api::experiment::{Control, Experiment, ExperimentRobot, FORMAT, Mode, Pose, Target};
use api::robot::LabRobot;
use serde_json::{Value, json};

/// Between the robot's bounding circle and the wall, m.
const WALL_GAP_M: f64 = 0.2;
/// Added to the time that the way takes at the wanted speed.
const SLOWEST_SHARE: f64 = 2.5;
const LONGEST_S: f64 = 240.0;

/// A draft of a report as a complete experiment; what is a complete experiment already stays as it is.
///
/// - Errors: `no_next_experiment` when the draft is neither.
pub fn experiment(draft: &Value, arena: &Arena, robot: &LabRobot) -> Result<Experiment, AppError> {
    if let Ok(whole) = serde_json::from_value::<Experiment>(draft.clone()) {
        return Ok(whole);
    }
    let name = draft.get("manoeuvre").and_then(Value::as_str).unwrap_or_default();
    let way = Way::of(name, arena, robot).ok_or_else(|| AppError::Conflict {
        code: "no_next_experiment",
        detail: format!("the report proposes the manoeuvre {name:?}, which this service cannot drive"),
    })?;
    Ok(way.experiment(arena, robot))
}

/// Places to pass, with a yaw where it matters.
struct Way {
    places: Vec<([f64; 2], Option<f64>)>,
    speed_m_per_s: f64,
}

/// The part of the floor that a robot's centre may use: half sides.
struct Field {
    x_m: f64,
    y_m: f64,
}

impl Field {
    fn of(arena: &Arena, robot: &LabRobot) -> Self {
        let half = |side_m: f64| (side_m / 2.0 - robot.bounding_radius_m - WALL_GAP_M).max(0.05);
        Self {
            x_m: half(arena.width_m),
            y_m: half(arena.height_m),
        }
    }

    fn at(&self, x_share: f64, y_share: f64) -> [f64; 2] {
        // Millimetres: people read these documents.
        [x_share * self.x_m, y_share * self.y_m].map(|value_m| (1000.0 * value_m).round() / 1000.0)
    }
}

impl Way {
    fn of(name: &str, arena: &Arena, robot: &LabRobot) -> Option<Self> {
        let field = Field::of(arena, robot);
        let chassis = robot.description.chassis.as_str();
        let car = matches!(chassis, "fwd" | "rwd" | "awd");
        let plain = |places: Vec<[f64; 2]>, speed_m_per_s: f64| Self {
            places: places.into_iter().map(|place| (place, None)).collect(),
            speed_m_per_s,
        };
        Some(match name {
            "slow_ramps" => plain(shuttle(&field, 8), 0.15),
            "speed_steps" => plain(shuttle(&field, 6), 0.6),
            "straight_lines" => plain(lines(&field), 0.5),
            "random_steps" => plain(scattered(&field), 0.6),
            "spins" if car => plain(circles(&field), 0.4),
            "spins" => spins(&field),
            "compass" => plain(star(&field), 0.4),
            "circles" => plain(circles(&field), 0.6),
            "field_grid" => plain(lanes(&field), 0.3),
            "strafes" if chassis == "omni4" => strafes(&field),
            "strafes" => plain(star(&field), 0.4),
            _ => return None,
        })
    }

    fn experiment(&self, arena: &Arena, robot: &LabRobot) -> Experiment {
        let name = &robot.description.name;
        let ([x_m, y_m], first_yaw) = self.places[0];
        let [next_x_m, next_y_m] = self.places.get(1).map_or([x_m + 1.0, y_m], |(place, _)| *place);
        let yaw_rad = first_yaw.unwrap_or_else(|| (next_y_m - y_m).atan2(next_x_m - x_m));
        let target = |(place, yaw_rad): &([f64; 2], Option<f64>)| Target {
            robot: Some(name.clone()),
            x_m: place[0],
            y_m: place[1],
            yaw_rad: *yaw_rad,
        };
        Experiment {
            format: FORMAT.to_owned(),
            mode: Mode::Physical,
            arena: arena.name.clone(),
            floor: arena.floor.clone(),
            robots: vec![ExperimentRobot {
                name: name.clone(),
                chassis: robot.description.chassis.clone(),
                controller: robot.controller.clone(),
                start: Pose { x_m, y_m, yaw_rad },
            }],
            control: Control {
                law: "waypoints".to_owned(),
                parameters: json!({"speed_m_per_s": self.speed_m_per_s}),
                interaction: None,
                feedback_alone: false,
            },
            targets: self.places.iter().skip(1).map(target).collect(),
            duration_s: self.duration_s(),
            seed: 1,
            model: None,
        }
    }

    /// The run ends earlier when the way is done.
    fn duration_s(&self) -> f64 {
        let way_m: f64 = self
            .places
            .windows(2)
            .map(|pair| distance_m(pair[0].0, pair[1].0))
            .sum();
        let turns_s = 2.0 * self.places.len() as f64;
        (SLOWEST_SHARE * way_m / self.speed_m_per_s + turns_s + 10.0)
            .min(LONGEST_S)
            .round()
    }
}

fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// Back and forth along the floor.
fn shuttle(field: &Field, times: usize) -> Vec<[f64; 2]> {
    (0..times)
        .map(|k| field.at(if k % 2 == 0 { -0.7 } else { 0.7 }, 0.0))
        .collect()
}

fn lines(field: &Field) -> Vec<[f64; 2]> {
    [
        (-1.0, -0.8),
        (1.0, -0.8),
        (1.0, 0.0),
        (-1.0, 0.0),
        (-1.0, 0.8),
        (1.0, 0.8),
        (-1.0, -0.8),
    ]
    .map(|(x, y)| field.at(x, y))
    .to_vec()
}

/// Places without order: steps of all sizes and directions.
fn scattered(field: &Field) -> Vec<[f64; 2]> {
    [
        (-0.6, -0.5),
        (0.1, 0.7),
        (0.9, -0.2),
        (0.5, 0.1),
        (-0.9, 0.8),
        (-0.2, -0.9),
        (0.8, 0.9),
        (-0.5, 0.2),
        (0.3, -0.6),
        (0.95, 0.4),
        (-0.8, -0.3),
    ]
    .map(|(x, y)| field.at(x, y))
    .to_vec()
}

/// In place, one way and the other.
fn spins(field: &Field) -> Way {
    let here = field.at(0.0, 0.0);
    let yaws = [0.0, 2.0, -2.0, 0.5, 2.5, -1.0, 1.0, -2.5, 0.0];
    Way {
        places: yaws.iter().map(|yaw| (here, Some(*yaw))).collect(),
        speed_m_per_s: 0.3,
    }
}

/// Out and back at eight headings.
fn star(field: &Field) -> Vec<[f64; 2]> {
    let diagonal = 0.7;
    let ends = [
        (1.0, 0.0),
        (diagonal, diagonal),
        (0.0, 1.0),
        (-diagonal, diagonal),
        (-1.0, 0.0),
        (-diagonal, -diagonal),
        (0.0, -1.0),
        (diagonal, -diagonal),
    ];
    let mut places = vec![field.at(0.0, 0.0)];
    for (x, y) in ends {
        places.extend([field.at(0.9 * x, 0.9 * y), field.at(0.0, 0.0)]);
    }
    places
}

/// A round to the left, then one to the right, as polygons of twelve corners.
fn circles(field: &Field) -> Vec<[f64; 2]> {
    let corner = |k: i32| {
        let angle_rad = f64::from(k) * core::f64::consts::TAU / 12.0;
        field.at(0.9 * angle_rad.cos(), 0.9 * angle_rad.sin())
    };
    (0..=12).chain((0..12).rev()).map(corner).collect()
}

/// Lanes of 0.3 m over the whole field.
fn lanes(field: &Field) -> Vec<[f64; 2]> {
    let count = (2.0 * field.y_m / 0.3).floor().max(1.0) as usize;
    let mut places = Vec::new();
    for lane in 0..=count {
        let y = -1.0 + 2.0 * lane as f64 / count as f64;
        let (from, to) = if lane % 2 == 0 { (-1.0, 1.0) } else { (1.0, -1.0) };
        places.extend([field.at(from, y), field.at(to, y)]);
    }
    places
}

/// Sideways and diagonal, the heading held.
fn strafes(field: &Field) -> Way {
    let places = [
        (0.0, -0.8),
        (0.0, 0.8),
        (0.0, -0.8),
        (0.8, 0.8),
        (-0.8, -0.8),
        (0.8, -0.8),
        (-0.8, 0.8),
        (0.0, 0.0),
    ];
    Way {
        places: places.iter().map(|(x, y)| (field.at(*x, *y), Some(0.0))).collect(),
        speed_m_per_s: 0.5,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::rehearsal::rehearse_json;

    const NAMES: [&str; 9] = [
        "slow_ramps",
        "speed_steps",
        "random_steps",
        "spins",
        "straight_lines",
        "compass",
        "circles",
        "field_grid",
        "strafes",
    ];

    #[test]
    fn the_twin_lets_every_chassis_drive_every_manoeuvre() {
        let lab: api::lab::LabDescription =
            serde_json::from_str(include_str!("../../../examples/lab/reference.json")).expect("laboratory");
        let mut driven = 0;
        for name in ["omni-01", "diff-01", "diff4-01", "fwd-01", "rwd-01", "awd-01"] {
            let robot = lab.robots.iter().find(|robot| robot.description.name == name);
            let robot = robot.expect("of the reference laboratory");
            for manoeuvre in NAMES {
                let made = experiment(&json!({"manoeuvre": manoeuvre}), &lab.arena, robot).expect("a manoeuvre");
                let scenario = json!({"experiment": made, "robots": [robot], "arena": lab.arena}).to_string();
                let outcome =
                    rehearse_json(&scenario).unwrap_or_else(|problems| panic!("{name} {manoeuvre}: {problems:?}"));
                assert!(
                    outcome.verdict.accepted,
                    "{name} {manoeuvre}: {}",
                    outcome.verdict.sentence
                );
                driven += 1;
            }
        }
        assert_eq!(driven, 54);
    }

    #[test]
    fn a_complete_experiment_stays_and_nonsense_is_refused() {
        let lab: api::lab::LabDescription =
            serde_json::from_str(include_str!("../../../examples/lab/reference.json")).expect("laboratory");
        let whole: Value =
            serde_json::from_str(include_str!("../../../examples/experiments/rectangle-omni4.json")).expect("example");
        let kept = experiment(&whole, &lab.arena, &lab.robots[0]).expect("complete");
        assert_eq!(kept.robots[0].name, "omni-01");
        let refused = experiment(&json!({"manoeuvre": "somersault"}), &lab.arena, &lab.robots[0]);
        assert!(matches!(
            refused,
            Err(AppError::Conflict {
                code: "no_next_experiment",
                ..
            })
        ));
    }
}
