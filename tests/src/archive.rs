//! Opens a run archive with independent readers.

use anyhow::{Context, ensure};
use arrow_array::RecordBatch;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::Read;

/// Members of a run archive, digests checked against the manifest.
pub struct Archive {
    pub members: BTreeMap<String, Vec<u8>>,
    pub manifest: Value,
}

pub struct ParquetSummary {
    pub rows: usize,
    pub columns: Vec<String>,
    /// Rows in which a command was sent.
    pub commands: usize,
    /// Those that held set-points: none after the end of the run.
    pub set_points: usize,
    /// Time of the last of those, s since the start of the motion.
    pub last_command_s: f64,
}

impl Archive {
    /// Errors if a member is missing, not listed, or differs from its SHA-256.
    pub fn open(zip: Vec<u8>) -> anyhow::Result<Self> {
        let mut archive = zip::ZipArchive::new(std::io::Cursor::new(zip)).context("not a zip")?;
        let mut members = BTreeMap::new();
        for index in 0..archive.len() {
            let mut member = archive.by_index(index)?;
            let mut bytes = Vec::new();
            member.read_to_end(&mut bytes)?;
            let name = member.name()?.into_owned();
            members.insert(name, bytes);
        }
        let manifest: Value =
            serde_json::from_slice(members.get("manifest.json").context("manifest.json is missing")?)?;
        let listed = manifest["files"].as_array().context("manifest: `files` is missing")?;
        for file in listed {
            let name = file["name"].as_str().context("manifest: file without a name")?;
            let bytes = members
                .get(name)
                .with_context(|| format!("{name} is listed but missing"))?;
            let found: String = Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect();
            ensure!(
                file["sha256"] == found.as_str(),
                "{name}: SHA-256 {found}, manifest says {}",
                file["sha256"]
            );
        }
        ensure!(
            members.len() == listed.len() + 1,
            "{} members but {} listed: {:?}",
            members.len(),
            listed.len(),
            members.keys()
        );
        Ok(Self { members, manifest })
    }

    pub fn member(&self, name: &str) -> anyhow::Result<&[u8]> {
        let found = self.members.get(name);
        Ok(found.with_context(|| format!("{name} is missing; there are {:?}", self.members.keys()))?)
    }

    /// Messages per topic of `run.mcap`.
    pub fn mcap_topics(&self) -> anyhow::Result<BTreeMap<String, usize>> {
        let mut topics = BTreeMap::new();
        for message in mcap::MessageStream::new(self.member("run.mcap")?)? {
            *topics.entry(message?.channel.topic.clone()).or_insert(0) += 1;
        }
        Ok(topics)
    }

    pub fn telemetry(&self, robot: &str) -> anyhow::Result<ParquetSummary> {
        let bytes = bytes::Bytes::copy_from_slice(self.member(&format!("robots/{robot}/telemetry.parquet"))?);
        let builder = ParquetRecordBatchReaderBuilder::try_new(bytes)?;
        let columns: Vec<_> = builder
            .schema()
            .fields()
            .iter()
            .map(|field| field.name().clone())
            .collect();
        let batches: Vec<RecordBatch> = builder.build()?.collect::<Result<_, _>>()?;
        let samples = |name: &str| -> usize {
            let of = |batch: &RecordBatch| batch.column_by_name(name).map_or(0, |c| c.len() - c.null_count());
            batches.iter().map(of).sum()
        };
        use arrow_array::{Array, Float64Array};
        let last_command_s = |batch: &RecordBatch| {
            let times = batch
                .column_by_name("time_s")?
                .as_any()
                .downcast_ref::<Float64Array>()?;
            let frame = batch.column_by_name("command_seq_sent")?;
            (0..times.len())
                .rev()
                .find(|row| frame.is_valid(*row))
                .map(|row| times.value(row))
        };
        Ok(ParquetSummary {
            last_command_s: batches
                .iter()
                .filter_map(last_command_s)
                .fold(f64::NEG_INFINITY, f64::max),
            rows: batches.iter().map(RecordBatch::num_rows).sum(),
            columns,
            commands: samples("command_seq_sent"),
            set_points: samples("command_wheel_0_rad_per_s"),
        })
    }
}
