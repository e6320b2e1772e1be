//! Calibration files from pictures of a tag board.

use super::pgm::Picture;
use anyhow::{Context, Result, bail};
use localise::{
    Board, BoardTag, BoardView, Calibration, CalibrationSettings, Detector, DetectorSettings, Frame, Lens, calibrate,
};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Rounds of detecting with the lens found so far: the second sees straight edges.
const ROUNDS: usize = 3;

/// `robopheus.board/1`: where the tags of the board are; in the first picture these are places in the world.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoardDocument {
    pub format: String,
    /// Height of the board above the floor in the first picture.
    pub z_m: f64,
    pub tags: Vec<BoardTagDocument>,
}

/// One tag of the board.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoardTagDocument {
    pub id: u16,
    pub x_m: f64,
    pub y_m: f64,
    #[serde(default)]
    pub yaw_rad: f64,
    /// Side of the black border.
    pub edge_m: f64,
}

/// Calibrates from pictures; the first shows the board at its places in the world.
///
/// - `camera`: name in the file.
pub fn calibrate_pictures(camera: &str, board: &BoardDocument, pictures: &[Picture]) -> Result<Calibration> {
    if board.format != "robopheus.board/1" {
        bail!("format: {:?} is not robopheus.board/1", board.format);
    }
    let Some(first) = pictures.first() else {
        bail!("views: there are no pictures; take at least four of the board");
    };
    let (width_px, height_px) = (first.width_px, first.height_px);
    if let Some(other) = pictures
        .iter()
        .position(|picture| (picture.width_px, picture.height_px) != (width_px, height_px))
    {
        bail!("views[{other}] is not {width_px} x {height_px} px as the first picture is");
    }
    let settings = CalibrationSettings {
        camera: camera.to_owned(),
        width_px,
        height_px,
        ..CalibrationSettings::default()
    };
    let mut lens = Lens::ideal(width_px, height_px);
    let mut found = None;
    for _ in 0..ROUNDS {
        let views = pictures
            .iter()
            .map(|picture| view(board, picture, &lens))
            .collect::<Result<Vec<_>>>()?;
        let calibration = calibrate(&views, &settings)?;
        lens = *calibration.document.check()?.lens();
        found = Some(calibration);
    }
    found.context("no round was made")
}

fn view(board: &BoardDocument, picture: &Picture, lens: &Lens) -> Result<BoardView> {
    let frame = Frame::new(picture.width_px, picture.height_px, &picture.pixels)?;
    let mut detector = Detector::new(DetectorSettings {
        identities: 587,
        ..DetectorSettings::default()
    });
    let mut detections = detector.search(&frame, lens).tags;
    // Tags in the hall that are not on the board say nothing.
    detections.retain(|detection| board.tags.iter().any(|tag| tag.id == detection.id));
    let tags = board.tags.iter().map(|tag| BoardTag {
        id: tag.id,
        x_m: tag.x_m,
        y_m: tag.y_m,
        yaw_rad: tag.yaw_rad,
        edge_m: tag.edge_m,
    });
    Ok(BoardView {
        board: Board {
            tags: tags.collect(),
            z_m: board.z_m,
        },
        detections,
    })
}

/// Reads board and pictures, writes the calibration file and tells how good it is.
pub fn calibrate_files(camera: &str, board: &Path, pictures: &[PathBuf], out: &Path) -> Result<()> {
    let board: BoardDocument = serde_json::from_slice(&read(board)?)
        .with_context(|| format!("{} is not a board, robopheus.board/1", board.display()))?;
    let pictures = pictures
        .iter()
        .map(|path| Picture::from_pgm(&read(path)?).with_context(|| path.display().to_string()))
        .collect::<Result<Vec<_>>>()?;
    let calibration = calibrate_pictures(camera, &board, &pictures)?;
    let temporary = out.with_extension("json.new");
    std::fs::write(&temporary, calibration.document.to_json()).with_context(|| temporary.display().to_string())?;
    std::fs::rename(&temporary, out).with_context(|| out.display().to_string())?;
    println!("{}", report(&calibration));
    println!("written: {}", out.display());
    Ok(())
}

fn report(calibration: &Calibration) -> String {
    let Calibration {
        document,
        view_rms_px,
        corners,
        left_out,
        deviation,
        ..
    } = calibration;
    let views: Vec<String> = view_rms_px.iter().map(|rms| format!("{rms:.3}")).collect();
    let [fx, fy] = document.focal_px;
    let [x, y, z] = document.position_m;
    let [sx, sy, sz] = deviation.position_m.map(|metres| metres * 1e3);
    format!(
        "{}: {corners} corners used, {left_out} left out, {:.3} px root mean square\n\
         per view: {} px\n\
         focal length {fx:.2} x {fy:.2} px (+-{:.2} x {:.2})\n\
         position {x:.4} {y:.4} {z:.4} m (+-{sx:.2} {sy:.2} {sz:.2} mm)",
        document.camera,
        document.rms_px,
        views.join(" "),
        deviation.focal_px[0],
        deviation.focal_px[1],
    )
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}
