//! Logs of real robots: what others found in them with their own tools, found again.
//!
//! The logs are not part of the repository; without them every test says so and passes. `ROBOPHEUS_REAL_LOGS` names their
//! folder (`../shared/data` beside the checkout otherwise) and asks for all of the data instead of a slice.

mod real_logs;

use identify::bundle::Bundle;
use identify::diagnose::Diagnosis;
use identify::fit::{Bounds, Fit, Member, Problem, fit};
use identify::floor::Floor;
use identify::hypothesis::{Candidate, Excitation, Hypothesis, candidates};
use identify::record::{Record, Stages, residuals};
use identify::report::Verdict;

use real_logs::{at_length, coast, dart, found, husky, lateral_gap_m, mrclam, names, told};

const FOUR_WHEELS: [bool; 4] = [true, false, true, false];

fn value(found: &Diagnosis, name: &str, parameter: &str) -> f64 {
    let effect = found.report.effects.iter().find(|effect| effect.name == name);
    let parameters = effect.map(|effect| effect.parameters.as_slice()).unwrap_or_default();
    let parameter = parameters.iter().find(|other| other.name == parameter);
    parameter.and_then(|parameter| parameter.value).unwrap_or(f64::NAN)
}

fn gap(found: &Diagnosis, channel: &str, horizon_s: f64) -> (f64, f64) {
    let line = found
        .report
        .gap
        .iter()
        .find(|gap| gap.channel == channel && gap.horizon_s == horizon_s);
    line.map_or((f64::NAN, f64::NAN), |gap| (gap.before, gap.after))
}

fn is_untestable(found: &Diagnosis, name: &str) -> bool {
    found.report.untestable.iter().any(|other| other.name == name)
}

/// The twin rolls without slip, slow driving calibrates it: what fast driving lacks is grip, not a gain of the steering.
#[test]
fn a_car_at_its_limit_lacks_grip_first() {
    let robot = dart::slip_free();
    let runs = |name: &str, parts: usize, most: usize| {
        let mut runs = dart::runs_of(&robot, name, parts)?;
        runs.truncate(most);
        Some(runs)
    };
    let all = || {
        let mut references = Vec::new();
        for name in dart::STEERING {
            references.extend(runs(name, 1, 1)?);
        }
        // The fast one of the two in the short version.
        let mut changed = runs(dart::FREE[2], if at_length() { 2 } else { 4 }, 4)?;
        if at_length() {
            changed.extend(runs(dart::FREE[0], 2, 2)?);
        }
        let mut locked = runs(dart::FREE[1], 1, 1)?;
        locked.extend(runs(dart::FREE[3], 1, 1)?);
        Some((references, changed, locked))
    };
    let Some((references, changed, locked)) = all() else {
        return;
    };
    let before_m = lateral_gap_m(&locked, &[]);
    let gain_m = lateral_gap_m(
        &locked,
        &[twin::effect::Effect::new("steering_scale", &[("scale", 0.65)])],
    );
    let found = found(references, changed, locked.clone());
    println!("{}", told(&found));
    let mut after = locked;
    for run in &mut after {
        run.bundle = redescribed(&run.bundle, &found);
    }
    let after_m = lateral_gap_m(&after, &found.model.effects);
    let grip = value(&found, "floor_friction", "scale") * 3.0;
    println!("lateral 2 s ahead: {before_m:.2} m, gain alone {gain_m:.2} m, found {after_m:.2} m; friction {grip:.2}");
    assert!(["floor_friction", "lateral_slip"].contains(&names(&found)[0][0]));
    assert!((0.7..1.1).contains(&grip), "{grip}");
    assert!(before_m > 1.2 && after_m < 0.8 * before_m, "{before_m} {after_m}");
    // Nothing in these runs says how a throttle that the log holds as a number becomes a speed.
    assert!(is_untestable(&found, "command_dead_band"));
    // The gain alone is the wrong name; after grip it is what the library has for the servo's map.
    if let Some(gain) = names(&found)
        .iter()
        .position(|of_one| of_one.contains(&"steering_scale"))
    {
        assert!(gain > 0 && after_m < 0.85 * gain_m, "{gain_m} {after_m}");
    }
}

/// The run with the description of the model that was found.
fn redescribed(bundle: &Bundle, found: &Diagnosis) -> Bundle {
    let mut changed = bundle.clone();
    changed.run.robot = found.model.robot.clone();
    changed
}

/// Speed of the body limited, then its acceleration, then a delay; a slow lag alone is the trap.
#[test]
fn a_skid_steered_robot_has_limits_before_it_has_a_lag() {
    let (count, most) = if at_length() { (6, 10) } else { (5, 5) };
    let Some(runs) = husky::runs(husky::ROBOT, &FOUR_WHEELS, count, most, at_length()) else {
        return;
    };
    let found = found(Vec::new(), runs, Vec::new());
    println!("{}", told(&found));
    let named = names(&found);
    assert_eq!(named[0], ["body_speed_saturation"]);
    assert_eq!(named[1][0], "acceleration_limit");
    let yaw_rate = value(&found, "body_speed_saturation", "yaw_rate");
    assert!((1.2..2.0).contains(&yaw_rate), "{yaw_rate}");
    let (before, after) = gap(&found, "wheel", 1.0);
    assert!(before > 2.0 && after < 0.75 * before, "{before} {after}");
    assert!(found.report.effects.iter().all(|effect| effect.name != "lateral_slip"));
}

/// Two robots that follow their set-points late; the library has no gain of forward speed alone and must not invent one.
#[test]
fn a_vacuum_cleaner_is_late() {
    let (count, length_s) = if at_length() { (8, 60.0) } else { (4, 50.0) };
    let Some(runs) = mrclam::runs(1, 20.0, length_s, count) else {
        return;
    };
    let found = found(Vec::new(), runs, Vec::new());
    println!("{}", told(&found));
    let named = names(&found);
    let late = named
        .iter()
        .find(|set| set.contains(&"command_delay"))
        .or(named.first());
    assert!(
        late.is_some_and(|set| set.contains(&"command_delay") || set.contains(&"motor_lag")),
        "{named:?}"
    );
    let delay_s = [
        value(&found, "command_delay", "delay"),
        value(&found, "motor_lag", "time_constant"),
    ];
    assert!(
        delay_s.iter().any(|delay_s| (0.16..0.3).contains(delay_s)),
        "{delay_s:?}"
    );
    for gain in ["wheel_radius", "pose_scale", "encoder_scale"] {
        assert!(!named.iter().flatten().any(|name| *name == gain), "{named:?}");
    }
}

/// Records, the model that is fitted and its residuals.
struct Side {
    records: Vec<Record>,
    residuals: Vec<Vec<f64>>,
}

fn side(bundles: &[&Bundle], model: &Hypothesis) -> Side {
    let records: Vec<Record> = bundles.iter().map(|bundle| Record::of("run", bundle)).collect();
    let records: Vec<Record> = records.into_iter().filter(|record| !record.is_empty()).collect();
    let residuals = records
        .iter()
        .map(|record| residuals(record, model, Stages::BOTH, None).unwrap_or_default())
        .collect();
    Side { records, residuals }
}

fn fitted(side: &Side, model: &Hypothesis, members: Vec<Member>) -> Fit {
    let floor = Floor::stated(model.clone(), Vec::new());
    let metric = floor.metric(&side.records, &[]);
    let problem = Problem {
        records: &side.records,
        metric: &metric,
        bounds: &Bounds::of(&floor, &side.records),
        base: model,
        residuals: &side.residuals,
        wanted_gain: f64::NEG_INFINITY,
    };
    match fit(&problem, members) {
        Some(fit) => fit,
        None => panic!("cannot be simulated"),
    }
}

fn candidate(model: &Hypothesis, name: &str) -> Candidate {
    let all = candidates(&model.description, &Excitation::default());
    match all.into_iter().find(|candidate| candidate.entry.name == name) {
        Some(candidate) => candidate,
        None => panic!("no {name}"),
    }
}

/// Coulomb 1.3 to 1.8 N and viscous about 0.34 N s/m; every other coast-down is held out.
#[test]
fn coast_downs_give_both_frictions() {
    let Some(runs) = coast::runs() else { return };
    let model = Hypothesis::nominal(&runs[0].bundle.run.robot);
    let half = |odd: usize| -> Vec<&Bundle> { runs.iter().skip(odd).step_by(2).map(|run| &run.bundle).collect() };
    let (train, held_out) = (side(&half(0), &model), side(&half(1), &model));
    // The motors push nothing, so their stall torque is no measure of what matters.
    let member = |name: &str, practical: f64| {
        let mut candidate = candidate(&model, name);
        candidate.axes[0].practical = practical;
        Member {
            values: vec![practical],
            candidate,
        }
    };
    let fit = fitted(
        &train,
        &model,
        vec![member("coulomb_friction", 3e-3), member("viscous_friction", 2e-5)],
    );
    // Four wheels: force = 4 torque / R, and per speed 4 coefficient / R^2.
    let coulomb_n = 4.0 * fit.members[0].values[0] / coast::RADIUS_M;
    let viscous_n_s_per_m = 4.0 * fit.members[1].values[0] / (coast::RADIUS_M * coast::RADIUS_M);
    let model = identify::fit::with_members(&model, &fit.members);
    let mut squares = Vec::new();
    for record in &held_out.records {
        let residual = residuals(record, &model, Stages::BOTH, None).unwrap_or_default();
        let places = record.places();
        for window in 0..record.windows.len() {
            let cells = || places.iter().zip(&residual).filter(|(place, _)| place.window == window);
            let n = cells().count() as f64;
            let mean = |value: &dyn Fn(f64, f64) -> f64| cells().map(|(p, r)| value(p.time_s, *r)).sum::<f64>() / n;
            let (time_s, rest) = (mean(&|t, _| t), mean(&|_, r| r));
            let slope = mean(&|t, r| (t - time_s) * (r - rest)) / mean(&|t, _| (t - time_s) * (t - time_s));
            let force_n = coast::MASS_KG * coast::RADIUS_M * slope;
            squares.push(force_n * force_n);
        }
    }
    let rms_n = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    println!(
        "{} + {} coast-downs: Coulomb {coulomb_n:.2} N, viscous {viscous_n_s_per_m:.3} N s/m; held out {rms_n:.2} N in {} windows",
        train.records.len(),
        held_out.records.len(),
        squares.len()
    );
    assert!((1.3..1.8).contains(&coulomb_n), "{coulomb_n}");
    assert!((0.27..0.41).contains(&viscous_n_s_per_m), "{viscous_n_s_per_m}");
    assert!(rms_n < 0.35, "{rms_n}");
}

/// Encoders to poses: how much wider the robot is than its track, against a twin without slip and against the contact.
///
/// Least squares on the same log by hand (turn over 2 s against the encoders' difference) give 2.62, medians by speed 2.2 to 2.55.
#[test]
fn a_skid_steered_robot_is_wider_than_its_track() {
    let Some(runs) = husky::runs(husky::SLIP_FREE, &[true, false], 6, 34, true) else {
        return;
    };
    let model = Hypothesis::nominal(&runs[0].bundle.run.robot);
    let bundles: Vec<&Bundle> = runs.iter().map(|run| &run.bundle).collect();
    let mut side = side(&bundles, &model);
    // Set-points do not count here.
    for record in &mut side.records {
        for window in &mut record.windows {
            window.drive.cells.clear();
        }
    }
    let all = side.records.iter();
    side.residuals = all
        .map(|record| residuals(record, &model, Stages::BOTH, None).unwrap_or_default())
        .collect();
    let member = Member {
        candidate: candidate(&model, "track_width"),
        values: vec![0.05],
    };
    let fit = fitted(&side, &model, vec![member]);
    // The slip-free description is already twice as wide.
    let effective = 2.0 * (1.0 + fit.members[0].values[0]);
    let own = contact_track_m() / 0.55;
    println!(
        "effective track {effective:.2} of the geometric one without slip; the contact alone gives {own:.2}, {:.2} remain",
        effective / own
    );
    assert!((2.1..2.75).contains(&effective), "{effective}");
    // B + L^2 / B
    assert!(
        (own / ((0.55 + 0.512 * 0.512 / 0.55) / 0.55) - 1.0).abs() < 0.05,
        "{own}"
    );
}

/// Track that the nominal contact of four wheels behaves like when it turns on the spot, m.
fn contact_track_m() -> f64 {
    let Ok(description) = serde_json::from_str(husky::ROBOT) else {
        return f64::NAN;
    };
    let Some(robot) = Hypothesis::nominal(&description).robot() else {
        return f64::NAN;
    };
    let speed_rad_per_s = 3.0;
    let rows: Vec<twin::replay::CommandRow> = (0..360)
        .map(|tick| {
            let mut row = twin::replay::CommandRow {
                time_s: f64::from(tick) / 120.0,
                ..Default::default()
            };
            for (slot, left) in row.wheel_rad_per_s.iter_mut().zip(FOUR_WHEELS) {
                *slot = Some(if left { -speed_rad_per_s } else { speed_rad_per_s });
            }
            row
        })
        .collect();
    let out = twin::replay::replay(&robot, twin::pose::Pose::default(), &rows).unwrap_or_default();
    out.last().map_or(f64::NAN, |row| {
        2.0 * 0.165 * speed_rad_per_s / row.state.twist.yaw_rate_rad_per_s
    })
}

/// What a model of real data explains, taken away and looked for again: the key is known, the data nobody simulated.
#[test]
fn an_effect_taken_from_a_fitted_model_is_found_again() {
    if !at_length() {
        println!("skipped: set ROBOPHEUS_REAL_LOGS to hide effects in real logs");
        return;
    }
    let Some(runs) = husky::runs(husky::ROBOT, &FOUR_WHEELS, 6, 10, false) else {
        return;
    };
    let whole = found(Vec::new(), runs.clone(), Vec::new());
    assert_ne!(whole.report.verdict, Verdict::Unexplained);
    let mut first = 0;
    let effects = whole.model.effects.len();
    for hidden in 0..effects {
        let mut model = whole.model.clone();
        let gone = model.effects.remove(hidden);
        let again = real_logs::found_from(model, runs.clone());
        let named = names(&again);
        println!("hidden {}: {:?} {named:?}", gone.name, again.report.verdict);
        first += usize::from(named.first().is_some_and(|set| set.contains(&gone.name.as_str())));
    }
    assert!(first * 3 >= effects * 2, "{first} of {effects}");
}
