//! `robopheus-camera` as a program: calibration from pictures, poses from a recorded stream, words for what cannot be.

#[path = "../../localise/tests/support/mod.rs"]
mod support;

use lab::camera::pgm::Picture;
use lab::camera::refusals::RefusalLine;
use lab::camera::sighting::Sighting;
use localise::CameraDocument;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use support::{Place, Plane, Random, Renderer, Style, Truth, camera_over_half, spread_out};

const SIDES: [usize; 2] = [640, 480];

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("robopheus-camera-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a folder");
        Self(path)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).expect("written");
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_robopheus-camera"))
}

fn calibrate(board: &Path, pictures: &[PathBuf], out: &Path) -> Output {
    let mut command = program();
    command.args(["calibrate", "--camera", "cam-7", "--board"]).arg(board);
    command.arg("--out").arg(out).args(pictures);
    command.output().expect("runs")
}

/// 5 x 4 tags of 0.2 m around a middle.
fn tags(middle_x_m: f64) -> Vec<(u16, f64, f64)> {
    (0..20)
        .map(|id| {
            let (column, row) = (f64::from(id % 5), f64::from(id / 5));
            (id, middle_x_m + 0.3 * (column - 2.0), 0.3 * (row - 1.5))
        })
        .collect()
}

fn board(middle_x_m: f64) -> Vec<u8> {
    let tags: Vec<_> = tags(middle_x_m)
        .iter()
        .map(|(id, x_m, y_m)| json!({"id": id, "x_m": x_m, "y_m": y_m, "edge_m": 0.2}))
        .collect();
    json!({"format": "robopheus.board/1", "z_m": 0.0, "tags": tags})
        .to_string()
        .into_bytes()
}

/// The board tilted in front of the camera.
fn tilted(tilt: [f64; 2], [x, y]: [f64; 2]) -> Plane {
    let ((sa, ca), (sb, cb)) = (tilt[0].sin_cos(), tilt[1].sin_cos());
    let facing = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
    let about_x = [[1.0, 0.0, 0.0], [0.0, ca, -sa], [0.0, sa, ca]];
    let about_y = [[cb, 0.0, sb], [0.0, 1.0, 0.0], [-sb, 0.0, cb]];
    let times = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| {
        [0, 1, 2].map(|i: usize| [0, 1, 2].map(|j: usize| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
    };
    Plane {
        rotation: times(times(facing, about_y), about_x),
        shift: [x, y, 1.9],
    }
}

/// Pictures of the board: on the floor around x = -0.9 m first, then tilted.
fn pictures(truth: &Truth) -> Vec<Vec<u8>> {
    let views = [
        ([0.5, 0.0], [0.0, 0.0]),
        ([-0.5, 0.2], [-0.5, -0.3]),
        ([0.1, 0.55], [0.5, 0.3]),
        ([0.0, -0.5], [0.5, -0.3]),
        ([0.4, 0.4], [-0.5, 0.3]),
        ([-0.4, -0.4], [0.0, 0.4]),
        ([0.35, -0.4], [0.0, -0.4]),
        ([-0.3, 0.45], [0.6, 0.0]),
    ];
    let planes = views.map(|(tilt, shift)| (tilted(tilt, shift), 0.0));
    let all = std::iter::once((truth.floor(0.0), -0.9)).chain(planes);
    let style = Style {
        body_m: 0.0,
        floor: 215.0,
        exposure_s: 0.0,
        ..Style::default()
    };
    let (mut renderer, mut random) = (Renderer::new(truth.clone()), Random(9));
    all.map(|(plane, middle_x_m)| {
        let places: Vec<Place> = tags(middle_x_m)
            .into_iter()
            .map(|(id, x_m, y_m)| Place {
                edge_m: 0.2,
                ..Place::tag(id, x_m, y_m, 0.0)
            })
            .collect();
        renderer.render(&plane, &places, &style, &mut random);
        let [width_px, height_px] = SIDES;
        Picture {
            width_px,
            height_px,
            pixels: renderer.pixels.clone(),
        }
        .to_pgm()
    })
    .collect()
}

/// Largest distance on the floor half that the camera sees between what truth and file say of a pixel.
fn floor_error_m(truth: &Truth, document: &CameraDocument) -> f64 {
    let (real, found) = (truth.camera(), document.check().expect("a camera"));
    let mut worst: f64 = 0.0;
    for column in 0..17 {
        for row in 0..13 {
            let at = [-1.8 + 0.1 * f64::from(column), -1.2 + 0.2 * f64::from(row), 0.1];
            let Some(pixel) = real.project(at) else { continue };
            let direction = found.lens().undistort(pixel).expect("inside the picture");
            let back = found.on_plane(direction, 0.1).expect("the floor is below");
            worst = worst.max((back[0] - at[0]).hypot(back[1] - at[1]));
        }
    }
    worst
}

#[test]
fn pictures_of_a_board_give_the_camera_and_bad_ones_a_reason_and_no_file() {
    let truth = camera_over_half(false);
    let folder = Folder::new("calibrate");
    let board_file = folder.write("board.json", &board(-0.9));
    let files: Vec<PathBuf> = pictures(&truth)
        .iter()
        .enumerate()
        .map(|(index, bytes)| folder.write(&format!("{index}.pgm"), bytes))
        .collect();
    let out = folder.0.join("cam-7.json");
    let output = calibrate(&board_file, &files, &out);
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{words}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let document = CameraDocument::from_json(&std::fs::read_to_string(&out).expect("written")).expect("a calibration");
    let error_m = floor_error_m(&truth, &document);
    println!("{words}worst error on the floor {:.2} mm", 1e3 * error_m);
    assert!(error_m < 0.0015 && document.camera == "cam-7");

    std::fs::remove_file(&out).expect("there");
    let small = folder.write("small.pgm", b"P5\n4 4\n255\n................");
    let no_board = folder.write("none.json", b"{\"format\":\"robopheus.board/2\",\"z_m\":0,\"tags\":[]}");
    let mixed = [files[0].clone(), small.clone(), files[1].clone(), files[2].clone()];
    let flat = vec![files[0].clone(); 4];
    for (board, pictures, word) in [
        (&no_board, &files[..], "robopheus.board/1"),
        (&board_file, &files[..2], "views"),
        (&board_file, &mixed[..], "views[1]"),
        (&board_file, &flat[..], "span of the picture"),
        (&files[0], &files[..], "not a board"),
    ] {
        let output = calibrate(board, pictures, &out);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && words.contains(word), "{word}: {words}");
        assert!(!words.contains("panicked") && !out.exists(), "{words}");
    }
}

/// A frame of the camera stream.
fn frame(sequence: u64, exposure_us: i64, sides: [u16; 2], pixels: &[u8]) -> Vec<u8> {
    frame_of(0, sequence, exposure_us, sides, pixels)
}

fn frame_of(camera: u16, sequence: u64, exposure_us: i64, [width, height]: [u16; 2], pixels: &[u8]) -> Vec<u8> {
    let mut bytes = b"RBCF\x01\x01".to_vec();
    bytes.extend(camera.to_be_bytes());
    bytes.extend(sequence.to_be_bytes());
    bytes.extend(exposure_us.to_be_bytes());
    bytes.extend(3000_u32.to_be_bytes());
    bytes.extend(width.to_be_bytes());
    bytes.extend(height.to_be_bytes());
    bytes.extend((pixels.len() as u32).to_be_bytes());
    bytes.extend(crc32fast::hash(pixels).to_be_bytes());
    let header = crc32fast::hash(&bytes);
    bytes.extend(header.to_be_bytes());
    bytes.extend(pixels);
    bytes
}

#[test]
fn a_recorded_stream_gives_a_line_for_each_good_picture() {
    let truth = camera_over_half(false);
    let folder = Folder::new("serve");
    let calibration = folder.write("cam.json", truth.document().to_json().as_bytes());
    let (mut renderer, mut random) = (Renderer::new(truth.clone()), Random(3));
    let places = spread_out(&mut random, false, 0, 6);
    let mut stream = Vec::new();
    for sequence in 0..12 {
        renderer.render(&truth.floor(0.1), &places, &Style::default(), &mut random);
        let mut bytes = frame(sequence, sequence as i64 * 16_667, [640, 480], &renderer.pixels);
        if sequence == 5 {
            // Damaged on the way: this picture is lost, the next is not.
            bytes[1000] ^= 1;
        }
        stream.extend(bytes);
        if sequence == 7 {
            stream.extend(frame(100, sequence as i64 * 16_667 + 5, [4, 2], &[0; 8]));
        }
    }
    stream.extend_from_slice(b"RBCF cut off");
    let file = folder.write("stream.bin", &stream);
    let output = program()
        .args(["serve", "--tag-height-m", "0.1", "--calibration"])
        .arg(&calibration)
        .arg("--frames")
        .arg(&file)
        .output()
        .expect("runs");
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{words}");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let (refusals, sightings): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.contains("refused"));
    let lines: Vec<Sighting> = sightings
        .into_iter()
        .map(|line| serde_json::from_str(line).expect("a sighting"))
        .collect();
    // Told at once, each kind: the laboratory counts them too.
    let told: Vec<RefusalLine> = refusals
        .into_iter()
        .map(|line| serde_json::from_str(line).expect("a line"))
        .collect();
    let counts: Vec<(u64, u64)> = told
        .iter()
        .map(|line| (line.refused.pixels, line.refused.size))
        .collect();
    assert_eq!(counts, [(1, 0), (1, 1)]);
    let sequences: Vec<u64> = lines.iter().map(|line| line.observation.sequence).collect();
    assert_eq!(sequences, [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11]);
    assert!(lines.iter().all(|line| line.observation.poses.len() == 6));
    assert!(
        words.contains("damaged") && words.contains("4 px is not possible"),
        "{words}"
    );
}

#[test]
fn another_cameras_calibration_is_refused_with_words_that_help() {
    let folder = Folder::new("other");
    let file = include_bytes!("../../examples/lab/cameras/cam-1.json");
    let calibration = folder.write("cam-1.json", file);
    let pictures = |camera| {
        folder.write(
            &format!("of-{camera}.bin"),
            &frame_of(camera, 0, 0, [640, 480], &[90; 640 * 480]),
        )
    };
    let serve = |frames: &Path, more: &[&str]| {
        let mut command = program();
        command.arg("serve").arg("--calibration").arg(&calibration);
        command.arg("--frames").arg(frames).args(more).output().expect("runs")
    };
    let wrong = serve(&pictures(0), &[]);
    let words = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert!(!wrong.status.success() && wrong.stdout.is_empty(), "{words}");
    for part in [
        "cam-1.json",
        "camera cam-1",
        "cam-0",
        "--calibration",
        "--camera-number 0",
    ] {
        assert!(words.contains(part), "{part}: {words}");
    }
    assert!(!words.contains("panicked"), "{words}");
    assert!(serve(&pictures(1), &[]).status.success());
    assert!(serve(&pictures(0), &["--camera-number", "0"]).status.success());
}
