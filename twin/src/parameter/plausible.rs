//! Descriptions whose numbers are each in range and together impossible.

use super::table;
use super::{ParameterError, problem};
use crate::robot::RobotDescription;

/// Two contact points nearer than this are one spot, m.
const SPOT_M: f64 = 1e-3;
/// Mass may lie this many bounding radii of the wheels from the origin.
const OVERHANG: f64 = 2.0;
/// Nothing is denser (osmium), kg/m^3.
const DENSEST_KG_PER_M3: f64 = 22_600.0;

/// Only looks at what is in range by itself.
pub(super) fn check(problems: &mut Vec<ParameterError>, robot: &RobotDescription) {
    let mut wheels = robot.wheels.iter();
    let placed = wheels.all(|wheel| table::WHEEL_X.allows(wheel.x_m) && table::WHEEL_Y.allows(wheel.y_m));
    if !placed || robot.wheels.is_empty() {
        return;
    }
    check_spots(problems, robot);
    check_inertia(problems, robot);
}

fn check_spots(problems: &mut Vec<ParameterError>, robot: &RobotDescription) {
    for (i, wheel) in robot.wheels.iter().enumerate() {
        let same = robot.wheels[..i].iter().position(|before| {
            let (dx, dy) = (before.x_m - wheel.x_m, before.y_m - wheel.y_m);
            // Two casters may be one with two wheels.
            let casters = before.kind == "caster" && wheel.kind == "caster";
            !casters && dx * dx + dy * dy < SPOT_M * SPOT_M
        });
        if let Some(same) = same {
            problems.push(problem(
                format!("wheels[{i}]"),
                format!("stands at ({}, {}) m like wheels[{same}]", wheel.x_m, wheel.y_m),
                format!("contact points at least {SPOT_M} m apart"),
                "correct x_m and y_m of one of them",
            ));
        }
    }
}

/// No mass distribution has an inertia outside of these.
///
/// upper: J <= m (2 r_b)^2, all mass on a ring of twice the wheels' bounding radius;
/// lower: a slice of mass dm = l dz has at least l^2 dz / (2 pi rho); of all bodies on the floor with the centre of mass at h
/// the paraboloid, l falling linearly to 0 at 3 h, has least: J >= 2 m^2 / (9 pi rho h).
fn check_inertia(problems: &mut Vec<ParameterError>, robot: &RobotDescription) {
    let (mass_kg, inertia) = (robot.mass_kg, robot.yaw_inertia_kg_m2);
    let reach = robot.wheels.iter().fold(0.0_f64, |reach, wheel| {
        let radius_m = wheel.radius_m.filter(|radius_m| radius_m.is_finite()).unwrap_or(0.0);
        reach.max((wheel.x_m * wheel.x_m + wheel.y_m * wheel.y_m).sqrt() + radius_m)
    });
    let usable = table::MASS.allows(mass_kg)
        && table::YAW_INERTIA.allows(inertia)
        && table::COM_HEIGHT.allows(robot.com_height_m)
        && reach > 0.0;
    if !usable {
        return;
    }
    let most = mass_kg * (OVERHANG * reach) * (OVERHANG * reach);
    // A height of 0 is an idealisation: then the centre of mass may lie as high as the wheels reach out.
    let height_m = robot.com_height_m.max(reach);
    let least = 2.0 * mass_kg * mass_kg / (9.0 * core::f64::consts::PI * DENSEST_KG_PER_M3 * height_m);
    if !(least..=most).contains(&inertia) {
        let why = if inertia > most {
            format!(
                "{inertia} is more than {mass_kg} kg can have {} m around the origin",
                OVERHANG * reach
            )
        } else {
            format!("{inertia} is less than {mass_kg} kg of the densest matter would have")
        };
        problems.push(problem(
            table::YAW_INERTIA.path,
            why,
            format!("{least:.3e}..={most:.3e} kg m2 for this mass and these wheels"),
            table::YAW_INERTIA.remedy,
        ));
    }
}
