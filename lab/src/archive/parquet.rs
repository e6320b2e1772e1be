//! `robots/<name>/telemetry.parquet`: one row per time stamp, empty where a channel has no sample at that time.

use crate::record::{CameraName, Command, Pose, Record, Telemetry};
use api::robot::RobotDescription;
use arrow_array::{ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Rows written at a time.
const BATCH_ROWS: usize = 8192;
/// Records of one moment arrive within this time of each other; older rows are final.
const REORDER_US: i64 = 2_000_000;

/// Columns of one robot and where they stand.
#[derive(Debug, Default)]
struct Layout {
    names: Vec<String>,
    command_wheel: Vec<usize>,
    wheel_speed: Vec<usize>,
    wheel_angle: Vec<usize>,
    current: Vec<usize>,
    steering: Option<[usize; 2]>,
    pose: [usize; 4],
    target: [usize; 2],
    inertial: [usize; 4],
    clocks: [usize; 2],
    sequence: [usize; 2],
}

/// Positions in `wheels` of the driven wheels: the order of the robot link.
pub fn driven_wheels(description: &RobotDescription) -> Vec<usize> {
    description
        .wheels
        .iter()
        .enumerate()
        .filter(|(_, wheel)| wheel.driven)
        .map(|(position, _)| position)
        .collect()
}

impl Layout {
    fn new(description: &RobotDescription) -> Self {
        let mut layout = Self::default();
        let driven = driven_wheels(description);
        layout.command_wheel = driven
            .iter()
            .map(|k| layout.add(format!("command_wheel_{k}_rad_per_s")))
            .collect();
        let has_steering = description.steering.is_some();
        layout.steering = has_steering.then(|| ["command_steering_rad", "steering_rad"].map(|name| layout.add(name)));
        layout.wheel_speed = driven
            .iter()
            .map(|k| layout.add(format!("wheel_{k}_rad_per_s")))
            .collect();
        layout.wheel_angle = driven.iter().map(|k| layout.add(format!("wheel_{k}_rad"))).collect();
        layout.current = driven.iter().map(|k| layout.add(format!("current_{k}_a"))).collect();
        layout.inertial =
            ["bus_v", "gyro_z_rad_per_s", "accel_x_m_per_s2", "accel_y_m_per_s2"].map(|name| layout.add(name));
        layout.pose = ["pose_x_m", "pose_y_m", "pose_yaw_rad", "pose_arrival_s"].map(|name| layout.add(name));
        layout.target = ["target_x_m", "target_y_m"].map(|name| layout.add(name));
        layout.clocks = ["telemetry_arrival_s", "robot_clock_s"].map(|name| layout.add(name));
        layout.sequence = ["command_seq_sent", "command_seq_applied"].map(|name| layout.add(name));
        layout
    }

    fn add(&mut self, name: impl Into<String>) -> usize {
        self.names.push(name.into());
        self.names.len() - 1
    }

    fn is_integer(&self, column: usize) -> bool {
        self.sequence.contains(&column)
    }

    fn schema(&self) -> Schema {
        let mut fields = vec![Field::new("time_s", DataType::Float64, false)];
        for (column, name) in self.names.iter().enumerate() {
            let kind = if self.is_integer(column) {
                DataType::Int64
            } else {
                DataType::Float64
            };
            fields.push(Field::new(name, kind, true));
        }
        fields.push(Field::new("camera_id", DataType::Utf8, true));
        Schema::new(fields)
    }
}

#[derive(Debug, Clone)]
struct Row {
    /// By column of the layout.
    values: Vec<Option<f64>>,
    camera: Option<CameraName>,
}

/// Writes one robot's table while a journal is read.
pub struct TelemetryTable {
    robot: u8,
    start_us: i64,
    newest_us: i64,
    layout: Layout,
    schema: Arc<Schema>,
    rows: BTreeMap<i64, Row>,
    batch: Vec<(i64, Row)>,
    writer: ArrowWriter<File>,
}

impl TelemetryTable {
    /// - `start_us`: the moment of `time_s` = 0.
    pub fn create(path: &Path, robot: u8, description: &RobotDescription, start_us: i64) -> Result<Self, ParquetError> {
        let layout = Layout::new(description);
        let schema = Arc::new(layout.schema());
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .build();
        let writer = ArrowWriter::try_new(File::create(path)?, schema.clone(), Some(properties))?;
        Ok(Self {
            robot,
            start_us,
            newest_us: i64::MIN,
            layout,
            schema,
            rows: BTreeMap::new(),
            batch: Vec::with_capacity(BATCH_ROWS),
            writer,
        })
    }

    /// Takes a record of any robot; samples from before the start are left out.
    pub fn take(&mut self, record: &Record) -> Result<(), ParquetError> {
        match record {
            Record::Command(command) if command.robot == self.robot => self.take_command(command),
            Record::Pose(pose) if pose.robot == self.robot => self.take_pose(pose),
            Record::Telemetry(telemetry) if telemetry.robot == self.robot => self.take_telemetry(telemetry),
            _ => return Ok(()),
        }
        self.settle(self.newest_us.saturating_sub(REORDER_US))
    }

    fn seconds(&self, at_us: i64) -> f64 {
        (at_us - self.start_us) as f64 * 1e-6
    }

    fn set(&mut self, at_us: i64, cells: impl IntoIterator<Item = (usize, f64)>) -> Option<&mut Row> {
        if at_us < self.start_us {
            return None;
        }
        self.newest_us = self.newest_us.max(at_us);
        let width = self.layout.names.len();
        let row = self.rows.entry(at_us).or_insert_with(|| Row {
            values: vec![None; width],
            camera: None,
        });
        for (column, value) in cells {
            if let Some(cell) = row.values.get_mut(column) {
                *cell = value.is_finite().then_some(value);
            }
        }
        Some(row)
    }

    fn take_command(&mut self, command: &Command) {
        let mut cells = Vec::new();
        // When a run has ended its robots brake by a ramp of their own: frames of then hold no set-points.
        if !command.ended {
            cells.extend(place(&self.layout.command_wheel, &command.wheel_rad_per_s));
            let steering = self.layout.steering;
            cells.extend(steering.map(|[command_column, _]| (command_column, command.steering_rad)));
        }
        cells.extend(
            command
                .target_m
                .into_iter()
                .flat_map(|target_m| self.layout.target.into_iter().zip(target_m)),
        );
        let [sent, _] = self.layout.sequence;
        cells.push((sent, f64::from(command.sequence)));
        self.set(command.sent_us, cells);
    }

    fn take_pose(&mut self, pose: &Pose) {
        let values = [pose.x_m, pose.y_m, pose.yaw_rad, self.seconds(pose.arrival_us)];
        let cells: Vec<_> = self.layout.pose.into_iter().zip(values).collect();
        if let Some(row) = self.set(pose.exposure_us, cells) {
            row.camera = Some(pose.camera.clone());
        }
    }

    fn take_telemetry(&mut self, telemetry: &Telemetry) {
        let layout = &self.layout;
        let mut cells = place(&layout.wheel_speed, &telemetry.wheel_rad_per_s);
        cells.extend(place(&layout.wheel_angle, &telemetry.wheel_rad));
        cells.extend(place(&layout.current, &telemetry.current_a));
        let [accel_x, accel_y] = telemetry.accel_m_per_s2;
        cells.extend(
            layout
                .inertial
                .into_iter()
                .zip([telemetry.bus_v, telemetry.gyro_z_rad_per_s, accel_x, accel_y]),
        );
        cells.extend(layout.steering.map(|[_, measured]| (measured, telemetry.steering_rad)));
        let clocks = [
            self.seconds(telemetry.arrival_us),
            f64::from(telemetry.robot_clock_ms) * 1e-3,
        ];
        cells.extend(layout.clocks.into_iter().zip(clocks));
        let [_, applied] = layout.sequence;
        cells.push((applied, f64::from(telemetry.applied_sequence)));
        self.set(telemetry.sample_us, cells);
    }

    /// Moves rows before `before_us` to the batch and writes it when it is full.
    fn settle(&mut self, before_us: i64) -> Result<(), ParquetError> {
        while let Some(first) = self.rows.first_entry().filter(|row| *row.key() < before_us) {
            self.batch.push(first.remove_entry());
            if self.batch.len() == BATCH_ROWS {
                self.write_batch()?;
            }
        }
        Ok(())
    }

    fn write_batch(&mut self) -> Result<(), ParquetError> {
        let rows = std::mem::take(&mut self.batch);
        let mut columns: Vec<ArrayRef> = vec![Arc::new(Float64Array::from_iter_values(
            rows.iter().map(|(at_us, _)| self.seconds(*at_us)),
        ))];
        for column in 0..self.layout.names.len() {
            let values = rows.iter().map(|(_, row)| row.values.get(column).copied().flatten());
            columns.push(if self.layout.is_integer(column) {
                Arc::new(
                    values
                        .map(|value| value.map(|value| value as i64))
                        .collect::<Int64Array>(),
                )
            } else {
                Arc::new(values.collect::<Float64Array>())
            });
        }
        columns.push(Arc::new(
            rows.iter()
                .map(|(_, row)| row.camera.as_deref())
                .collect::<StringArray>(),
        ));
        self.writer.write(&RecordBatch::try_new(self.schema.clone(), columns)?)
    }

    /// Writes what is left and the footer.
    pub fn finish(mut self) -> Result<(), ParquetError> {
        self.settle(i64::MAX)?;
        if !self.batch.is_empty() {
            self.write_batch()?;
        }
        self.writer.close().map(|_| ())
    }
}

fn place(columns: &[usize], values: &[f64]) -> Vec<(usize, f64)> {
    columns.iter().copied().zip(values.iter().copied()).collect()
}
