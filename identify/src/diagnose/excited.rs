//! What runs did: largest set-points and the floor they covered.

use crate::hypothesis::{Excitation, Hypothesis};
use crate::record::Record;

/// Over all runs, with the geometry of `given`.
pub(super) fn excitation(records: &[Record], given: &Hypothesis) -> Excitation {
    let mut excitation = Excitation {
        extent_m: [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY],
        ..Excitation::default()
    };
    let robot = given.robot();
    for record in records {
        excitation.wheel_rad_per_s = excitation.wheel_rad_per_s.max(record.largest_command_rad_per_s);
        let [x0, x1, y0, y1] = record.extent_m();
        let e = &mut excitation.extent_m;
        *e = [e[0].min(x0), e[1].max(x1), e[2].min(y0), e[3].max(y1)];
        let Some(robot) = &robot else { continue };
        for window in &record.windows {
            let mut held = window.drive.held;
            for row in &window.drive.rows {
                held.apply(robot, row);
                let twist = robot.twist_of_wheels(&held.command());
                let now = [twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s];
                for (largest, value) in excitation.twist.iter_mut().zip(now) {
                    *largest = largest.max(value.abs());
                }
            }
        }
    }
    excitation
}
