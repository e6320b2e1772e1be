//! DRIVE Husky: steps of constant set-points, three windows of 2 s each at 20 Hz, lidar poses relative to each window.

use super::npz::read;
use super::{Rows, folder};
use identify::diagnose::Run;

pub const ROBOT: &str = include_str!("husky.json");
pub const SLIP_FREE: &str = include_str!("husky-slip-free.json");
const DT_S: f64 = 0.05;
const SAMPLES: usize = 40;
/// Wheels slower than this stand, rad/s.
const STANDS_RAD_PER_S: f64 = 0.05;
/// Wheel speeds of neighbouring samples differ by less than this, rad/s.
const CONTINUOUS_RAD_PER_S: f64 = 1.2;

/// All steps in `count` runs. Steps that follow each other without a stop share their time; before a step that starts from
/// rest the set-points are 0 and one second passes.
///
/// - `wheels`: true for those on the left.
/// - `most`: steps of a run.
/// - `poses`: with the lidar's poses; without them only the wheels are compared.
pub fn runs(robot: &str, wheels: &[bool], count: usize, most: usize, poses: bool) -> Option<Vec<Run>> {
    let path = folder("norlab_drive")?.join("husky.npz");
    let [cl, cr, wl, wr, px, py, pt] = [
        "cmd_left",
        "cmd_right",
        "left_wheel_vel",
        "right_wheel_vel",
        "icp_x",
        "icp_y",
        "icp_yaw",
    ]
    .map(|name| read(&path, name).values);
    let windows = cl.len() / SAMPLES;
    let mut names: Vec<String> = Vec::new();
    for (k, _) in wheels.iter().enumerate() {
        names.push(format!("command_wheel_{k}_rad_per_s"));
        names.push(format!("wheel_{k}_rad_per_s"));
    }
    names.extend(["pose_x_m", "pose_y_m", "pose_yaw_rad"].map(str::to_owned));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let steps = windows / 3;
    let mut out = Vec::new();
    for number in 0..count {
        let mut rows = Rows::new(&names);
        let mut time_s = 0.0;
        let mut pose = [0.0_f64; 3];
        let begin = number * steps / count;
        let end = ((number + 1) * steps / count).min(begin + most);
        for step in begin..end {
            let first = step * 3 * SAMPLES;
            let stands = wl[first].abs() < STANDS_RAD_PER_S && wr[first].abs() < STANDS_RAD_PER_S;
            let follows = step > begin
                && (wl[first] - wl[first - 1]).abs() < CONTINUOUS_RAD_PER_S
                && (wr[first] - wr[first - 1]).abs() < CONTINUOUS_RAD_PER_S;
            if stands || !follows {
                time_s += 1.0;
                if stands {
                    let mut values = vec![None; names.len()];
                    for k in 0..wheels.len() {
                        values[2 * k] = Some(0.0);
                    }
                    rows.push(time_s, values);
                }
                time_s += 1.0;
            }
            for window in 0..3 {
                let base = pose;
                for sample in 0..SAMPLES {
                    let at = first + window * SAMPLES + sample;
                    let (sin, cos) = libm::sincos(base[2]);
                    pose = [
                        base[0] + cos * px[at] - sin * py[at],
                        base[1] + sin * px[at] + cos * py[at],
                        base[2] + pt[at],
                    ];
                    let mut values = vec![None; names.len()];
                    for (k, left) in wheels.iter().enumerate() {
                        values[2 * k] = Some(if *left { cl[at] } else { cr[at] });
                        values[2 * k + 1] = Some(if *left { wl[at] } else { wr[at] });
                    }
                    let end = names.len();
                    let told = [pose[0], pose[1], twin::pose::wrapped_rad(pose[2])];
                    for (slot, value) in values[end - 3..].iter_mut().zip(told) {
                        *slot = Some(value).filter(|_| poses);
                    }
                    rows.push(time_s, values);
                    time_s += DT_S;
                }
                // The next window starts one sample later: on with the motion of the last half second.
                let last = first + (window + 1) * SAMPLES - 1;
                let drift = |line: &[f64]| (line[last] - line[last - 10]) / 10.0;
                let (sin, cos) = libm::sincos(base[2]);
                let (dx, dy) = (drift(&px), drift(&py));
                pose = [
                    pose[0] + cos * dx - sin * dy,
                    pose[1] + sin * dx + cos * dy,
                    pose[2] + drift(&pt),
                ];
            }
        }
        out.push(rows.bundle(&format!("husky/{number}"), robot));
    }
    Some(out)
}
