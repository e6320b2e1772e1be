//! References say how late a robot acts and shows what it does.

mod plant;

use identify::hypothesis::Hypothesis;
use plant::replayed::calibration;
use twin::tread::Tread;

const FIRST_SEED: u64 = 900;

/// Delay of commands, s.
fn delay_s(found: &Hypothesis) -> f64 {
    let delays = found.effects.iter().filter(|effect| effect.name == "command_delay");
    delays.map(|effect| effect.value("delay")).sum()
}

/// A servo of second order is no delay of commands: wheels, which have none, would be late.
#[test]
fn a_servo_of_second_order_is_found_and_no_delay_with_it() {
    let found = calibration("rwd", FIRST_SEED, |own| {
        if let Some(steering) = &mut own.steering {
            (steering.lag_s, steering.filter_s) = (0.04, Some(0.04));
        }
        own.accelerometer_lag_s = Some(0.008);
        own.tread = Some(Tread {
            slip_scale_m_per_s: 0.006,
            creep: 0.06,
            tail: 0.4,
            sliding: 0.9,
        });
    });
    let steering = found.description.steering.clone().unwrap_or_else(|| panic!("a car"));
    let filter_s = steering.filter_s.unwrap_or(0.0);
    let lag_s = found.description.accelerometer_lag_s.unwrap_or(0.0);
    // Lag and filter may change places.
    assert!((steering.lag_s + filter_s - 0.08).abs() < 0.008, "{steering:?}");
    assert!((steering.lag_s * filter_s / 0.0016 - 1.0).abs() < 0.25, "{steering:?}");
    assert!((lag_s - 0.008).abs() < 0.002, "{lag_s}");
    assert!(delay_s(&found) < 0.002, "{}", delay_s(&found));
}

#[test]
fn a_robot_as_described_is_not_late() {
    let found = calibration("diff2", FIRST_SEED, |_| ());
    let lag_s = found.description.accelerometer_lag_s.unwrap_or(0.0);
    assert!(lag_s < 0.002 && delay_s(&found) < 0.001, "{lag_s} {}", delay_s(&found));
}

/// On another tyre wheels and accelerations are off everywhere at first. That must not pass for noise that hides how late they are.
#[test]
fn other_tyres_do_not_hide_a_robot_that_is_in_time() {
    let found = calibration("omni4", FIRST_SEED, |own| {
        own.tread = Some(Tread {
            slip_scale_m_per_s: 0.004,
            creep: 0.05,
            tail: 0.8,
            sliding: 0.85,
        });
    });
    assert!(delay_s(&found) < 0.002, "{}", delay_s(&found));
    let tread = found.description.tread.unwrap_or(Tread::NOMINAL);
    assert!((tread.creep - 0.05).abs() < 0.015, "{tread:?}");
}
