//! A trajectory through places at equal times: a natural cubic spline driven by a smooth clock.
//!
//! q(w), w in [0, n], is the cubic spline with q(k) = place k and q'' = 0 at both ends [de Boor 1978]; its second
//! derivatives solve  m(k-1) + 4 m(k) + m(k+1) = 6 (q(k+1) - 2 q(k) + q(k-1)).  The clock w(t) has w(k T) = k; it rises
//! from rest in the first interval as 3 s^2 - 3 s^3 + s^4 and comes to rest in the last the same way, so velocity and
//! acceleration are continuous. With one interval it is 10 s^3 - 15 s^4 + 6 s^5.

use crate::vector::{Vector, add, scale, sub};

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trajectory {
    places_m: Vec<Vector>,
    /// Second derivatives of the spline at the places.
    bends_m: Vec<Vector>,
    interval_s: f64,
}

/// Where to be, how fast, and how the velocity changes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reference {
    pub place_m: Vector,
    pub velocity_m_per_s: Vector,
    pub acceleration_m_per_s2: Vector,
    /// Direction of the path; zero where it has none.
    pub tangent: Vector,
}

impl Trajectory {
    /// The trajectory that is at `places_m[k]` at `k interval_s`.
    pub fn new(places_m: Vec<Vector>, interval_s: f64) -> Trajectory {
        let bends_m = bends(&places_m);
        Trajectory {
            places_m,
            bends_m,
            interval_s,
        }
    }

    pub fn duration_s(&self) -> f64 {
        self.places_m.len().saturating_sub(1) as f64 * self.interval_s
    }

    /// The reference at a time; before the start and after the end it rests.
    pub fn at(&self, time_s: f64) -> Reference {
        let intervals = self.places_m.len().saturating_sub(1);
        if intervals == 0 {
            return Reference {
                place_m: self.places_m.first().copied().unwrap_or_default(),
                ..Reference::default()
            };
        }
        let s = (time_s / self.interval_s).clamp(0.0, intervals as f64);
        let k = (s as usize).min(intervals - 1);
        let [w, rate, change] = clock(s - k as f64, k == 0, k + 1 == intervals);
        let (a, b) = (self.places_m[k], self.places_m[k + 1]);
        let (ma, mb) = (self.bends_m[k], self.bends_m[k + 1]);
        let part = |axis: usize| {
            let slope = b[axis] - a[axis] - (2.0 * ma[axis] + mb[axis]) / 6.0;
            let cubic = (mb[axis] - ma[axis]) / 6.0;
            let place = a[axis] + w * (slope + w * (0.5 * ma[axis] + w * cubic));
            [
                place,
                slope + w * (ma[axis] + 3.0 * w * cubic),
                ma[axis] + 6.0 * w * cubic,
            ]
        };
        let (x, y) = (part(0), part(1));
        let tangent = [x[1], y[1]];
        let rate = rate / self.interval_s;
        let change = change / (self.interval_s * self.interval_s);
        let rests = time_s < 0.0 || s >= intervals as f64;
        let [rate, change] = if rests { [0.0, 0.0] } else { [rate, change] };
        Reference {
            place_m: [x[0], y[0]],
            velocity_m_per_s: scale(tangent, rate),
            acceleration_m_per_s2: add(scale([x[2], y[2]], rate * rate), scale(tangent, change)),
            tangent,
        }
    }
}

/// Clock within an interval: value, first and second derivative by `s`.
fn clock(s: f64, first: bool, last: bool) -> [f64; 3] {
    let rising = |s: f64| {
        [
            s * s * (3.0 - s * (3.0 - s)),
            s * (6.0 - s * (9.0 - 4.0 * s)),
            6.0 - s * (18.0 - 12.0 * s),
        ]
    };
    match (first, last) {
        (false, false) => [s, 1.0, 0.0],
        (true, false) => rising(s),
        (false, true) => {
            let [value, rate, change] = rising(1.0 - s);
            [1.0 - value, rate, -change]
        }
        (true, true) => [
            s * s * s * (10.0 - s * (15.0 - 6.0 * s)),
            30.0 * s * s * (1.0 - s) * (1.0 - s),
            60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
        ],
    }
}

/// Second derivatives of the natural spline, by elimination of its tridiagonal system.
fn bends(places: &[Vector]) -> Vec<Vector> {
    let n = places.len();
    let mut bends = vec![[0.0, 0.0]; n];
    let mut factors = vec![0.0; n];
    for k in 1..n.saturating_sub(1) {
        let right = scale(add(sub(places[k + 1], places[k]), sub(places[k - 1], places[k])), 6.0);
        let pivot = 4.0 - factors[k - 1];
        factors[k] = 1.0 / pivot;
        bends[k] = scale(sub(right, bends[k - 1]), 1.0 / pivot);
    }
    for k in (1..n.saturating_sub(1)).rev() {
        bends[k] = sub(bends[k], scale(bends[k + 1], factors[k]));
    }
    bends
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::length;

    fn example() -> Trajectory {
        let places = vec![[0.0, 0.0], [0.5, 0.2], [0.7, 0.9], [-0.3, 1.0], [-0.5, 0.0]];
        Trajectory::new(places, 2.0)
    }

    #[test]
    fn it_is_at_each_place_at_its_time_and_rests_at_both_ends() {
        let trajectory = example();
        for (k, place) in trajectory.places_m.iter().enumerate() {
            let at = trajectory.at(2.0 * k as f64);
            assert!(length(sub(at.place_m, *place)) < 1e-12, "{k}");
        }
        for time_s in [-1.0, 0.0, 8.0, 9.0] {
            assert!(length(trajectory.at(time_s).velocity_m_per_s) < 1e-12);
        }
    }

    /// Central differences of the closed form, and no jump anywhere: h = 1 ms, error of order h^2.
    #[test]
    fn velocity_and_acceleration_are_the_derivatives() {
        let trajectory = example();
        let h = 1e-3;
        for k in 1..799 {
            let t = 0.01 * f64::from(k) + 0.0005;
            let (before, now, after) = (trajectory.at(t - h), trajectory.at(t), trajectory.at(t + h));
            let velocity = scale(sub(after.place_m, before.place_m), 0.5 / h);
            let acceleration = scale(sub(after.velocity_m_per_s, before.velocity_m_per_s), 0.5 / h);
            assert!(length(sub(velocity, now.velocity_m_per_s)) < 1e-5, "{t}");
            assert!(length(sub(acceleration, now.acceleration_m_per_s2)) < 2e-3, "{t}");
        }
    }

    #[test]
    fn a_straight_line_stays_straight() {
        let trajectory = Trajectory::new(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]], 1.0);
        for k in 0..30 {
            let at = trajectory.at(0.1 * f64::from(k)).place_m;
            assert!((at[0] - at[1]).abs() < 1e-12);
        }
    }
}
