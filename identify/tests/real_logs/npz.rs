//! NumPy archives: little-endian numbers in C order.

use std::io::Read;
use std::path::Path;

/// One array as numbers.
pub struct Array {
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// The array `name` of an archive.
pub fn read(path: &Path, name: &str) -> Array {
    let file = std::fs::File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut zip = zip::ZipArchive::new(file).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut bytes = Vec::new();
    zip.by_name(&format!("{name}.npy"))
        .unwrap_or_else(|error| panic!("{name}: {error}"))
        .read_to_end(&mut bytes)
        .unwrap_or_else(|error| panic!("{name}: {error}"));
    assert!(bytes.starts_with(b"\x93NUMPY\x01"), "{name} is version 1");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = String::from_utf8_lossy(&bytes[10..10 + length]).into_owned();
    assert!(header.contains("'fortran_order': False"), "{header}");
    let between = |from: &str, to: &str| {
        let start = header.find(from).map_or(0, |at| at + from.len());
        let end = header[start..].find(to).map_or(start, |at| start + at);
        header[start..end].to_owned()
    };
    let kind = between("'descr': '", "'");
    let shape: Vec<usize> = between("'shape': (", ")")
        .split(',')
        .filter_map(|part| part.trim().parse().ok())
        .collect();
    let body = &bytes[10 + length..];
    let values = match kind.as_str() {
        "<f8" => body
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap_or_default()))
            .collect(),
        "<f4" => body
            .chunks_exact(4)
            .map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap_or_default())))
            .collect(),
        "<i2" => body
            .chunks_exact(2)
            .map(|b| f64::from(i16::from_le_bytes(b.try_into().unwrap_or_default())))
            .collect(),
        "|i1" => body.iter().map(|b| f64::from(*b as i8)).collect(),
        other => panic!("{name}: {other} is not read"),
    };
    Array { shape, values }
}
