//! Laws that are parts of one curve: what one of them leaves where the curve has another shape looks like the others.

/// Share of what a part of a curve explains that another part of it has to explain besides. Real curves are off their laws by that much.
const CURVE_REST: f64 = 0.1;
/// Torque over speed of a drive; force over slip of a tyre; time from command to action.
const CURVES: [&[&str]; 3] = [
    &["coulomb_friction", "viscous_friction", "stribeck_friction"],
    &[
        "floor_friction",
        "low_friction_patch",
        "longitudinal_slip",
        "lateral_slip",
    ],
    &["command_delay", "motor_lag", "steering_lag"],
];

/// Gain that a candidate needs beside effects that explain `explained` together.
///
/// - `members`: names of these effects.
pub(super) fn bar<'a>(candidate: &str, members: impl Iterator<Item = &'a str>, explained: f64) -> f64 {
    let mut members = members;
    let is_part = |other: &str| {
        other != candidate
            && CURVES
                .iter()
                .any(|curve| curve.contains(&candidate) && curve.contains(&other))
    };
    if members.any(is_part) {
        CURVE_REST * explained
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_curve_need_a_share_of_what_the_first_explains() {
        let of = |candidate, members: &[&'static str]| bar(candidate, members.iter().copied(), 1000.0);
        assert!((of("stribeck_friction", &["payload", "coulomb_friction"]) - 100.0).abs() < 1e-9);
        assert!(of("stribeck_friction", &["payload", "floor_friction"]) < 1e-9);
        assert!(of("coulomb_friction", &["coulomb_friction"]) < 1e-9, "another wheel's");
        assert!(of("payload", &["coulomb_friction"]) < 1e-9);
    }

    #[test]
    fn parts_of_curves_are_effects_of_the_library() {
        for name in CURVES.into_iter().flatten() {
            assert!(twin::effect::library::find(name).is_some(), "{name}");
        }
    }
}
