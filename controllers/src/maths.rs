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

/// The one bit pattern of what is not a number: which of them an operation gives hangs on the machine.
pub const NOT_A_NUMBER: f64 = f64::from_bits(0x7ff8_0000_0000_0000);

/// The number; every one that is none as the same bits.
pub fn canonical(x: f64) -> f64 {
    if x.is_nan() { NOT_A_NUMBER } else { x }
}

/// The smaller one, of equal ones (0 and -0) the first, of which `f64::min` promises nothing; a number where one is.
pub fn least(x: f64, y: f64) -> f64 {
    if x.is_nan() || y < x { y } else { x }
}

/// The greater one, likewise.
pub fn greatest(x: f64, y: f64) -> f64 {
    if x.is_nan() || y > x { y } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_keep_their_order_and_numbers_win() {
        for of in [least, greatest] {
            assert!(of(0.0, -0.0).is_sign_positive() && of(-0.0, 0.0).is_sign_negative());
            assert_eq!([of(f64::NAN, 1.0), of(1.0, f64::NAN), of(2.0, 2.0)], [1.0, 1.0, 2.0]);
        }
        assert_eq!((least(1.0, 2.0), greatest(1.0, 2.0)), (1.0, 2.0));
    }

    #[test]
    fn no_number_has_one_pattern() {
        assert_eq!(
            canonical(f64::from_bits(0xfff8_0000_0000_0001)).to_bits(),
            NOT_A_NUMBER.to_bits()
        );
        assert_eq!(canonical(-0.0).to_bits(), (-0.0f64).to_bits());
    }
}
