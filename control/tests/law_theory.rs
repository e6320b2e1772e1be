//! Published properties of the team laws, on ideal robots.

mod common;

use common::{Ideal, Pcg, team};
use control::TICK_S;
use control::law::assignment::Assigner;
use serde_json::{Value, json};

const ROOM: [f64; 2] = [12.0, 12.0];

fn circle(n: usize, radius_m: f64) -> Vec<(&'static str, [f64; 3])> {
    (0..n)
        .map(|i| {
            let angle = i as f64 / n as f64 * core::f64::consts::TAU;
            ("omni4", [radius_m * libm::cos(angle), radius_m * libm::sin(angle), 0.0])
        })
        .collect()
}

/// Starts along the second eigenvector of the Laplacian, in y; x only keeps the robots apart.
///
/// Complete: any vector of sum 0, lambda = n. Ring: cos(2 pi i / n), lambda = 2 - 2 cos(2 pi / n). Line:
/// cos(pi (i + 1/2) / n), lambda = 2 - 2 cos(pi / n).
fn eigen(graph: &str, n: usize) -> (Vec<f64>, f64) {
    let pi = core::f64::consts::PI;
    let part = |i: usize| {
        let i = i as f64;
        match graph {
            "ring" => libm::cos(2.0 * pi * i / n as f64),
            "line" => libm::cos(pi * (i + 0.5) / n as f64),
            _ => {
                if i == 0.0 {
                    1.0
                } else {
                    -1.0 / (n as f64 - 1.0)
                }
            }
        }
    };
    let lambda = match graph {
        "ring" => 2.0 - 2.0 * libm::cos(2.0 * pi / n as f64),
        "line" => 2.0 - 2.0 * libm::cos(pi / n as f64),
        _ => n as f64,
    };
    ((0..n).map(part).collect(), lambda)
}

/// The disagreement falls as exp(-k lambda_2 t). One step of the sampled law multiplies it by 1 - k lambda_2 T, so the
/// rate differs by the share k lambda_2 T / 2 <= 0.9 %; the tolerance is 1 %.
#[test]
fn consensus_converges_at_the_second_eigenvalue_of_the_laplacian() {
    for (number, graph) in ["complete", "ring", "line"].into_iter().enumerate() {
        for n in [3, 5] {
            let (shape, lambda) = eigen(graph, n);
            let robots: Vec<(&str, [f64; 3])> = (0..n)
                .map(|i| ("omni4", [1.2 * i as f64 - 3.0, 0.2 + 0.2 * shape[i], 0.0]))
                .collect();
            let parameters = json!({"value": 2, "graph": number, "consensus_gain_per_s": 0.4, "speed_m_per_s": 0.7});
            let mut ideal = Ideal::new(&team("consensus", parameters, &robots, json!([]), 60.0, ROOM));
            let disagreement = |ideal: &Ideal| {
                let y: Vec<f64> = (0..n).map(|i| ideal.place(i)[1]).collect();
                let mean = y.iter().sum::<f64>() / n as f64;
                assert!(
                    (mean - 0.2 - 0.2 * shape.iter().sum::<f64>() / n as f64).abs() < 1e-12,
                    "the mean moved"
                );
                y.iter().map(|y| (y - mean) * (y - mean)).sum::<f64>().sqrt()
            };
            let first = disagreement(&ideal);
            let ticks = (2.0 / (0.4 * lambda) / TICK_S) as u32;
            for _ in 0..ticks {
                ideal.step();
            }
            let rate = -libm::log(disagreement(&ideal) / first) / (f64::from(ticks) * TICK_S);
            println!("{graph} {n}: rate {rate:.4} /s, k lambda_2 = {:.4} /s", 0.4 * lambda);
            assert!((rate / (0.4 * lambda) - 1.0).abs() < 0.01, "{graph} {n}");
        }
    }
}

#[test]
fn consensus_reaches_the_value_of_the_leader() {
    let robots = circle(5, 2.0);
    let parameters = json!({"value": 1, "graph": 2, "leader": 3, "consensus_gain_per_s": 0.8});
    let targets = json!([{"robot": "r2", "x_m": 0.7, "y_m": 1.0}]);
    let mut ideal = Ideal::new(&team("consensus", parameters, &robots, targets, 60.0, ROOM));
    for _ in 0..60 * 120 {
        ideal.step();
    }
    for i in 0..5 {
        assert!(
            (ideal.place(i)[0] - 0.7).abs() < 1e-3,
            "robot {i} at {:?}",
            ideal.place(i)
        );
    }
}

/// In each shape the places differ by the offsets of the shape, to a micrometre after 60 s; the mean of the team stays.
#[test]
fn formation_error_goes_to_zero() {
    for n in [3_usize, 6] {
        for shape in 0..3 {
            for graph in 0..3 {
                for rotation in 0..2 {
                    let mut random = Pcg(5);
                    let robots: Vec<(&str, [f64; 3])> = circle(n, 2.0)
                        .into_iter()
                        .map(|(chassis, [x, y, _])| (chassis, [x + random.between(-0.3, 0.3), y, 0.5]))
                        .collect();
                    let parameters = json!({"shape": shape, "graph": graph, "rotation": rotation, "keep_right": 0,
                        "formation_gain_per_s": 1.0, "turn_rad": 0.3});
                    let mut ideal = Ideal::new(&team("formation", parameters, &robots, json!([]), 60.0, ROOM));
                    let mean =
                        |ideal: &Ideal, axis: usize| (0..n).map(|i| ideal.place(i)[axis]).sum::<f64>() / n as f64;
                    let first = [mean(&ideal, 0), mean(&ideal, 1)];
                    for _ in 0..60 * 120 {
                        ideal.step();
                    }
                    let away = |i: usize| {
                        let (place, target) = (ideal.place(i), ideal.demands[i].target);
                        libm::hypot(place[0] - target[0], place[1] - target[1])
                    };
                    let error_m = (0..n).map(away).fold(0.0, f64::max);
                    assert!(
                        error_m < 1e-6,
                        "{n} robots, shape {shape}, graph {graph}, rotation {rotation}: {error_m}"
                    );
                    for (axis, first) in first.into_iter().enumerate() {
                        let drift_m = mean(&ideal, axis) - first;
                        assert!(drift_m.abs() < 1e-9, "{n} {shape} {graph} {rotation}: {drift_m}");
                    }
                    let mut nearest: Vec<f64> = (0..n)
                        .map(|i| {
                            let far = |j: usize| {
                                let (a, b) = (ideal.place(i), ideal.place(j));
                                libm::hypot(a[0] - b[0], a[1] - b[1])
                            };
                            (0..n).filter(|j| *j != i).map(far).fold(f64::MAX, f64::min)
                        })
                        .collect();
                    nearest.sort_by(f64::total_cmp);
                    assert!((nearest[0] - 0.75).abs() < 1e-6, "spacing: {nearest:?}");
                }
            }
        }
    }
}

/// The definition: the cost over a finer grid than the law's, with the density of its documentation.
fn coverage_cost(ideal: &Ideal, n: usize, room_m: [f64; 2], peaks: &[[f64; 2]], points: u32) -> f64 {
    let mut sum = 0.0;
    for row in 0..points {
        for column in 0..points {
            let x = room_m[0] * ((f64::from(column) + 0.5) / f64::from(points) - 0.5);
            let y = room_m[1] * ((f64::from(row) + 0.5) / f64::from(points) - 0.5);
            let squared = |p: [f64; 2]| (x - p[0]) * (x - p[0]) + (y - p[1]) * (y - p[1]);
            let weight = 1.0
                + peaks
                    .iter()
                    .map(|p| 5.0 * libm::exp(-0.5 * squared(*p) / 0.25))
                    .sum::<f64>();
            sum += weight * (0..n).map(|i| squared(ideal.place(i))).fold(f64::MAX, f64::min);
        }
    }
    sum
}

/// The points of the law are 80 by 80 in a square room; on them the cost never grows (1e-9 of it for rounding).
#[test]
fn coverage_cost_never_grows_and_ends_at_the_centres_of_the_cells() {
    for targets in [json!([]), json!([{"x_m": 1.0, "y_m": 1.2}])] {
        let peaks: Vec<[f64; 2]> = targets
            .as_array()
            .expect("list")
            .iter()
            .map(|t| [t["x_m"].as_f64().expect("x"), t["y_m"].as_f64().expect("y")])
            .collect();
        let room_m = [6.0, 6.0];
        let starts = [[-2.0, -2.0], [-1.4, -2.1], [-2.1, -1.3], [-0.9, -1.4], [0.0, -2.2]];
        let robots: Vec<(&str, [f64; 3])> = starts.iter().map(|[x, y]| ("omni4", [*x, *y, 0.2])).collect();
        let document = team("coverage", json!({}), &robots, targets, 60.0, room_m);
        let mut ideal = Ideal::new(&document);
        let mut cost = coverage_cost(&ideal, 5, room_m, &peaks, 80);
        let first = cost;
        for _ in 0..60 * 120 {
            ideal.step();
            if ideal.tick.is_multiple_of(20) {
                let now = coverage_cost(&ideal, 5, room_m, &peaks, 80);
                assert!(now <= cost * (1.0 + 1e-9), "tick {}: {now} after {cost}", ideal.tick);
                cost = now;
            }
        }
        assert!(cost < 0.5 * first);
        // Centroidal: against the centres on a finer grid, within a quarter of the law's grid step of 75 mm.
        let mut cells = [[0.0; 3]; 5];
        for row in 0..400 {
            for column in 0..400 {
                let x = 6.0 * ((f64::from(column) + 0.5) / 400.0 - 0.5);
                let y = 6.0 * ((f64::from(row) + 0.5) / 400.0 - 0.5);
                let squared = |p: [f64; 2]| (x - p[0]) * (x - p[0]) + (y - p[1]) * (y - p[1]);
                let weight = 1.0
                    + peaks
                        .iter()
                        .map(|p| 5.0 * libm::exp(-0.5 * squared(*p) / 0.25))
                        .sum::<f64>();
                let order = |a: &usize, b: &usize| squared(ideal.place(*a)).total_cmp(&squared(ideal.place(*b)));
                let i = (0..5).min_by(order).expect("robots");
                cells[i] = [cells[i][0] + weight * x, cells[i][1] + weight * y, cells[i][2] + weight];
            }
        }
        for (i, [x, y, weight]) in cells.into_iter().enumerate() {
            let off_m = libm::hypot(x / weight - ideal.place(i)[0], y / weight - ideal.place(i)[1]);
            println!("robot {i}: {:.1} mm from its centre", 1e3 * off_m);
            assert!(off_m < 0.02, "robot {i}: {off_m} m");
        }
    }
}

/// Two robots in a 6 by 3 m room end at the centres of its halves: (-1.5, 0) and (1.5, 0).
#[test]
fn coverage_by_two_robots_halves_the_room() {
    let robots = [("omni4", [-0.4, 0.3, 0.0]), ("omni4", [0.3, -0.2, 0.0])];
    let mut ideal = Ideal::new(&team("coverage", json!({}), &robots, json!([]), 60.0, [6.0, 3.0]));
    for _ in 0..60 * 120 {
        ideal.step();
    }
    for (i, x) in [(0, -1.5), (1, 1.5)] {
        let [at_x, at_y] = ideal.place(i);
        assert!((at_x - x).abs() < 0.01 && at_y.abs() < 0.01, "{:?}", ideal.place(i));
    }
}

/// Heap's algorithm over all assignments.
fn brute_force(cost: &[Vec<f64>]) -> f64 {
    fn visit(order: &mut [usize], k: usize, cost: &[Vec<f64>], best: &mut f64) {
        if k == order.len() {
            let sum: f64 = order.iter().enumerate().map(|(i, j)| cost[i][*j]).sum();
            *best = best.min(sum);
            return;
        }
        for swap in k..order.len() {
            order.swap(k, swap);
            visit(order, k + 1, cost, best);
            order.swap(k, swap);
        }
    }
    let mut best = f64::MAX;
    visit(&mut (0..cost.len()).collect::<Vec<_>>(), 0, cost, &mut best);
    best
}

#[test]
fn the_hungarian_method_is_as_good_as_trying_everything() {
    let mut random = Pcg(11);
    let mut assigner = Assigner::new(7);
    for n in 1..=7_usize {
        for round in 0..60 {
            let cost: Vec<Vec<f64>> = (0..n)
                .map(|_| {
                    (0..n)
                        .map(|_| {
                            let value = random.between(-3.0, 10.0);
                            // Every third round has many ties.
                            if round % 3 == 0 { value.round() } else { value }
                        })
                        .collect()
                })
                .collect();
            let mut column_of = vec![0; n];
            assigner.solve(|i, j| cost[i][j], &mut column_of);
            let mut seen = column_of.clone();
            seen.sort_unstable();
            assert_eq!(seen, (0..n).collect::<Vec<_>>());
            let sum: f64 = column_of.iter().enumerate().map(|(i, j)| cost[i][*j]).sum();
            assert!((sum - brute_force(&cost)).abs() < 1e-9, "{n}: {cost:?}");
        }
    }
}

fn spread(random: &mut Pcg, n: usize, apart_m: f64) -> Vec<[f64; 2]> {
    let mut places: Vec<[f64; 2]> = Vec::new();
    while places.len() < n {
        let place = [random.between(-2.7, 2.7), random.between(-2.7, 2.7)];
        if places
            .iter()
            .all(|p| libm::hypot(p[0] - place[0], p[1] - place[1]) >= apart_m)
        {
            places.push(place);
        }
    }
    places
}

/// Turpin et al. 2014: starts and goals 2 sqrt(2) R apart, so the robots stay 2 R apart (0.1 mm for the control's lag).
#[test]
fn paths_to_assigned_goals_never_bring_robots_together() {
    let mut random = Pcg(3);
    let mut closest_m = f64::MAX;
    for n in 2..=6_usize {
        for _ in 0..8 {
            let apart_m = 2.0 * core::f64::consts::SQRT_2 * 0.25 + 1e-6;
            let starts = spread(&mut random, n, apart_m);
            let goals = spread(&mut random, n, apart_m);
            let robots: Vec<(&str, [f64; 3])> = starts.iter().map(|[x, y]| ("omni4", [*x, *y, 0.0])).collect();
            let targets: Vec<Value> = goals.iter().map(|[x, y]| json!({"x_m": x, "y_m": y})).collect();
            let document = team(
                "goal_assignment",
                json!({"reassign_period_s": 1.0}),
                &robots,
                json!(targets),
                60.0,
                [6.0, 6.0],
            );
            let mut ideal = Ideal::new(&document);
            for _ in 0..40 * 120 {
                ideal.step();
                for j in 0..n {
                    for i in 0..j {
                        let (a, b) = (ideal.place(i), ideal.place(j));
                        closest_m = closest_m.min(libm::hypot(a[0] - b[0], a[1] - b[1]));
                    }
                }
                assert!(closest_m > 0.5 - 1e-4, "{n} robots: {closest_m}");
            }
            assert!(ideal.demands.iter().all(|demand| demand.finished), "{n} robots");
        }
    }
    println!("closest {closest_m:.4} m");
}

/// Robots that are pushed to each other's goals take these at the next assignment.
#[test]
fn goals_are_shared_out_anew() {
    let robots = [("omni4", [-2.0, -1.0, 0.0]), ("omni4", [-2.0, 1.0, 0.0])];
    let targets = json!([{"x_m": 2.0, "y_m": 1.0}, {"x_m": 2.0, "y_m": -1.0}]);
    for (period_s, swapped) in [(0.0, false), (1.0, true)] {
        let document = team(
            "goal_assignment",
            json!({"reassign_period_s": period_s}),
            &robots,
            targets.clone(),
            60.0,
            ROOM,
        );
        let mut ideal = Ideal::new(&document);
        for _ in 0..120 {
            ideal.step();
        }
        let (a, b) = (ideal.robots[0].pose, ideal.robots[1].pose);
        ideal.robots[0].pose = b;
        ideal.robots[1].pose = a;
        for _ in 0..40 * 120 {
            ideal.step();
        }
        let above = ideal.place(0)[1] > 0.0;
        assert_eq!(above, swapped, "{:?}", ideal.place(0));
        assert!(ideal.demands.iter().all(|demand| demand.finished));
    }
}

/// The body origin lies ahead of the fixed axle: with the back first it swings out before it comes back, and a gain that is
/// too large for the speed makes that grow. Every gain of the path must bring the robot home.
#[test]
fn a_car_with_the_back_first_stays_on_its_path_however_slow_it_is() {
    for chassis in ["fwd", "rwd", "awd"] {
        for (distance, derivative) in [(1.5, 0.0), (3.0, 0.0), (3.0, 0.2), (5.0, 0.0)] {
            let parameters = json!({"speed_m_per_s": 0.7, "distance_gain_per_s": distance, "integral_gain_per_s2": 0.0,
                "derivative_gain": derivative, "yaw_gain_per_s": 5.0});
            let targets = json!([{"x_m": 1.5, "y_m": 0.0}, {"x_m": 1.5, "y_m": 2.5}, {"x_m": 1.5, "y_m": 0.0}, {"x_m": -1.0, "y_m": 0.0}]);
            let document = team(
                "path_following",
                parameters,
                &[(chassis, [-1.0, 0.0, 0.0])],
                targets,
                60.0,
                ROOM,
            );
            let ideal = control::ideal::drive(&common::parsed(&document), 60.0).expect("a scenario");
            let ideal = ideal.expect("a law that ships");
            let [_, beside_m, yaw_rad] = *ideal.poses.last().expect("poses");
            println!(
                "{chassis}, k_p {distance}, k_d {derivative}: {:.2} mm, {yaw_rad:.4} rad",
                1e3 * beside_m
            );
            assert!(ideal.finished, "{chassis}");
            assert!(
                beside_m.abs() < 0.002 && yaw_rad.abs() < 0.02,
                "{chassis}, k_p {distance}: {beside_m} m, {yaw_rad} rad"
            );
        }
    }
}
