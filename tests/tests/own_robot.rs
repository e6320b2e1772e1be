//! A robot of one's own enters the laboratory: the lines of `docs/your-own-robots.md`, word for word but for folders and ports.

use anyhow::{Context, ensure};
use api::run::{RunState, RunView, Whose};
use arrow_array::{Array, Float64Array};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;
use std::io::Write;
use std::net::UdpSocket;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use system_tests::{Archive, System, ask_stop_port, repository, wait_for};
use uuid::Uuid;

const LIMIT: Duration = Duration::from_secs(120);
/// From the start of the experiment to its target, as the crow flies.
const WAY_M: f64 = 1.887;

/// The page's lines with the places of a test.
struct Page {
    lines: Vec<String>,
    places: Vec<(&'static str, String)>,
}

impl Page {
    fn read(system: &System) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(repository().join("docs/your-own-robots.md"))?;
        let (_, steps) = text.split_once("**Step by step**").context("the steps")?;
        let blocks: Vec<&str> = steps.split("```\n").collect();
        let (start, lines) = (blocks.get(1).context("a block")?, blocks.get(3).context("a block")?);
        ensure!(
            start.trim() == "cargo xtask up --no-lab",
            "the system of this test was started otherwise: {start}"
        );
        let base = free_robot_port()?;
        let folder = system.data.display();
        Ok(Self {
            lines: lines.lines().map(str::to_owned).collect(),
            places: vec![
                ("data/", format!("{folder}/")),
                ("target/debug/", format!("{}/", program_folder()?.display())),
                ("http://127.0.0.1:8080", system.base.clone()),
                ("--port 9001", format!("--port {}", base + 1)),
                ("--robot-udp-base 9000", format!("--robot-udp-base {base}")),
                ("127.0.0.1:8081", "127.0.0.1:0".to_owned()),
            ],
        })
    }

    /// The only line with this program, as a command for the shell.
    fn line(&self, program: &str) -> anyhow::Result<String> {
        let mut found = self.lines.iter().filter(|line| line.contains(program));
        let line = found.next().with_context(|| format!("no line with {program}"))?;
        ensure!(found.next().is_none(), "two lines with {program}");
        let places = self.places.iter();
        Ok(places.fold(line.clone(), |line, (written, here)| line.replace(written, here)))
    }
}

fn shell(line: &str) -> Command {
    let mut command = Command::new("sh");
    command
        .args(["-c", line])
        .current_dir(repository())
        .stdin(Stdio::null());
    command
}

/// A process in the background; killed when dropped.
struct Background(Child);

impl Background {
    fn start(line: &str, log: &Path) -> anyhow::Result<Self> {
        let log = std::fs::File::create(log)?;
        let mut command = shell(&format!("exec {line}"));
        Ok(Self(command.stdout(log.try_clone()?).stderr(log).spawn()?))
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn program_folder() -> anyhow::Result<PathBuf> {
    let own = std::env::current_exe()?;
    let found = own.ancestors().find(|folder| folder.join("robopheus-lab").is_file());
    Ok(found.context("build first: cargo build --bins")?.to_owned())
}

/// A base whose next port is free.
fn free_robot_port() -> anyhow::Result<u16> {
    Ok(UdpSocket::bind("127.0.0.1:0")?.local_addr()?.port() - 1)
}

/// A tracker that sees nobody.
fn empty_tracker(path: &Path) -> anyhow::Result<()> {
    let listener = UnixListener::bind(path)?;
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            std::thread::spawn(move || {
                for frame in 0_u64.. {
                    let picture =
                        serde_json::json!({"frame": frame, "camera": "tracker", "exposure_us": i64::MAX, "poses": []});
                    if writeln!(stream, "{picture}").is_err() {
                        return;
                    }
                    std::thread::sleep(Duration::from_millis(10));
                }
            });
        }
    });
    Ok(())
}

async fn until_free(system: &System) -> anyhow::Result<()> {
    wait_for("the laboratory is registered", LIMIT, || async {
        let arenas = system.get("/api/v1/arenas").await?;
        let free = |arena: &Value| arena["name"] == "own" && arena["state"] == "free";
        Ok(arenas.as_array().is_some_and(|all| all.iter().any(free)).then_some(()))
    })
    .await
}

/// Way of the robot over the run by its poses, and the first and the last of them, metres.
fn way(archive: &Archive) -> anyhow::Result<(f64, [f64; 2], [f64; 2])> {
    let bytes = bytes::Bytes::copy_from_slice(archive.member("robots/own-01/telemetry.parquet")?);
    let mut places: Vec<[f64; 2]> = Vec::new();
    for batch in ParquetRecordBatchReaderBuilder::try_new(bytes)?.build()? {
        let batch = batch?;
        let column = |name: &str| {
            let column = batch.column_by_name(name).with_context(|| format!("no {name}"))?;
            column
                .as_any()
                .downcast_ref::<Float64Array>()
                .cloned()
                .context("numbers")
        };
        let (x, y) = (column("pose_x_m")?, column("pose_y_m")?);
        places.extend(x.iter().zip(y.iter()).filter_map(|(x, y)| Some([x?, y?])));
    }
    let steps = places
        .windows(2)
        .map(|pair| f64::hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]));
    let (first, last) = places.first().zip(places.last()).context("no poses")?;
    Ok((steps.sum(), *first, *last))
}

async fn newest_run(system: &System) -> anyhow::Result<RunView> {
    let runs = system.get("/api/v1/runs").await?;
    let id: Uuid = serde_json::from_value(runs["runs"][0]["id"].clone()).with_context(|| format!("{runs}"))?;
    system.run(id).await
}

async fn drives(system: &System, page: &Page) -> anyhow::Result<()> {
    let submit = page.line("robopheus --server")?;
    let watched = tokio::task::spawn_blocking(move || shell(&submit).output()).await??;
    let run = newest_run(system).await?;
    ensure!(
        run.state == RunState::Done,
        "{:?}\n{}{}",
        run.fault,
        String::from_utf8_lossy(&watched.stdout),
        String::from_utf8_lossy(&watched.stderr)
    );
    ensure!(watched.status.success(), "{}", String::from_utf8_lossy(&watched.stderr));
    let path = format!("/api/v1/runs/{}/archive", run.id);
    let archive = wait_for("the archive", LIMIT, || async {
        Ok(system.download(&path).await.and_then(Archive::open).ok())
    })
    .await?;
    let edge = &archive.manifest["edge"]["robots"][0];
    ensure!(edge["robot"] == "own-01" && edge["unsent"] == 0, "{edge}");
    let count = |of: &str, what: &str| edge[of][what].as_u64().unwrap_or(0);
    ensure!(
        count("heard", "used") > 500 && count("told", "accepted") > 500,
        "{edge}"
    );
    let (way_m, first, last) = way(&archive)?;
    println!("an own robot drove {way_m:.3} m from {first:.2?} to {last:.2?}");
    let near = |place: [f64; 2], x_m: f64, y_m: f64| f64::hypot(place[0] - x_m, place[1] - y_m) < 0.06;
    ensure!(
        near(first, -0.8, -0.5) && near(last, 0.8, 0.5),
        "from {first:?} to {last:?}"
    );
    ensure!(way_m > 0.98 * WAY_M - 0.06 && way_m < 1.5 * WAY_M, "{way_m} m");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_of_ones_own_drives_by_the_lines_of_the_page() -> anyhow::Result<()> {
    let system = System::start_with("own-robot", &["--no-lab"]).await?;
    let page = Page::read(&system)?;
    let made = shell(&page.line("mkdir -p")?).status()?;
    ensure!(made.success(), "no key file");
    let own = system.data.join("own");
    let robot = Background::start(&page.line("robot.py")?, &own.join("robot.log"))?;
    wait_for("the robot's tracker", LIMIT, || async {
        Ok(own.join("tracker.sock").exists().then_some(()))
    })
    .await?;
    let line = page.line("robopheus-lab")?;
    let laboratory = Background::start(&line, &own.join("lab.log"))?;
    until_free(&system).await?;
    let (_, state) = ask_stop_port(&own, "GET /state")?;
    ensure!(
        state["edge"]["robots"][0]["heard"]["used"].as_u64() > Some(0),
        "{state}"
    );
    let log = || std::fs::read_to_string(own.join("lab.log")).unwrap_or_default();
    drives(&system, &page).await.with_context(log)?;

    // Nobody sees it: somebody would have to carry it, and is told so.
    drop(laboratory);
    empty_tracker(&own.join("empty.sock"))?;
    let blind = Background::start(&line.replace("tracker.sock", "empty.sock"), &own.join("blind.log"))?;
    let experiment: Value = serde_json::from_str(&std::fs::read_to_string(
        repository().join("examples/robots/python/experiment.json"),
    )?)?;
    // Twice: a run that failed before the start leaves the robot free for the next.
    for attempt in 0..2 {
        let run = system.submit(&experiment, None).await?;
        let ended = system.wait_until_ended(run, LIMIT).await?;
        let fault = ended
            .fault
            .with_context(|| format!("attempt {attempt}: {}", ended.state.as_str()))?;
        ensure!(
            fault.code == "placing_failed" && fault.whose == Whose::Operator,
            "attempt {attempt}: {fault:?}"
        );
        ensure!(
            fault.message.contains("own-01") && fault.message.contains("no hand"),
            "{}",
            fault.message
        );
    }
    drop((blind, robot));
    system.stop()?;
    Ok(())
}
