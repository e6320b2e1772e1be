//! DART's throttle steps: what is left of them are coast-downs, on-board speed at 10 Hz.

use super::csv_table::Table;
use super::{Rows, dart, folder};
use identify::diagnose::Run;

/// Fastest sample that counts as standing, m/s, and shortest coast-down, samples.
const SLOW_M_PER_S: f64 = 0.25;
const SHORTEST: usize = 17;
/// Samples after the throttle has closed in which the motor still works against its own current.
const CLOSING: usize = 2;
pub const RADIUS_M: f64 = 0.033;
pub const MASS_KG: f64 = 1.58;

/// The car with motors that push nothing: friction is all there is. Wheels are light, their inertia is in the mass.
pub fn robot() -> String {
    let motor = "\"motor\": {\"gear_ratio\": 1.0, \"torque_constant_n_m_per_a\": 0.01, \"resistance_ohm\": 1.0, \"current_limit_a\": 0.001, \"supply_v\": 7.4, \"viscous_n_m_s\": 0.0, \"coulomb_n_m\": 0.0, \"speed_loop_kp_v_s_per_rad\": 0.01, \"speed_loop_ki_v_per_rad\": 0.01}, \"steering\"";
    dart::ROBOT
        .replace("1e-05", "1e-06")
        .replace("\"wheel_rad_per_s\": 1.0", "\"wheel_rad_per_s\": 1.5")
        .replacen("\"steering\"", motor, 1)
}

/// One run a coast-down.
pub fn runs() -> Option<Vec<Run>> {
    let table = Table::read(&folder("dart_car")?.join("step_inputs_onboard_10Hz.csv"));
    let names = table.text("run");
    let [t, throttle, safety, speed] = ["t", "throttle", "safety", "v_enc"].map(|name| table.column(name));
    let coasts = |k: usize| throttle[k] * safety[k] <= 0.01 && speed[k] > SLOW_M_PER_S;
    let columns: Vec<String> = (0..4)
        .flat_map(|k| [format!("command_wheel_{k}_rad_per_s"), format!("wheel_{k}_rad_per_s")])
        .collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let robot = robot();
    let mut runs = Vec::new();
    let mut from = 0;
    while from < t.len() {
        let to = (from..t.len())
            .find(|k| !coasts(*k) || names[*k] != names[from])
            .unwrap_or(t.len());
        if to - from >= SHORTEST {
            let mut rows = Rows::new(&columns);
            for k in from + CLOSING..to {
                let wheel = Some(speed[k] / RADIUS_M);
                rows.push(t[k], [Some(0.0), wheel].repeat(4));
            }
            runs.push(rows.bundle(&format!("coast/{}", names[from]), &robot));
        }
        from = to.max(from + 1);
    }
    Some(runs)
}
