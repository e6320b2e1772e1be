//! Groups of robots that have something to do with each other, as a forest over their indices.

#[derive(Debug, Clone)]
pub struct Groups {
    parent: Vec<u32>,
}

impl Groups {
    pub fn new(robots: usize) -> Groups {
        Groups {
            parent: (0..robots as u32).collect(),
        }
    }

    pub fn reset(&mut self) {
        for (i, parent) in self.parent.iter_mut().enumerate() {
            *parent = i as u32;
        }
    }

    /// Smallest index of the group.
    pub fn of(&self, robot: usize) -> usize {
        let mut at = robot;
        while self.parent[at] as usize != at {
            at = self.parent[at] as usize;
        }
        at
    }

    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        self.parent[high] = low as u32;
    }
}
