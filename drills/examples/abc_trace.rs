//! Where along a course a robot is off its path, and what the virtual robot ahead of it does there.
//!
//! `abc_trace learn CHASSIS FLOOR DIRECTORY` learns a model once, minutes. `abc_trace drive CHASSIS FLOOR DIRECTORY COURSE WHO`
//! then drives in a second: errors by piece, and with `out=FILE` a line a tick. WHO is `plain`, `plus`, `nominal`, `named` or
//! `model`; further words are `gains=tuned`, `horizon=S`, `bias=false`, `round=N`.

use anyhow::{Context, Result, anyhow, bail};
use control::answer::Answer;
use control::interaction::Settings;
use control::law::{Piece, Place};
use control::path_error::PathError;
use control::team::Team;
use drills::abc::course::{Course, Setting, pieces};
use drills::abc::drive::plant_settings;
use drills::abc::experiment::tuned_on_plant;
use drills::abc::learned::{Case, Threads, learned};
use drills::abc::{floor, settings};
use drills::{Rig, RigSettings};
use emulator::hidden::Hidden;
use lab::record::Record;
use std::io::Write;
use std::path::{Path, PathBuf};
use twin::model_document::ModelDocument;
use twin::pose::Pose;
use twin::robot::{Robot, RobotDescription};

const SEED: u64 = 1;

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["learn", chassis, number, directory] => Subject::new(chassis, number, directory)?.learn(),
        ["drive", chassis, number, directory, course, who, rest @ ..] => {
            Subject::new(chassis, number, directory)?.drive(course, who, rest)
        }
        _ => bail!("learn CHASSIS FLOOR DIRECTORY | drive CHASSIS FLOOR DIRECTORY COURSE WHO [key=value ...]"),
    }
}

/// A robot on a hidden floor, and where its files are.
struct Subject {
    chassis: String,
    number: u64,
    directory: PathBuf,
    setting: Setting,
    description: RobotDescription,
    hidden: Hidden,
}

impl Subject {
    fn new(chassis: &str, number: &str, directory: &str) -> Result<Self> {
        let setting = *settings::committed()?.get(chassis).context("a chassis")?;
        let scenario = Course::L.scene(chassis, &setting)?.scenario()?;
        let description = scenario.robots.first().context("a robot")?.description.clone();
        let number = number.parse()?;
        Ok(Self {
            hidden: floor::floor(&description.name, settings::is_steered(chassis), number, SEED),
            chassis: chassis.to_owned(),
            number,
            directory: directory.into(),
            setting,
            description,
        })
    }

    fn file(&self, what: &str) -> PathBuf {
        self.directory
            .join(format!("{}-{}-{what}.json", self.chassis, self.number))
    }

    fn seed(&self) -> u64 {
        SEED + 1000 * (self.number + 1)
    }

    fn learn(&self) -> Result<()> {
        std::fs::create_dir_all(&self.directory)?;
        let case = Case {
            chassis: &self.chassis,
            description: &self.description,
            setting: &self.setting,
            hidden: &self.hidden,
            seed: self.seed(),
        };
        let found = learned(&case, &Threads(2))?;
        println!("{}\n{}\n{}", found.sentence, found.effects.join(", "), found.residual);
        std::fs::write(self.file("named"), serde_json::to_string(&found.named)?)?;
        std::fs::write(self.file("model"), serde_json::to_string(&found.model)?)?;
        std::fs::write(self.file("tuned"), serde_json::to_string(&tuned_on_plant(&case)?)?)?;
        Ok(())
    }

    fn model(&self, who: &str) -> Result<Option<Robot>> {
        match who {
            "plain" | "plus" => Ok(None),
            "nominal" => Robot::new(self.description.clone())
                .map(Some)
                .map_err(|error| anyhow!("{}", error.message)),
            _ => {
                let document: ModelDocument = read(&self.file(who))?;
                document.robot().map(Some).map_err(|error| anyhow!("{error}"))
            }
        }
    }

    fn drive(&self, name: &str, who: &str, rest: &[&str]) -> Result<()> {
        let (mut setting, mut settings, mut out, mut round) = (self.setting, Settings::default(), None, 1);
        for word in rest {
            match word.split_once('=').context("key=value")? {
                ("gains", "tuned") => setting = read(&self.file("tuned"))?,
                ("horizon", value) => settings.horizon_s = value.parse()?,
                ("bias", value) => settings.learns_bias = value.parse()?,
                ("round", value) => round = value.parse()?,
                ("out", value) => out = Some(std::io::BufWriter::new(std::fs::File::create(value)?)),
                _ => bail!("{word}"),
            }
        }
        let scene = course(name)?.scene(&self.chassis, &setting)?;
        let scenario = scene.scenario()?;
        let rig_settings = RigSettings {
            looks_ahead: who != "plain",
            learns: false,
            ..plant_settings(&self.hidden, self.seed() + 700 + round)
        };
        let mut team = Team::new(&scenario).map_err(|problems| anyhow!("{problems:?}"))?;
        if let Some(model) = self.model(who)? {
            let answer = Answer::of(&model);
            println!(
                "answer: driving {:.3} s, turning {:.3} s",
                answer.driving_s, answer.turning_s
            );
            team = team.with_interaction(std::slice::from_ref(&model), settings);
        }
        let mut rig = Rig::with_team(&scene, &rig_settings, &scenario, team)?;
        let mut trace = Trace::new(pieces(&scenario), out)?;
        while rig.slot() < 95 * 120 {
            let pose = *rig.poses().first().context("a robot")?;
            let more = rig.tick();
            trace.add(pose, &rig)?;
            rig.records.clear();
            if !more {
                break;
            }
        }
        trace.print(&format!("{} {name} {who}", self.chassis));
        Ok(())
    }
}

/// Sums by piece, and the file.
struct Trace<W> {
    path: Vec<Piece>,
    error: PathError,
    /// Squares, m2; largest, m; ticks.
    pieces: Vec<(f64, f64, f64)>,
    out: Option<W>,
    ticks: u32,
}

impl<W: Write> Trace<W> {
    fn new(path: Vec<Piece>, mut out: Option<W>) -> Result<Self> {
        if let Some(out) = &mut out {
            writeln!(
                out,
                "time_s,piece,left_m,yaw_rad,ideal_left_m,ideal_yaw_rad,expected_left_m,expected_yaw_rad,newest_left_m,newest_yaw_rad,\
                 u_m_per_s,r_rad_per_s,steering_rad,wished_u_m_per_s,wished_r_rad_per_s"
            )?;
        }
        Ok(Self {
            error: PathError::new(&path),
            pieces: vec![(0.0, 0.0, 0.0); path.len()],
            path,
            out,
            ticks: 0,
        })
    }

    fn add(&mut self, [x_m, y_m, yaw_rad]: [f64; 3], rig: &Rig) -> Result<()> {
        let off_m = self.error.at([x_m, y_m]);
        let active = self.error.active();
        let (piece, sums) = self
            .path
            .get(active)
            .zip(self.pieces.get_mut(active))
            .context("a piece")?;
        *sums = (sums.0 + off_m * off_m, sums.1.max(off_m), sums.2 + 1.0);
        self.ticks += 1;
        let Some(out) = &mut self.out else { return Ok(()) };
        let team = rig.pilot().team();
        let expected = team.interactions().first().and_then(|one| one.expected());
        let newest = team.seen().first().map(|seen| seen.pose);
        write!(out, "{:.4},{active}", f64::from(self.ticks) / 120.0)?;
        let own = Some(Pose { x_m, y_m, yaw_rad });
        for pose in [
            own,
            expected.map(|[ideal, _]| ideal),
            expected.map(|[_, model]| model),
            newest,
        ] {
            let [left_m, yaw_rad] = pose.map_or([f64::NAN; 2], |pose| beside(piece, &pose));
            write!(out, ",{left_m:.5},{yaw_rad:.5}")?;
        }
        let command = rig.records.iter().find_map(|record| match record {
            Record::Command(command) => Some(command),
            _ => None,
        });
        let command = command.map_or([f64::NAN; 5], |told| {
            [
                told.twist[0],
                told.twist[2],
                told.steering_rad,
                told.desired[0],
                told.desired[2],
            ]
        });
        command.iter().try_for_each(|value| write!(out, ",{value:.5}"))?;
        Ok(writeln!(out)?)
    }

    fn print(&self, title: &str) {
        let squares_m2: f64 = self.pieces.iter().map(|sums| sums.0).sum();
        let largest_m = self.pieces.iter().map(|sums| sums.1).fold(0.0, f64::max);
        let rms_mm = 1e3 * (squares_m2 / f64::from(self.ticks.max(1))).sqrt();
        println!("{title}: {rms_mm:.2} ({:.0}) mm", 1e3 * largest_m);
        for (number, (piece, sums)) in self.path.iter().zip(&self.pieces).enumerate() {
            println!(
                "  piece {number}, {}, {:+.2} 1/m, {:.2} m: {:.1} ({:.0}) mm in {:.1} s, {:.0} % of the squares",
                if piece.backwards { "backwards" } else { "forwards" },
                piece.curvature_per_m,
                piece.length_m,
                1e3 * (sums.0 / sums.2.max(1.0)).sqrt(),
                1e3 * sums.1,
                sums.2 / 120.0,
                100.0 * sums.0 / squares_m2.max(1e-12),
            );
        }
    }
}

/// Distance to the left of the nearest point of a piece, and heading against it.
fn beside(piece: &Piece, pose: &Pose) -> [f64; 2] {
    let far_m = |place: &Place| (place.place_m[0] - pose.x_m).hypot(place.place_m[1] - pose.y_m);
    let places = (0..=400).map(|part| piece.at(piece.length_m * f64::from(part) / 400.0));
    let near = places.min_by(|a, b| far_m(a).total_cmp(&far_m(b))).unwrap_or_default();
    let (sin, cos) = near.yaw_rad.sin_cos();
    let left_m = cos * (pose.y_m - near.place_m[1]) - sin * (pose.x_m - near.place_m[0]);
    let (sin, cos) = (pose.yaw_rad - near.yaw_rad).sin_cos();
    [left_m, sin.atan2(cos)]
}

fn read<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    Ok(serde_json::from_str(&text)?)
}

fn course(name: &str) -> Result<Course> {
    let all = [Course::L, Course::Zigzag, Course::Weave, Course::Bends, Course::Hook];
    all.into_iter().find(|course| course.name() == name).context("a course")
}
