//! Numbers and times in words. Radians become degrees here and nowhere else.

use chrono::{DateTime, Utc};

/// Real minus sign, so that figures line up and read well.
fn signed(text: String) -> String {
    match text.strip_prefix('-') {
        // A rounded zero has no sign.
        Some(figures)
            if figures
                .chars()
                .all(|c| matches!(c, '0' | '.' | ' ') || c.is_alphabetic() || c == '\u{b0}') =>
        {
            figures.to_owned()
        }
        Some(figures) => format!("\u{2212}{figures}"),
        None => text,
    }
}

pub fn metres(value_m: f64) -> String {
    signed(format!("{value_m:.2} m"))
}

pub fn millimetres(value_m: f64) -> String {
    signed(format!("{:.0} mm", value_m * 1000.0))
}

/// For distances that may be far below a centimetre: one decimal there.
pub fn fine_millimetres(value_m: f64) -> String {
    let value_mm = value_m * 1000.0;
    let decimals = usize::from(value_mm.abs() < 9.95);
    signed(format!("{value_mm:.decimals$} mm"))
}

pub fn degrees(value_rad: f64) -> String {
    signed(format!("{:.0}\u{b0}", value_rad.to_degrees()))
}

pub fn volts(value_v: f64) -> String {
    format!("{value_v:.1} V")
}

pub fn milliseconds(value_ms: f64) -> String {
    format!("{value_ms:.0} ms")
}

/// For times that are a few milliseconds long.
pub fn fine_milliseconds(value_ms: f64) -> String {
    format!("{value_ms:.1} ms")
}

/// A length of time: `4.2 s`, `1 min 05 s`.
pub fn seconds(value_s: f64) -> String {
    if value_s < 60.0 {
        format!("{value_s:.1} s")
    } else {
        let whole = value_s.round() as u64;
        format!("{} min {:02} s", whole / 60, whole % 60)
    }
}

/// A short time: `0.30 s`.
pub fn fine_seconds(value_s: f64) -> String {
    format!("{value_s:.2} s")
}

/// A moment of a replay: `0:04.2`.
pub fn moment(value_s: f64) -> String {
    let tenths = (value_s * 10.0).round() as u64;
    format!("{}:{:02}.{}", tenths / 600, tenths / 10 % 60, tenths % 10)
}

pub fn bytes(value_bytes: i64) -> String {
    let value = value_bytes as f64;
    match value_bytes {
        ..1_000 => format!("{value_bytes} B"),
        1_000..1_000_000 => format!("{:.0} kB", value / 1e3),
        _ => format!("{:.1} MB", value / 1e6),
    }
}

/// Before and after now, as a person says it.
pub fn relative(moment: DateTime<Utc>, now: DateTime<Utc>) -> String {
    let seconds = (moment - now).num_seconds();
    let (amount, unit) = match seconds.unsigned_abs() {
        s @ 0..60 => (s, "s"),
        s @ 60..3_600 => (s / 60, "min"),
        s @ 3_600..172_800 => (s / 3_600, "h"),
        s => (s / 86_400, "days"),
    };
    match seconds {
        -4..=4 => "now".to_owned(),
        5.. => format!("in {amount} {unit}"),
        _ => format!("{amount} {unit} ago"),
    }
}

/// Date and time of day, UTC.
pub fn utc(moment: DateTime<Utc>) -> String {
    moment.format("%Y-%m-%d %H:%M:%S UTC").to_string()
}

/// A value with a unit from a finding.
pub fn with_unit(value: f64, unit: Option<&str>) -> String {
    match unit {
        Some("m") if value.abs() < 1.0 => millimetres(value),
        Some("m") => metres(value),
        Some("rad") => degrees(value),
        Some("s") => seconds(value),
        Some(unit) => signed(format!("{value:.2} {unit}")),
        None => signed(format!("{value:.2}")),
    }
}

/// The first part of a digest or id, enough to compare by eye.
pub fn short(hex: &str) -> &str {
    hex.get(..12).unwrap_or(hex)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_carry_units_and_real_minus_signs() {
        assert_eq!(metres(-1.5), "\u{2212}1.50 m");
        assert_eq!(metres(-0.001), "0.00 m");
        assert_eq!(millimetres(0.0753), "75 mm");
        assert_eq!(degrees(-std::f64::consts::FRAC_PI_2), "\u{2212}90\u{b0}");
        assert_eq!(degrees(-0.001), "0\u{b0}");
        assert_eq!(seconds(65.2), "1 min 05 s");
        assert_eq!(moment(64.25), "1:04.3");
        assert_eq!(bytes(1_530_000), "1.5 MB");
        assert_eq!(with_unit(0.031, Some("m")), "31 mm");
    }

    #[test]
    fn times_are_said_relative_to_now() {
        let now = DateTime::from_timestamp(1_000_000, 0).expect("valid");
        let at = |offset_s: i64| relative(DateTime::from_timestamp(1_000_000 + offset_s, 0).expect("valid"), now);
        assert_eq!(
            [at(2), at(42), at(-300), at(7_300)],
            ["now", "in 42 s", "5 min ago", "in 2 h"]
        );
    }
}
