//! Bad sensor settings are refused by field, with limit and remedy.

mod support;

use core::f64::consts::FRAC_PI_2;

use support::{car, omni4, robot};
use twin::sensor::encoder::TickSettings;
use twin::sensor::{SensorSettings, SensorSuite};

fn set_ticks(settings: &mut SensorSettings, encoder_ticks_per_rev: u32, window_samples: u32) {
    if let Some(encoder) = &mut settings.encoder {
        encoder.ticks = Some(TickSettings {
            encoder_ticks_per_rev,
            window_samples,
        });
    }
}

fn refused(change: impl Fn(&mut SensorSettings)) -> Vec<String> {
    let robot = robot(car("fwd"));
    let mut settings = SensorSettings::of(&robot);
    assert_eq!(settings.check(&robot), []);
    set_ticks(&mut settings, 1000, 4);
    change(&mut settings);
    let problems = settings.check(&robot);
    for problem in &problems {
        assert!(
            !problem.limit.is_empty() && !problem.remedy.is_empty() && !problem.message.is_empty(),
            "{problem:?}"
        );
    }
    assert_eq!(SensorSuite::new(&robot, settings).err(), problems.first().cloned());
    problems.into_iter().map(|problem| problem.field).collect()
}

/// Changes one entry of the settings of a sensor that is there.
macro_rules! refused_with {
    ($sensor:ident: $($field:tt)+) => {
        refused(|settings| {
            if let Some($sensor) = &mut settings.$sensor {
                $($field)+;
            }
        })
    };
}

#[test]
fn every_setting_has_a_limit() {
    let nan = f64::NAN;
    assert_eq!(
        refused_with!(encoder: encoder.every_steps = 0),
        ["sensors.encoder.every_steps"]
    );
    assert_eq!(
        refused(|settings| set_ticks(settings, 0, 1)),
        ["sensors.encoder.ticks.encoder_ticks_per_rev"]
    );
    assert_eq!(
        refused(|settings| set_ticks(settings, 1, 0)),
        ["sensors.encoder.ticks.window_samples"]
    );
    assert_eq!(
        refused(|settings| set_ticks(settings, 1, 65)),
        ["sensors.encoder.ticks.window_samples"]
    );
    assert_eq!(
        refused_with!(encoder: encoder.noise_rad_per_s = -1.0),
        ["sensors.encoder.noise_rad_per_s"]
    );
    assert_eq!(
        refused_with!(current: current.noise_a = nan),
        ["sensors.current.noise_a"]
    );
    assert_eq!(
        refused_with!(current: current.every_steps = 4801),
        ["sensors.current.every_steps"]
    );
    assert_eq!(
        refused_with!(bus_voltage: bus_voltage.noise_v = -0.1),
        ["sensors.bus_voltage.noise_v"]
    );
    assert_eq!(
        refused_with!(steering: steering.noise_rad = f64::INFINITY),
        ["sensors.steering.noise_rad"]
    );
    assert_eq!(
        refused_with!(gyro: gyro.noise_rad_per_s = nan),
        ["sensors.gyro.noise_rad_per_s"]
    );
    assert_eq!(
        refused_with!(accelerometer: accelerometer.noise_m_per_s2 = -1.0),
        ["sensors.accelerometer.noise_m_per_s2"]
    );
    assert_eq!(
        refused_with!(magnetometer: magnetometer.field_t = 0.0),
        ["sensors.magnetometer.field_t"]
    );
    assert_eq!(
        refused_with!(magnetometer: magnetometer.inclination_rad = FRAC_PI_2),
        ["sensors.magnetometer.inclination_rad"]
    );
    assert_eq!(
        refused_with!(magnetometer: magnetometer.magnetic_north_rad = 90.0),
        ["sensors.magnetometer.magnetic_north_rad"]
    );
    assert_eq!(
        refused_with!(range: range.mounts[2].angle_rad = -30.0),
        ["sensors.range.mounts[2].angle_rad"]
    );
    assert_eq!(
        refused_with!(range: range.mounts[6].x_m = nan),
        ["sensors.range.mounts[6].x_m"]
    );
    assert_eq!(refused_with!(range: range.max_m = range.min_m), ["sensors.range.max_m"]);
    assert_eq!(
        refused_with!(range: range.noise_share = 1.1),
        ["sensors.range.noise_share"]
    );
    assert_eq!(
        refused_with!(tracked_pose: tracked_pose.drop_probability = 1.5),
        ["sensors.tracked_pose.drop_probability"]
    );
    assert_eq!(
        refused_with!(tracked_pose: tracked_pose.latency_jitter_s = 1.5),
        ["sensors.tracked_pose.latency_jitter_s"]
    );
    assert_eq!(
        refused_with!(tracked_pose: tracked_pose.latency_s = -1.0),
        ["sensors.tracked_pose.latency_s"]
    );
    // The shutter is still open when the frame would arrive.
    assert_eq!(
        refused_with!(tracked_pose: tracked_pose.exposure_steps = 4),
        ["sensors.tracked_pose.latency_s"]
    );
    let too_long = |settings: &mut SensorSettings| {
        if let Some(tracker) = &mut settings.tracked_pose {
            (tracker.exposure_steps, tracker.latency_s) = (5, 0.1);
        }
    };
    assert_eq!(refused(too_long), ["sensors.tracked_pose.exposure_steps"]);
}

#[test]
fn sensors_of_parts_that_are_missing_are_refused() {
    let rich = SensorSettings::of(&robot(car("fwd")));
    let mut poor = omni4();
    poor.motor = None;
    let fields: Vec<String> = rich
        .check(&robot(poor))
        .into_iter()
        .map(|problem| problem.field)
        .collect();
    assert_eq!(fields, ["sensors.current", "sensors.bus_voltage", "sensors.steering"]);
}
