//! Knobs: small changes in which every laboratory's robot differs from its description, and from day to day.
//!
//! They calibrate the nominal model on references, and span the differences between runs that a named effect must stand
//! out from. A knob of an effect that cannot be negative turns the description's own number instead.

use twin::effect::Effect;
use twin::robot::RobotDescription;

use super::{Candidate, Hypothesis, TreadKnob};

/// One direction.
#[derive(Debug, Clone, PartialEq)]
pub enum Knob {
    /// A parameter of an effect, neutral + value.
    Parameter {
        name: &'static str,
        index: Option<usize>,
        parameter: &'static str,
        neutral: f64,
        /// Change for a knob at 1: the practical size.
        practical: f64,
        low: f64,
        high: f64,
    },
    /// Supply voltage, share for a knob at 1.
    Supply(f64),
    /// Resistance of the motors, share for a knob at 1.
    Resistance(f64),
    Tread(TreadKnob),
    /// Filter in front of the steering gear, s for a knob at 1.
    SteeringFilter(f64),
    /// Filter of the accelerometer, s for a knob at 1.
    AccelerometerLag(f64),
}

/// Effects that are no laboratory's everyday difference, or change nothing when they are small.
const NEVER: [&str; 15] = [
    "longitudinal_slip",
    "stribeck_friction",
    "command_dead_band",
    "wheel_speed_saturation",
    "body_speed_saturation",
    "acceleration_limit",
    "low_friction_patch",
    "lateral_slip",
    "gear_backlash",
    "carpet_grain",
    "cable_drag",
    "wheel_eccentricity",
    "thermal_drift",
    "caster_swivel",
    "rolling_shutter",
];
/// Duplicates of other knobs.
const DOUBLES: [&str; 3] = ["encoder_scale", "lens_distortion", "battery_droop"];
/// What the supply and the resistance of a knob at 1 change.
const SUPPLY_SHARE: f64 = 0.02;
const RESISTANCE_SHARE: f64 = 0.05;
/// The same of filters, s, and how long they can be, knobs.
const STEERING_FILTER_S: f64 = 0.02;
const ACCELEROMETER_LAG_S: f64 = 0.005;
const LONGEST_FILTER: f64 = 10.0;

/// Knobs of a robot, from its candidates.
pub fn knobs(candidates: &[Candidate], robot: &RobotDescription) -> Vec<Knob> {
    let mut all = Vec::new();
    for candidate in candidates {
        let name = candidate.entry.name;
        if NEVER.contains(&name) || DOUBLES.contains(&name) {
            continue;
        }
        for axis in candidate
            .axes
            .iter()
            .filter(|axis| axis.carries_size && axis.neutral.is_finite())
        {
            all.push(Knob::Parameter {
                name,
                index: candidate.index,
                parameter: axis.name,
                neutral: axis.neutral,
                practical: axis.practical,
                low: axis.low,
                high: axis.high,
            });
        }
    }
    if robot.motor.is_some() {
        all.push(Knob::Supply(SUPPLY_SHARE));
        all.push(Knob::Resistance(RESISTANCE_SHARE));
    }
    all.extend(TreadKnob::ALL.map(Knob::Tread));
    if robot.steering.is_some() {
        all.push(Knob::SteeringFilter(STEERING_FILTER_S));
    }
    all.push(Knob::AccelerometerLag(ACCELEROMETER_LAG_S));
    all
}

impl Knob {
    /// A hypothesis with this knob at some value.
    pub fn applied(&self, base: &Hypothesis, value: f64) -> Hypothesis {
        realised(base, core::slice::from_ref(self), &[value])
    }

    /// The knob that is the same direction as a candidate's axis.
    pub fn is(&self, candidate: &Candidate, parameter: &str) -> bool {
        match self {
            Knob::Parameter {
                name,
                index,
                parameter: own,
                ..
            } => *name == candidate.entry.name && *index == candidate.index && *own == parameter,
            _ => false,
        }
    }

    /// How far the knob is turned for its sensitivity: away from the end of what is possible.
    pub fn step(&self, value: f64) -> f64 {
        if self.possible(value + 1.0) < value + 0.5 {
            -1.0
        } else {
            1.0
        }
    }

    /// Of what no description tells: tyres, and filters inside servos and sensors.
    pub fn is_untold(&self) -> bool {
        matches!(
            self,
            Knob::Tread(_) | Knob::SteeringFilter(_) | Knob::AccelerometerLag(_)
        )
    }

    /// The floor's friction.
    pub fn is_friction(&self) -> bool {
        matches!(
            self,
            Knob::Parameter {
                name: "floor_friction",
                ..
            }
        )
    }

    /// Time from command to action.
    pub fn is_delay(&self) -> bool {
        matches!(self, Knob::Parameter { name, .. } if *name == "command_delay")
    }

    /// The nearest value that the knob can have.
    pub fn possible(&self, value: f64) -> f64 {
        const BOTH_WAYS: [&str; 5] = [
            "coulomb_friction",
            "viscous_friction",
            "payload",
            "steering_lag",
            "floor_friction",
        ];
        match self {
            Knob::Parameter {
                name,
                neutral,
                practical,
                low,
                high,
                ..
            } if !BOTH_WAYS.contains(name) => value.clamp((low - neutral) / practical, (high - neutral) / practical),
            Knob::Tread(knob) => knob.possible(value),
            Knob::SteeringFilter(_) | Knob::AccelerometerLag(_) => value.clamp(0.0, LONGEST_FILTER),
            _ => value,
        }
    }

    /// In words.
    pub fn label(&self) -> String {
        match self {
            Knob::Parameter {
                name, index, parameter, ..
            } => match index {
                Some(index) => format!("{name}.{parameter}[{index}]"),
                None => format!("{name}.{parameter}"),
            },
            Knob::Supply(_) => "supply voltage".to_owned(),
            Knob::Resistance(_) => "motor resistance".to_owned(),
            Knob::Tread(knob) => knob.label().to_owned(),
            Knob::SteeringFilter(_) => "steering.filter_s".to_owned(),
            Knob::AccelerometerLag(_) => "accelerometer_lag_s".to_owned(),
        }
    }
}

/// A hypothesis with all knobs at their values.
pub fn realised(base: &Hypothesis, knobs: &[Knob], values: &[f64]) -> Hypothesis {
    let mut changed = base.clone();
    for (knob, value) in knobs.iter().zip(values) {
        if *value == 0.0 {
            continue;
        }
        match knob {
            Knob::Supply(share) => {
                if let Some(motor) = &mut changed.description.motor {
                    motor.supply_v *= 1.0 + share * value;
                }
            }
            Knob::Resistance(share) => {
                if let Some(motor) = &mut changed.description.motor {
                    motor.resistance_ohm *= (1.0 + share * value).max(0.3);
                }
            }
            Knob::Tread(knob) => knob.apply(&mut changed, *value),
            Knob::SteeringFilter(seconds) => {
                if let Some(steering) = &mut changed.description.steering {
                    steering.filter_s = Some((steering.filter_s.unwrap_or(0.0) + seconds * value).max(0.0));
                }
            }
            Knob::AccelerometerLag(seconds) => {
                let lag = &mut changed.description.accelerometer_lag_s;
                *lag = Some((lag.unwrap_or(0.0) + seconds * value).max(0.0));
            }
            Knob::Parameter {
                name,
                index,
                parameter,
                neutral,
                practical,
                low,
                high,
            } => {
                let change = practical * value;
                if !in_description(&mut changed, name, parameter, change) {
                    let number = (neutral + change).clamp(*low, *high);
                    add(&mut changed.effects, name, *index, parameter, number, *neutral);
                }
            }
        }
    }
    changed
}

/// Changes a number of the description; false when the description has none for this.
fn in_description(hypothesis: &mut Hypothesis, name: &str, parameter: &str, change: f64) -> bool {
    let description = &mut hypothesis.description;
    let motor = description.motor.as_mut();
    match (name, parameter) {
        ("coulomb_friction", _) => {
            if let Some(motor) = motor {
                motor.coulomb_n_m = (motor.coulomb_n_m + change).max(0.0);
            }
        }
        ("viscous_friction", _) => {
            if let Some(motor) = motor {
                motor.viscous_n_m_s = (motor.viscous_n_m_s + change).max(0.0);
            }
        }
        ("payload", "mass") => description.mass_kg = (description.mass_kg + change).max(0.2 * description.mass_kg),
        ("payload", _) => {
            description.yaw_inertia_kg_m2 =
                (description.yaw_inertia_kg_m2 + change).max(0.2 * description.yaw_inertia_kg_m2);
        }
        ("steering_lag", _) => {
            if let Some(steering) = &mut description.steering {
                steering.lag_s = (steering.lag_s + change).max(0.001);
            }
        }
        // The practical size of the friction is a tenth less.
        ("floor_friction", _) => description.floor_friction *= (1.0 + change).max(0.2),
        _ => return false,
    }
    true
}

fn add(effects: &mut Vec<Effect>, name: &str, index: Option<usize>, parameter: &str, number: f64, neutral: f64) {
    let existing = effects
        .iter_mut()
        .find(|effect| effect.name == name && effect.index == index);
    match existing {
        Some(effect) => {
            let sum = effect.value(parameter) + number - neutral;
            effect.parameters.insert(parameter.to_owned(), Some(sum));
        }
        None => {
            let mut effect = Effect::new(name, &[(parameter, number)]);
            effect.index = index;
            effects.push(effect);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the end of what is possible a turn outwards changes nothing, and would be taken for no sensitivity.
    #[test]
    fn knobs_are_turned_away_from_their_ends() {
        let tail = Knob::Tread(TreadKnob::Tail);
        assert_eq!((tail.step(0.0), tail.step(2.0), tail.step(4.0)), (1.0, 1.0, -1.0));
        let lag = Knob::AccelerometerLag(ACCELEROMETER_LAG_S);
        assert_eq!((lag.step(0.0), lag.step(LONGEST_FILTER)), (1.0, -1.0));
    }

    #[test]
    fn filters_are_turned_in_the_description() {
        let robot = twin::golden::reference_robot("rwd");
        let nominal = Hypothesis::nominal(&robot);
        let knobs = [Knob::SteeringFilter(0.02), Knob::AccelerometerLag(0.005)];
        let turned = realised(&nominal, &knobs, &[1.5, 2.0]).description;
        let filter_s = turned.steering.and_then(|steering| steering.filter_s);
        assert!(filter_s.is_some_and(|filter_s| (filter_s - 0.03).abs() < 1e-12));
        assert!(
            turned
                .accelerometer_lag_s
                .is_some_and(|lag_s| (lag_s - 0.01).abs() < 1e-12)
        );
        assert_eq!(realised(&nominal, &knobs, &[0.0, 0.0]), nominal);
    }
}
