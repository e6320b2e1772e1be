//! Which run is for what. The unit of hold-out is a run, never a sample.

/// What a run is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    Reference,
    Train,
    Validation,
    Locked,
}

impl Role {
    /// As it stands in the report.
    pub fn name(self) -> &'static str {
        match self {
            Role::Reference => "reference",
            Role::Train => "train",
            Role::Validation => "validation",
            Role::Locked => "locked",
        }
    }
}

/// Roles of the runs to be diagnosed, in their order.
///
/// - `liveliness`: one number a run, how hard it was driven; runs alike are spread over the roles.
/// - `has_locked`: locked runs were given apart.
pub fn roles(liveliness: &[f64], has_locked: bool) -> Vec<Role> {
    let n = liveliness.len();
    let (locked, validation) = match (n, has_locked) {
        (0 | 1, _) => (0, 0),
        (2, false) => (0, 1),
        (3..=5, false) => (1, 1),
        (_, false) => ((n / 6).max(2), (n / 3).max(2)),
        (2 | 3, true) => (0, 1),
        (_, true) => (0, (n / 3).max(2)),
    };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| liveliness[*b].total_cmp(&liveliness[*a]).then(a.cmp(b)));
    // Train, validation, locked in turn from the liveliest run, as far as each has places left: none gets only quiet runs.
    let mut left = [n - locked - validation, validation, locked];
    let mut out = vec![Role::Train; n];
    let mut turn = 0;
    for run in order {
        while left[turn % 3] == 0 {
            turn += 1;
        }
        left[turn % 3] -= 1;
        out[run] = [Role::Train, Role::Validation, Role::Locked][turn % 3];
        turn += 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(n: usize, has_locked: bool) -> [usize; 3] {
        let roles = roles(&vec![1.0; n], has_locked);
        [Role::Train, Role::Validation, Role::Locked].map(|role| roles.iter().filter(|r| **r == role).count())
    }

    #[test]
    fn counts_are_those_of_the_rules() {
        assert_eq!(count(1, false), [1, 0, 0]);
        assert_eq!(count(2, false), [1, 1, 0]);
        assert_eq!(count(4, false), [2, 1, 1]);
        assert_eq!(count(6, false), [2, 2, 2]);
        assert_eq!(count(12, false), [6, 4, 2]);
        assert_eq!(count(6, true), [4, 2, 0]);
    }

    #[test]
    fn the_liveliest_run_is_for_training() {
        let roles = roles(&[0.1, 0.5, 0.9, 0.2], false);
        assert_eq!(roles[2], Role::Train);
    }
}
