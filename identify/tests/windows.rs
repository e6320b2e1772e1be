//! Windows begin anew in the middle of a motion: what the motion before left behind must not be lost.

mod plant;

use identify::gap::{CLOSE_ANCHOR_PERIOD_S, RobotClock, end_to_end_with};
use identify::hypothesis::Hypothesis;
use identify::record::{Quantity, Record, Stages, WINDOW_S, residuals, residuals_with};
use plant::replayed::of_the_twin_with;
use plant::{Change, robot, run};
use twin::effect::Effect;
use twin::robot::Robot;

/// Root mean square of what is left of a channel in the first `seconds` of the windows of two runs of the twin with an effect, under models with
/// the effects told.
fn left<const N: usize>(
    chassis: &str,
    truth: &Effect,
    (of, seconds): (fn(Quantity) -> bool, f64),
    models: [&[Effect]; N],
) -> [f64; N] {
    let description = robot(chassis);
    let records: Vec<Record> = (0..2)
        .map(|k| {
            let driven = run("run", &description, &Change::none(), 70 + k, 20, false);
            let replayed = of_the_twin_with(driven, description.clone(), core::slice::from_ref(truth), k);
            Record::of(&replayed.path, &replayed.bundle)
        })
        .collect();
    models.map(|effects| {
        let hypothesis = Hypothesis {
            effects: effects.to_vec(),
            ..Hypothesis::nominal(&description)
        };
        let (mut sum, mut count) = (0.0, 0.0);
        for record in &records {
            let residual = residuals(record, &hypothesis, Stages::BOTH, None).expect("the twin can be driven");
            for (place, value) in record.places().iter().zip(residual) {
                let into_s = place.time_s - record.windows[place.window].from_s;
                if place.quantity.is_some_and(of) && into_s < seconds {
                    sum += value * value;
                    count += 1.0;
                }
            }
        }
        f64::sqrt(sum / count)
    })
}

#[test]
fn a_play_of_the_steering_is_met_by_its_own_size_alone() {
    let play = |rad: f64| Effect::new("steering_backlash", &[("play", rad)]);
    let is_gyro = |quantity| quantity == Quantity::Gyro;
    let sizes = [0.015, 0.03, 0.034, 0.06].map(|rad| [play(rad)]);
    let models: [&[Effect]; 5] = [&[], &sizes[0], &sizes[1], &sizes[2], &sizes[3]];
    let [none, half, truth, more, twice] = left("rwd", &play(0.03), (is_gyro, WINDOW_S), models);
    // Noise of 6 mrad/s over cells of six samples, and what is left of that of the steering.
    assert!(truth < 0.005, "rad/s: {truth}");
    assert!(
        none > 3.0 * truth && more > truth && half > 1.7 * truth && twice > 3.0 * truth,
        "{none} {half} {truth} {more} {twice}"
    );
}

#[test]
fn a_play_of_the_gears_is_met_by_its_own_size_alone() {
    let play = |rad: f64| Effect::new("gear_backlash", &[("play", rad)]);
    let is_wheel = |quantity| matches!(quantity, Quantity::Wheel(_));
    let models: [&[Effect]; 3] = [&[], &[play(0.03)], &[play(0.06)]];
    let [none, truth, twice] = left("diff2", &play(0.03), (is_wheel, WINDOW_S), models);
    // What happens at a step while the rotor is in the middle of its play depends on where it is to a hair.
    assert!(truth < 0.75 * none && truth < twice, "rad/s: {none} {truth} {twice}");
}

/// Encoders sit at the rotors: how the robot turns tells what wheels do within the play.
#[test]
fn a_play_of_the_gears_is_met_in_how_the_robot_turns() {
    let play = |rad: f64| Effect::new("gear_backlash", &[("play", rad)]);
    let is_gyro = |quantity| quantity == Quantity::Gyro;
    let sizes = [0.015, 0.03, 0.06].map(|rad| [play(rad)]);
    let models: [&[Effect]; 4] = [&[], &sizes[0], &sizes[1], &sizes[2]];
    for chassis in ["diff2", "diff4", "rwd"] {
        let [none, half, truth, twice] = left(chassis, &play(0.03), (is_gyro, WINDOW_S), models);
        assert!(
            truth < 0.6 * none && truth < half && truth < 0.6 * twice,
            "{chassis}, rad/s: {none} {half} {truth} {twice}"
        );
    }
}

/// Every robot has some: half a degree is the practical size.
#[test]
fn small_plays_of_the_gears_stay_out_of_how_the_robot_turns() {
    let play = |rad: f64| Effect::new("gear_backlash", &[("play", rad)]);
    let is_gyro = |quantity| quantity == Quantity::Gyro;
    let models: [&[Effect]; 3] = [&[], &[play(0.0086)], &[play(0.0088)]];
    let [none, small, practical] = left("diff2", &play(0.03), (is_gyro, WINDOW_S), models);
    assert!(
        small == none && practical < 0.95 * none,
        "rad/s: {none} {small} {practical}"
    );
}

/// A speed loop in the middle of an acceleration holds its voltage with an error and less of an integral.
#[test]
fn windows_that_begin_in_an_acceleration_are_met() {
    let nothing = Effect::new("gyro_bias", &[("bias", 0.0)]);
    let is_wheel = |quantity| matches!(quantity, Quantity::Wheel(_));
    for chassis in ["diff2", "omni4", "rwd"] {
        let [left] = left(chassis, &nothing, (is_wheel, 0.6), [&[]]);
        // Noise of 50 mrad/s over cells of six samples is 20.
        assert!(left < 0.04, "{chassis}: {left} rad/s");
    }
}

#[test]
fn predictions_from_the_middle_of_a_run_know_the_play_too() {
    let play = Effect::new("steering_backlash", &[("play", 0.06)]);
    let description = robot("rwd");
    let driven = run("run", &description, &Change::none(), 70, 20, false);
    let replayed = of_the_twin_with(driven, description.clone(), core::slice::from_ref(&play), 0);
    let yaw_rad = |effects: &[Effect]| {
        let robot = Robot::with_effects(description.clone(), effects).expect("a robot");
        let gap = end_to_end_with(&replayed.bundle, &robot, RobotClock::default(), 0.5).expect("poses");
        gap.horizons[2].yaw_rad
    };
    let (without, with) = (yaw_rad(&[]), yaw_rad(core::slice::from_ref(&play)));
    assert!(with < 0.25 * without, "rad: {without} {with}");
}

/// What is left of places with a tag at the calibrated height, at its own and at `more_m`, m.
fn left_of_places(chassis: &str, height_m: f64, more_m: f64) -> [f64; 3] {
    let tag = |z_m: f64| Effect::new("tag_height", &[("z", z_m)]);
    let is_place = |quantity| matches!(quantity, Quantity::Forward | Quantity::Left);
    let models: [&[Effect]; 3] = [&[], &[tag(height_m)], &[tag(more_m)]];
    left(chassis, &tag(height_m), (is_place, WINDOW_S), models)
}

/// A tag 8 cm above the floor is seen up to 3 cm aside, to the other side by the other camera: near the line between them nobody knows which.
#[test]
fn a_tag_above_the_floor_is_met_where_two_cameras_meet() {
    let [none, truth, half_more] = left_of_places("diff2", 0.08, 0.12);
    assert!(
        truth < 0.0008 && none > 3.0 * truth && half_more > 1.5 * truth,
        "m: {none} {truth} {half_more}"
    );
}

/// 15 cm above it is 6 cm: a start beside the line may be that of either camera, and is that of the one that goes with the path.
#[test]
fn a_start_is_seen_by_the_camera_that_the_path_tells() {
    let [none, truth, more] = left_of_places("awd", 0.15, 0.18);
    assert!(
        truth < 0.0015 && none > 5.0 * truth && more > 1.5 * truth,
        "m: {none} {truth} {more}"
    );
}

#[test]
fn predictions_begin_where_the_robot_is_and_not_where_it_is_seen() {
    let description = robot("diff2");
    let tag = Effect::new("tag_height", &[("z", 0.15)]);
    let driven = run("run", &description, &Change::none(), 71, 20, false);
    let seen = of_the_twin_with(driven, description.clone(), core::slice::from_ref(&tag), 1);
    let position_m = |effects: &[Effect]| {
        let robot = Robot::with_effects(description.clone(), effects).unwrap();
        let gap = end_to_end_with(&seen.bundle, &robot, RobotClock::default(), CLOSE_ANCHOR_PERIOD_S).unwrap();
        gap.horizons[2].position_m
    };
    let (without, with) = (position_m(&[]), position_m(core::slice::from_ref(&tag)));
    // A prediction that is 1 mm off beside the line is seen 13 cm off there.
    assert!(with < 0.3 * without, "m: {without} {with}");
}

/// Where no wheel came near a patch nothing is simulated, and simulating gives the same bits.
#[test]
fn windows_that_a_patch_cannot_touch_are_as_without_it() {
    let description = robot("omni4");
    let driven = run("run", &description, &Change::none(), 41, 20, false);
    let record = Record::of("run", &driven.bundle);
    let nominal = Hypothesis::nominal(&description);
    let base = residuals(&record, &nominal, Stages::BOTH, None).expect("a simulation");
    let [mut kept, mut changed] = [0, 0];
    for (x_m, y_m) in [(-0.8, -0.6), (0.0, 0.0), (0.7, 0.5), (1.1, -0.7)] {
        let values = [("x", x_m), ("y", y_m), ("radius", 0.2), ("scale", 0.1)];
        let model = nominal.with(Effect::new("low_friction_patch", &values));
        let whole = residuals(&record, &model, Stages::BOTH, None).expect("a simulation");
        let quick = residuals_with(&record, &model, 1, Stages::BOTH, &base).expect("a simulation");
        assert_eq!(quick, whole, "({x_m}, {y_m})");
        for cells in record.cells_of_windows() {
            let is_kept = quick[cells.clone()] == base[cells];
            *(if is_kept { &mut kept } else { &mut changed }) += 1;
        }
    }
    assert!(kept > 0 && changed > 0, "{kept} {changed}");
}
