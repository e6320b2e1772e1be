use control::interaction::Settings;
use drills::abc::course::{Course, Setting};
use drills::abc::drive::{Correction, ideal, on_plant, on_twin};
use emulator::hidden::*;
use twin::robot::Robot;
fn main() {
    let chassis: Vec<String> = std::env::args().skip(1).collect();
    for chassis in &chassis {
        for speed in [0.4, 0.7] {
            let setting = Setting { speed_m_per_s: speed, distance_gain_per_s: 1.5, integral_gain_per_s2: 0.2, derivative_gain: 0.1, yaw_gain_per_s: 3.0, start_yaw_rad: 0.0 };
            let t = on_twin(chassis, Course::L, &setting).unwrap();
            println!("{chassis} {speed}: twin {:.2} mm max {:.1} in {:.1} s fin {}", 1e3*t.rms_m, 1e3*t.largest_m, t.seconds, t.finished);
            let (t, poses) = ideal(chassis, Course::L, &setting).unwrap();
            println!("{chassis} {speed}: ideal {:.2} mm max {:.1} in {:.1} s fin {}", 1e3*t.rms_m, 1e3*t.largest_m, t.seconds, t.finished);
            if std::env::var("TRACE").is_ok() { for p in poses.iter().step_by(30) { println!("   {:.3} {:.3} {:.3}", p[0], p[1], p[2]); } }
            let scene = Course::L.scene(chassis, &setting).unwrap();
            let scenario = scene.scenario().unwrap();
            let robot: Robot = control::team::robots(&scenario).unwrap().remove(0);
            let mut hard = Hidden::neutral();
            hard.floors.insert("lab-floor".into(), HiddenFloor { friction_scale: 0.5, rolling_resistance: 0.02, ..HiddenFloor::default() });
            hard.robots.insert(robot.name().to_owned(), HiddenRobot { mass_scale: 1.3, yaw_inertia_scale: 1.3, com_x_m: 0.01, com_y_m: 0.01, wheel_radius_scale: vec![1.02, 0.98, 1.01, 0.99], torque_constant_scale: vec![0.7, 1.0, 1.0, 1.0], coulomb_scale: 3.0, half_backlash_rad: 0.01, wear: Wear { steering_offset_rad: 0.04, steering_lag_s: 0.03, ..Wear::default() }, ..HiddenRobot::default() });
            for (name, hidden) in [("neutral", Hidden::neutral()), ("hard", hard)] {
                let go = |what: &str, correction: Correction| {
                    let clock = std::time::Instant::now();
                    let f = on_plant(chassis, Course::L, &setting, &hidden, 3, &correction).unwrap().figures;
                    println!("  {name:<8} {what:<12} rms {:.2} mm max {:.1} in {:.1} s fin {} corrected {:.2} cpu {:.2}", 1e3*f.rms_m, 1e3*f.largest_m, f.seconds, f.finished, f.corrected, clock.elapsed().as_secs_f64());
                };
                go("plain", Correction::Plain);
                go("ahead", Correction::LookAhead);
                go("usual", Correction::Usual);
                go("model+bias", Correction::Model(Box::new(robot.clone()), Settings::default()));
                go("model", Correction::Model(Box::new(robot.clone()), Settings { learns_bias: false, ..Settings::default() }));
            }
        }
    }
}
