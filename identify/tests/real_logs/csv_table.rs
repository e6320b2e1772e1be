//! Tables of numbers with a header, and texts in the columns that are none.

use std::path::Path;

pub struct Table {
    header: Vec<String>,
    cells: Vec<csv::StringRecord>,
}

impl Table {
    pub fn read(path: &Path) -> Table {
        let mut reader = csv::Reader::from_path(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let header = reader
            .headers()
            .map(|h| h.iter().map(str::to_owned).collect())
            .unwrap_or_default();
        let cells = reader.records().filter_map(Result::ok).collect();
        Table { header, cells }
    }

    fn position(&self, name: &str) -> usize {
        self.header
            .iter()
            .position(|other| other == name)
            .unwrap_or_else(|| panic!("no column {name}"))
    }

    pub fn column(&self, name: &str) -> Vec<f64> {
        self.text(name)
            .iter()
            .map(|cell| cell.parse().unwrap_or(f64::NAN))
            .collect()
    }

    pub fn text(&self, name: &str) -> Vec<&str> {
        let at = self.position(name);
        self.cells.iter().map(|row| row.get(at).unwrap_or("")).collect()
    }
}
