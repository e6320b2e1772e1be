//! What the laboratory measured of a run, as a bundle: the columns of its archive, through the public reader.

use super::drive::Driven;
use anyhow::{Result, anyhow};
use identify::bundle::Bundle;
use identify::diagnose::Run;
use lab::record::Record;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write;
use twin::robot::RobotDescription;

/// Cells of a moment, by column.
type Row = BTreeMap<usize, f64>;

struct Table {
    names: Vec<String>,
    rows: BTreeMap<i64, Row>,
}

impl Table {
    fn set(&mut self, at_us: i64, name: &str, value: f64) {
        let column = self.names.iter().position(|known| known == name);
        let column = column.unwrap_or_else(|| {
            self.names.push(name.to_owned());
            self.names.len() - 1
        });
        if at_us >= 0 && value.is_finite() {
            self.rows.entry(at_us).or_default().insert(column, value);
        }
    }

    fn csv(&self) -> Result<String> {
        let mut text = format!("time_s,{}\n", self.names.join(","));
        for (at_us, row) in &self.rows {
            write!(text, "{:.6}", *at_us as f64 * 1e-6)?;
            for column in 0..self.names.len() {
                match row.get(&column) {
                    Some(value) => write!(text, ",{value}")?,
                    None => text.push(','),
                }
            }
            text.push('\n');
        }
        Ok(text)
    }
}

/// The run as a bundle.
///
/// - `label`: names it in reports, as a path would.
/// - Errors: what the reader refuses.
pub fn run(description: &RobotDescription, driven: &Driven, label: &str, reference: bool) -> Result<Run> {
    let wheels: Vec<usize> = (0..description.wheels.len())
        .filter(|wheel| description.wheels.get(*wheel).is_some_and(|wheel| wheel.driven))
        .collect();
    let mut table = Table {
        names: Vec::new(),
        rows: BTreeMap::new(),
    };
    let begin_us = driven.begin_us;
    let steered = description.steering.is_some();
    for record in &driven.records {
        match record {
            Record::Command(command) => {
                let at_us = command.sent_us - begin_us;
                for (wheel, speed) in wheels.iter().zip(command.wheel_rad_per_s) {
                    table.set(at_us, &format!("command_wheel_{wheel}_rad_per_s"), speed);
                }
                if steered {
                    table.set(at_us, "command_steering_rad", command.steering_rad);
                }
            }
            Record::Pose(pose) if pose.accepted => {
                let at_us = pose.exposure_us - begin_us;
                table.set(at_us, "pose_x_m", pose.x_m);
                table.set(at_us, "pose_y_m", pose.y_m);
                table.set(at_us, "pose_yaw_rad", pose.yaw_rad);
            }
            Record::Telemetry(heard) => {
                let at_us = heard.sample_us - begin_us;
                for (place, wheel) in wheels.iter().enumerate() {
                    let of = |values: &[f64]| values.get(place).copied().unwrap_or(f64::NAN);
                    table.set(at_us, &format!("wheel_{wheel}_rad_per_s"), of(&heard.wheel_rad_per_s));
                    table.set(at_us, &format!("wheel_{wheel}_rad"), of(&heard.wheel_rad));
                    table.set(at_us, &format!("current_{wheel}_a"), of(&heard.current_a));
                }
                table.set(at_us, "bus_v", heard.bus_v);
                table.set(at_us, "gyro_z_rad_per_s", heard.gyro_z_rad_per_s);
                table.set(at_us, "accel_x_m_per_s2", heard.accel_m_per_s2[0]);
                table.set(at_us, "accel_y_m_per_s2", heard.accel_m_per_s2[1]);
                if steered {
                    table.set(at_us, "steering_rad", heard.steering_rad);
                }
            }
            _ => {}
        }
    }
    let document = json!({
        "format": "robopheus.run/1", "robot": description, "floor": "lab-floor", "label": label,
        "started": "2026-01-01T00:00:00Z", "change_free_reference": reference, "stamp": "sample",
    });
    let bundle =
        Bundle::parse(&document.to_string(), table.csv()?.as_bytes()).map_err(|error| anyhow!("{label}: {error}"))?;
    Ok(Run {
        path: label.to_owned(),
        sha256: String::new(),
        bundle,
    })
}
