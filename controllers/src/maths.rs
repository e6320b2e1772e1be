//! Functions of numbers that scripts and modules both have. All from `libm`: the same bits on every machine.

/// Name and function of one number.
pub type Unary = (&'static str, fn(f64) -> f64);
/// Name and function of two.
pub type Binary = (&'static str, fn(f64, f64) -> f64);

pub const UNARY: [Unary; 10] = [
    ("sin", libm::sin),
    ("cos", libm::cos),
    ("tan", libm::tan),
    ("asin", libm::asin),
    ("acos", libm::acos),
    ("atan", libm::atan),
    ("exp", libm::exp),
    ("ln", libm::log),
    ("tanh", libm::tanh),
    ("wrap", wrap),
];
pub const BINARY: [Binary; 3] = [("atan2", libm::atan2), ("hypot", libm::hypot), ("pow", libm::pow)];

/// The same angle in [-pi, pi].
fn wrap(angle_rad: f64) -> f64 {
    libm::atan2(libm::sin(angle_rad), libm::cos(angle_rad))
}
