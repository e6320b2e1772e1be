//! How loud what was named is, channel by channel.
//!
//! What an unnamed rest looks like is only known through residuals and their floor. What was named is known better: it is the
//! difference of two predictions, without noise. Its root mean square over the noise of each sensor says where a person would see
//! it; positions and headings 2 s ahead from the same start, driven by the set-points.

use crate::floor::sensor_sigmas;
use crate::gap::{ANCHOR_PERIOD_S, GapSample, RobotClock, end_to_end_with};
use crate::hypothesis::Hypothesis;
use crate::record::{CLASSES, Record, Stages, residuals};

use super::Run;

/// How far ahead poses are predicted.
const AHEAD_S: f64 = 2.0;
/// Positions of pose and yaw among the channels.
const POSE: usize = 6;
const YAW: usize = 7;

/// Share of each channel in the squared loudness of a change of the model, largest first; empty when it changes nothing.
pub(super) fn shares(runs: &[Run], records: &[&Record], before: &Hypothesis, after: &Hypothesis) -> Vec<(usize, f64)> {
    let mut sums = [[0.0; 2]; CLASSES];
    let mut add = |class: usize, square: f64| {
        sums[class][0] += square;
        sums[class][1] += 1.0;
    };
    for record in records {
        let pair = residuals(record, before, Stages::BOTH, None).zip(residuals(record, after, Stages::BOTH, None));
        let Some((one, other)) = pair else { continue };
        for ((place, a), b) in record.places().iter().zip(&one).zip(&other) {
            if let Some(class) = place
                .quantity
                .map(|quantity| quantity.class())
                .filter(|class| *class < POSE)
            {
                add(class, (a - b) * (a - b));
            }
        }
        let Some(run) = runs.iter().find(|run| run.path == record.name) else {
            continue;
        };
        for (square, yaw_square) in ahead(run, before, after) {
            add(POSE, square);
            add(YAW, yaw_square);
        }
    }
    let sigmas = sensor_sigmas(&before.description);
    let mean = |class: usize| sums[class][0] / f64::max(sums[class][1], 1.0) / (sigmas[class] * sigmas[class]);
    let total: f64 = (0..CLASSES).map(mean).sum();
    let seen = (0..CLASSES).filter(|class| sums[*class][1] > 0.0);
    let mut shares: Vec<(usize, f64)> = seen.map(|class| (class, mean(class) / total)).collect();
    shares.retain(|(_, share)| share.is_finite());
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    shares
}

/// Squares of how far two predictions of a run are apart, m^2 and rad^2.
fn ahead(run: &Run, before: &Hypothesis, after: &Hypothesis) -> Vec<(f64, f64)> {
    let predicted = |model: &Hypothesis| -> Option<Vec<GapSample>> {
        let clock = RobotClock::of(&model.effects);
        let gap = end_to_end_with(&run.bundle, &model.robot()?, clock, ANCHOR_PERIOD_S).ok()?;
        Some(gap.samples)
    };
    let Some((one, other)) = predicted(before).zip(predicted(after)) else {
        return Vec::new();
    };
    let far = one.iter().filter(|sample| sample.horizon_s == AHEAD_S);
    far.filter_map(|a| {
        let b = other
            .iter()
            .find(|b| b.anchor_s == a.anchor_s && b.horizon_s == a.horizon_s)?;
        let (forward, left) = (a.forward_m - b.forward_m, a.left_m - b.left_m);
        let yaw = twin::pose::wrapped_rad(a.yaw_rad - b.yaw_rad);
        Some((forward * forward + left * left, yaw * yaw))
    })
    .collect()
}
