//! What the reader takes and what it refuses.

mod support;

use identify::bundle::{Bundle, BundleError};
use identify::channel::Channel;
use support::run_json;

fn parse(csv: &str) -> Result<Bundle, BundleError> {
    Bundle::parse(&run_json(), csv.as_bytes())
}

fn refused(csv: &str) -> String {
    match parse(csv) {
        Ok(_) => panic!("took {csv:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn channels_may_have_different_rates() {
    let csv = "time_s,command_wheel_0_rad_per_s,pose_x_m,gyro_z_rad_per_s\n0.0,1.5,,0.1\n0.01,,0.25,\n0.02,2.5,,0.2\n";
    let Ok(bundle) = parse(csv) else { panic!("refused") };
    assert_eq!(bundle.telemetry.time_s, [0.0, 0.01, 0.02]);
    let Some(command) = bundle.telemetry.series(Channel::CommandWheel(0)) else {
        panic!("no commands")
    };
    assert_eq!(
        (command.rows.as_slice(), command.values.as_slice()),
        (&[0, 2][..], &[1.5, 2.5][..])
    );
    assert_eq!(command.held(1), Some(1.5));
    assert_eq!(bundle.telemetry.series(Channel::PoseY), None);
    let rows = bundle.command_rows();
    assert_eq!(rows[1].wheel_rad_per_s[0], None);
    assert_eq!(rows[2].wheel_rad_per_s[0], Some(2.5));
}

#[test]
fn errors_name_line_and_column() {
    assert_eq!(
        refused("time_s,pose_x_m\n0.0,1\n0.1,abc\n"),
        "telemetry line 3, column \"pose_x_m\": \"abc\" is not a number"
    );
    assert!(refused("time_s,pose_x_m\n0.0,NaN\n").contains("line 2, column \"pose_x_m\": \"NaN\" is not finite"));
    assert_eq!(
        refused("time_s,pose_x_m\n0.0,1\n0.1,1\n0.05,1\n"),
        "telemetry line 4, column \"time_s\": time runs backward: 0.05 s after 0.1 s"
    );
    assert!(
        refused("time_s,pose_x_m\n0.1,1\n0.1,1\n").contains("line 3, column \"time_s\": time stamp 0.1 s stands twice")
    );
    assert!(refused("time_s,pose_x_m\n0.1,1\n0.2\n").contains("line 3: 1 cells where the header has 2"));
    assert!(refused("time_s,pose_x_m\n,1\n").contains("line 2, column \"time_s\": empty"));
    assert!(refused("pose_x_m\n1\n").contains("column \"time_s\": missing"));
    assert!(refused("time_s,pose_x_m,pose_x_m\n0,1,2\n").contains("column \"pose_x_m\": stands twice"));
    assert!(refused("time_s,pose_x_m\n").contains("no rows"));
    assert!(matches!(
        Bundle::parse(&run_json(), b"time_s,bus_v\n0,1\n1,\xff\n"),
        Err(BundleError::Row { line: 3, .. })
    ));
}

#[test]
fn wheels_must_exist_and_be_driven() {
    assert!(refused("time_s,wheel_5_rad\n0,1\n").contains("the robot has 4 wheels"));
    assert!(refused("time_s,command_wheel_2_rad_per_s\n0,1\n").contains("wheel 2 is not driven"));
}

#[test]
fn degrees_are_refused() {
    assert!(
        refused("time_s,pose_yaw_rad\n0.0,1.0\n0.1,92.5\n").contains("line 3, column \"pose_yaw_rad\": 92.5 is beyond")
    );
    assert!(refused("time_s,command_steering_rad\n0.0,20\n").contains("degrees"));
    let mut csv = "time_s,pose_yaw_rad,gyro_z_rad_per_s\n".to_owned();
    for step in 0..100 {
        let yaw = -1.5 + 0.03 * f64::from(step);
        csv.push_str(&format!("{},{yaw},{}\n", 0.1 * f64::from(step), 0.3_f64.to_degrees()));
    }
    assert!(refused(&csv).contains("column \"gyro_z_rad_per_s\": turns 57 times"));
    assert!(parse(&csv.replace(&format!(",{}\n", 0.3_f64.to_degrees()), ",0.3\n")).is_ok());
}

#[test]
fn a_tag_that_flips_has_not_turned() {
    let mut csv = "time_s,pose_yaw_rad,gyro_z_rad_per_s\n".to_owned();
    for step in 0..100 {
        // Half a turn and a little: there and back are both less than half a turn the other way.
        let flip = if step % 7 == 3 {
            -core::f64::consts::PI + 0.007
        } else {
            0.0
        };
        let yaw = 0.015 * f64::from(step) + flip;
        csv.push_str(&format!("{},{yaw},0.15\n", 0.1 * f64::from(step)));
    }
    assert!(parse(&csv).is_ok());
}

#[test]
fn odd_channels_are_remarked() {
    let csv = "time_s,command_wheel_0_rad_per_s,bus_v,current_0_a,mood\n0.0,1,24,,x\n0.1,1,24,,y\n3.0,1,24,,z\n";
    let Ok(bundle) = parse(csv) else { panic!("refused") };
    let about = |column: &str| {
        bundle
            .remarks
            .iter()
            .filter(|remark| remark.column == column)
            .map(|remark| remark.message.as_str())
            .collect::<Vec<_>>()
    };
    assert_eq!(about("bus_v"), ["constant at 24 in all 3 samples"]);
    assert_eq!(about("current_0_a"), ["no sample in any row"]);
    assert_eq!(about("mood"), ["not a column of the format; not read"]);
    assert_eq!(about("command_wheel_1_rad_per_s").len(), 1);
    assert_eq!(about("time_s"), ["no rows between 0.1 s and 3 s"]);
    assert!(about("command_wheel_0_rad_per_s").is_empty());
}

/// A robot whose run has ended brakes by a ramp of its own, which a replay of the set-points cannot know.
#[test]
fn rows_in_which_a_robot_comes_to_rest_by_itself_are_left_out() {
    let head = "time_s,command_wheel_0_rad_per_s,wheel_0_rad_per_s,command_seq_sent\n";
    let read = |end: &str| match parse(&format!("{head}0,2,1.9,1\n0.1,2,2,2\n0.2,,1.4,3\n{end},,0,4\n")) {
        Ok(bundle) => bundle,
        Err(error) => panic!("{error}"),
    };
    let told = |bundle: &Bundle| {
        let own = bundle
            .remarks
            .iter()
            .filter(|remark| remark.column == "command_seq_sent");
        own.map(|remark| remark.message.clone()).collect::<Vec<_>>()
    };
    let ended = read("0.3");
    assert_eq!(ended.telemetry.time_s, [0.0, 0.1]);
    assert_eq!(told(&ended), [""; 0], "every run ends so");
    let long = read("9.2");
    assert_eq!(long.telemetry.time_s, [0.0, 0.1]);
    assert!(
        matches!(&told(&long)[..], [one] if one.contains("the last 9.0 s")),
        "{:?}",
        told(&long)
    );
}

#[test]
fn run_documents_are_checked() {
    let csv = b"time_s\n0\n".as_slice();
    let swap = |from: &str, to: &str| match Bundle::parse(&run_json().replacen(from, to, 1), csv) {
        Ok(_) => panic!("took {to}"),
        Err(error) => error.to_string(),
    };
    assert!(swap("robopheus.run/1", "robopheus.run/9").starts_with("run.json format:"));
    assert!(swap("\"mass_kg\":12.0", "\"mass_kg\":-12.0").starts_with("run.json robot.mass_kg: -12 is out of range"));
    assert!(swap("\"floor\"", "\"flor\"").starts_with("run.json line 1, column "));
    assert!(
        swap(
            "\"change_free_reference\":true",
            "\"change_free_reference\":true,\"command_delay_s\":9"
        )
        .contains("command_delay_s")
    );
}

#[test]
fn positions_in_millimetres_are_refused() {
    let mut csv = "time_s,pose_x_m,pose_y_m,pose_yaw_rad\n".to_owned();
    for row in 0..50 {
        csv.push_str(&format!("{},{},0,0\n", f64::from(row) / 100.0, 700 * row));
    }
    let refused = Bundle::parse(&run_json(), csv.as_bytes());
    assert!(
        refused
            .as_ref()
            .is_err_and(|error| error.to_string().contains("millimetres")),
        "{refused:?}"
    );
    // One wild pose is the tracker's, not a unit.
    let mut csv = "time_s,pose_x_m,pose_y_m,pose_yaw_rad\n".to_owned();
    for row in 0..50 {
        let x = if row == 20 { 300.0 } else { 0.005 * f64::from(row) };
        csv.push_str(&format!("{},{x},0,0\n", f64::from(row) / 100.0));
    }
    assert!(Bundle::parse(&run_json(), csv.as_bytes()).is_ok());
}
