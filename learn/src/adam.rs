//! Adam with decoupled weight decay (Kingma, Ba 2015; Loshchilov, Hutter 2019).

const MEAN_DECAY: f64 = 0.9;
const SQUARE_DECAY: f64 = 0.999;
const SMALLEST: f64 = 1e-8;

/// State of the method for one vector of parameters.
#[derive(Debug, Clone)]
pub struct Adam {
    mean: Vec<f64>,
    square: Vec<f64>,
    /// `MEAN_DECAY` and `SQUARE_DECAY` to the power of the steps taken.
    left: (f64, f64),
}

impl Adam {
    /// Before the first step.
    pub fn new(count: usize) -> Adam {
        Adam {
            mean: vec![0.0; count],
            square: vec![0.0; count],
            left: (1.0, 1.0),
        }
    }

    /// One step down the gradient.
    ///
    /// - `decay`: share of every parameter that is taken away, per unit of the rate.
    pub fn step(&mut self, parameters: &mut [f64], gradient: &[f64], rate: f64, decay: f64) {
        self.left = (self.left.0 * MEAN_DECAY, self.left.1 * SQUARE_DECAY);
        let state = self.mean.iter_mut().zip(&mut self.square);
        for ((parameter, g), (mean, square)) in parameters.iter_mut().zip(gradient).zip(state) {
            *mean += (1.0 - MEAN_DECAY) * (g - *mean);
            *square += (1.0 - SQUARE_DECAY) * (g * g - *square);
            let along = *mean / (1.0 - self.left.0);
            let size = (*square / (1.0 - self.left.1)).sqrt() + SMALLEST;
            *parameter -= rate * (along / size + decay * *parameter);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_has_the_rate_and_the_minimum_is_found() {
        let mut x = [3.0, -2.0];
        let mut adam = Adam::new(2);
        let gradient = |x: &[f64; 2]| [2.0 * (x[0] - 1.0), 40.0 * (x[1] + 1.5)];
        adam.step(&mut x, &gradient(&[3.0, -2.0]), 0.05, 0.0);
        assert!((x[0] - 2.95).abs() < 1e-6 && (x[1] + 1.95).abs() < 1e-6, "{x:?}");
        for _ in 0..2000 {
            let g = gradient(&x);
            adam.step(&mut x, &g, 0.02, 0.0);
        }
        assert!((x[0] - 1.0).abs() < 1e-3 && (x[1] + 1.5).abs() < 1e-3, "{x:?}");
    }
}
