//! Optimal assignment by the Hungarian method.
//!
//! Shortest augmenting paths with potentials, O(n^3) [Kuhn 1955; Munkres 1957; Jonker and Volgenant 1987]. Ties go to the
//! lower number, so the result depends on nothing but the costs.

/// Solver for teams up to the size it was made for; allocates only in [`Assigner::new`].
#[derive(Debug, Clone)]
pub struct Assigner {
    /// Potentials of rows and columns, 1-based like all that follow; entry 0 is the root of the search.
    row_potential: Vec<f64>,
    column_potential: Vec<f64>,
    /// Row of each column.
    row_of: Vec<usize>,
    before: Vec<usize>,
    least: Vec<f64>,
    used: Vec<bool>,
}

impl Assigner {
    pub fn new(most: usize) -> Assigner {
        Assigner {
            row_potential: vec![0.0; most + 1],
            column_potential: vec![0.0; most + 1],
            row_of: vec![0; most + 1],
            before: vec![0; most + 1],
            least: vec![0.0; most + 1],
            used: vec![false; most + 1],
        }
    }

    /// Writes the column of every row (0-based) that makes the sum of `cost(row, column)` least.
    ///
    /// - `column_of`: as many rows as columns, at most the size of the solver; longer ones are left as they are.
    /// - `cost`: finite numbers.
    pub fn solve(&mut self, cost: impl Fn(usize, usize) -> f64, column_of: &mut [usize]) {
        let n = column_of.len();
        if n >= self.row_of.len() {
            return;
        }
        self.row_potential.fill(0.0);
        self.column_potential.fill(0.0);
        self.row_of.fill(0);
        for row in 1..=n {
            self.augment(row, n, &cost);
        }
        for column in 1..=n {
            column_of[self.row_of[column] - 1] = column - 1;
        }
    }

    fn augment(&mut self, row: usize, n: usize, cost: &impl Fn(usize, usize) -> f64) {
        self.row_of[0] = row;
        self.least.fill(f64::INFINITY);
        self.used.fill(false);
        let mut column = 0;
        // Each round marks one more column, so n + 1 rounds are enough for any costs.
        for _ in 0..=n {
            self.used[column] = true;
            let from = self.row_of[column];
            let (mut step, mut next) = (f64::INFINITY, 0);
            for j in (1..=n).filter(|j| !self.used[*j]) {
                let reduced = cost(from - 1, j - 1) - self.row_potential[from] - self.column_potential[j];
                if reduced < self.least[j] {
                    self.least[j] = reduced;
                    self.before[j] = column;
                }
                if self.least[j] < step || next == 0 {
                    step = self.least[j];
                    next = j;
                }
            }
            for j in 0..=n {
                if self.used[j] {
                    self.row_potential[self.row_of[j]] += step;
                    self.column_potential[j] -= step;
                } else {
                    self.least[j] -= step;
                }
            }
            column = next;
            if self.row_of[column] == 0 {
                break;
            }
        }
        while column != 0 {
            let before = self.before[column];
            self.row_of[column] = self.row_of[before];
            column = before;
        }
    }
}
