//! CMA-ES in the unit cube: covariance matrix adaptation with a diagonal matrix.
//!
//! ```text
//! x_k ~ m + sigma N(0, C),  m <- sum w_i x_(i)            the better half moves the mean
//! p_s <- (1 - c_s) p_s + sqrt(c_s (2 - c_s) mu_w) C^-1/2 step,  sigma <- sigma exp(c_s / d_s (|p_s| / E|N| - 1))
//! C <- (1 - c_1 - c_mu) C + c_1 p_c p_c + c_mu sum w_i y_i y_i
//! ```
//! Separable as in Ros and Hansen 2008: with some 50 numbers and a few thousand evaluations a full matrix has no time to be
//! learnt. Long bent valleys (Rosenbrock's) are beyond it. Samples outside the cube are folded back at its faces.

use anyhow::Result;
use emulator::noise::Noise;

/// See the module. Minimises.
#[derive(Debug, Clone)]
pub struct Evolution {
    random: Noise,
    mean: Vec<f64>,
    sigma: f64,
    variance: Vec<f64>,
    path_sigma: Vec<f64>,
    path_variance: Vec<f64>,
    weights: Vec<f64>,
    generation: i32,
}

impl Evolution {
    /// - `start`: first mean, each 0 to 1; `sigma`: first spread; `population`: samples of a generation.
    pub fn new(start: Vec<f64>, sigma: f64, population: usize, seed: u64) -> Self {
        let parents = (population / 2).max(1);
        let raw: Vec<f64> = (0..parents)
            .map(|k| (parents as f64 + 0.5).ln() - (k as f64 + 1.0).ln())
            .collect();
        let sum: f64 = raw.iter().sum();
        let n = start.len();
        Self {
            random: Noise::new(seed, 0x0C_4AE5),
            mean: start,
            sigma,
            variance: vec![1.0; n],
            path_sigma: vec![0.0; n],
            path_variance: vec![0.0; n],
            weights: raw.iter().map(|weight| weight / sum).collect(),
            generation: 0,
        }
    }

    /// A generation of `population` samples, unfolded: [`folded`] makes them points of the cube.
    pub fn ask(&mut self, population: usize) -> Vec<Vec<f64>> {
        let Self {
            random,
            mean,
            sigma,
            variance,
            ..
        } = self;
        let mut sample = || {
            let parts = mean.iter().zip(variance.iter());
            parts
                .map(|(mean, variance)| mean + *sigma * variance.sqrt() * random.normal())
                .collect()
        };
        (0..population).map(|_| sample()).collect()
    }

    /// Learns from the samples' costs.
    pub fn tell(&mut self, samples: &[Vec<f64>], costs: &[f64]) {
        let n = self.mean.len() as f64;
        let mut order: Vec<usize> = (0..samples.len()).collect();
        order.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
        let mu_w = 1.0 / self.weights.iter().map(|weight| weight * weight).sum::<f64>();
        let c_sigma = (mu_w + 2.0) / (n + mu_w + 5.0);
        let d_sigma = 1.0 + c_sigma + 2.0 * (((mu_w - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0);
        let c_path = (4.0 + mu_w / n) / (n + 4.0 + 2.0 * mu_w / n);
        // A diagonal matrix is learnt (n + 2) / 3 times as fast.
        let faster = (n + 2.0) / 3.0;
        let c_1 = (faster * 2.0 / ((n + 1.3).powi(2) + mu_w)).min(0.5);
        let c_mu = (faster * 2.0 * (mu_w - 2.0 + 1.0 / mu_w) / ((n + 2.0).powi(2) + mu_w)).clamp(0.0, 1.0 - c_1);
        let expected = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
        self.generation += 1;
        let steps: Vec<f64> = (0..self.mean.len())
            .map(|axis| {
                let best = self.weights.iter().zip(&order);
                best.map(|(weight, k)| weight * (samples[*k][axis] - self.mean[axis]))
                    .sum::<f64>()
                    / self.sigma
            })
            .collect();
        for (axis, step) in steps.iter().enumerate() {
            let gain = (c_sigma * (2.0 - c_sigma) * mu_w).sqrt();
            self.path_sigma[axis] = (1.0 - c_sigma) * self.path_sigma[axis] + gain * step / self.variance[axis].sqrt();
        }
        let length = self.path_sigma.iter().map(|part| part * part).sum::<f64>().sqrt();
        let settled = (1.0 - (1.0 - c_sigma).powi(2 * self.generation)).sqrt();
        let moves = f64::from(u8::from(length / settled < (1.4 + 2.0 / (n + 1.0)) * expected));
        for (axis, step) in steps.iter().enumerate() {
            let path = &mut self.path_variance[axis];
            *path = (1.0 - c_path) * *path + moves * (c_path * (2.0 - c_path) * mu_w).sqrt() * step;
            let best = self.weights.iter().zip(&order);
            let spread: f64 = best
                .map(|(weight, k)| weight * ((samples[*k][axis] - self.mean[axis]) / self.sigma).powi(2))
                .sum();
            let kept = 1.0 - c_1 - c_mu + (1.0 - moves) * c_1 * c_path * (2.0 - c_path);
            self.variance[axis] = kept * self.variance[axis] + c_1 * *path * *path + c_mu * spread;
        }
        for (mean, step) in self.mean.iter_mut().zip(&steps) {
            *mean += self.sigma * step;
        }
        self.sigma *= (c_sigma / d_sigma * (length / expected - 1.0)).clamp(-1.0, 1.0).exp();
        self.sigma = self.sigma.min(0.5);
    }
}

/// The point of the unit cube that a sample stands for: folded back at the faces.
pub fn folded(sample: &[f64]) -> Vec<f64> {
    let fold = |value: &f64| {
        let rest = value.rem_euclid(2.0);
        if rest > 1.0 { 2.0 - rest } else { rest }
    };
    sample.iter().map(fold).collect()
}

/// Minimises with `evaluations` calls at most; the best point and its cost. `costs` gets a whole generation.
pub fn minimise(
    start: Vec<f64>,
    evaluations: u64,
    seed: u64,
    mut costs: impl FnMut(&[Vec<f64>]) -> Result<Vec<f64>>,
) -> Result<(Vec<f64>, f64)> {
    let population = 4 + (3.0 * (start.len() as f64).ln()) as usize;
    let mut evolution = Evolution::new(start.clone(), 0.25, population, seed);
    let (mut best, mut least) = (start, f64::INFINITY);
    let mut left = evaluations as usize;
    while left > 0 {
        let samples = evolution.ask(population.min(left));
        left -= samples.len();
        let points: Vec<Vec<f64>> = samples.iter().map(|sample| folded(sample)).collect();
        let found = costs(&points)?;
        for (point, cost) in points.iter().zip(&found) {
            if *cost < least {
                (best, least) = (point.clone(), *cost);
            }
        }
        if samples.len() == population {
            evolution.tell(&samples, &found);
        }
    }
    Ok((best, least))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cost of a point, its generation's costs in order.
    fn all(cost: impl Fn(&[f64]) -> f64) -> impl Fn(&[Vec<f64>]) -> Result<Vec<f64>> {
        move |points| Ok(points.iter().map(|point| cost(point)).collect())
    }

    #[test]
    fn an_ellipsoid_of_condition_ten_thousand_is_minimised() {
        let cost = |point: &[f64]| -> f64 {
            let parts = point.iter().enumerate();
            parts
                .map(|(k, x)| 1e4_f64.powf(k as f64 / 9.0) * (x - 0.3 - 0.03 * k as f64).powi(2))
                .sum()
        };
        let (best, least) = minimise(vec![0.8; 10], 5000, 1, all(cost)).expect("a minimum");
        assert!(least < 1e-8, "{least}");
        assert!(
            best.iter()
                .enumerate()
                .all(|(k, x)| (x - 0.3 - 0.03 * k as f64).abs() < 1e-3)
        );
    }

    #[test]
    fn a_discus_at_a_face_of_the_cube_is_minimised() {
        let cost = |point: &[f64]| -> f64 {
            let flat: f64 = point.iter().skip(1).map(|x| x * x).sum();
            1e4 * (point[0] - 0.9).powi(2) + flat
        };
        let (best, least) = minimise(vec![0.5; 6], 5000, 3, all(cost)).expect("a minimum");
        assert!(least < 1e-6 && (best[0] - 0.9).abs() < 1e-4, "{least} {best:?}");
    }

    #[test]
    fn the_same_seed_finds_the_same() {
        let find = |seed| minimise(vec![0.2; 3], 200, seed, all(|x| x[0] + x[1] * x[2])).expect("a minimum");
        assert_eq!(find(5), find(5));
        assert_ne!(find(5), find(6));
    }
}
