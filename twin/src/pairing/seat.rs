//! Is the connector plugged in all the way, and is it the chassis it should be?
//!
//! A blanked corner keeps the plug from turning. Pins 36 and 38, at the far end from the battery, are shorter than
//! the others and joined in the chassis' plug: the loop closes last and opens first, so power stages stay off
//! unless every other pin has contact. A resistor in the plug from pin 37 to battery negative says which chassis it
//! is. Resistances and pin lengths are this project's choice.

/// Share of the nominal key resistance that a reading may be off.
const KEY_TOLERANCE: f64 = 0.15;

/// Chassis and their key resistances, ohm.
pub const KEYS: [(&str, f64); 6] = [
    ("omni4", 1_000.0),
    ("diff2", 2_200.0),
    ("diff4", 4_700.0),
    ("fwd", 10_000.0),
    ("rwd", 22_000.0),
    ("awd", 47_000.0),
];

/// What the controller reads before it switches the power stages on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeatReading {
    /// Pin 36 is joined to pin 38.
    pub loop_closed: bool,
    /// Between pin 37 and battery negative.
    pub key_resistance_ohm: f64,
}

/// Why the power stages stay off.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SeatProblem {
    #[error(
        "connector: not seated, the loop of pins 36 and 38 is open (limit: closed; push the plug in until it locks)"
    )]
    NotSeated,
    #[error("connector: the chassis is {found}, not {expected} (limit: {expected}; plug in another chassis)")]
    WrongChassis { expected: String, found: &'static str },
    #[error(
        "connector: no chassis has a key of {resistance_ohm} ohm (limit: within 15 % of a chassis' key; check pin 37)"
    )]
    UnknownKey { resistance_ohm: f64 },
}

/// Checks a reading against the chassis of the description.
pub fn check_seat(chassis: &str, reading: SeatReading) -> Result<(), SeatProblem> {
    if !reading.loop_closed {
        return Err(SeatProblem::NotSeated);
    }
    let resistance_ohm = reading.key_resistance_ohm;
    let near = |nominal_ohm: f64| (resistance_ohm - nominal_ohm).abs() <= KEY_TOLERANCE * nominal_ohm;
    match KEYS.iter().find(|(_, nominal_ohm)| near(*nominal_ohm)) {
        None => Err(SeatProblem::UnknownKey { resistance_ohm }),
        Some((found, _)) if *found == chassis => Ok(()),
        Some((found, _)) => Err(SeatProblem::WrongChassis {
            expected: chassis.to_owned(),
            found,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::CHASSIS;

    fn seated(key_resistance_ohm: f64) -> SeatReading {
        SeatReading {
            loop_closed: true,
            key_resistance_ohm,
        }
    }

    #[test]
    fn every_chassis_is_told_from_every_other() {
        assert_eq!(KEYS.map(|(chassis, _)| chassis), CHASSIS);
        for (chassis, nominal_ohm) in KEYS {
            for (other, _) in KEYS {
                for factor in [0.86, 1.0, 1.14] {
                    let found = check_seat(other, seated(factor * nominal_ohm));
                    assert_eq!(found.is_ok(), other == chassis, "{other} {found:?}");
                }
            }
        }
    }

    #[test]
    fn an_open_loop_or_key_keeps_the_power_off() {
        let open = SeatReading {
            loop_closed: false,
            ..seated(1_000.0)
        };
        assert_eq!(check_seat("omni4", open), Err(SeatProblem::NotSeated));
        for resistance_ohm in [0.0, -1.0, 1_500.0, f64::INFINITY, f64::NAN] {
            let problem = check_seat("omni4", seated(resistance_ohm)).unwrap_err();
            assert!(matches!(problem, SeatProblem::UnknownKey { .. }), "{problem}");
        }
    }
}
