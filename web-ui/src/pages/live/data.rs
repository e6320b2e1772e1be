//! What the Live page shows.

use crate::arena_view::{Ink, Scene, SceneRobot, Shape, Trail};
use crate::course::courses;
use crate::pages::words;
use crate::state::State;
use crate::theme::{self, Tone};
use api::live::{LiveLearning, LiveRobot, LiveShadow, LiveStages};
use api::run::RunView;

/// Length of a trail, seconds of the run.
const TRAIL_S: f64 = 20.0;
/// Live frames in the means of the stages: one second.
const STAGE_FRAMES: usize = 20;
/// Ages above these are worth a colour.
const LINK_LATE_MS: f64 = 50.0;
const LINK_LOST_MS: f64 = 100.0;
/// Below this the battery is nearly empty (24 V packs).
const BATTERY_LOW_V: f64 = 22.0;
/// No frame for this long: the picture is old.
pub const PICTURE_OLD_S: f64 = 1.0;

/// The run the page is about: the one on the floor, else the last one that was watched.
pub fn run(state: &State) -> Option<&RunView> {
    let watched = || state.live.run.and_then(|id| state.queue.find(id));
    state
        .queue
        .active()
        .or_else(|| watched().filter(|_| !state.live.frames.is_empty()))
}

pub fn scene(state: &State, run: &RunView) -> Scene {
    let experiment = &run.experiment;
    let mut scene = Scene::of_arena(state.lab.arena_or_reference(&experiment.arena));
    let courses = courses(experiment, &state.lab).into_iter();
    scene.paths = courses.flatten().map(|course| course.line).collect();
    scene.add_targets(experiment);
    let Some(last) = state.live.frames.back() else {
        return scene;
    };
    scene.drawings.clone_from(&state.live.drawings.1);
    for live in &last.robots {
        let index = experiment.robots.iter().position(|r| r.name == live.name).unwrap_or(0);
        let points = state
            .live
            .frames
            .iter()
            .filter(|f| f.tick >= 0 && last.time_s - f.time_s <= TRAIL_S)
            .filter_map(|f| f.robots.iter().find(|r| r.name == live.name).map(|r| [r.x_m, r.y_m]))
            .collect();
        scene.trails.push(Trail {
            points,
            ink: Ink::Robot(index),
            dashed: false,
            faint: false,
        });
        scene.robots.push(SceneRobot {
            name: live.name.clone(),
            pose: [live.x_m, live.y_m, live.yaw_rad],
            shape: Shape::of(state.lab.robot(&live.name).map(|r| &r.description)),
            ink: Ink::Robot(index),
            ghost: false,
            show_name: true,
            mark: live.safety.as_deref().map(|code| words::safety(code).to_owned()),
        });
    }
    for shadow in &last.shadow {
        let index = experiment
            .robots
            .iter()
            .position(|r| r.name == shadow.name)
            .unwrap_or(0);
        scene.robots.push(SceneRobot {
            name: shadow.name.clone(),
            pose: [shadow.x_m, shadow.y_m, shadow.yaw_rad],
            shape: Shape::of(state.lab.robot(&shadow.name).map(|r| &r.description)),
            ink: Ink::Robot(index),
            ghost: true,
            show_name: false,
            mark: None,
        });
    }
    scene
}

#[derive(Debug, Clone, PartialEq)]
pub struct RobotCard {
    pub name: String,
    pub index: usize,
    /// Name, value, tone.
    pub lines: Vec<(&'static str, String, Tone)>,
}

pub fn robots(state: &State, run: &RunView) -> Vec<RobotCard> {
    let Some(last) = state.live.frames.back() else {
        return Vec::new();
    };
    last.robots
        .iter()
        .map(|robot| RobotCard {
            name: robot.name.clone(),
            index: run
                .experiment
                .robots
                .iter()
                .position(|r| r.name == robot.name)
                .unwrap_or(0),
            lines: lines(
                robot,
                last.shadow.iter().find(|shadow| shadow.name == robot.name),
                last.learning.iter().find(|learning| learning.name == robot.name),
            ),
        })
        .collect()
}

fn lines(
    robot: &LiveRobot,
    shadow: Option<&LiveShadow>,
    learning: Option<&LiveLearning>,
) -> Vec<(&'static str, String, Tone)> {
    let (link, link_tone) = age(robot.link_age_ms);
    let (pose, pose_tone) = age(robot.pose_age_ms);
    let battery_tone = if robot.bus_v < BATTERY_LOW_V {
        Tone::Warning
    } else {
        Tone::Neutral
    };
    let (safety, safety_tone) = robot
        .safety
        .as_deref()
        .map_or(("leaves it alone", Tone::Neutral), |code| {
            (words::safety(code), Tone::Warning)
        });
    let mut lines = vec![
        ("Link", link, link_tone),
        ("Pose", pose, pose_tone),
        ("Battery", theme::volts(robot.bus_v), battery_tone),
        ("Safety filter", safety.to_owned(), safety_tone),
    ];
    if let Some(shadow) = shadow {
        let apart_m = (shadow.x_m - robot.x_m).hypot(shadow.y_m - robot.y_m);
        lines.push((
            "Virtual robot",
            format!("{} away", theme::millimetres(apart_m)),
            Tone::Neutral,
        ));
    }
    if let Some(learning) = learning {
        let [parent, learnt] = [learning.parent_m, learning.learnt_m].map(theme::millimetres);
        let is_better = learning.learnt_m < learning.parent_m;
        let tone = if is_better { Tone::Good } else { Tone::Neutral };
        lines.push(("0.5 s ahead", format!("twin {parent}, learnt {learnt}"), tone));
    }
    lines
}

fn age(value_ms: f64) -> (String, Tone) {
    let tone = match value_ms {
        v if v > LINK_LOST_MS => Tone::Error,
        v if v > LINK_LATE_MS => Tone::Warning,
        _ => Tone::Neutral,
    };
    (format!("{} old", theme::milliseconds(value_ms)), tone)
}

/// Facts about the run as a whole.
pub fn facts(state: &State) -> Vec<(String, String)> {
    let Some(last) = state.live.frames.back() else {
        return Vec::new();
    };
    let time = if last.tick < 0 {
        "before the start".to_owned()
    } else {
        theme::seconds(last.time_s)
    };
    vec![
        ("Time".to_owned(), time),
        ("Tick".to_owned(), last.tick.max(0).to_string()),
        ("Missed ticks".to_owned(), last.ticks_missed.to_string()),
    ]
}

/// How long each stage from light to command takes, means of the last second; empty before the first picture.
pub fn stages(state: &State) -> Vec<(String, String)> {
    let frames = state.live.frames.iter().rev().take(STAGE_FRAMES);
    let known: Vec<_> = frames.filter_map(|frame| frame.stages).collect();
    let pictures: u32 = known.iter().map(|stages| stages.pictures).sum();
    if pictures == 0 {
        return Vec::new();
    }
    let mean = |part: fn(&LiveStages) -> f64| {
        let weighted = known.iter().map(|stages| part(stages) * f64::from(stages.pictures));
        weighted.sum::<f64>() / f64::from(pictures)
    };
    let parts = [
        ("Camera", mean(|stages| stages.camera_ms)),
        ("Finding tags", mean(|stages| stages.locate_ms)),
        ("Fusion", mean(|stages| stages.fuse_ms)),
        ("Waiting for tick", mean(|stages| stages.wait_ms)),
        ("Law and filter", mean(|stages| stages.control_ms)),
        ("Robot link", mean(|stages| stages.link_ms)),
    ];
    let sum = parts.iter().map(|(_, ms)| ms).sum();
    let all = parts.into_iter().chain([("Light to robot", sum)]);
    all.map(|(name, ms)| (name.to_owned(), theme::fine_milliseconds(ms)))
        .collect()
}

/// Newest log lines of the run's own controller, with their times.
pub fn log(state: &State) -> Vec<(f64, &str)> {
    let lines = state.live.log.iter();
    lines.map(|(time_s, text)| (*time_s, text.as_str())).collect()
}

/// Says how fresh the picture is.
pub fn connection(state: &State) -> (String, Tone) {
    let live = &state.live;
    if state.queue.active().is_none() {
        return ("Last picture".to_owned(), Tone::Neutral);
    }
    let age_s = state.clock.time_s - live.last_frame_at_s;
    match (live.open, live.frames.is_empty()) {
        (false, _) => ("Connecting \u{2026}".to_owned(), Tone::Warning),
        (true, true) => ("Waiting for the first picture \u{2026}".to_owned(), Tone::Active),
        (true, false) if age_s > PICTURE_OLD_S => (format!("Picture is {} old", theme::seconds(age_s)), Tone::Warning),
        (true, false) => ("Live".to_owned(), Tone::Good),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_well_a_robot_is_predicted_is_told_where_somebody_learns() {
        let robot = LiveRobot {
            name: "omni-01".to_owned(),
            x_m: 0.5,
            y_m: 0.25,
            yaw_rad: 0.0,
            target_x_m: 0.0,
            target_y_m: 0.0,
            pose_age_ms: 8.0,
            link_age_ms: 4.0,
            bus_v: 24.1,
            safety: None,
        };
        let learning = LiveLearning {
            name: "omni-01".to_owned(),
            parent_m: 0.0412,
            learnt_m: 0.0091,
        };
        assert!(lines(&robot, None, None).iter().all(|line| line.0 != "0.5 s ahead"));
        let told = lines(&robot, None, Some(&learning));
        assert_eq!(
            told.last(),
            Some(&("0.5 s ahead", "twin 41 mm, learnt 9 mm".to_owned(), Tone::Good))
        );
    }
}
