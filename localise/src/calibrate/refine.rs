//! Levenberg-Marquardt on lens and poses together.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::view::Points;
use super::{CalibrationSettings, Deviation, Model, Pose, project};
use crate::problem::Problem;

/// Numbers of the lens in the parameter vector: fx fy cx cy k1 k2 p1 p2 k3.
const LENS: usize = 9;
/// Numbers of a pose: a small turn and a shift.
const POSE: usize = 6;
const STEPS_MAX: usize = 100;
/// A step that lowers the sum of squares by less than this share ends the fit.
const ENOUGH: f64 = 1e-10;

/// Improves the model.
///
/// - Returns the number of steps.
/// - Errors: no step lowers the sum although it is not at a minimum; degenerate views.
pub(super) fn refine(model: &mut Model, views: &[Points], fit_k3: bool) -> Result<usize, Problem> {
    let mut damping = 1e-3;
    let mut cost = cost(model, views);
    for step in 1..=STEPS_MAX {
        let (normal, gradient) = normal_equations(model, views, fit_k3);
        loop {
            let mut damped = normal.clone();
            for index in 0..damped.nrows() {
                damped[(index, index)] *= 1.0 + damping;
            }
            let Some(factor) = Cholesky::new(damped) else {
                return Err(degenerate());
            };
            let mut next = model.clone();
            apply(&mut next, &factor.solve(&(-&gradient)));
            let next_cost = self::cost(&next, views);
            if next_cost < cost {
                let gain = (cost - next_cost) / cost;
                (*model, cost) = (next, next_cost);
                damping = (damping * 0.2f64).max(1e-12);
                if gain < ENOUGH {
                    return Ok(step);
                }
                break;
            }
            damping *= 8.0;
            if damping > 1e8 {
                return Ok(step);
            }
        }
    }
    Ok(STEPS_MAX)
}

fn degenerate() -> Problem {
    Problem::new(
        "views",
        "the views do not determine lens and poses",
        "boards at several tilts and places",
        "add views with the board tilted by 20 to 40 degrees and near the picture's borders",
    )
}

/// Root mean square distances: per view, and of all.
pub(super) fn residuals(model: &Model, views: &[Points]) -> (Vec<f64>, f64) {
    let sums: Vec<f64> = views
        .iter()
        .zip(&model.poses)
        .map(|(view, pose)| view_cost(model, view, pose))
        .collect();
    let per_view = sums
        .iter()
        .zip(views)
        .map(|(sum, view)| (sum / view.world.len() as f64).sqrt())
        .collect();
    let count: usize = views.iter().map(|view| view.world.len()).sum();
    (per_view, (sums.iter().sum::<f64>() / count as f64).sqrt())
}

/// Standard deviations from the inverse of the normal equations and the corners' scatter.
pub(super) fn deviation(
    model: &Model,
    views: &[Points],
    settings: &CalibrationSettings,
    rms_px: f64,
) -> Result<Deviation, Problem> {
    let (normal, _) = normal_equations(model, views, settings.fit_k3);
    let inverse = Cholesky::new(normal).ok_or_else(degenerate)?.inverse();
    // Each corner gives two numbers, so the variance of one coordinate is half the mean square distance.
    let variance = rms_px * rms_px / 2.0;
    let lens = |index: usize| (inverse[(index, index)] * variance).sqrt();
    let pose = &model.poses[settings.world_view];
    let at = LENS + POSE * settings.world_view;
    // position = -R^T t. A turn w before the pose (R' = exp(w) R, t fixed) moves it by R^T (w x t).
    let mut jacobian = DMatrix::<f64>::zeros(3, POSE);
    for axis in 0..3 {
        for column in 0..3 {
            let mut turn = [0.0; 3];
            turn[column] = 1.0;
            let moved = cross(turn, pose.shift_m);
            jacobian[(axis, column)] = (0..3).map(|row| pose.rotation[row][axis] * moved[row]).sum();
            jacobian[(axis, 3 + column)] = -pose.rotation[column][axis];
        }
    }
    let block = inverse.view((at, at), (POSE, POSE));
    let position = &jacobian * block * jacobian.transpose() * variance;
    Ok(Deviation {
        focal_px: [lens(0), lens(1)],
        centre_px: [lens(2), lens(3)],
        k1: lens(4),
        k2: lens(5),
        position_m: [0, 1, 2].map(|axis| position[(axis, axis)].sqrt()),
    })
}

fn cost(model: &Model, views: &[Points]) -> f64 {
    views
        .iter()
        .zip(&model.poses)
        .map(|(view, pose)| view_cost(model, view, pose))
        .sum()
}

fn view_cost(model: &Model, view: &Points, pose: &Pose) -> f64 {
    let squares = view.world.iter().zip(&view.pixel).map(|(world, pixel)| {
        let at = project(&model.lens, pose, *world);
        (at[0] - pixel[0]).powi(2) + (at[1] - pixel[1]).powi(2)
    });
    squares.sum()
}

/// J^T J and J^T r; slopes by central differences with a step fitted to each number's size.
fn normal_equations(model: &Model, views: &[Points], fit_k3: bool) -> (DMatrix<f64>, DVector<f64>) {
    const STEP: [f64; LENS + POSE] = [
        1e-2, 1e-2, 1e-2, 1e-2, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6, 1e-5, 1e-5, 1e-5,
    ];
    let size = LENS + POSE * views.len();
    let mut normal = DMatrix::<f64>::zeros(size, size);
    let mut gradient = DVector::<f64>::zeros(size);
    for (index, (view, pose)) in views.iter().zip(&model.poses).enumerate() {
        let moved: Vec<[(super::Lens, Pose); 2]> = (0..LENS + POSE)
            .map(|number| [STEP[number], -STEP[number]].map(|step| nudged(&model.lens, pose, number, step)))
            .collect();
        let place = |number: usize| if number < LENS { number } else { number + POSE * index };
        for (world, pixel) in view.world.iter().zip(&view.pixel) {
            let at = project(&model.lens, pose, *world);
            let residual = [at[0] - pixel[0], at[1] - pixel[1]];
            let mut slope = [[0.0; 2]; LENS + POSE];
            for (number, [high, low]) in moved.iter().enumerate() {
                let (high, low) = (project(&high.0, &high.1, *world), project(&low.0, &low.1, *world));
                slope[number] = [0, 1].map(|axis| (high[axis] - low[axis]) / (2.0 * STEP[number]));
            }
            if !fit_k3 {
                slope[LENS - 1] = [0.0; 2];
            }
            for i in 0..LENS + POSE {
                gradient[place(i)] += slope[i][0] * residual[0] + slope[i][1] * residual[1];
                for j in 0..LENS + POSE {
                    normal[(place(i), place(j))] += slope[i][0] * slope[j][0] + slope[i][1] * slope[j][1];
                }
            }
        }
    }
    if !fit_k3 {
        normal[(LENS - 1, LENS - 1)] = 1.0;
    }
    (normal, gradient)
}

fn apply(model: &mut Model, step: &DVector<f64>) {
    for number in 0..LENS {
        (model.lens, _) = nudged(&model.lens, &model.poses[0], number, step[number]);
    }
    for (index, pose) in model.poses.iter_mut().enumerate() {
        let part = |number: usize| step[LENS + POSE * index + number];
        pose.rotation = turned(&pose.rotation, [part(0), part(1), part(2)]);
        for axis in 0..3 {
            pose.shift_m[axis] += part(3 + axis);
        }
    }
}

/// Lens and pose with one number changed.
fn nudged(lens: &super::Lens, pose: &Pose, number: usize, step: f64) -> (super::Lens, Pose) {
    let (mut lens, mut pose) = (*lens, *pose);
    match number {
        0 | 1 => lens.focal_px[number] += step,
        2 | 3 => lens.centre_px[number - 2] += step,
        4 => lens.distortion.k1 += step,
        5 => lens.distortion.k2 += step,
        6 => lens.distortion.p1 += step,
        7 => lens.distortion.p2 += step,
        8 => lens.distortion.k3 += step,
        9..12 => {
            let mut turn = [0.0; 3];
            turn[number - 9] = step;
            pose.rotation = turned(&pose.rotation, turn);
        }
        _ => pose.shift_m[number - 12] += step,
    }
    (lens, pose)
}

/// exp(turn) rotation  [Rodrigues].
fn turned(rotation: &[[f64; 3]; 3], turn: [f64; 3]) -> [[f64; 3]; 3] {
    let angle = turn.iter().map(|value| value * value).sum::<f64>().sqrt();
    if angle < 1e-300 {
        return *rotation;
    }
    let axis = turn.map(|value| value / angle);
    let (sine, cosine) = angle.sin_cos();
    let mut out = [[0.0; 3]; 3];
    for column in 0..3 {
        let vector = [rotation[0][column], rotation[1][column], rotation[2][column]];
        let across = cross(axis, vector);
        let along: f64 = (0..3).map(|row| axis[row] * vector[row]).sum();
        for row in 0..3 {
            out[row][column] = cosine * vector[row] + sine * across[row] + (1.0 - cosine) * along * axis[row];
        }
    }
    out
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
