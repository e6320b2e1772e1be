//! A measured line without most of its noise, where it may not be averaged by what follows: a play does not pass small
//! swings on, so noise in front of it is no noise behind it but a smaller play.

use super::Line;

/// Half-widths of the means that are tried, samples; every sample's is its own.
const HALF_WIDTHS: [usize; 6] = [0, 1, 2, 4, 8, 16];
/// A wider mean counts as long as it agrees with every narrower one to this many standard deviations.
const AGREES: f64 = 2.0;
/// Samples of a mean lie within this many median periods of their neighbours.
const LONGEST_PERIODS: f64 = 3.0;
/// Median of the magnitude of a normal deviate.
const MEDIAN_OF_NORMAL: f64 = 0.6745;

/// Means of every sample's neighbours, as many as agree with one another.
///
/// The rule of intersecting confidence intervals (Goldenshluger and Nemirovski, "On spatially adaptive estimation of
/// nonparametric regression", Mathematical Methods of Statistics 6, 1997); the noise from second differences.
pub fn smoothed(line: &Line) -> Line {
    let sigma = noise(&line.values);
    let mut sums = vec![0.0];
    sums.extend(line.values.iter().scan(0.0, |sum, value| {
        *sum += value;
        Some(*sum)
    }));
    let gaps = gaps(&line.time_s);
    let values = (0..line.values.len()).map(|i| {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut mean = line.values[i];
        for half in HALF_WIDTHS {
            if half > i || i + half >= line.values.len() || gaps[i + half] != gaps[i - half] {
                break;
            }
            let count = (2 * half + 1) as f64;
            let wider = (sums[i + half + 1] - sums[i - half]) / count;
            let reach = AGREES * sigma / count.sqrt();
            (low, high) = (low.max(wider - reach), high.min(wider + reach));
            if low > high {
                break;
            }
            mean = wider;
        }
        mean
    });
    Line {
        values: values.collect(),
        time_s: line.time_s.clone(),
    }
}

/// Standard deviation of what is not smooth, from the median second difference.
fn noise(values: &[f64]) -> f64 {
    let mut bends: Vec<f64> = values
        .windows(3)
        .map(|three| (three[0] - 2.0 * three[1] + three[2]).abs())
        .collect();
    bends.sort_by(f64::total_cmp);
    bends.get(bends.len() / 2).copied().unwrap_or(0.0) / (MEDIAN_OF_NORMAL * 6.0_f64.sqrt())
}

/// Pauses before every sample, counted.
fn gaps(time_s: &[f64]) -> Vec<usize> {
    let mut periods: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    periods.sort_by(f64::total_cmp);
    let longest_s = LONGEST_PERIODS * periods.get(periods.len() / 2).copied().unwrap_or(0.0);
    let mut count = 0;
    let mut gaps = vec![0];
    gaps.extend(time_s.windows(2).map(|pair| {
        count += usize::from(pair[1] - pair[0] > longest_s);
        count
    }));
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const NOISE: f64 = 0.003;

    /// A servo's answer to steps at 120 Hz, and the same with noise.
    fn servo() -> (Vec<f64>, Line) {
        let mut random = Random::new(7, 0);
        let time_s: Vec<f64> = (0..1200).map(|k| f64::from(k) / 120.0).collect();
        let mut angle = 0.0;
        let truth: Vec<f64> = time_s
            .iter()
            .map(|t| {
                let wanted = if (*t as u32).is_multiple_of(2) { 0.2 } else { -0.15 };
                angle += (wanted - angle) / 120.0 / 0.08;
                angle
            })
            .collect();
        let values = truth.iter().map(|angle| angle + NOISE * random.normal()).collect();
        (truth, Line { time_s, values })
    }

    fn rms(a: &[f64], b: &[f64]) -> f64 {
        let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
        (sum / a.len() as f64).sqrt()
    }

    #[test]
    fn holds_lose_their_noise_and_steps_keep_their_edges() {
        let (truth, line) = servo();
        let smooth = smoothed(&line);
        assert_eq!(smooth.time_s, line.time_s);
        // Held: the last 0.4 s before every step.
        let held = |values: &[f64]| -> Vec<f64> {
            let is_held = |k: &usize| k % 120 >= 72;
            (0..1200).filter(is_held).map(|k| values[k]).collect()
        };
        let (rest, whole) = (rms(&held(&smooth.values), &held(&truth)), rms(&smooth.values, &truth));
        assert!(rest < 0.45 * NOISE && whole < 0.8 * NOISE, "{rest} {whole}");
    }

    #[test]
    fn a_line_without_noise_stays_as_it_is() {
        let (truth, line) = servo();
        let clean = Line {
            values: truth.clone(),
            ..line
        };
        let change = rms(&smoothed(&clean).values, &truth);
        assert!(change < 1e-4, "{change}");
    }

    #[test]
    fn means_do_not_reach_over_pauses() {
        let time_s: Vec<f64> = (0..60)
            .map(|k| 0.01 * f64::from(k) + if k >= 30 { 1.0 } else { 0.0 })
            .collect();
        let values: Vec<f64> = (0..60)
            .map(|k| f64::from(u8::from(k >= 30)) + 1e-3 * f64::from(k % 3))
            .collect();
        let smooth = smoothed(&Line { time_s, values });
        assert!(smooth.values[..30].iter().all(|value| *value < 0.01));
        assert!(smooth.values[30..].iter().all(|value| *value > 0.99));
    }
}
