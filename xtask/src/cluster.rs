//! A private PostgreSQL cluster: its folder, its socket, its server process.

mod place;
mod user;

use std::fs;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use place::ClusterPlace;
pub use place::short_socket_folder;
use user::User;

use crate::setup::PostgresBinaries;
use crate::{run, sys};

/// Role and database of the service in a private cluster.
const NAME: &str = "robopheus";
/// Connections a private cluster serves: all programs and all tests at once.
const MAX_CONNECTIONS: u32 = 200;
/// Longest start, crash recovery included.
const START_LIMIT: Duration = Duration::from_secs(60);
/// Longest wait for a server left behind by a supervisor that was killed.
const LEFTOVER_LIMIT: Duration = Duration::from_secs(10);

/// Whether a commit waits until it is on the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// Every commit is on the disk: what people use.
    Safe,
    /// A power cut loses the cluster: only for clusters that are thrown away after a test.
    Disposable,
}

/// A private cluster; its server process belongs to whoever started it.
#[derive(Clone, Debug)]
pub struct Cluster {
    binaries: PostgresBinaries,
    place: ClusterPlace,
    /// Whom the server runs as when we are root, which PostgreSQL refuses.
    user: Option<User>,
    durability: Durability,
}

impl Cluster {
    /// Finds or makes the cluster of a data folder.
    pub fn prepare(binaries: &PostgresBinaries, data: &Path, durability: Durability) -> Result<Self> {
        let user = if sys::is_root() {
            Some(user::unprivileged()?)
        } else {
            None
        };
        let place = ClusterPlace::prepare(data, binaries.major, user.as_ref())?;
        let cluster = Self {
            binaries: binaries.clone(),
            place,
            user,
            durability,
        };
        if !cluster.place.cluster.join("PG_VERSION").is_file() {
            cluster.initialise()?;
        }
        Ok(cluster)
    }

    /// Address for the service's programs.
    pub fn url(&self) -> String {
        format!(
            "postgres://{NAME}@localhost/{NAME}?host={}",
            percent_encoded(&self.place.socket_folder)
        )
    }

    /// Makes the cluster and its database; an interrupted attempt is cleared away first.
    fn initialise(&self) -> Result<()> {
        println!(
            "setup: making a PostgreSQL {} cluster in {}",
            self.binaries.major,
            self.place.cluster.display()
        );
        user::remove_contents(&self.place.cluster)?;
        let mut initdb = self.command("initdb");
        initdb.arg("--pgdata").arg(&self.place.cluster);
        initdb.args([
            "--username",
            NAME,
            "--auth",
            "trust",
            "--encoding",
            "UTF8",
            "--locale",
            "C",
        ]);
        let made = run::read(&mut initdb).and_then(|_| self.create_database());
        if made.is_err() {
            user::remove_contents(&self.place.cluster)?;
        }
        made
    }

    /// Single-user mode needs neither a running server nor a client program.
    fn create_database(&self) -> Result<()> {
        let mut single = self.command("postgres");
        single
            .arg("--single")
            .arg("-D")
            .arg(&self.place.cluster)
            .arg("postgres");
        single
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        let mut child = single.spawn().context("cannot start postgres in single-user mode")?;
        if let Some(mut input) = child.stdin.take() {
            writeln!(input, "CREATE DATABASE {NAME}")?;
        }
        let output = child.wait_with_output()?;
        let words = String::from_utf8_lossy(&output.stderr);
        if !output.status.success() || words.contains("ERROR") {
            bail!("cannot make the database: {words}");
        }
        Ok(())
    }

    /// The command that runs the server in the foreground; its log goes where the caller says.
    pub fn server_command(&self) -> Command {
        let mut command = self.command("postgres");
        command
            .arg("-D")
            .arg(&self.place.cluster)
            .arg("-k")
            .arg(&self.place.socket_folder)
            .args(["-h", ""]);
        let on = if self.durability == Durability::Safe {
            "on"
        } else {
            "off"
        };
        for (name, value) in [("fsync", on), ("synchronous_commit", on), ("full_page_writes", on)] {
            command.arg("-c").arg(format!("{name}={value}"));
        }
        command.arg("-c").arg(format!("max_connections={MAX_CONNECTIONS}"));
        command
    }

    /// Clears away what a killed server left: live processes are ended, stale pid and socket files are removed.
    ///
    /// Only for the holder of the data folder's lock: nobody else may be using this cluster. The pid file is
    /// PostgreSQL's own guard against two servers on one folder, so it goes only once no process is left there.
    pub fn clear_leftovers(&self) -> Result<()> {
        let started = Instant::now();
        while let left = servers_of(&self.place.cluster)
            && !left.is_empty()
        {
            if started.elapsed() > LEFTOVER_LIMIT {
                bail!(
                    "PostgreSQL processes {left:?} still use {} and do not end",
                    self.place.cluster.display()
                );
            }
            let signal = if started.elapsed() < LEFTOVER_LIMIT / 2 {
                libc::SIGINT
            } else {
                libc::SIGQUIT
            };
            for pid in left {
                sys::signal_process(pid, signal);
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        let pid_file = self.place.cluster.join("postmaster.pid");
        for file in [
            pid_file,
            self.socket(),
            self.place.socket_folder.join(".s.PGSQL.5432.lock"),
        ] {
            remove_if_there(&file)?;
        }
        Ok(())
    }

    /// True once the server says it accepts connections.
    pub fn is_ready(&self) -> bool {
        let text = fs::read_to_string(self.place.cluster.join("postmaster.pid")).unwrap_or_default();
        text.lines().nth(7).is_some_and(|line| line.trim() == "ready") && self.socket().exists()
    }

    fn socket(&self) -> PathBuf {
        self.place.socket_folder.join(place::SOCKET_FILE)
    }

    fn command(&self, program: &str) -> Command {
        let mut command = run::command(self.binaries.program(program));
        if let Some(user) = &self.user {
            command.uid(user.uid).gid(user.gid);
        }
        // Backends must be able to stand in their working folder, which the checkout may not allow them.
        command.current_dir(&self.place.cluster);
        command.env_remove("LD_LIBRARY_PATH").env("LC_ALL", "C");
        for name in ["PGDATA", "PGHOST", "PGPORT", "PGUSER", "PGDATABASE", "PGOPTIONS"] {
            command.env_remove(name);
        }
        command
    }
}

/// A running server for tests; its folder is removed when dropped.
pub struct DisposableServer {
    child: Child,
    cluster: Cluster,
    data: PathBuf,
}

impl DisposableServer {
    /// Starts a fresh cluster in a temporary folder and waits until it accepts connections.
    pub fn start(binaries: &PostgresBinaries) -> Result<Self> {
        let data = std::env::temp_dir().join(format!("robopheus-tests-{}", std::process::id()));
        fs::create_dir_all(&data)?;
        let cluster = Cluster::prepare(binaries, &data, Durability::Disposable)?;
        let log = fs::File::create(data.join("postgres.log"))?;
        let mut command = cluster.server_command();
        command.stdout(log.try_clone()?).stderr(log).process_group(0);
        sys::die_with_parent(&mut command, libc::SIGQUIT);
        let child = command.spawn().context("cannot start postgres")?;
        let mut server = Self { child, cluster, data };
        server.wait_until_ready()?;
        Ok(server)
    }

    fn wait_until_ready(&mut self) -> Result<()> {
        let started = Instant::now();
        while !self.cluster.is_ready() {
            let log = || fs::read_to_string(self.data.join("postgres.log")).unwrap_or_default();
            if let Some(status) = self.child.try_wait()? {
                bail!("postgres ended ({status}):\n{}", log());
            }
            if started.elapsed() > START_LIMIT {
                bail!("postgres is not ready after {} s:\n{}", START_LIMIT.as_secs(), log());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(())
    }

    /// Address of the empty database.
    pub fn url(&self) -> String {
        self.cluster.url()
    }
}

impl Drop for DisposableServer {
    fn drop(&mut self) {
        sys::signal_process(self.child.id(), libc::SIGQUIT);
        self.child.wait().ok();
        self.cluster.place.remove();
        fs::remove_dir_all(&self.data).ok();
    }
}

/// PostgreSQL processes that work in a cluster's folder, whoever started them.
fn servers_of(folder: &Path) -> Vec<u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    pids.filter(|pid| is_server_of(*pid, folder)).collect()
}

/// True when the process is PostgreSQL working in that folder; a number used again by another program is not.
fn is_server_of(pid: u32, folder: &Path) -> bool {
    let here = fs::read_link(format!("/proc/{pid}/cwd")).is_ok_and(|cwd| cwd == folder);
    here && fs::read_to_string(format!("/proc/{pid}/comm")).is_ok_and(|name| name.trim() == "postgres")
}

fn remove_if_there(file: &Path) -> Result<()> {
    match fs::remove_file(file) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("remove {}", file.display()))
        }
        _ => Ok(()),
    }
}

/// A path as the value of a query parameter.
fn percent_encoded(path: &Path) -> String {
    use std::os::unix::ffi::OsStrExt;
    let mut text = String::new();
    for byte in path.as_os_str().as_bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/".contains(byte) {
            text.push(char::from(*byte));
        } else {
            text.push_str(&format!("%{byte:02X}"));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_with_odd_letters_survives_in_an_address() {
        assert_eq!(percent_encoded(Path::new("/tmp/a b&c/é")), "/tmp/a%20b%26c/%C3%A9");
    }

    #[test]
    fn another_program_with_the_same_number_is_no_server() {
        let cwd = std::env::current_dir().unwrap();
        assert!(!is_server_of(std::process::id(), &cwd));
    }

    /// Only where PostgreSQL is installed, which `cargo xtask test` sees to before it runs this.
    #[test]
    fn a_private_cluster_starts_from_nothing_and_leaves_nothing() {
        let Ok(Some(found)) = crate::setup::set_up(crate::setup::Needs {
            postgres: true,
            ..Default::default()
        }) else {
            panic!("PostgreSQL is not installed: run this through `cargo xtask test`");
        };
        let server = DisposableServer::start(&found.postgres.unwrap()).unwrap();
        let (data, cluster) = (server.data.clone(), server.cluster.clone());
        assert!(cluster.is_ready());
        assert!(servers_of(&cluster.place.cluster).contains(&server.child.id()));
        drop(server);
        assert!(servers_of(&cluster.place.cluster).is_empty());
        assert!(!data.exists() && !cluster.place.cluster.exists());
    }
}
