//! A tracker's stream of poses: newline-delimited JSON on a local socket, about 120 frames a second.

use super::{Localisation, line};
use crate::clock::monotonic_us;
use crate::pose_frame::{PoseFrame, SeenPose};
use crate::record::CameraName;
use serde::Deserialize;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Debug, Deserialize)]
struct Line<'a> {
    frame: u64,
    #[serde(borrow)]
    camera: std::borrow::Cow<'a, str>,
    exposure_us: i64,
    poses: Vec<TrackedPose>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct TrackedPose {
    number: u8,
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
}

/// Reads on a thread of its own until the process ends.
pub(super) fn start(localisation: Arc<Localisation>, socket: PathBuf) -> io::Result<()> {
    std::thread::Builder::new().name("tracker".to_owned()).spawn(move || {
        let mut camera: CameraName = "".into();
        line::read_for_ever("tracker", &socket, |bytes| {
            localisation.take(frame(bytes, &mut camera)?);
            Ok(())
        });
    })?;
    Ok(())
}

fn frame(line: &[u8], camera: &mut CameraName) -> io::Result<PoseFrame> {
    let arrival_us = monotonic_us();
    let parsed: Line = serde_json::from_slice(line)?;
    if parsed.camera != **camera {
        *camera = parsed.camera.as_ref().into();
    }
    // A picture cannot come from the future; a wrong clock must not look fresh for ever.
    let exposure_us = parsed.exposure_us.min(arrival_us);
    let seen = |pose: TrackedPose| SeenPose {
        number: pose.number,
        x_m: pose.x_m,
        y_m: pose.y_m,
        yaw_rad: pose.yaw_rad,
        velocity: None,
        spread: None,
    };
    Ok(PoseFrame {
        frame: parsed.frame,
        camera: camera.clone(),
        exposure_us,
        received_us: exposure_us,
        located_us: arrival_us,
        arrival_us,
        poses: parsed.poses.into_iter().map(seen).collect(),
        refused: Vec::new(),
    })
}
