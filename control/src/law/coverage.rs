//! `coverage`: the robots spread over the arena, each to the centre of mass of its Voronoi cell.
//!
//! v_i = k (C_i - x_i),  C_i the centre of mass of the points that are nearest to robot i
//!                                                       [Cortés, Martínez, Karataş and Bullo 2004, move to the centroid; Lloyd 1982]
//!
//! The cost sum_q w(q) min_i |q - x_i|^2 never grows along the way. Cells and cost are taken over a grid of points, on
//! which this holds exactly: moving towards C_i lowers the part of cell i, and dealing the points anew lowers the sum.

use super::driver::{Driver, Request};
use super::parameters::{SPEED, YAW_GAIN};
use super::targets::{Owner, TargetRule, YawUse};
use super::{COVERAGE, Demand, Drive, Law, LawSpec, Observation, ParameterSpec, Parameters};
use crate::scenario::Scenario;
use crate::vector::{Vector, add, clip, dot, length, scale, sub};

pub(super) const SPEC: LawSpec = LawSpec {
    name: COVERAGE,
    title: "Coverage: the robots spread over the arena, denser where the targets are",
    source: "Cortés, Martínez, Karataş and Bullo 2004, move to the centroid; Lloyd 1982",
    targets: TargetRule {
        owner: Owner::Team,
        least: 0,
        most_each: 32,
        yaw: YawUse::Unused,
        apart: false,
        meaning: "Places of interest, where the density is raised by a bell of density_width_m; none means an even density.",
    },
    parameters: &[
        ParameterSpec::quantity(
            "coverage_gain_per_s",
            "1/s",
            [0.05, 0.8, 5.0],
            "k: speed for each metre between robot and centre of its cell.",
        ),
        SPEED,
        ParameterSpec::quantity(
            "density_peak",
            "",
            [0.0, 5.0, 100.0],
            "How much denser than elsewhere a place of interest is: w = 1 + peak exp(-d^2 / (2 width^2)).",
        ),
        ParameterSpec::quantity(
            "density_width_m",
            "m",
            [0.05, 0.5, 10.0],
            "Standard deviation of the bell around a place of interest.",
        ),
        YAW_GAIN,
        ParameterSpec::quantity(
            "reach_radius_m",
            "m",
            [0.005, 0.04, 0.5],
            "A robot is finished when it is this close to the centre of its cell.",
        ),
    ],
};

/// Points of the grid along the longer side of the arena.
const POINTS: f64 = 80.0;

#[derive(Debug)]
pub struct Coverage {
    points: Vec<Point>,
    drivers: Vec<Driver>,
    /// Sums over each cell: `[w x, w y, w]`.
    cells: Vec<[f64; 3]>,
}

#[derive(Debug, Clone, Copy)]
struct Point {
    place_m: Vector,
    weight: f64,
}

impl Coverage {
    pub fn new(scenario: &Scenario) -> Coverage {
        let n = scenario.experiment.robots.len();
        Coverage {
            points: points(scenario),
            drivers: vec![Driver::default(); n],
            cells: vec![[0.0; 3]; n],
        }
    }

    /// Deals the points out to the nearest robots; ties go to the first.
    fn deal(&mut self, observation: &Observation<'_>) {
        self.cells.fill([0.0; 3]);
        for point in &self.points {
            let mut nearest: Option<(usize, f64)> = None;
            for (i, robot) in observation.robots.iter().enumerate().take(self.cells.len()) {
                if !robot.pose.is_finite() {
                    continue;
                }
                let off = sub(point.place_m, [robot.pose.x_m, robot.pose.y_m]);
                let squared = dot(off, off);
                if nearest.is_none_or(|(_, least)| squared < least) {
                    nearest = Some((i, squared));
                }
            }
            if let Some((i, _)) = nearest {
                let [x_m, y_m] = point.place_m;
                let cell = &mut self.cells[i];
                cell[0] += point.weight * x_m;
                cell[1] += point.weight * y_m;
                cell[2] += point.weight;
            }
        }
    }
}

/// A grid over the arena with the density at each point, in the middle of its square.
fn points(scenario: &Scenario) -> Vec<Point> {
    let parameters = Parameters::of(&scenario.experiment.control);
    let (peak, width_m) = (parameters.get("density_peak"), parameters.get("density_width_m"));
    let sides_m = [scenario.arena.width_m, scenario.arena.height_m];
    let step_m = sides_m[0].max(sides_m[1]) / POINTS;
    let counts = sides_m.map(|side_m| (side_m / step_m).round().max(1.0) as u32);
    let at = |axis: usize, k: u32| {
        let count = f64::from(counts[axis]);
        sides_m[axis] * ((f64::from(k) + 0.5) / count - 0.5)
    };
    let weight = |place_m: Vector| {
        let bell = |target: &crate::scenario::Target| {
            let off = sub(place_m, [target.x_m, target.y_m]);
            peak * libm::exp(-0.5 * dot(off, off) / (width_m * width_m))
        };
        1.0 + scenario.experiment.targets.iter().map(bell).sum::<f64>()
    };
    let mut points = Vec::new();
    for row in 0..counts[1] {
        for column in 0..counts[0] {
            let place_m = [at(0, column), at(1, row)];
            points.push(Point {
                place_m,
                weight: weight(place_m),
            });
        }
    }
    points
}

impl Law for Coverage {
    fn name(&self) -> &'static str {
        COVERAGE
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        self.deal(observation);
        let parameters = observation.parameters;
        let all = self.cells.iter().zip(&mut self.drivers).zip(demands);
        for (i, ((cell, driver), demand)) in all.enumerate() {
            let (Some(robot), Some(body)) = (observation.robots.get(i), observation.bodies.get(i)) else {
                continue;
            };
            if !robot.pose.is_finite() {
                continue;
            }
            let here = [robot.pose.x_m, robot.pose.y_m];
            let way = if cell[2] > 0.0 {
                sub(scale([cell[0], cell[1]], 1.0 / cell[2]), here)
            } else {
                [0.0, 0.0]
            };
            demand.target = add(here, way);
            demand.finished = length(way) <= parameters.get("reach_radius_m");
            let velocity = clip(
                scale(way, parameters.get("coverage_gain_per_s")),
                parameters.get("speed_m_per_s"),
            );
            let rests = demand.finished && body.drive != Drive::Holonomic;
            let request = Request {
                velocity: if rests { [0.0, 0.0] } else { velocity },
                way,
                yaw_rad: None,
                stops: true,
            };
            demand.twist = driver.twist(body.drive, robot, &request, parameters.get("yaw_gain_per_s"));
        }
    }
}
