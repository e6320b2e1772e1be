//! What is set in a robot's controller before it drives: nominal geometry, gains and limits of its description.

use crate::hidden::HiddenRobot;
use api::robot::{LabRobot, Motor, RobotDescription};
use robot::battery::BatterySettings;
use robot::estimator::{EstimatorSettings, Magnetometer};
use robot::firmware::Settings;
use robot::fusion::DynamicLimits;
use robot::key::Key;
use robot::kinematics::{Wheel, WheelKind, WheelTable};
use robot::motor_control::{ControllerSettings, EncoderSettings, Law, MAX_DELAY_SAMPLES, MAX_WINDOW_SAMPLES};
use robot::watchdog::WatchdogSettings;

const FIRMWARE_HZ: u32 = crate::plant::TICK_HZ;
/// The plant's own steps: no controller samples more often.
const PLANT_HZ: u32 = crate::plant::TICK_HZ * crate::plant::SUBSTEPS;
const MAGNETOMETER_HEADING_RAD: f64 = 0.05;
const MAGNETOMETER_CORRELATION_S: f64 = 0.5;

/// Why a robot cannot be commissioned.
#[derive(Debug, thiserror::Error)]
pub enum CommissioningError {
    #[error("robot {robot}: its wheels give no kinematics ({problem:?})")]
    Wheels {
        robot: String,
        problem: robot::kinematics::WheelTableError,
    },
    #[error("robot {robot}: motor.controller.{field} {value} is not {allowed}")]
    Controller {
        robot: String,
        field: &'static str,
        value: String,
        allowed: String,
    },
}

/// Everything that the firmware is told at commissioning.
pub fn settings(robot: &LabRobot, key: Key, hidden: &HiddenRobot) -> Result<Settings, CommissioningError> {
    let description = &robot.description;
    let supply_v = description.motor.as_ref().map_or(24.0, |motor| motor.supply_v);
    let gyro_rad_per_s = description.noise.as_ref().and_then(|noise| noise.gyro_rad_per_s);
    let magnetometer = hidden.magnetometer.map(|hidden| Magnetometer {
        north_rad: hidden.north_rad,
        field_t: hidden.field_t,
        heading_rad: MAGNETOMETER_HEADING_RAD,
        correlation_s: MAGNETOMETER_CORRELATION_S,
    });
    let plain = EstimatorSettings::default();
    Ok(Settings {
        number: robot.number,
        key,
        wheels: wheel_table(description)?,
        motor: controller(description)?,
        smoothing_s: hidden.wear.motor_lag_s,
        watchdog: WatchdogSettings::default(),
        limits: DynamicLimits::default(),
        estimator: EstimatorSettings {
            gyro_rad_per_s: gyro_rad_per_s.unwrap_or(plain.gyro_rad_per_s).max(1e-4),
            magnetometer,
            ..plain
        },
        battery: BatterySettings::for_supply(supply_v),
    })
}

fn wheel_table(description: &RobotDescription) -> Result<WheelTable, CommissioningError> {
    let wheels: Vec<_> = description
        .wheels
        .iter()
        .map(|wheel| Wheel {
            kind: match wheel.kind.as_str() {
                "omni" => WheelKind::Omni,
                "caster" => WheelKind::Caster,
                _ => WheelKind::Standard,
            },
            x_m: wheel.x_m,
            y_m: wheel.y_m,
            rolling_direction_rad: wheel.rolling_direction_rad,
            radius_m: wheel.radius_m.unwrap_or(0.0),
            driven: wheel.driven,
            steered: wheel.steered,
        })
        .collect();
    let limit_rad = description
        .steering
        .as_ref()
        .and_then(|steering| steering.angle_limit_rad)
        .unwrap_or(f64::INFINITY);
    WheelTable::new(&wheels, limit_rad).map_err(|problem| CommissioningError::Wheels {
        robot: description.name.clone(),
        problem,
    })
}

fn controller(description: &RobotDescription) -> Result<ControllerSettings, CommissioningError> {
    let plain = |motor: Option<&Motor>| ControllerSettings {
        law: Law::SpeedPi {
            kp_v_s_per_rad: motor.map_or(0.0, |motor| motor.speed_loop_kp_v_s_per_rad),
            ki_v_per_rad: motor.map_or(0.0, |motor| motor.speed_loop_ki_v_per_rad),
        },
        sample_rate_hz: FIRMWARE_HZ,
        computation_delay_samples: 0,
        encoder: None,
    };
    let motor = description.motor.as_ref();
    let Some((motor, controller)) = motor.and_then(|motor| Some((motor, motor.controller.as_ref()?))) else {
        return Ok(plain(motor));
    };
    let refuse = |field: &'static str, value: String, allowed: String| CommissioningError::Controller {
        robot: description.name.clone(),
        field,
        value,
        allowed,
    };
    let rate_hz = controller.sample_rate_hz;
    let divides = |whole: u32, part: u32| part > 0 && whole.is_multiple_of(part);
    if !(10..=PLANT_HZ).contains(&rate_hz) || !(divides(FIRMWARE_HZ, rate_hz) || divides(rate_hz, FIRMWARE_HZ)) {
        let allowed = format!("a divisor or a multiple of {FIRMWARE_HZ} from 10 to {PLANT_HZ}, the steps of the plant");
        return Err(refuse("sample_rate_hz", rate_hz.to_string(), allowed));
    }
    let delay = controller.computation_delay_samples as usize;
    if delay > MAX_DELAY_SAMPLES {
        let allowed = format!("at most {MAX_DELAY_SAMPLES}");
        return Err(refuse("computation_delay_samples", delay.to_string(), allowed));
    }
    let window_samples = controller.speed_window_samples.unwrap_or(1) as usize;
    if !(1..=MAX_WINDOW_SAMPLES).contains(&window_samples) {
        let allowed = format!("1 to {MAX_WINDOW_SAMPLES}");
        return Err(refuse("speed_window_samples", window_samples.to_string(), allowed));
    }
    let gain = |field: &'static str, value: Option<f64>| {
        value
            .filter(|value| value.is_finite() && *value >= 0.0)
            .ok_or_else(|| refuse(field, format!("{value:?}"), "a gain of zero or more".to_owned()))
    };
    let law = match controller.kind.as_str() {
        "speed_pi" => plain(Some(motor)).law,
        "cascade" => Law::Cascade {
            speed_kp_a_s_per_rad: gain("speed_kp_a_s_per_rad", controller.speed_kp_a_s_per_rad)?,
            speed_ki_a_per_rad: gain("speed_ki_a_per_rad", controller.speed_ki_a_per_rad)?,
            current_kp_v_per_a: gain("current_kp_v_per_a", controller.current_kp_v_per_a)?,
            current_ki_v_per_a_s: gain("current_ki_v_per_a_s", controller.current_ki_v_per_a_s)?,
            current_limit_a: controller
                .current_limit_a
                .or(motor.current_limit_a)
                .unwrap_or(motor.supply_v / motor.resistance_ohm),
        },
        other => return Err(refuse("kind", format!("{other:?}"), "speed_pi or cascade".to_owned())),
    };
    Ok(ControllerSettings {
        law,
        sample_rate_hz: rate_hz,
        computation_delay_samples: delay,
        encoder: controller.encoder_ticks_per_rev.map(|ticks_per_rev| EncoderSettings {
            ticks_per_rev,
            window_samples,
        }),
    })
}
