//! Their table row by row: CSV or Parquet, never whole in memory.

use anyhow::{Context, bail, ensure};
use parquet::file::reader::SerializedFileReader;
use parquet::record::Field;
use parquet::record::reader::RowIter;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Longest line of a CSV file, bytes.
const LONGEST_LINE: usize = 1 << 20;
/// Buffer in front of the file, bytes.
const BUFFER: usize = 1 << 18;

/// An open table.
pub struct Table {
    pub header: Vec<String>,
    source: Source,
}

enum Source {
    Csv(Box<csv::Reader<LineLimit<BufReader<File>>>>),
    Parquet(RowIter<'static>, u64),
}

impl Table {
    /// Opens by the file's name: `.parquet`, else CSV with comma, semicolon or tab, `#` in front of comments.
    pub fn open(path: &Path) -> anyhow::Result<Table> {
        let file = File::open(path).context("cannot be opened")?;
        if path.extension().is_some_and(|end| end == "parquet") {
            let reader = SerializedFileReader::new(file).context("is no Parquet file")?;
            let iter = RowIter::from_file_into(Box::new(reader));
            let schema = SerializedFileReader::new(File::open(path)?)?;
            let schema = parquet::file::reader::FileReader::metadata(&schema)
                .file_metadata()
                .schema_descr_ptr();
            let header = schema.columns().iter().map(|column| column.name().to_owned()).collect();
            return Ok(Table {
                header,
                source: Source::Parquet(iter, 0),
            });
        }
        let mut file = BufReader::with_capacity(BUFFER, file);
        let delimiter = delimiter(file.fill_buf().context("cannot be read")?);
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(LineLimit { inner: file, length: 0 });
        let header = reader.headers().context("cannot be read as CSV")?;
        let mut header: Vec<String> = header.iter().map(str::to_owned).collect();
        if let Some(first) = header.first_mut() {
            *first = first.trim_start_matches('\u{feff}').to_owned();
        }
        ensure!(
            !header.is_empty(),
            "is empty; a header line with the names of the columns is needed"
        );
        for (k, name) in header.iter().enumerate() {
            ensure!(
                !header[..k].contains(name),
                "column {name:?} stands twice in the header; rename one"
            );
        }
        Ok(Table {
            header,
            source: Source::Csv(Box::new(reader)),
        })
    }

    /// The next row, and its line in the file (its number in Parquet); `None` at the end.
    pub fn next_row(&mut self, cells: &mut csv::StringRecord) -> anyhow::Result<Option<u64>> {
        match &mut self.source {
            Source::Csv(reader) => match reader.read_record(cells) {
                Ok(true) => Ok(Some(cells.position().map_or(0, csv::Position::line))),
                Ok(false) => Ok(None),
                Err(error) => bail!(row_problem(&error)),
            },
            Source::Parquet(rows, number) => {
                let Some(row) = rows.next() else { return Ok(None) };
                *number += 1;
                let row = row.with_context(|| format!("row {number}"))?;
                cells.clear();
                for (name, field) in row.get_column_iter() {
                    cells.push_field(&text(field).with_context(|| format!("column {name:?} holds no numbers"))?);
                }
                Ok(Some(*number))
            }
        }
    }
}

fn text(field: &Field) -> Option<String> {
    Some(match field {
        Field::Null => String::new(),
        Field::Double(value) => value.to_string(),
        Field::Float(value) => value.to_string(),
        Field::Byte(value) => value.to_string(),
        Field::Short(value) => value.to_string(),
        Field::Int(value) => value.to_string(),
        Field::Long(value) | Field::TimestampMillis(value) | Field::TimestampMicros(value) => value.to_string(),
        Field::UByte(value) => value.to_string(),
        Field::UShort(value) => value.to_string(),
        Field::UInt(value) => value.to_string(),
        Field::ULong(value) => value.to_string(),
        Field::Bool(value) => u8::from(*value).to_string(),
        // For a column that the runs are cut by; others say that it is no number.
        Field::Str(value) => value.clone(),
        _ => return None,
    })
}

fn row_problem(error: &csv::Error) -> String {
    let line = error.position().map_or(1, csv::Position::line);
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => format!(
            "line {line}: {len} cells where the header has {expected_len}; a cut-off line at the end can be deleted"
        ),
        csv::ErrorKind::Utf8 { .. } => format!("line {line}: not UTF-8 text; convert the file, for example with iconv"),
        _ => format!("line {line}: {error}"),
    }
}

/// The one of comma, semicolon and tab that stands most often in the header.
fn delimiter(start: &[u8]) -> u8 {
    let header = start
        .split(|byte| *byte == b'\n')
        .find(|line| line.first() != Some(&b'#'))
        .unwrap_or_default();
    let count = |wanted: u8| header.iter().filter(|byte| **byte == wanted).count();
    let mut best = b',';
    for other in [b';', b'\t'] {
        if count(other) > count(best) {
            best = other;
        }
    }
    best
}

/// Refuses lines that would fill the memory.
struct LineLimit<R> {
    inner: R,
    length: usize,
}

impl<R: Read> Read for LineLimit<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(buffer)?;
        for byte in &buffer[..count] {
            self.length = if *byte == b'\n' || *byte == b'\r' {
                0
            } else {
                self.length + 1
            };
            if self.length > LONGEST_LINE {
                let message = format!("a line of more than {LONGEST_LINE} bytes: this is no table of telemetry");
                return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, message));
            }
        }
        Ok(count)
    }
}
