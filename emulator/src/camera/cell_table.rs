//! A tag's cells, laid out for looking up many points.

use super::tag::{BLACK_REFLECTANCE, CELLS, Tag, WHITE_REFLECTANCE};

/// The cells of a tag with three empty ones around them: `[reflectance, 1]`, and `[0, 0]` where there is no tag.
#[derive(Debug, Clone)]
pub struct CellTable {
    cells: [[f32; 2]; Self::SIDE * Self::SIDE],
}

impl CellTable {
    const SIDE: usize = 16;
    const RIM: usize = (Self::SIDE - CELLS) / 2;
    /// How far off the tag [`Self::near`] may be asked, in cells.
    pub const REACH: f32 = Self::RIM as f32 - 0.5;

    pub fn new(tag: Tag) -> Self {
        let mut cells = [[0.0; 2]; Self::SIDE * Self::SIDE];
        for (index, white) in tag.cells().into_iter().enumerate() {
            let reflectance = if white { WHITE_REFLECTANCE } else { BLACK_REFLECTANCE };
            let (column, row) = (index % CELLS + Self::RIM, index / CELLS + Self::RIM);
            cells[row * Self::SIDE + column] = [reflectance as f32, 1.0];
        }
        Self { cells }
    }

    /// At a place within [`Self::REACH`] of the tag.
    #[inline(always)]
    pub fn near(&self, column: f32, row: f32) -> [f32; 2] {
        // Adding 2^23 rounds and leaves the whole number in the low bits; half a cell less makes it rounding down. Several
        // times as fast as a saturating conversion.
        const DOWN: f32 = CellTable::RIM as f32 - 0.5;
        let whole = |value: f32| (value + DOWN + 8_388_608.0).to_bits() as usize % Self::SIDE;
        self.cells[whole(row) * Self::SIDE + whole(column)]
    }

    /// Anywhere; `None` off the tag.
    pub fn at(&self, column: f32, row: f32) -> Option<f32> {
        let on_tag = |value: f32| (0.0..CELLS as f32).contains(&value);
        let whole = |value: f32| value as usize + Self::RIM;
        (on_tag(column) && on_tag(row)).then(|| self.cells[whole(row) * Self::SIDE + whole(column)][0])
    }

    /// What all cells within `spread` of a place have in common.
    #[inline(always)]
    pub fn even(&self, [column, row]: [f32; 2], [dc, dr]: [f32; 2]) -> Option<[f32; 2]> {
        if dc > 0.5 || dr > 0.5 {
            return None;
        }
        let first = self.near(column - dc, row - dr);
        let same = first == self.near(column + dc, row + dr)
            && first == self.near(column - dc, row + dr)
            && first == self.near(column + dc, row - dr);
        same.then_some(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_and_around_a_tag_find_its_cells() {
        let (tag, table) = (
            Tag::new(33).expect("a tag"),
            CellTable::new(Tag::new(33).expect("a tag")),
        );
        for (row, column) in (-2..12).flat_map(|row| (-2..12).map(move |column| (row, column))) {
            let on_tag = (0..10).contains(&row) && (0..10).contains(&column);
            let white = on_tag && tag.cells()[(row * 10 + column) as usize];
            let reflectance = (if white { WHITE_REFLECTANCE } else { BLACK_REFLECTANCE }) as f32;
            for (dc, dr) in [(0.001, 0.001), (0.5, 0.3), (0.999, 0.999)] {
                let (x, y) = (column as f32 + dc, row as f32 + dr);
                assert_eq!(
                    table.near(x, y),
                    if on_tag { [reflectance, 1.0] } else { [0.0, 0.0] },
                    "{x} {y}"
                );
                assert_eq!(table.at(x, y), on_tag.then_some(reflectance), "{x} {y}");
            }
        }
        assert_eq!(
            table.even([0.5, 0.5], [0.4, 0.4]),
            Some([WHITE_REFLECTANCE as f32, 1.0]),
            "the white margin"
        );
        assert_eq!(table.even([0.9, 1.5], [0.2, 0.2]), None, "margin and border");
        assert_eq!(table.even([-1.0, 3.0], [0.3, 0.3]), Some([0.0, 0.0]), "off the tag");
        assert_eq!(
            (table.at(-0.5, 2.0), table.at(f32::NAN, 2.0), table.at(1e9, 0.0)),
            (None, None, None)
        );
    }
}
