//! Plane vectors as `[x, y]` arrays; only correctly rounded operations and `libm`.

pub type Vector = [f64; 2];

pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1]]
}

pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

pub fn scale(a: Vector, factor: f64) -> Vector {
    [a[0] * factor, a[1] * factor]
}

pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// `a` shortened to at most `limit`, direction kept.
pub fn clip(a: Vector, limit: f64) -> Vector {
    let size = length(a);
    if size > limit { scale(a, limit / size) } else { a }
}

/// Unit vector along `a`; `None` when `a` is too short to have a direction.
pub fn direction(a: Vector) -> Option<Vector> {
    let size = length(a);
    (size > 1e-9).then(|| scale(a, 1.0 / size))
}

/// `a` turned a quarter to the right (clockwise seen from above).
pub fn right_of(a: Vector) -> Vector {
    [a[1], -a[0]]
}

/// Unit vector of an angle.
pub fn heading(yaw_rad: f64) -> Vector {
    [libm::cos(yaw_rad), libm::sin(yaw_rad)]
}

/// `a`, given in the world frame, expressed in a body frame with this yaw.
pub fn body_from_world(a: Vector, yaw_rad: f64) -> Vector {
    let [c, s] = heading(yaw_rad);
    [c * a[0] + s * a[1], c * a[1] - s * a[0]]
}

/// `a`, given in a body frame with this yaw, expressed in the world frame.
pub fn world_from_body(a: Vector, yaw_rad: f64) -> Vector {
    let [c, s] = heading(yaw_rad);
    [c * a[0] - s * a[1], s * a[0] + c * a[1]]
}

/// Angle wrapped to (-pi, pi].
pub fn wrap(angle_rad: f64) -> f64 {
    libm::atan2(libm::sin(angle_rad), libm::cos(angle_rad))
}

/// Distance of `point` from the segment `from`..`to`.
pub fn distance_to_segment(point: Vector, from: Vector, to: Vector) -> f64 {
    let along = sub(to, from);
    let squared = dot(along, along);
    let fraction = if squared > 0.0 {
        (dot(sub(point, from), along) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    length(sub(point, add(from, scale(along, fraction))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_inverse_and_counter_clockwise() {
        let world = world_from_body([1.0, 0.0], core::f64::consts::FRAC_PI_2);
        assert!(length(sub(world, [0.0, 1.0])) < 1e-15);
        let back = body_from_world(world, core::f64::consts::FRAC_PI_2);
        assert!(length(sub(back, [1.0, 0.0])) < 1e-15);
        assert_eq!(right_of([1.0, 0.0]), [0.0, -1.0]);
    }

    #[test]
    fn distance_stops_at_the_ends_of_a_segment() {
        assert_eq!(distance_to_segment([2.0, 1.0], [0.0, 0.0], [4.0, 0.0]), 1.0);
        assert_eq!(distance_to_segment([7.0, 4.0], [0.0, 0.0], [4.0, 0.0]), 5.0);
        assert_eq!(distance_to_segment([3.0, 4.0], [0.0, 0.0], [0.0, 0.0]), 5.0);
    }
}
