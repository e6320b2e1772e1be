//! Sizes at the end of what the library allows.

use super::taken::Taken;
use crate::hypothesis::Axis;

/// So near, as a share of the change up to there, a fit has been stopped by the end.
const NEAR: f64 = 0.01;

/// What a fit would make larger than the library allows is larger than any effect of this kind, or another effect: it is not confirmed.
pub(super) fn reserve_ends(all: &mut [Taken]) {
    for taken in all.iter_mut().filter(|taken| !taken.is_absorbed) {
        let member = &taken.finalist.member;
        let axes = member.candidate.axes.iter().zip(&member.values);
        let stopped = axes.filter_map(|(axis, value)| Some((axis, end_at(axis, *value)?)));
        let why: Vec<String> = stopped
            .map(|(axis, end)| {
                let unit = if axis.unit == "1" {
                    String::new()
                } else {
                    format!(" {}", axis.unit)
                };
                format!(
                    "its {} stands at {end}{unit}, the end of what the library allows, so the effect is larger than that, or another one",
                    axis.name
                )
            })
            .collect();
        taken.reserved.extend(why);
    }
}

/// The end of an axis at which a size stands; where it has no effect is none.
fn end_at(axis: &Axis, value: f64) -> Option<f64> {
    let is_there = |end: f64| {
        let change = if axis.neutral.is_finite() {
            end - axis.neutral
        } else {
            end
        };
        change != 0.0 && change.is_finite() && (value - end).abs() <= NEAR * change.abs()
    };
    let of_size = axis.carries_size.then_some([axis.low, axis.high])?;
    of_size.into_iter().find(|end| is_there(*end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_at_the_end_of_its_range_is_not_confirmed() {
        let at = |name: &str, value: f64| {
            let mut taken = Taken::sample(name, 40.0);
            taken.finalist.member.values[0] = value;
            let mut all = [taken];
            reserve_ends(&mut all);
            all[0].reservations()
        };
        let limited = at("acceleration_limit", 0.0501);
        assert!(
            limited.iter().any(|why| why.contains("limit stands at 0.05 m/s2")),
            "{limited:?}"
        );
        let gain = at("weak_motor", 0.2);
        assert!(
            gain.iter().any(|why| why.contains("gain stands at 0.2, the end")),
            "{gain:?}"
        );
        assert!(!at("command_delay", 0.4999).is_empty(), "0.5 s at most");
        for (name, value) in [("command_delay", 0.3), ("acceleration_limit", 0.06), ("gyro_bias", 0.2)] {
            assert_eq!(at(name, value), Vec::<String>::new(), "{name}");
        }
    }

    #[test]
    fn where_an_effect_is_none_no_range_ends() {
        let axis = |neutral: f64| Axis {
            name: "mass",
            unit: "kg",
            neutral,
            low: 0.0,
            high: f64::INFINITY,
            practical: 0.1,
            carries_size: true,
        };
        assert_eq!(end_at(&axis(0.0), 0.0), None);
        assert_eq!(end_at(&axis(1.0), 0.005), Some(0.0));
        assert_eq!(end_at(&axis(1.0), f64::INFINITY), None);
        let place = Axis {
            carries_size: false,
            ..axis(1.0)
        };
        assert_eq!(end_at(&place, 0.0), None, "a place has no size");
    }
}
