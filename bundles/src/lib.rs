//! Run bundles as bytes and from disk: folders, zip files and run archives; telemetry as CSV or Parquet.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use identify::bundle::Bundle;
use parquet::basic::Type as PhysicalType;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use parquet::schema::types::ColumnDescPtr;
use sha2::{Digest, Sha256};

/// A bundle with the digest of what was read.
#[derive(Debug)]
pub struct BundleFile {
    pub path: String,
    pub sha256: String,
    pub bundle: Bundle,
}

/// Largest file of a bundle.
const MAX_BYTES: u64 = 2 << 30;

/// The two files of a bundle.
#[derive(Debug, Clone)]
pub struct Files {
    /// `run.json`.
    pub run: Vec<u8>,
    pub telemetry: Vec<u8>,
    /// Telemetry is Parquet, not CSV.
    pub is_parquet: bool,
}

/// Reads a bundle.
///
/// - `path`: a folder with `run.json` and `telemetry.csv` or `telemetry.parquet`, a zip of it, or a run archive (folder or
///   zip), whose bundle of `robot` is taken; `robot` may be left out when there is one.
pub fn read(path: &Path, robot: Option<&str>) -> anyhow::Result<BundleFile> {
    let shown = path.display().to_string();
    let files = if path.is_dir() {
        from_folder(path, robot)
    } else {
        from_zip(path, robot)
    };
    parse(shown.clone(), files.with_context(|| shown)?)
}

/// Checks and parses the files of a bundle.
///
/// - `shown`: what to call it in messages and reports.
pub fn parse(shown: String, files: Files) -> anyhow::Result<BundleFile> {
    let mut hash = Sha256::new();
    hash.update(&files.run);
    hash.update(&files.telemetry);
    let sha256 = hash.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    });
    let csv = if files.is_parquet {
        csv_of_parquet(files.telemetry).with_context(|| format!("{shown}: telemetry.parquet"))?
    } else {
        files.telemetry
    };
    let run = String::from_utf8(files.run).with_context(|| format!("{shown}: run.json is not UTF-8 text"))?;
    let bundle = Bundle::parse(&run, &csv).with_context(|| shown.clone())?;
    Ok(BundleFile {
        path: shown,
        sha256,
        bundle: bundle.from_start(),
    })
}

/// Reads a robot's bundle from the files of a run.
///
/// - `shown`: what to call the run in messages.
/// - `open`: the bytes of a file by its name in the archive, checked; `None` when the run has no such file.
/// - Errors: words for a person, when the run holds no readable bundle of this robot.
pub fn of_run(
    shown: String,
    robot: &str,
    mut open: impl FnMut(&str) -> anyhow::Result<Option<Vec<u8>>>,
) -> anyhow::Result<BundleFile> {
    let mut file = |name: &str| open(&format!("robots/{robot}/{name}"));
    let run = file("run.json")?.with_context(|| format!("{shown} holds no records of the robot {robot}"))?;
    let (telemetry, is_parquet) = match file("telemetry.csv")? {
        Some(csv) => (csv, false),
        None => match file("telemetry.parquet")? {
            Some(parquet) => (parquet, true),
            None => bail!("{shown} holds no telemetry of the robot {robot}"),
        },
    };
    let files = Files {
        run,
        telemetry,
        is_parquet,
    };
    parse(shown, files)
}

fn from_folder(path: &Path, robot: Option<&str>) -> anyhow::Result<Files> {
    let robots = path.join("robots");
    let folder = if path.join("run.json").is_file() || !robots.is_dir() {
        path.to_owned()
    } else {
        let mut names: Vec<String> = std::fs::read_dir(&robots)?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        names.sort();
        robots.join(chosen(&names, robot)?)
    };
    let read = |name: &str| -> anyhow::Result<Vec<u8>> {
        let file: PathBuf = folder.join(name);
        let size = std::fs::metadata(&file)
            .with_context(|| format!("cannot read {name}"))?
            .len();
        ensure!(
            size <= MAX_BYTES,
            "{name} has {size} bytes; at most {MAX_BYTES} are read"
        );
        std::fs::read(&file).with_context(|| format!("cannot read {name}"))
    };
    let is_parquet = !folder.join("telemetry.csv").is_file() && folder.join("telemetry.parquet").is_file();
    Ok(Files {
        run: read("run.json")?,
        telemetry: read(if is_parquet {
            "telemetry.parquet"
        } else {
            "telemetry.csv"
        })?,
        is_parquet,
    })
}

fn from_zip(path: &Path, robot: Option<&str>) -> anyhow::Result<Files> {
    let file = std::fs::File::open(path).context("cannot be opened: neither a folder nor a readable file")?;
    let mut zip = zip::ZipArchive::new(file).context("is no zip file")?;
    let names: Vec<String> = zip
        .file_names()
        .filter_map(|name| Some(name.ok()?.into_owned()))
        .collect();
    let mut roots: Vec<String> = names
        .iter()
        .filter_map(|name| name.strip_suffix("run.json").map(str::to_owned))
        .filter(|root| root.is_empty() || root.ends_with('/'))
        .collect();
    roots.sort();
    let root = match roots.len() {
        0 => bail!("holds no run.json"),
        1 if robot.is_none() => roots[0].clone(),
        _ => {
            let short: Vec<String> = roots
                .iter()
                .map(|root| root.trim_end_matches('/').rsplit('/').next().unwrap_or("").to_owned())
                .collect();
            let name = chosen(&short, robot)?;
            let position = short.iter().position(|other| *other == name).unwrap_or(0);
            roots[position].clone()
        }
    };
    let mut read = |name: String| -> anyhow::Result<Vec<u8>> {
        let entry = zip
            .by_name(&name)
            .with_context(|| format!("{name} is missing or damaged"))?;
        ensure!(entry.size() <= MAX_BYTES, "{name} has more than {MAX_BYTES} bytes");
        let mut bytes = Vec::new();
        entry
            .take(MAX_BYTES)
            .read_to_end(&mut bytes)
            .with_context(|| format!("{name} is damaged"))?;
        Ok(bytes)
    };
    let is_parquet = !names.contains(&format!("{root}telemetry.csv"));
    Ok(Files {
        run: read(format!("{root}run.json"))?,
        telemetry: read(format!(
            "{root}telemetry.{}",
            if is_parquet { "parquet" } else { "csv" }
        ))?,
        is_parquet,
    })
}

fn chosen(names: &[String], robot: Option<&str>) -> anyhow::Result<String> {
    match (robot, names) {
        (Some(robot), _) if names.iter().any(|name| name == robot) => Ok(robot.to_owned()),
        (Some(robot), _) => bail!("holds no robot {robot}; it has {}", names.join(", ")),
        (None, [one]) => Ok(one.clone()),
        (None, []) => bail!("holds no run.json"),
        (None, _) => bail!("holds several robots: name one of {} with --robot", names.join(", ")),
    }
}

/// The same table as text.
fn csv_of_parquet(bytes: Vec<u8>) -> anyhow::Result<Vec<u8>> {
    let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).context("is no Parquet file")?;
    let mut text = String::new();
    let schema = reader.metadata().file_metadata().schema_descr();
    let names: Vec<&str> = schema.columns().iter().map(|column| column.name()).collect();
    text.push_str(&names.join(","));
    text.push('\n');
    let labels = labels_of(&reader)?;
    for row in reader.get_row_iter(None)? {
        let row = row?;
        let mut first = true;
        for (name, field) in row.get_column_iter() {
            if !first {
                text.push(',');
            }
            first = false;
            match field {
                Field::Null => {}
                Field::Double(value) => write!(text, "{value}")?,
                Field::Float(value) => write!(text, "{value}")?,
                Field::Byte(value) => write!(text, "{value}")?,
                Field::Short(value) => write!(text, "{value}")?,
                Field::Int(value) => write!(text, "{value}")?,
                Field::Long(value) => write!(text, "{value}")?,
                Field::UByte(value) => write!(text, "{value}")?,
                Field::UShort(value) => write!(text, "{value}")?,
                Field::UInt(value) => write!(text, "{value}")?,
                Field::ULong(value) => write!(text, "{value}")?,
                Field::Str(label) => match labels
                    .get(name)
                    .and_then(|known| known.iter().position(|one| one == label))
                {
                    _ if label.parse::<f64>().is_ok() => text.push_str(label),
                    Some(number) => write!(text, "{number}")?,
                    None => {}
                },
                _ => bail!("column {name} holds no numbers"),
            }
        }
        text.push('\n');
    }
    Ok(text.into_bytes())
}

/// The words of every column of text (cameras have names), sorted: a word's number is its place among them.
fn labels_of(reader: &SerializedFileReader<bytes::Bytes>) -> anyhow::Result<BTreeMap<String, BTreeSet<String>>> {
    let mut labels: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let schema = reader.metadata().file_metadata().schema_descr();
    let is_text = |column: &ColumnDescPtr| column.physical_type() == PhysicalType::BYTE_ARRAY;
    if !schema.columns().iter().any(is_text) {
        return Ok(labels);
    }
    for row in reader.get_row_iter(None)? {
        for (name, field) in row?.get_column_iter() {
            if let Field::Str(label) = field {
                labels.entry(name.clone()).or_default().insert(label.clone());
            }
        }
    }
    Ok(labels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    use std::sync::Arc;

    #[test]
    fn cameras_have_names_in_parquet_and_numbers_in_the_table() {
        let schema = "message telemetry { REQUIRED DOUBLE time_s; OPTIONAL INT64 command_seq_sent; OPTIONAL BYTE_ARRAY camera_id (UTF8); }";
        let schema = Arc::new(parse_message_type(schema).expect("a schema"));
        let mut bytes = Vec::new();
        let mut writer = SerializedFileWriter::new(&mut bytes, schema, Default::default()).expect("a file");
        let mut group = writer.next_row_group().expect("a group");
        let mut column = group.next_column().expect("no error").expect("time_s");
        let written = column
            .typed::<DoubleType>()
            .write_batch(&[0.0, 0.5, 1.0, 1.5], None, None);
        written.and_then(|_| column.close()).expect("times");
        let mut column = group.next_column().expect("no error").expect("command_seq_sent");
        let written = column.typed::<Int64Type>().write_batch(&[7], Some(&[0, 1, 0, 0]), None);
        written.and_then(|_| column.close()).expect("numbers");
        let mut column = group.next_column().expect("no error").expect("camera_id");
        let names = ["west", "east", "west"].map(ByteArray::from);
        let written = column
            .typed::<ByteArrayType>()
            .write_batch(&names, Some(&[1, 1, 0, 1]), None);
        written.and_then(|_| column.close()).expect("names");
        group.close().expect("a group");
        writer.close().expect("a file");
        let table = csv_of_parquet(bytes).expect("a table");
        assert_eq!(
            String::from_utf8(table).expect("text"),
            "time_s,command_seq_sent,camera_id\n0,,1\n0.5,7,0\n1,,\n1.5,,1\n"
        );
    }
}
