//! Intervals of rates and medians.

/// 97.5 % point of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// Wilson's 95 % interval of a rate.
pub fn wilson(hits: usize, count: usize) -> (f64, f64) {
    if count == 0 {
        return (0.0, 1.0);
    }
    let (n, p) = (count as f64, hits as f64 / count as f64);
    let middle = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z / (1.0 + Z * Z / n) * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

/// Upper end of the one-sided 95 % interval of Clopper and Pearson: the rate at which so few hits have a chance of 5 %.
pub fn clopper_pearson_upper(hits: usize, count: usize) -> f64 {
    if hits >= count {
        return 1.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if at_most(hits, count, middle) > 0.05 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Chance of at most `hits` of `count` at a rate.
fn at_most(hits: usize, count: usize, rate: f64) -> f64 {
    let mut log_term = count as f64 * (1.0 - rate).ln();
    let mut sum = log_term.exp();
    for k in 0..hits {
        log_term += ((count - k) as f64 / (k + 1) as f64).ln() + (rate / (1.0 - rate)).ln();
        sum += log_term.exp();
    }
    sum
}

/// Median and its 95 % interval by order statistics; `None` without numbers.
pub fn median(values: &[f64]) -> Option<(f64, f64, f64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    let last = n.checked_sub(1)?;
    let middle = 0.5 * (sorted[last / 2] + sorted[n / 2]);
    let half = 0.5 * Z * (n as f64).sqrt();
    let low = ((0.5 * n as f64 - half).floor().max(0.0) as usize).min(last);
    let high = ((0.5 * n as f64 + half).ceil() as usize).min(last);
    Some((middle, sorted[low], sorted[high]))
}

/// Chance that a standard normal number is above, by Simpson's rule to 1e-9.
pub fn normal_tail(z: f64) -> f64 {
    const FAR: f64 = 8.0;
    const STEPS: usize = 2000;
    if z < 0.0 {
        return 1.0 - normal_tail(-z);
    }
    let width = FAR / STEPS as f64;
    let density = |k: usize| {
        let x = z + width * k as f64;
        let weight = if k == 0 || k == STEPS {
            1.0
        } else if k % 2 == 1 {
            4.0
        } else {
            2.0
        };
        weight * (-0.5 * x * x).exp()
    };
    let sum: f64 = (0..=STEPS).map(density).sum();
    sum * width / 3.0 / std::f64::consts::TAU.sqrt()
}

/// The number above which a standard normal one is with this chance.
pub fn normal_point(tail: f64) -> f64 {
    let (mut low, mut high) = (-8.0, 8.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if normal_tail(middle) > tail {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of the normal distribution as in any table.
    #[test]
    fn tails_of_the_normal_distribution() {
        for (z, tail) in [(0.0, 0.5), (1.0, 0.158_655_254), (Z, 0.025), (-1.0, 0.841_344_746)] {
            assert!((normal_tail(z) - tail).abs() < 1e-8, "{z}: {}", normal_tail(z));
        }
        assert!((normal_point(0.025) - Z).abs() < 1e-6);
        assert!((normal_point(0.95) + 1.644_853_627).abs() < 1e-6);
    }

    #[test]
    fn known_intervals() {
        // Wilson 1927 by hand: 8 of 10 is 0.4902 .. 0.9433.
        let (low, high) = wilson(8, 10);
        assert!(
            (low - 0.4902).abs() < 5e-5 && (high - 0.9433).abs() < 5e-5,
            "{low} {high}"
        );
        // None of n: 1 - 0.05^(1/n).
        let upper = clopper_pearson_upper(0, 300);
        assert!((upper - (1.0 - 0.05f64.powf(1.0 / 300.0))).abs() < 1e-9, "{upper}");
        // One of two: (1 - p)^2 + 2 p (1 - p) = 1 - p^2 = 0.05.
        assert!((clopper_pearson_upper(1, 2) - 0.95f64.sqrt()).abs() < 1e-9);
        assert_eq!(clopper_pearson_upper(3, 3), 1.0);
    }

    #[test]
    fn medians() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]).map(|m| m.0), Some(2.0));
        assert_eq!(median(&[4.0, 1.0]).map(|m| m.0), Some(2.5));
    }
}
