//! UTIAS MRCLAM 6: iRobot Create, velocity set-points and Vicon.

use super::npz::read;
use super::{Rows, folder};
use identify::diagnose::Run;

pub const ROBOT: &str = include_str!("create.json");

/// `count` runs of `length_s` of a robot, one after the other from `from_s` on.
pub fn runs(robot: usize, from_s: f64, length_s: f64, count: usize) -> Option<Vec<Run>> {
    let path = folder("mrclam6")?.join(format!("robot{robot}.npz"));
    let [tc, v, w, tg, x, y, yaw] =
        ["t_cmd", "v_cmd", "w_cmd", "t_gt", "x", "y", "yaw"].map(|name| read(&path, name).values);
    let names = [
        "command_forward_m_per_s",
        "command_yaw_rate_rad_per_s",
        "pose_x_m",
        "pose_y_m",
        "pose_yaw_rad",
    ];
    let part = |number: usize| {
        let begin_s = from_s + number as f64 * length_s;
        let inside = |t: f64| t >= begin_s && t < begin_s + length_s;
        let mut rows = Rows::new(&names);
        let mut before = (f64::NAN, f64::NAN);
        for k in (0..tc.len()).filter(|k| inside(tc[*k])) {
            // Set-points hold: only changes are needed.
            if (v[k], w[k]) != before {
                before = (v[k], w[k]);
                rows.push(tc[k], vec![Some(v[k]), Some(w[k]), None, None, None]);
            }
        }
        for k in (0..tg.len()).filter(|k| inside(tg[*k])) {
            rows.push(tg[k], vec![None, None, Some(x[k]), Some(y[k]), Some(yaw[k])]);
        }
        rows.bundle(&format!("mrclam6/robot{robot}/{number}"), ROBOT)
    };
    Some((0..count).map(part).collect())
}
