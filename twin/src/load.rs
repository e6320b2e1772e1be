//! Normal loads of the wheels.

use nalgebra::{SMatrix, SVector};

use crate::linear::solve_semidefinite;
use crate::{GRAVITY_M_PER_S2, MAX_WHEELS};

/// Constants of the minimum-norm load distribution.
///
/// N = min-norm solution of  sum N = m g,  sum N x = -m h a_x,  sum N y = -m h a_y
///
/// (centre of mass at the body origin). With all wheels down N is linear in `(g, a_x, a_y)`; a negative load is
/// removed, the most negative first, and the rest solved again. Where the wheels cannot meet a moment (two wheels on
/// one axle) that moment is dropped.
#[derive(Debug, Clone)]
pub(crate) struct LoadModel {
    count: usize,
    x_m: [f64; MAX_WHEELS],
    y_m: [f64; MAX_WHEELS],
    mass_kg: f64,
    com_height_m: f64,
    /// With every wheel on the floor.
    pub(crate) all_down: LoadRows,
}

/// N = at_rest + per_x a_x + per_y a_y for the wheels on the floor, 0 for the others.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LoadRows {
    pub(crate) at_rest_n: [f64; MAX_WHEELS],
    /// N s^2/m.
    pub(crate) per_x: [f64; MAX_WHEELS],
    pub(crate) per_y: [f64; MAX_WHEELS],
}

impl LoadRows {
    /// Normal loads, N, at the body acceleration `(a_x, a_y)` that the contact forces give, m/s^2.
    #[inline(always)]
    pub(crate) fn at(&self, [a_x, a_y]: [f64; 2]) -> [f64; MAX_WHEELS] {
        let mut loads = [0.0; MAX_WHEELS];
        for (i, load) in loads.iter_mut().enumerate() {
            *load = self.at_rest_n[i] + (self.per_x[i] * a_x + self.per_y[i] * a_y);
        }
        loads
    }

    /// The wheel with the most negative load.
    pub(crate) fn most_negative(&self, accel_m_per_s2: [f64; 2]) -> Option<usize> {
        let loads = self.at(accel_m_per_s2);
        if !loads.iter().fold(false, |any, load| any | (*load < 0.0)) {
            return None;
        }
        let mut worst = 0;
        for i in 1..MAX_WHEELS {
            if loads[i] < loads[worst] {
                worst = i;
            }
        }
        (loads[worst] < 0.0).then_some(worst)
    }
}

impl LoadModel {
    pub(crate) fn new(positions_m: &[(f64, f64)], mass_kg: f64, com_height_m: f64) -> LoadModel {
        let mut model = LoadModel {
            count: positions_m.len().min(MAX_WHEELS),
            x_m: [0.0; MAX_WHEELS],
            y_m: [0.0; MAX_WHEELS],
            mass_kg,
            com_height_m,
            all_down: LoadRows {
                at_rest_n: [0.0; MAX_WHEELS],
                per_x: [0.0; MAX_WHEELS],
                per_y: [0.0; MAX_WHEELS],
            },
        };
        for (i, (x, y)) in positions_m.iter().take(MAX_WHEELS).enumerate() {
            model.x_m[i] = *x;
            model.y_m[i] = *y;
        }
        model.all_down = model.solved(&[true; MAX_WHEELS]);
        model
    }

    /// Loads when only the wheels of `down` touch the floor.
    pub(crate) fn standing_on(&self, down: &[bool; MAX_WHEELS]) -> LoadRows {
        if *down == [true; MAX_WHEELS] {
            self.all_down
        } else {
            self.solved(down)
        }
    }

    #[cold]
    fn solved(&self, down: &[bool; MAX_WHEELS]) -> LoadRows {
        let scaled = |unit: [f64; 3], by: f64| self.minimum_norm(down, SVector::from(unit)).map(|load| load * by);
        let moment = -self.mass_kg * self.com_height_m;
        LoadRows {
            at_rest_n: scaled([1.0, 0.0, 0.0], self.mass_kg * GRAVITY_M_PER_S2),
            per_x: scaled([0.0, 1.0, 0.0], moment),
            per_y: scaled([0.0, 0.0, 1.0], moment),
        }
    }

    /// Wheels, casters included.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    pub(crate) fn com_height_m(&self) -> f64 {
        self.com_height_m
    }

    /// Wheels on the floor at the body acceleration `(a_x, a_y)` that the contact forces give, m/s^2: the one with the most
    /// negative load is taken off until none has one.
    pub(crate) fn standing_at(&self, accel_m_per_s2: [f64; 2]) -> [bool; MAX_WHEELS] {
        let mut down = [true; MAX_WHEELS];
        let mut rows = self.all_down;
        for _ in 1..self.count {
            let Some(worst) = rows.most_negative(accel_m_per_s2) else {
                break;
            };
            down[worst] = false;
            rows = self.standing_on(&down);
        }
        down
    }

    /// Normal loads, N, at that acceleration.
    pub(crate) fn loads_n(&self, accel_x_m_per_s2: f64, accel_y_m_per_s2: f64) -> [f64; MAX_WHEELS] {
        let accel = [accel_x_m_per_s2, accel_y_m_per_s2];
        let down = self.standing_at(accel);
        self.standing_on(&down).at(accel).map(|load| load.max(0.0))
    }

    fn minimum_norm(&self, down: &[bool; MAX_WHEELS], right: SVector<f64, 3>) -> [f64; MAX_WHEELS] {
        let mut gram = SMatrix::<f64, 3, 3>::zeros();
        for i in (0..self.count).filter(|i| down[*i]) {
            let row = SVector::<f64, 3>::new(1.0, self.x_m[i], self.y_m[i]);
            gram += row * row.transpose();
        }
        let multiplier = solve_semidefinite(&gram, &right);
        let mut loads = [0.0; MAX_WHEELS];
        for i in (0..self.count).filter(|i| down[*i]) {
            loads[i] = multiplier[0] + multiplier[1] * self.x_m[i] + multiplier[2] * self.y_m[i];
        }
        loads
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [(f64, f64); 4] = [(0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1)];

    #[test]
    fn braking_loads_the_front() {
        let model = LoadModel::new(&SQUARE, 10.0, 0.05);
        let loads = model.loads_n(-2.0, 0.0);
        assert!((loads[..4].iter().sum::<f64>() - 98.1).abs() < 1e-12);
        assert!((loads[0] - loads[1] - 10.0 * 0.05 * 2.0 / 0.2).abs() < 1e-12);
    }

    #[test]
    fn a_negative_load_is_removed_and_weight_is_kept() {
        let model = LoadModel::new(&SQUARE, 10.0, 0.3);
        let loads = model.loads_n(4.0, 3.0);
        assert!(loads.iter().all(|load| *load >= 0.0));
        assert_eq!(loads[0], 0.0);
        assert!((loads[..4].iter().sum::<f64>() - 98.1).abs() < 1e-9);
    }

    #[test]
    fn two_wheels_on_one_axle_share_the_weight() {
        let loads = LoadModel::new(&[(0.0, 0.1), (0.0, -0.1)], 4.0, 0.05).loads_n(1.0, 0.0);
        assert!((loads[0] - 19.62).abs() < 1e-12 && (loads[1] - 19.62).abs() < 1e-12);
    }
}
