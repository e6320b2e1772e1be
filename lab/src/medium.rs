//! Whether the medium carries a run: asked before anything moves.

use crate::run::Conclusion;
use api::run::Whose;
use robot::medium::{MediumError, MediumKind, MediumProfile, Traffic};

/// A medium by its name on the command line.
pub fn named(name: &str) -> Result<MediumKind, String> {
    MediumProfile::named(name).map(|profile| profile.kind).ok_or_else(|| {
        let names: Vec<_> = MediumProfile::all().iter().map(|profile| profile.name).collect();
        format!("choose one of {}", names.join(", "))
    })
}

/// Share of the medium's time that a run takes: commands and telemetry of all robots at `rate_hz`, both ways.
///
/// - `grouped`: all robots read groups, so that their commands share frames.
pub fn share(profile: &MediumProfile, robots: usize, rate_hz: f64, grouped: bool) -> Result<f64, MediumError> {
    let group = if grouped { profile.largest_group().max(1) } else { 1 };
    profile.check(&Traffic::at_rate(robots, rate_hz, group.min(robots.max(1))))
}

/// Refuses a run that does not fit.
pub(crate) fn check(profile: &MediumProfile, robots: usize, rate_hz: f64, grouped: bool) -> Result<(), Conclusion> {
    let refused = |error: MediumError| {
        let message = format!(
            "{robots} robots at {rate_hz} Hz do not fit on the medium {}: {error}.",
            profile.name
        );
        Conclusion::failed(Whose::Platform, "medium_full", message)
    };
    share(profile, robots, rate_hz, grouped).map(|_| ()).map_err(refused)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Characters of frames as `docs/link.md` has them.
    #[test]
    fn a_wifi_carries_what_its_time_on_air_allows_and_the_refusal_says_why() {
        let wifi = MediumProfile::named("wifi").expect("a medium");
        let frame_s = |characters: f64| 120e-6 + characters / 6e6;
        let up_s = 120.0 * frame_s(154.0) + 10.0 * frame_s(114.0) + frame_s(156.0);
        let alone_s = 120.0 * frame_s(82.0) + up_s;
        let most = (0.6 / alone_s).floor() as usize;
        assert!(check(wifi, most, 120.0, false).is_ok());
        let refusal = check(wifi, most + 1, 120.0, false).expect_err("one too many");
        let fault = refusal.fault.expect("a fault");
        assert_eq!((fault.whose, fault.code.as_str()), (Whose::Platform, "medium_full"));
        assert!(
            fault.message.contains(&format!("{} robots at 120 Hz", most + 1)),
            "{}",
            fault.message
        );
        assert!(check(wifi, most + 1, 120.0, true).is_ok(), "groups save frames");
    }

    #[test]
    fn a_serial_line_carries_no_run_at_120_hz() {
        let serial = MediumProfile::named("serial").expect("a medium");
        assert!(check(serial, 1, 120.0, false).is_err());
        assert!(check(MediumProfile::of(MediumKind::Ideal), 16, 120.0, false).is_ok());
        assert!(named("pigeon").expect_err("unknown").contains("digimesh"));
    }
}
