//! What the Robots page shows.

use crate::pages::words;
use crate::state::State;
use crate::theme::{self, Tone};
use api::health::{BatteryLevel, RobotActivity};
use api::robot::RobotView;

#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub name: String,
    pub kind: String,
    pub state: String,
    pub tone: Tone,
    pub battery: String,
    pub battery_tone: Tone,
    pub link: String,
    pub link_tone: Tone,
    pub message: String,
}

/// One row a robot; `None` until the server answered.
pub fn rows(state: &State) -> Option<Vec<Row>> {
    let robots = state.lab.robots.as_deref()?;
    Some(
        robots
            .iter()
            .map(|view| {
                let (word, tone) = state_word(view);
                let (battery, battery_tone) = battery(view);
                let (link, link_tone) = link(view);
                Row {
                    name: view.name.clone(),
                    kind: words::chassis(&view.robot.description.chassis).to_owned(),
                    state: word.to_owned(),
                    tone,
                    battery,
                    battery_tone,
                    link,
                    link_tone,
                    message: message(view),
                }
            })
            .collect(),
    )
}

/// A robot on its way home or at its dock may be had for a run all the same, unless the message says why not.
fn state_word(view: &RobotView) -> (&str, Tone) {
    match (view.state.as_str(), view.activity) {
        ("idle", Some(RobotActivity::DrivingHome)) => ("Driving home", Tone::Active),
        ("idle", Some(RobotActivity::Charging)) => ("Charging", Tone::Good),
        ("idle", None) => ("Ready", Tone::Good),
        ("leased", _) => ("In a run", Tone::Active),
        ("offline", _) => ("Offline", Tone::Error),
        (other, _) => (other, Tone::Neutral),
    }
}

/// Voltage without the load and level, or what there is.
fn battery(view: &RobotView) -> (String, Tone) {
    let Some(health) = &view.health else {
        let text = view.bus_v.map_or_else(|| "not measured".to_owned(), theme::volts);
        return (text, Tone::Neutral);
    };
    let (word, tone) = match health.battery {
        BatteryLevel::Good => ("good", Tone::Neutral),
        BatteryLevel::Low => ("low", Tone::Warning),
        BatteryLevel::Critical => ("critical", Tone::Error),
        BatteryLevel::Empty => ("empty", Tone::Error),
    };
    (format!("{}, {word}", theme::volts(health.rest_v)), tone)
}

/// Delay that 95 of 100 frames keep, its jitter and the lost frames.
fn link(view: &RobotView) -> (String, Tone) {
    let Some(link) = view.link.filter(|_| view.state != "offline") else {
        return ("not measured".to_owned(), Tone::Neutral);
    };
    let text = format!(
        "{} \u{b1} {}, {:.1} % lost",
        theme::fine_milliseconds(link.delay_p95_ms),
        theme::fine_milliseconds(link.jitter_ms),
        100.0 * link.loss_share
    );
    // The link's limit is 12 ms one way.
    let tone = if link.delay_p95_ms > 12.0 || link.loss_share > 0.1 {
        Tone::Warning
    } else {
        Tone::Neutral
    };
    (text, tone)
}

/// What the service says, and what the robot says about itself.
fn message(view: &RobotView) -> String {
    let mut parts: Vec<&str> = view.message.as_deref().into_iter().collect();
    if let Some(health) = &view.health {
        let told = |words: &str| view.message.as_deref().is_some_and(|message| message.contains(words));
        if health.stalled && !told("motor") {
            parts.push("a motor was blocked");
        }
        if health.sensor_fault && !told("sensor") {
            parts.push("a sensor is faulty");
        }
        if !health.bounded_estimate && view.state == "leased" {
            parts.push("it does not know its own pose well");
        }
    }
    parts.join("; ")
}

/// The arena in one line.
pub fn arena(state: &State) -> Option<(String, Tone)> {
    let view = state.lab.arenas.as_deref()?.first()?;
    let (word, tone) = match view.state.as_str() {
        "free" => ("is free", Tone::Good),
        "leased" => ("is in use", Tone::Active),
        "held" => ("is held", Tone::Warning),
        "offline" => ("is offline", Tone::Error),
        other => (other, Tone::Neutral),
    };
    let size = format!(
        "{} by {}",
        theme::metres(view.arena.width_m),
        theme::metres(view.arena.height_m)
    );
    let message = view
        .message
        .as_deref()
        .map(|m| format!(" {}", words::full_stop(m)))
        .unwrap_or_default();
    Some((
        format!("Arena \u{201c}{}\u{201d} ({size}) {word}.{message}", view.arena.name),
        tone,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use api::health::{LinkQuality, RobotHealth};

    fn view() -> RobotView {
        let lab: api::lab::LabDescription =
            serde_json::from_str(include_str!("../../../../examples/lab/reference.json"))
                .expect("the reference laboratory");
        RobotView {
            name: "omni-01".to_owned(),
            arena: "reference".to_owned(),
            robot: lab.robots[0].clone(),
            state: "idle".to_owned(),
            message: Some("is charging (battery low)".to_owned()),
            bus_v: Some(23.04),
            health: Some(RobotHealth {
                battery: BatteryLevel::Low,
                rest_v: 22.46,
                stalled: true,
                sensor_fault: false,
                bounded_estimate: true,
            }),
            link: Some(LinkQuality {
                loss_share: 0.0123,
                delay_p50_ms: 2.0,
                delay_p95_ms: 13.04,
                jitter_ms: 1.5,
            }),
            activity: None,
        }
    }

    #[test]
    fn health_and_link_are_told_in_words_with_units() {
        let view = view();
        assert_eq!(battery(&view), ("22.5 V, low".to_owned(), Tone::Warning));
        assert_eq!(
            link(&view),
            ("13.0 ms \u{b1} 1.5 ms, 1.2 % lost".to_owned(), Tone::Warning)
        );
        assert_eq!(message(&view), "is charging (battery low); a motor was blocked");
    }

    #[test]
    fn the_way_home_and_the_dock_have_words_and_a_run_goes_before_them() {
        let doing = |state: &str, activity| {
            let view = RobotView {
                state: state.to_owned(),
                activity,
                ..view()
            };
            state_word(&view).0.to_owned()
        };
        assert_eq!(doing("idle", Some(RobotActivity::DrivingHome)), "Driving home");
        assert_eq!(doing("idle", Some(RobotActivity::Charging)), "Charging");
        assert_eq!(doing("idle", None), "Ready");
        assert_eq!(doing("leased", Some(RobotActivity::Charging)), "In a run");
        assert_eq!(doing("offline", Some(RobotActivity::Charging)), "Offline");
    }

    #[test]
    fn what_is_not_told_is_not_measured() {
        let view = RobotView {
            health: None,
            link: None,
            message: None,
            ..view()
        };
        assert_eq!(battery(&view), ("23.0 V".to_owned(), Tone::Neutral));
        assert_eq!(link(&view).0, "not measured");
        assert_eq!(message(&view), "");
    }
}
