//! Sizes of candidates as the library states them.

use identify::hypothesis::{Candidate, Excitation, candidates};
use twin::golden::reference_robot;
use twin::robot::RobotDescription;

fn of(chassis: &str) -> (RobotDescription, Vec<Candidate>) {
    let robot = reference_robot(chassis);
    let driven = Excitation {
        wheel_rad_per_s: 20.0,
        twist: [0.8, 0.6, 2.0],
        extent_m: [-1.0, 1.0, -1.0, 1.0],
    };
    let found = candidates(&robot, &driven);
    (robot, found)
}

fn named<'a>(all: &'a [Candidate], name: &str) -> &'a Candidate {
    all.iter()
        .find(|candidate| candidate.entry.name == name)
        .unwrap_or_else(|| panic!("{name} is no candidate"))
}

#[test]
fn large_sizes_are_those_of_the_library_in_practical_sizes() {
    let (robot, all) = of("omni4");
    // 0.2 % to 3 % of the radius.
    assert!((named(&all, "wheel_radius_one").large_size(&robot) - 15.0).abs() < 1e-9);
    for candidate in &all {
        let large = candidate.large_size(&robot);
        let has_size = candidate
            .axes
            .iter()
            .any(|axis| axis.carries_size && axis.neutral.is_finite());
        assert!(large >= 1.0, "{}: {large}", candidate.label());
        assert_eq!(large.is_finite(), has_size, "{}: {large}", candidate.label());
    }
    assert_eq!(named(&all, "wheel_speed_saturation").large_size(&robot), f64::INFINITY);
}

#[test]
fn the_choice_of_a_wheel_is_a_choice() {
    let (_, all) = of("omni4");
    assert_eq!(named(&all, "wheel_radius").choices(&[0.01]), 1);
    assert_eq!(named(&all, "wheel_radius_one").choices(&[0.01]), 2);
    let limits = named(&all, "body_speed_saturation");
    assert_eq!(limits.choices(&[0.5, f64::INFINITY, f64::INFINITY]), 1);
    assert_eq!(limits.choices(&[0.5, f64::INFINITY, 1.0]), 2);
}
