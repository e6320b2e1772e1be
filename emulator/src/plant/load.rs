//! How the weight stands on the wheels: a rigid chassis on springs of their own stiffness, leaning with a lag.

use super::{GRAVITY_M_PER_S2, MAX_WHEELS, Step};

/// Time in which the chassis leans.
const LEAN_S: f64 = 0.03;

/// Loads as an affine function of the horizontal acceleration.
#[derive(Debug, Clone)]
pub struct Loads {
    weight_n: f64,
    /// Load at rest, and per m/s2 forward and left.
    coefficients: [[f64; 3]; MAX_WHEELS],
    lean_m_per_s2: [f64; 2],
}

/// One spring: position from the centre of mass and relative stiffness.
#[derive(Debug, Clone, Copy)]
pub struct Spring {
    pub x_m: f64,
    pub y_m: f64,
    pub stiffness: f64,
}

impl Loads {
    /// Heave, pitch and roll of the chassis follow from the sums of force and moments over all springs.
    pub fn new(springs: &[Spring], mass_kg: f64, com_height_m: f64) -> Self {
        let mut normal = [[0.0; 3]; 3];
        for spring in springs {
            let row = [1.0, spring.x_m, spring.y_m];
            for (i, line) in normal.iter_mut().enumerate() {
                for (entry, column) in line.iter_mut().zip(row) {
                    *entry += spring.stiffness * row[i] * column;
                }
            }
        }
        // A robot on fewer than three points is kept upright by its (imagined) casters.
        for (i, line) in normal.iter_mut().enumerate() {
            line[i] += 1e-6;
        }
        let inverse = invert(&normal);
        let weight_n = mass_kg * GRAVITY_M_PER_S2;
        let lever_kg_m = mass_kg * com_height_m;
        let mut coefficients = [[0.0; 3]; MAX_WHEELS];
        for (coefficient, spring) in coefficients.iter_mut().zip(springs) {
            let row = [1.0, spring.x_m, spring.y_m];
            let along = |column: usize| spring.stiffness * (0..3).map(|i| row[i] * inverse[i][column]).sum::<f64>();
            *coefficient = [along(0) * weight_n, -along(1) * lever_kg_m, -along(2) * lever_kg_m];
        }
        Self {
            weight_n,
            coefficients,
            lean_m_per_s2: [0.0; 2],
        }
    }

    /// Loads after a step under an acceleration (forward, left). A lifted wheel carries nothing, the others the whole weight.
    pub fn step(&mut self, acceleration_m_per_s2: [f64; 2], step: Step) -> [f64; MAX_WHEELS] {
        let share = step.dt_s / (LEAN_S + step.dt_s);
        for (lean, acceleration) in self.lean_m_per_s2.iter_mut().zip(acceleration_m_per_s2) {
            *lean += share * (acceleration - *lean);
        }
        let [forward, left] = self.lean_m_per_s2;
        let loads = self
            .coefficients
            .map(|[rest, per_forward, per_left]| (rest + per_forward * forward + per_left * left).max(0.0));
        let scale = self.weight_n / loads.iter().sum::<f64>().max(1e-9);
        loads.map(|load| load * scale)
    }
}

fn invert(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_balance_weight_and_moments() {
        let springs = [
            (0.12, 0.12, 1.2),
            (-0.12, 0.12, 0.9),
            (-0.12, -0.12, 1.0),
            (0.12, -0.12, 0.8),
        ];
        let springs = springs.map(|(x_m, y_m, stiffness)| Spring { x_m, y_m, stiffness });
        let mut loads = Loads::new(&springs, 12.0, 0.11);
        let mut carried = [0.0; MAX_WHEELS];
        for _ in 0..10_000 {
            carried = loads.step([1.5, -0.5], Step { dt_s: 1e-3 });
        }
        let sum = |of: fn(&Spring) -> f64| {
            springs
                .iter()
                .zip(carried)
                .map(|(spring, load)| of(spring) * load)
                .sum::<f64>()
        };
        assert!((sum(|_| 1.0) - 12.0 * GRAVITY_M_PER_S2).abs() < 1e-3);
        assert!((sum(|spring| spring.x_m) + 12.0 * 0.11 * 1.5).abs() < 1e-3);
        assert!((sum(|spring| spring.y_m) - 12.0 * 0.11 * 0.5).abs() < 1e-3);
    }
}
