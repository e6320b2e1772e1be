//! Docks: where robots of this laboratory live when no run has them, and who stands at the own one.

use crate::prepare::is_at;
use anyhow::{Context, Result, bail};
use api::docks::{DOCKS_FORMAT, Docks as Document};
use api::experiment::Pose;
use api::lab::LabDescription;
use control::safety::Geofence;
use std::collections::BTreeMap;
use std::path::Path;

/// Room between the circle of a docked robot and walls, and between the circles of two docked robots: what the safety
/// filter keeps free, and a little for robots that stand askew.
pub const ROOM_M: f64 = 0.08;

/// Poses by robot number. Empty in a laboratory without docks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Docks(BTreeMap<u8, Pose>);

impl Docks {
    /// Reads and checks the file.
    pub fn read(path: &Path, lab: &LabDescription) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("read {}", path.display()))?;
        let document = serde_json::from_slice(&bytes).with_context(|| format!("understand {}", path.display()))?;
        Self::new(&document, lab).with_context(|| format!("use {}", path.display()))
    }

    /// - Errors: another format; a robot that the laboratory does not have, or twice; a dock without room.
    pub fn new(document: &Document, lab: &LabDescription) -> Result<Self> {
        if document.format != DOCKS_FORMAT {
            bail!("format: {:?} is not {DOCKS_FORMAT:?}", document.format);
        }
        let mut docks = BTreeMap::new();
        let mut standing: Vec<(Pose, f64)> = Vec::new();
        for (index, dock) in document.docks.iter().enumerate() {
            let robot = lab.robots.iter().find(|robot| robot.description.name == dock.robot);
            let robot = robot.with_context(|| {
                format!(
                    "docks[{index}].robot: the laboratory has no {:?}; name one of its robots",
                    dock.robot
                )
            })?;
            let (pose, radius_m) = (dock.pose, robot.bounding_radius_m);
            if docks.insert(robot.number, pose).is_some() {
                bail!(
                    "docks[{index}].robot: {} has a dock already; give each robot one",
                    dock.robot
                );
            }
            check_walls(index, pose, radius_m, lab)?;
            check_fence(index, pose, radius_m, lab)?;
            for (place, other) in standing.iter().enumerate() {
                let gap_m = f64::hypot(pose.x_m - other.0.x_m, pose.y_m - other.0.y_m) - radius_m - other.1;
                if gap_m < ROOM_M {
                    bail!(
                        "docks[{index}].pose: {gap_m:.3} m between its robot and that of docks[{place}], at least {ROOM_M} m; \
                         move them apart"
                    );
                }
            }
            standing.push((pose, radius_m));
        }
        Ok(Self(docks))
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Where robot `number` lives.
    pub fn of(&self, number: u8) -> Option<Pose> {
        self.0.get(&number).copied()
    }

    /// A robot that is seen there stands at its own dock.
    pub(crate) fn is_home(&self, number: u8, seen: &crate::pose_frame::SeenPose) -> bool {
        self.of(number).is_some_and(|dock| is_at(seen, &dock))
    }
}

fn check_walls(index: usize, pose: Pose, radius_m: f64, lab: &LabDescription) -> Result<()> {
    let arena = &lab.arena;
    let axes = [("x_m", pose.x_m, arena.width_m), ("y_m", pose.y_m, arena.height_m)];
    for (axis, value_m, side_m) in axes {
        let most_m = 0.5 * side_m - radius_m - ROOM_M;
        if value_m.is_nan() || value_m.abs() > most_m {
            bail!(
                "docks[{index}].pose.{axis}: {value_m} m, {:.3} to {most_m:.3} m; move it into the arena",
                -most_m
            );
        }
    }
    if !pose.yaw_rad.is_finite() {
        bail!(
            "docks[{index}].pose.yaw_rad: {} rad is no angle; give a number",
            pose.yaw_rad
        );
    }
    Ok(())
}

/// A robot beyond the geofence would never be let home.
fn check_fence(index: usize, pose: Pose, radius_m: f64, lab: &LabDescription) -> Result<()> {
    let corners = lab
        .arena
        .contents
        .as_ref()
        .map_or(&[][..], |contents| &contents.geofence);
    if corners.is_empty() {
        return Ok(());
    }
    let fence = Geofence::polygon(corners).map_err(|problem| {
        anyhow::anyhow!(
            "arena.contents.{}: {}, {}; {}",
            problem.field,
            problem.message,
            problem.limit,
            problem.remedy
        )
    })?;
    let least_m = radius_m + ROOM_M;
    let depth_m = fence.depth_m([pose.x_m, pose.y_m]);
    if depth_m < least_m {
        bail!(
            "docks[{index}].pose: {depth_m:.3} m inside the geofence of the arena, at least {least_m:.3} m; move it further inside"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use api::docks::Dock;

    fn lab() -> LabDescription {
        serde_json::from_str(include_str!("../../examples/lab/reference.json")).expect("the reference laboratory")
    }

    fn document(docks: &[(&str, f64, f64)]) -> Document {
        let dock = |(robot, x_m, y_m): &(&str, f64, f64)| Dock {
            robot: (*robot).to_owned(),
            pose: Pose {
                x_m: *x_m,
                y_m: *y_m,
                yaw_rad: 0.0,
            },
        };
        Document {
            format: DOCKS_FORMAT.to_owned(),
            docks: docks.iter().map(dock).collect(),
        }
    }

    #[test]
    fn docks_lie_inside_the_geofence() {
        let fenced = |x_m: f64| {
            let mut lab = lab();
            let contents = lab.arena.contents.get_or_insert_default();
            contents.geofence = vec![[-x_m, -1.5], [x_m, -1.5], [x_m, 1.5], [-x_m, 1.5]];
            let name = lab.robots[0].description.name.clone();
            Docks::new(&document(&[(&name, 0.5, 0.0)]), &lab).map(|_| ())
        };
        fenced(1.8).expect("inside");
        let words = fenced(0.6).expect_err("too close").to_string();
        assert!(words.contains("docks[0].pose") && words.contains("geofence"), "{words}");
    }

    #[test]
    fn the_example_fits_the_reference_laboratory() {
        let text = include_str!("../../examples/lab/docks.json");
        let docks = Docks::new(&serde_json::from_str(text).expect("a document"), &lab()).expect("docks with room");
        assert!(!docks.is_empty() && docks.of(1).is_some() && docks.of(250).is_none());
    }

    #[test]
    fn docks_without_room_or_robot_are_refused_in_words() {
        let problem = |docks: &[(&str, f64, f64)]| {
            let error = Docks::new(&document(docks), &lab()).expect_err("a problem");
            format!("{error:#}")
        };
        assert!(problem(&[("nobody", 0.0, 0.0)]).contains("docks[0].robot"));
        assert!(problem(&[("omni-01", 0.0, 0.0), ("omni-01", 1.0, 0.0)]).contains("docks[1].robot"));
        // 2.0 m to the wall, 0.25 m of robot, 0.08 m of room.
        assert!(problem(&[("omni-01", 1.68, 0.0)]).contains("docks[0].pose.x_m"));
        assert!(problem(&[("omni-01", f64::NAN, 0.0)]).contains("docks[0].pose.x_m"));
        assert!(problem(&[("omni-01", 0.0, 0.0), ("omni-02", 0.57, 0.0)]).contains("docks[1].pose"));
        assert!(Docks::new(&document(&[("omni-01", 1.66, 0.0), ("omni-02", 1.07, 0.0)]), &lab()).is_ok());
    }
}
