//! The unified 38-pin connector between chassis and controller.
//!
//! | pins | for |
//! |---|---|
//! | 1, 2 | battery, positive |
//! | 3, 4 | battery, negative |
//! | 5..=32 | four motors, 7 pins each, in the order of the driven wheels |
//! | 33..=35 | steering gear |
//! | 36..=38 | spare; the detection of [`super::seat`] uses them |
//!
//! Places are fixed, so a pin has the same meaning on every chassis; a chassis leaves the places it lacks open.
//! The counts 38 = 4 + 31 + 3, 7 and 3 are the design's; the order is this project's.

use serde::Serialize;

use crate::robot::RobotDescription;

pub const PIN_COUNT: u64 = 38;
pub const BATTERY_PINS: u64 = 4;
pub const ACTUATOR_PINS: u64 = 31;
pub const SPARE_PINS: u64 = 3;
/// 3 for power, 4 for feedback.
pub const MOTOR_PINS: u64 = MOTOR_LINES.len() as u64;
/// 2 for power, 1 for feedback.
pub const STEERING_GEAR_PINS: u64 = STEERING_GEAR_LINES.len() as u64;

const FIRST_ACTUATOR_PIN: u8 = 5;
const FIRST_STEERING_GEAR_PIN: u8 = 33;
const MOTOR_PLACES: usize = 4;
const MOTOR_LINES: [Line; 7] = [
    Line::PhaseU,
    Line::PhaseV,
    Line::PhaseW,
    Line::EncoderA,
    Line::EncoderB,
    Line::FeedbackSupply,
    Line::FeedbackGround,
];
const STEERING_GEAR_LINES: [Line; 3] = [Line::GearPositive, Line::GearNegative, Line::GearAngle];

/// What a pin carries.
///
/// The power stages, which also measure the current and commutate, stand on the controller's side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Line {
    PhaseU,
    PhaseV,
    PhaseW,
    EncoderA,
    EncoderB,
    FeedbackSupply,
    FeedbackGround,
    GearPositive,
    GearNegative,
    /// Analogue, relative to the gear's supply.
    GearAngle,
}

/// Something that moves the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Actuator {
    /// `wheel` counts in the description's `wheels`, from 0.
    Motor {
        wheel: usize,
    },
    SteeringGear,
}

/// One occupied pin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Pin {
    /// 5..=35.
    pub number: u8,
    pub actuator: Actuator,
    pub line: Line,
}

/// The occupied actuator pins, by number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PinAssignment {
    pub pins: Vec<Pin>,
}

impl Actuator {
    pub fn pin_count(self) -> u64 {
        match self {
            Actuator::Motor { .. } => MOTOR_PINS,
            Actuator::SteeringGear => STEERING_GEAR_PINS,
        }
    }

    /// `motor of wheels[2]` or `steering gear`.
    pub fn name(self) -> String {
        match self {
            Actuator::Motor { wheel } => format!("motor of wheels[{wheel}]"),
            Actuator::SteeringGear => "steering gear".to_owned(),
        }
    }
}

/// A motor for every driven wheel, in the order of `wheels`; one steering gear if any wheel is steered.
pub fn actuators(robot: &RobotDescription) -> Vec<Actuator> {
    let driven = robot.wheels.iter().enumerate().filter(|(_, wheel)| wheel.driven);
    let mut actuators: Vec<Actuator> = driven.map(|(wheel, _)| Actuator::Motor { wheel }).collect();
    if robot.wheels.iter().any(|wheel| wheel.steered) {
        actuators.push(Actuator::SteeringGear);
    }
    actuators
}

/// Places actuators on the connector; `None` if they need more pins than it has for them.
pub fn assign(actuators: &[Actuator]) -> Option<PinAssignment> {
    let mut pins = Vec::new();
    let mut motors = 0;
    let mut gears = 0;
    for &actuator in actuators {
        let (first, lines): (u8, &[Line]) = match actuator {
            Actuator::Motor { .. } => {
                motors += 1;
                let place = u8::try_from(motors - 1).ok().filter(|_| motors <= MOTOR_PLACES)?;
                (FIRST_ACTUATOR_PIN + place * MOTOR_LINES.len() as u8, &MOTOR_LINES)
            }
            Actuator::SteeringGear => {
                gears += 1;
                (
                    Some(FIRST_STEERING_GEAR_PIN).filter(|_| gears == 1)?,
                    &STEERING_GEAR_LINES,
                )
            }
        };
        let numbered = (first..).zip(lines);
        pins.extend(numbered.map(|(number, &line)| Pin { number, actuator, line }));
    }
    Some(PinAssignment { pins })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motors(count: usize) -> Vec<Actuator> {
        (0..count).map(|wheel| Actuator::Motor { wheel }).collect()
    }

    #[test]
    fn the_pins_add_up() {
        assert_eq!(BATTERY_PINS + ACTUATOR_PINS + SPARE_PINS, PIN_COUNT);
        assert_eq!((MOTOR_PINS, STEERING_GEAR_PINS), (7, 3));
    }

    #[test]
    fn four_motors_and_a_gear_fill_the_connector() {
        let mut all = motors(4);
        all.push(Actuator::SteeringGear);
        let assignment = assign(&all).unwrap();
        let numbers: Vec<u8> = assignment.pins.iter().map(|pin| pin.number).collect();
        assert_eq!(numbers, (5..=35).collect::<Vec<u8>>());
        assert_eq!(numbers.len() as u64, ACTUATOR_PINS);
    }

    #[test]
    fn what_does_not_fit_is_not_placed() {
        assert_eq!(assign(&motors(5)), None);
        assert_eq!(assign(&[Actuator::SteeringGear, Actuator::SteeringGear]), None);
    }
}
