//! Who knows of whom in a team.

/// Names of the graphs, by number.
pub const CHOICES: &[&str] = &["complete", "ring", "line"];

/// A connectivity graph over robots in their order; undirected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Graph {
    Complete,
    Ring,
    Line,
}

impl Graph {
    /// The graph of a number in [`CHOICES`].
    pub fn of(choice: usize) -> Graph {
        match choice {
            1 => Graph::Ring,
            2 => Graph::Line,
            _ => Graph::Complete,
        }
    }

    /// Whether robots `i` and `j` of `n` know of each other.
    pub fn links(self, i: usize, j: usize, n: usize) -> bool {
        let apart = i.abs_diff(j);
        match self {
            Graph::Complete => apart > 0,
            Graph::Line => apart == 1,
            Graph::Ring => apart == 1 || (n > 2 && apart + 1 == n),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees() {
        let degree = |graph: Graph, i: usize, n: usize| (0..n).filter(|j| graph.links(i, *j, n)).count();
        assert_eq!([degree(Graph::Complete, 2, 5), degree(Graph::Ring, 0, 5)], [4, 2]);
        assert_eq!([degree(Graph::Line, 0, 5), degree(Graph::Line, 2, 5)], [1, 2]);
        assert_eq!([degree(Graph::Ring, 0, 2), degree(Graph::Ring, 0, 1)], [1, 0]);
    }
}
