//! From waypoints to a path: lines, and arcs in the corners of car-like robots; what such a robot cannot drive.

use super::Drive;
use super::piece::{Piece, Place};
use crate::scenario::{FieldProblem, Scenario};
use crate::vector::{Vector, direction, length, sub, wrap};

/// Closer points are the same point.
const SAME_M: f64 = 0.012;
/// Arcs of car-like robots are wider than the tightest by this factor: what is left of the steering makes up for slip, a
/// servo that is off and errors of the path.
const RADIUS_SHARE: f64 = 1.3;
/// A car-like robot changes gear where the path turns back by more than this.
const CUSP_RAD: f64 = 2.6;
/// A car-like robot must start along its path within this angle.
const START_LIMIT_RAD: f64 = 0.8;

/// Start and waypoints of a robot, points that coincide left out.
pub fn corners(scenario: &Scenario, i: usize) -> Vec<Vector> {
    let start = scenario.experiment.robots[i].start;
    let mut corners = vec![[start.x_m, start.y_m]];
    for target in scenario.targets_of(i) {
        let next = [target.x_m, target.y_m];
        if corners.last().is_some_and(|last| length(sub(next, *last)) > SAME_M) {
            corners.push(next);
        }
    }
    corners
}

fn tightest_m(drive: Drive) -> Option<f64> {
    match drive {
        Drive::Steered {
            turning_radius_m,
            axle_x_m,
        } => Some(RADIUS_SHARE * length([turning_radius_m, axle_x_m])),
        _ => None,
    }
}

/// Lines, and for car-like robots arcs in the corners; where the path turns back they go on with the back first. `Err`: number
/// of the corner that is too sharp.
pub fn pieces(corners: &[Vector], drive: Drive) -> Result<Vec<Piece>, usize> {
    let mut pieces = Vec::new();
    let mut begun_m = 0.0;
    let mut backwards = false;
    for (k, pair) in corners.windows(2).enumerate() {
        let line = sub(pair[1], pair[0]);
        let yaw_rad = libm::atan2(line[1], line[0]);
        let turn_rad = corners.get(k + 2).map_or(0.0, |next| {
            let onward = sub(*next, pair[1]);
            wrap(libm::atan2(onward[1], onward[0]) - yaw_rad)
        });
        let turns_back = turn_rad.abs() > CUSP_RAD;
        let cut_m = match tightest_m(drive) {
            Some(radius_m) if turn_rad.abs() > 1e-9 && !turns_back => radius_m * libm::tan(0.5 * turn_rad.abs()),
            _ => 0.0,
        };
        let length_m = length(line) - begun_m - cut_m;
        if length_m < 0.0 {
            return Err(k + usize::from(cut_m >= begun_m));
        }
        let from = Place {
            place_m: pair[0],
            yaw_rad: if backwards {
                wrap(yaw_rad + core::f64::consts::PI)
            } else {
                yaw_rad
            },
        };
        let ahead = Piece {
            from,
            length_m: begun_m,
            backwards,
            ..Piece::default()
        };
        let straight = Piece {
            from: ahead.end(),
            length_m,
            ..ahead
        };
        pieces.push(straight);
        if let (Some(radius_m), true) = (tightest_m(drive), cut_m > 0.0) {
            pieces.push(Piece {
                from: straight.end(),
                curvature_per_m: straight.sign() * turn_rad.signum() / radius_m,
                length_m: turn_rad.abs() * radius_m,
                backwards,
            });
        }
        backwards ^= turns_back && tightest_m(drive).is_some();
        begun_m = cut_m;
    }
    Ok(pieces)
}

pub fn check(scenario: &Scenario) -> Vec<FieldProblem> {
    let mut problems = Vec::new();
    for (i, drive) in super::drives(scenario).into_iter().enumerate() {
        let Some(radius_m) = tightest_m(drive) else { continue };
        let name = &scenario.experiment.robots[i].name;
        let corners = corners(scenario, i);
        if let Err(corner) = pieces(&corners, drive) {
            let [x_m, y_m] = corners[corner.min(corners.len() - 1)];
            problems.push(FieldProblem {
                field: "targets".into(),
                message: format!("{name} cannot drive the corner of its path at ({x_m:.2}, {y_m:.2}) m"),
                limit: format!("arcs of a radius of {radius_m:.2} m must fit into the corner"),
                remedy: "move the waypoints apart, make the corner blunter, or use a robot that turns in place".into(),
            });
        }
        problems.extend(start_problem(
            scenario,
            i,
            corners.get(1).map(|to| sub(*to, corners[0])),
        ));
    }
    problems
}

/// A car-like robot cannot turn before it drives.
pub fn start_problem(scenario: &Scenario, i: usize, first_way: Option<Vector>) -> Option<FieldProblem> {
    let way = direction(first_way?)?;
    let robot = &scenario.experiment.robots[i];
    let way_rad = libm::atan2(way[1], way[0]);
    let off_rad = wrap(robot.start.yaw_rad - way_rad).abs();
    (off_rad > START_LIMIT_RAD).then(|| FieldProblem {
        field: format!("robots[{i}].start.yaw_rad"),
        message: format!(
            "{} is car-like and points {off_rad:.2} rad away from where its path begins",
            robot.name
        ),
        limit: format!("within {START_LIMIT_RAD} rad of {way_rad:.2} rad"),
        remedy: "turn the start, move the first target, or use a robot that turns in place".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_car_goes_back_with_the_back_first_on_the_way_it_came() {
        let drive = Drive::Steered {
            turning_radius_m: 0.5,
            axle_x_m: -0.12,
        };
        let corners = [[0.0, 0.0], [0.0, 1.0], [2.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
        let pieces = pieces(&corners, drive).expect("a path");
        assert_eq!(pieces.len(), 6);
        for (there, back) in pieces.iter().zip(pieces.iter().rev()) {
            let middle = there.at(0.3 * there.length_m);
            let same = back.at(0.7 * back.length_m);
            assert!(length(sub(middle.place_m, same.place_m)) < 1e-9, "{there:?}, {back:?}");
            assert!(wrap(middle.yaw_rad - same.yaw_rad).abs() < 1e-9);
            assert_ne!(there.backwards, back.backwards);
        }
        for pair in pieces.windows(2) {
            assert!(length(sub(pair[0].end().place_m, pair[1].from.place_m)) < 1e-9);
        }
    }
}
