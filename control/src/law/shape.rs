//! Shapes of formations: the place of each robot, and what speaks against a shape.

use super::Parameters;
use super::assignment::Assigner;
use crate::scenario::{FieldProblem, MIN_START_GAP_M, Scenario};
use crate::vector::{Vector, add, dot, heading, length, scale, sub, world_from_body};

/// Names of the shapes, by number.
pub const SHAPES: &[&str] = &["line", "circle", "wedge", "given"];
const GIVEN: usize = 3;
/// Half the opening angle of a wedge.
const WEDGE_RAD: f64 = core::f64::consts::FRAC_PI_4;

/// Places of a shape about their mean, in the order of the robots.
pub fn offsets(scenario: &Scenario, parameters: &Parameters) -> Vec<Vector> {
    let n = scenario.experiment.robots.len();
    let shape = parameters.choice("shape");
    let turn_rad = parameters.get("turn_rad");
    let mut places: Vec<Vector> = if shape == GIVEN {
        let given = |i: usize| scenario.targets_of(i).next().map_or([0.0, 0.0], |t| [t.x_m, t.y_m]);
        (0..n).map(given).collect()
    } else {
        (0..n)
            .map(|k| place(shape, k, n, parameters.get("spacing_m")))
            .collect()
    };
    let centre = mean(&places);
    for place in &mut places {
        *place = world_from_body(sub(*place, centre), turn_rad);
    }
    if shape == GIVEN {
        return places;
    }
    let starts: Vec<Vector> = starts(scenario);
    let middle = mean(&starts);
    let mut place_of = vec![0; n];
    let cost = |i: usize, k: usize| {
        let way = sub(places[k], sub(starts[i], middle));
        dot(way, way)
    };
    Assigner::new(n).solve(cost, &mut place_of);
    place_of.into_iter().map(|k| places[k]).collect()
}

fn starts(scenario: &Scenario) -> Vec<Vector> {
    let robots = &scenario.experiment.robots;
    robots.iter().map(|robot| [robot.start.x_m, robot.start.y_m]).collect()
}

fn mean(places: &[Vector]) -> Vector {
    let sum = places.iter().fold([0.0, 0.0], |sum, place| add(sum, *place));
    scale(sum, 1.0 / places.len().max(1) as f64)
}

/// Place `k` of `n` in a shape.
fn place(shape: usize, k: usize, n: usize, spacing_m: f64) -> Vector {
    match shape {
        1 if n > 1 => {
            let half_rad = core::f64::consts::PI / n as f64;
            let radius_m = 0.5 * spacing_m / libm::sin(half_rad);
            scale(heading(2.0 * half_rad * k as f64), radius_m)
        }
        2 => {
            let row = k.div_ceil(2) as f64 * spacing_m;
            let side = if k % 2 == 1 { 1.0 } else { -1.0 };
            let [c, s] = heading(WEDGE_RAD);
            [-row * c, side * row * s]
        }
        _ => [k as f64 * spacing_m, 0.0],
    }
}

/// Counts, spacing and walls.
pub fn check(scenario: &Scenario) -> Vec<FieldProblem> {
    let experiment = &scenario.experiment;
    let parameters = Parameters::of(&experiment.control);
    let n = experiment.robots.len();
    let mut problems = Vec::new();
    let problem = |field: &str, message: String, limit: String, remedy: &str| FieldProblem {
        field: field.into(),
        message,
        limit,
        remedy: remedy.into(),
    };
    if n < 2 {
        let message = "one robot makes no shape".to_owned();
        problems.push(problem(
            "robots",
            message,
            "at least 2 robots".into(),
            "add a robot, or use the law go_to_point",
        ));
        return problems;
    }
    if parameters.choice("shape") == GIVEN && experiment.targets.len() != n {
        let message = format!("{} places for {n} robots", experiment.targets.len());
        let limit = format!("one target for each of the {n} robots");
        problems.push(problem(
            "targets",
            message,
            limit,
            "give the place of every robot in the shape",
        ));
        return problems;
    }
    if parameters.choice("shape") != GIVEN && !experiment.targets.is_empty() {
        let message = format!("the shape {} takes no targets", SHAPES[parameters.choice("shape")]);
        let limit = format!("no targets, or shape {GIVEN} (given)");
        problems.push(problem(
            "targets",
            message,
            limit,
            "leave the targets out or choose the shape given",
        ));
        return problems;
    }
    let places = offsets(scenario, &parameters);
    let middle = mean(&starts(scenario));
    for i in 0..n {
        let radius_m = scenario.robots[i].bounding_radius_m;
        for j in 0..i {
            let least_m = radius_m + scenario.robots[j].bounding_radius_m + MIN_START_GAP_M;
            let apart_m = length(sub(places[i], places[j]));
            // Given places are compared with the other targets already.
            if parameters.choice("shape") != GIVEN && apart_m < least_m {
                let message = format!("neighbours would stand {apart_m:.3} m apart");
                let limit = format!("at least {least_m:.3} m between their centres");
                problems.push(problem(
                    "control.parameters.spacing_m",
                    message,
                    limit,
                    "choose a larger spacing",
                ));
                return problems;
            }
        }
        let room_m = [
            0.5 * scenario.arena.width_m - radius_m,
            0.5 * scenario.arena.height_m - radius_m,
        ];
        let place = add(middle, places[i]);
        if parameters.choice("rotation") == 0 && (place[0].abs() > room_m[0] || place[1].abs() > room_m[1]) {
            let message = format!(
                "the shape about the mean of the starts puts {} at ({:.2}, {:.2}) m, in the wall",
                experiment.robots[i].name, place[0], place[1]
            );
            let limit = format!("x up to {:.2} m, y up to {:.2} m from the middle", room_m[0], room_m[1]);
            let field = if parameters.choice("shape") == GIVEN {
                "targets"
            } else {
                "control.parameters.spacing_m"
            };
            problems.push(problem(
                field,
                message,
                limit,
                "make the shape smaller, turn it, or move the starts",
            ));
        }
    }
    problems
}
