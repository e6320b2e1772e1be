//! The printed tag: AprilTag family 36h11, its layout and its size on the robot.
//!
//! Ten by ten cells: a white margin of one cell, a black border of one cell, six by six data cells. Cells are counted from the
//! tag's top left corner, column to the right, row down, as the family publishes it (`bit_x`, `bit_y` of `tag36h11.c`, counted
//! there from the border's corner). On the robot the tag's x axis (to the right on the page) points forward, so its top points
//! to the robot's left. White is 1.

use super::tag_codes::CODES;

/// Outer edge of the black border.
pub const BORDER_EDGE_M: f64 = 0.16;
/// Cells along an edge, white margin included.
pub const CELLS: usize = 10;
/// Edge of one cell.
pub const CELL_M: f64 = BORDER_EDGE_M / 8.0;
/// Share of light that black and white print give back.
pub const BLACK_REFLECTANCE: f64 = 0.05;
pub const WHITE_REFLECTANCE: f64 = 0.85;
/// Data bits.
pub const BITS: usize = 36;

/// Column and row of each data bit within the black border's eight by eight cells; bit 0 is the most significant of the code.
const BIT_CELLS: [(u8, u8); BITS] = [
    (1, 1),
    (2, 1),
    (3, 1),
    (4, 1),
    (5, 1),
    (2, 2),
    (3, 2),
    (4, 2),
    (3, 3),
    (6, 1),
    (6, 2),
    (6, 3),
    (6, 4),
    (6, 5),
    (5, 2),
    (5, 3),
    (5, 4),
    (4, 3),
    (6, 6),
    (5, 6),
    (4, 6),
    (3, 6),
    (2, 6),
    (5, 5),
    (4, 5),
    (3, 5),
    (4, 4),
    (1, 6),
    (1, 5),
    (1, 4),
    (1, 3),
    (1, 2),
    (2, 5),
    (2, 4),
    (2, 3),
    (3, 4),
];

/// A tag of the family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tag {
    id: u16,
}

impl Tag {
    /// `None` if the family has no such tag; it has 587.
    pub fn new(id: u16) -> Option<Self> {
        (usize::from(id) < CODES.len()).then_some(Self { id })
    }

    pub fn id(self) -> u16 {
        self.id
    }

    /// Cells by row from the top: `cells[row * CELLS + column]`, true where white.
    pub fn cells(self) -> [bool; CELLS * CELLS] {
        let mut cells = [true; CELLS * CELLS];
        for row in 1..CELLS - 1 {
            cells[row * CELLS + 1..row * CELLS + CELLS - 1].fill(false);
        }
        let code = CODES.get(usize::from(self.id)).copied().unwrap_or_default();
        for (bit, (column, row)) in BIT_CELLS.iter().enumerate() {
            let index = (usize::from(*row) + 1) * CELLS + usize::from(*column) + 1;
            cells[index] = code >> (BITS - 1 - bit) & 1 == 1;
        }
        cells
    }

    /// Centre of a cell in the robot's body frame, `[forward, left]` in metres.
    pub fn cell_centre_m(column: usize, row: usize) -> [f64; 2] {
        let half = CELLS as f64 / 2.0;
        [
            (column as f64 + 0.5 - half) * CELL_M,
            (half - row as f64 - 0.5) * CELL_M,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The code of a tag turned by a quarter: the layout lists four congruent groups of nine bits.
    fn quarter(code: u64) -> u64 {
        (code << 9 | code >> 27) & ((1 << BITS) - 1)
    }

    #[test]
    fn all_587_codes_keep_a_hamming_distance_of_11_in_every_turn() {
        let mut least = u32::MAX;
        for (index, code) in CODES.iter().enumerate() {
            assert!(*code < 1 << BITS);
            let turns = [
                *code,
                quarter(*code),
                quarter(quarter(*code)),
                quarter(quarter(quarter(*code))),
            ];
            for turn in &turns[1..] {
                least = least.min((code ^ turn).count_ones());
            }
            for other in &CODES[index + 1..] {
                for turn in turns {
                    least = least.min((other ^ turn).count_ones());
                }
            }
        }
        assert_eq!(least, 11);
    }

    #[test]
    fn turning_the_cells_by_a_quarter_turns_the_code_by_nine_bits() {
        for id in [0, 1, 17, 300, 586] {
            let cells = Tag::new(id).expect("a tag").cells();
            let turned = |column: usize, row: usize| cells[(CELLS - 1 - column) * CELLS + row];
            let mut code = 0;
            for (column, row) in BIT_CELLS {
                code = code << 1 | u64::from(turned(usize::from(column) + 1, usize::from(row) + 1));
            }
            let original = CODES[usize::from(id)];
            let back = quarter(code);
            assert!(back == original || quarter(original) == code, "tag {id}");
        }
    }

    /// As the family's own picture generator draws it.
    #[test]
    fn tag_0_has_the_published_cells() {
        let cells = Tag::new(0).expect("a tag").cells();
        let picture: Vec<String> = cells
            .chunks(CELLS)
            .map(|row| row.iter().map(|white| if *white { '#' } else { '.' }).collect())
            .collect();
        let published = [
            "##########",
            "#........#",
            "#.##.#.#.#",
            "#..###.#.#",
            "#..##....#",
            "#.#.#....#",
            "#..#.##..#",
            "#....#...#",
            "#........#",
            "##########",
        ];
        assert_eq!(picture, published);
    }

    #[test]
    fn the_tag_has_a_white_margin_a_black_border_and_lies_forward_on_the_robot() {
        let cells = Tag::new(5).expect("a tag").cells();
        assert!((0..CELLS).all(|i| cells[i] && cells[i * CELLS] && cells[90 + i] && cells[i * CELLS + 9]));
        assert!((1..9).all(|i| !cells[10 + i] && !cells[i * CELLS + 1] && !cells[80 + i] && !cells[i * CELLS + 8]));
        let corner = Tag::cell_centre_m(0, 0);
        assert!(
            (corner[0] + 0.09).abs() < 1e-12 && (corner[1] - 0.09).abs() < 1e-12,
            "behind and to the left"
        );
        assert_eq!(Tag::new(587), None);
    }
}
