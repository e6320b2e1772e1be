//! Three predictors on the same windows.

use identify::workers::{Cancelled, Workers, gathered};
use serde::Serialize;

use crate::compare::pose_error;
use crate::rollout::{Moment, Predictor};
use crate::window::{Reading, Window};

/// Horizons at which poses are compared, s.
pub const HORIZONS_S: [f64; 2] = [0.5, 2.0];

/// RMS errors of one quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    pub quantity: &'static str,
    pub unit: &'static str,
    /// Time ahead; over the whole window up to it for twist, wheels and gyro.
    pub horizon_s: f64,
    pub physics: f64,
    /// `None` when there is no such predictor.
    pub black_box: Option<f64>,
    pub residual: Option<f64>,
    pub samples: u32,
}

/// The same for one run and the place 2 s ahead.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunFigure {
    pub path: String,
    pub position_m: Figure,
}

/// Quantities in the order of [`Sums`].
const QUANTITIES: [(&str, &str, f64); 9] = [
    ("position", "m", HORIZONS_S[0]),
    ("yaw", "rad", HORIZONS_S[0]),
    ("position", "m", HORIZONS_S[1]),
    ("yaw", "rad", HORIZONS_S[1]),
    ("forward", "m/s", HORIZONS_S[1]),
    ("left", "m/s", HORIZONS_S[1]),
    ("yaw rate", "rad/s", HORIZONS_S[1]),
    ("wheel speed", "rad/s", HORIZONS_S[1]),
    ("gyro", "rad/s", HORIZONS_S[1]),
];
const COUNT: usize = QUANTITIES.len();
/// Position 2 s ahead among [`QUANTITIES`].
const FAR: usize = 2;

/// Sums of squares and counts by quantity.
#[derive(Debug, Clone, Copy, Default)]
struct Sums([(f64, u32); COUNT]);

impl Sums {
    fn of(window: &Window, path: &[Moment]) -> Sums {
        let mut sums = Sums::default();
        for (number, horizon_s) in HORIZONS_S.into_iter().enumerate() {
            if let Some([forward, left, yaw]) = pose_error(window, path, horizon_s) {
                sums.add(2 * number, forward * forward + left * left);
                sums.add(2 * number + 1, yaw * yaw);
            }
        }
        for sample in &window.samples {
            let Some(moment) = Moment::at(path, sample.time_s) else {
                continue;
            };
            let (place, predicted) = match sample.reading {
                Reading::Forward => (4, moment.twist[0]),
                Reading::Left => (5, moment.twist[1]),
                Reading::YawRate => (6, moment.twist[2]),
                Reading::Wheel(k) => (7, moment.wheel_rad_per_s[k]),
                Reading::Gyro => (8, moment.gyro_rad_per_s),
            };
            sums.add(place, (sample.value - predicted) * (sample.value - predicted));
        }
        sums
    }

    fn add(&mut self, place: usize, square: f64) {
        self.0[place].0 += square;
        self.0[place].1 += 1;
    }

    fn joined(mut self, other: &Sums) -> Sums {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a = (a.0 + b.0, a.1 + b.1);
        }
        self
    }

    fn rms(&self, place: usize) -> f64 {
        let (sum, count) = self.0[place];
        if count == 0 {
            0.0
        } else {
            (sum / f64::from(count)).sqrt()
        }
    }
}

/// The predictors; a missing one gives no figures.
#[derive(Clone, Copy)]
pub struct Rivals<'a> {
    pub physics: &'a dyn Predictor,
    pub black_box: Option<&'a dyn Predictor>,
    pub residual: Option<&'a dyn Predictor>,
}

/// All figures over windows, and those of each run.
///
/// - `paths`: names of the runs by [`Window::run`].
/// - A window that one of them cannot predict counts for none.
pub fn figures(
    workers: &dyn Workers,
    windows: &[Window],
    rivals: Rivals<'_>,
    paths: &[String],
) -> Result<(Vec<Figure>, Vec<RunFigure>), Cancelled> {
    let given = [Some(rivals.physics), rivals.black_box, rivals.residual];
    let all = gathered(workers, windows.len(), &|number| {
        let window = &windows[number];
        let mut sums = [Sums::default(); 3];
        for (sums, rival) in sums.iter_mut().zip(given) {
            if let Some(rival) = rival {
                *sums = Sums::of(window, &rival.path(window)?);
            }
        }
        Some(sums)
    })?;
    let total = |wanted: &dyn Fn(&Window) -> bool| {
        let pairs = windows.iter().zip(&all).filter(|(window, _)| wanted(window));
        pairs
            .filter_map(|(_, sums)| sums.as_ref())
            .fold([Sums::default(); 3], |total, sums| {
                core::array::from_fn(|k| total[k].joined(&sums[k]))
            })
    };
    let figure = |sums: &[Sums; 3], place: usize| {
        let (quantity, unit, horizon_s) = QUANTITIES[place];
        Figure {
            quantity,
            unit,
            horizon_s,
            physics: sums[0].rms(place),
            black_box: given[1].map(|_| sums[1].rms(place)),
            residual: given[2].map(|_| sums[2].rms(place)),
            samples: sums[0].0[place].1,
        }
    };
    let whole = total(&|_| true);
    let figures = (0..COUNT)
        .map(|place| figure(&whole, place))
        .filter(|figure| figure.samples > 0)
        .collect();
    let runs = paths.iter().enumerate().filter_map(|(run, path)| {
        let sums = total(&|window| window.run == run);
        let position_m = figure(&sums, FAR);
        (position_m.samples > 0).then(|| RunFigure {
            path: path.clone(),
            position_m,
        })
    });
    Ok((figures, runs.collect()))
}

/// Place errors, and gains, below this are a tracker's and its anchor's, m.
pub const TRACKER_M: f64 = 0.002;

/// How surely one predictor's place 2 s ahead is nearer than another's: mean over windows of ln(e_a^2 + s^2) - ln(e_b^2 + s^2)
/// over its standard error, s = 2 mm. Positive when `better` is.
pub fn far_sigmas(
    workers: &dyn Workers,
    windows: &[Window],
    physics: &dyn Predictor,
    better: &dyn Predictor,
) -> Result<f64, Cancelled> {
    let ratios = gathered(workers, windows.len(), &|number| {
        let window = &windows[number];
        let size = |predictor: &dyn Predictor| {
            let [forward, left, _] = pose_error(window, &predictor.path(window)?, HORIZONS_S[1])?;
            Some(libm::log(forward * forward + left * left + TRACKER_M * TRACKER_M))
        };
        Some(size(physics)? - size(better)?)
    })?;
    Ok(sigmas(ratios.into_iter().flatten()))
}

/// A mean over its standard error; 0 for fewer than two values.
pub fn sigmas(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let count = values.len() as f64;
    if count < 2.0 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / count;
    let spread = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (count - 1.0);
    mean / (spread / count).sqrt().max(f64::MIN_POSITIVE)
}

/// RMS place error 2 s ahead of one predictor.
pub fn far_position_m(workers: &dyn Workers, windows: &[Window], predictor: &dyn Predictor) -> Result<f64, Cancelled> {
    let rivals = Rivals {
        physics: predictor,
        black_box: None,
        residual: None,
    };
    let (figures, _) = figures(workers, windows, rivals, &[])?;
    let far = figures
        .iter()
        .find(|figure| figure.quantity == "position" && figure.horizon_s == HORIZONS_S[1]);
    Ok(far.map_or(f64::INFINITY, |figure| figure.physics))
}
