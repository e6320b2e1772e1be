//! Two models on runs made here: which is nearer, by how much, and when a run cannot tell.

mod support;

use identify::compare::{CompareError, Comparison, Nearer, compare};
use identify::gap::{CLOSE_ANCHOR_PERIOD_S, GapError, RobotClock, end_to_end_with};
use identify::hypothesis::Hypothesis;
use support::recorded;
use twin::effect::Effect;
use twin::golden::reference_robot;
use twin::robot::Robot;

/// A run of a robot with larger wheels than described, and the models without and with that effect.
fn case() -> (identify::bundle::Bundle, Hypothesis, Hypothesis) {
    let described = reference_robot("diff2");
    let mut truth = described.clone();
    truth
        .wheels
        .iter_mut()
        .for_each(|wheel| wheel.radius_m = wheel.radius_m.map(|radius_m| 1.03 * radius_m));
    let nominal = Hypothesis::nominal(&described);
    let right = nominal.with(Effect::new("wheel_radius", &[("relative", 0.03)]));
    (recorded(&truth, &described), nominal, right)
}

fn pose(comparison: &Comparison, horizon_s: f64) -> [f64; 2] {
    let row = comparison
        .rows
        .iter()
        .find(|row| row.channel == "pose" && row.horizon_s == horizon_s)
        .expect("a row");
    [row.first, row.second]
}

#[test]
fn the_model_with_the_effect_is_nearer_and_by_how_much_is_the_gap_of_each() {
    let (bundle, nominal, right) = case();
    let found = compare(&bundle, [&nominal, &right]).expect("comparable");
    assert_eq!(found.nearer, Nearer::Second, "{:?}", found.ratio);
    for (place, model) in [&nominal, &right].into_iter().enumerate() {
        let robot = Robot::with_model(model.description.clone(), &model.effects, None).expect("a robot");
        let gap = end_to_end_with(&bundle, &robot, RobotClock::default(), CLOSE_ANCHOR_PERIOD_S).expect("a gap");
        for horizon in &gap.horizons {
            let shown_m = pose(&found, horizon.horizon_s)[place];
            assert!((shown_m - horizon.position_m).abs() < 1e-12, "{horizon:?}: {shown_m}");
        }
    }
    let [far_m, near_m] = pose(&found, 2.0);
    assert!(near_m < 0.2 * far_m, "{far_m} {near_m}");
    let ratio = found.ratio.expect("long enough");
    assert!(
        (ratio.value - near_m / far_m).abs() < 1e-9 && ratio.high < 0.3,
        "{ratio:?}"
    );
    let sentence = found.sentence(["nominal", "diff-01/1"]);
    assert!(
        sentence.starts_with("diff-01/1 is nearer to this run than nominal:"),
        "{sentence}"
    );
    let has = |name: &str| found.rows.iter().any(|row| row.channel == name);
    assert!(["yaw", "wheel", "current"].into_iter().all(has), "{:?}", found.rows);

    let turned = compare(&bundle, [&right, &nominal]).expect("comparable");
    assert_eq!((turned.nearer, pose(&turned, 2.0)), (Nearer::First, [near_m, far_m]));
    assert_eq!(
        compare(&bundle, [&nominal, &right]).expect("comparable"),
        found,
        "the same again"
    );
}

#[test]
fn a_model_is_alike_to_itself_and_to_one_that_hardly_differs() {
    let (bundle, nominal, _) = case();
    let same = compare(&bundle, [&nominal, &nominal]).expect("comparable");
    let ratio = same.ratio.expect("long enough");
    assert_eq!(
        (same.nearer, ratio.value, ratio.low, ratio.high),
        (Nearer::Alike, 1.0, 1.0, 1.0)
    );
    assert!(same.rows.iter().all(|row| row.first == row.second));
    let hardly = nominal.with(Effect::new("wheel_radius", &[("relative", 1e-5)]));
    assert_eq!(
        compare(&bundle, [&nominal, &hardly]).expect("comparable").nearer,
        Nearer::Alike
    );
}

#[test]
fn what_cannot_be_compared_says_why() {
    let (mut bundle, nominal, _) = case();
    let broken = nominal.with(Effect::new("wheel_radius", &[("relative", -3.0)]));
    assert_eq!(
        compare(&bundle, [&nominal, &broken]),
        Err(CompareError::Model("second"))
    );
    bundle.telemetry.channels.retain(|channel, _| !channel.is_command());
    let refused = compare(&bundle, [&nominal, &nominal]);
    assert_eq!(refused, Err(CompareError::Gap(GapError::NoCommands)));
}
