//! Laws that are parts of one curve: what one of them leaves where the curve has another shape looks like the others.

/// Share of what a part of a curve explains that another part of it has to explain besides. Real curves are off their laws by that much.
const CURVE_REST: f64 = 0.1;
/// Torque over speed of a drive; how wheels stop and start; force over slip of a tyre; time from command to action.
const CURVES: [&[&str]; 4] = [
    &["coulomb_friction", "viscous_friction", "stribeck_friction"],
    &["command_dead_band", "stribeck_friction"],
    &[
        "floor_friction",
        "low_friction_patch",
        "longitudinal_slip",
        "lateral_slip",
    ],
    &["command_delay", "motor_lag", "steering_lag"],
];

/// Share of what named effects explain that a candidate has to explain besides.
///
/// - `members`: names of these effects.
pub(super) fn share<'a>(candidate: &str, members: impl Iterator<Item = &'a str>) -> f64 {
    let mut members = members;
    let is_part = |other: &str| {
        other != candidate
            && CURVES
                .iter()
                .any(|curve| curve.contains(&candidate) && curve.contains(&other))
    };
    if members.any(is_part) { CURVE_REST } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_curve_need_a_share_of_what_the_first_explains() {
        let of = |candidate, members: &[&'static str]| share(candidate, members.iter().copied());
        assert!((of("stribeck_friction", &["payload", "coulomb_friction"]) - CURVE_REST).abs() < 1e-9);
        assert_eq!(of("stribeck_friction", &["payload", "floor_friction"]), 0.0);
        assert!((of("stribeck_friction", &["command_dead_band"]) - CURVE_REST).abs() < 1e-9);
        assert_eq!(of("coulomb_friction", &["command_dead_band"]), 0.0);
        assert_eq!(of("coulomb_friction", &["coulomb_friction"]), 0.0, "another wheel's");
        assert_eq!(of("payload", &["coulomb_friction"]), 0.0);
    }

    #[test]
    fn parts_of_curves_are_effects_of_the_library() {
        for name in CURVES.into_iter().flatten() {
            assert!(twin::effect::library::find(name).is_some(), "{name}");
        }
    }
}
