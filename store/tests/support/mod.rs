//! A database per test: on the server of `TEST_DATABASE_URL` (or `DATABASE_URL`), else on a private PostgreSQL
//! that this test starts and removes again, also when it panics.

// Each crate that includes this uses its own part of it.
#![allow(dead_code)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::str::FromStr;
use std::time::{Duration, Instant};

use sqlx::postgres::{PgConnectOptions, PgConnection, PgRow};
use sqlx::{AssertSqlSafe, ConnectOptions, Connection};

const START_LIMIT: Duration = Duration::from_secs(20);

/// An empty database of its own.
pub struct TestDatabase {
    /// For `Store::connect`.
    pub url: String,
    /// The private server, when this test has one.
    pub cluster: Option<Cluster>,
    /// The database and the address of its server, when it has to be dropped from a shared one.
    dropped_from: Option<(String, String)>,
}

impl TestDatabase {
    /// A database on the shared server if there is one, else on a private one.
    pub async fn new() -> Self {
        match std::env::var("TEST_DATABASE_URL").or_else(|_| std::env::var("DATABASE_URL")) {
            Ok(url) => Self::on_shared_server(&url).await,
            Err(_) => Self::private().await,
        }
    }

    /// A database on a private server, for tests that take the server away.
    pub async fn private() -> Self {
        let cluster = Cluster::start();
        cluster.wait_until_ready().await;
        Self {
            url: cluster.url(),
            cluster: Some(cluster),
            dropped_from: None,
        }
    }

    async fn on_shared_server(admin_url: &str) -> Self {
        let name = format!("robopheus_test_{}", uuid::Uuid::now_v7().simple());
        execute_at(admin_url, &format!("CREATE DATABASE {name}")).await;
        let options = PgConnectOptions::from_str(admin_url)
            .expect("the address of the test database reads")
            .database(&name);
        let url = options.to_url_lossy().to_string();
        Self {
            url,
            cluster: None,
            dropped_from: Some((name, admin_url.to_owned())),
        }
    }

    /// Runs any SQL, for what the store's functions do not offer. Panics when the server refuses.
    pub async fn execute(&self, sql: &str) {
        execute_at(&self.url, sql).await;
    }

    /// Runs any SQL and hands the server's refusal out.
    pub async fn try_execute(&self, sql: &str) -> Result<u64, sqlx::Error> {
        let mut connection = PgConnection::connect(&self.url).await?;
        let done = sqlx::query(AssertSqlSafe(sql.to_owned()))
            .execute(&mut connection)
            .await;
        // The server tells a refusal before it gives the locks back; it answers this after.
        connection.ping().await?;
        Ok(done?.rows_affected())
    }

    /// One value.
    pub async fn scalar<T>(&self, sql: &str) -> T
    where
        for<'r> (T,): sqlx::FromRow<'r, PgRow>,
        T: Send + Unpin,
    {
        let mut connection = PgConnection::connect(&self.url)
            .await
            .expect("the test database answers");
        let (value,): (T,) = sqlx::query_as(AssertSqlSafe(sql.to_owned()))
            .fetch_one(&mut connection)
            .await
            .expect("the statement gives one row");
        value
    }
}

impl Drop for TestDatabase {
    fn drop(&mut self) {
        let Some((name, admin_url)) = self.dropped_from.take() else {
            return;
        };
        // A thread of its own: a runtime may not be entered from inside another.
        let dropping = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()
                .expect("a runtime starts");
            runtime.block_on(execute_at(&admin_url, &format!("DROP DATABASE {name} WITH (FORCE)")));
        });
        if dropping.join().is_err() {
            eprintln!("a test database was left behind");
        }
    }
}

async fn execute_at(url: &str, sql: &str) {
    let mut connection = PgConnection::connect(url).await.expect("the test database answers");
    sqlx::raw_sql(AssertSqlSafe(sql.to_owned()))
        .execute(&mut connection)
        .await
        .expect("the test database takes the statement");
}

/// A private PostgreSQL on a socket in a temporary folder.
pub struct Cluster {
    folder: PathBuf,
    server: Option<Child>,
}

impl Cluster {
    /// Makes an empty cluster and starts it.
    pub fn start() -> Self {
        // Short: the path of a socket may have about 100 characters.
        let id = uuid::Uuid::now_v7().simple().to_string();
        let folder = std::env::temp_dir().join(format!("rpg-{}", &id[16..]));
        std::fs::create_dir(&folder).expect("a temporary folder can be made");
        let mut cluster = Self { folder, server: None };
        if let Some(user) = server_user() {
            run(Command::new("chown").arg(&user).arg(&cluster.folder));
        }
        let initdb = [
            "-D",
            "data",
            "-A",
            "trust",
            "-U",
            "robopheus",
            "-E",
            "UTF8",
            "--no-sync",
            "--locale=C",
        ];
        run(as_server_user("initdb").args(initdb).current_dir(&cluster.folder));
        cluster.resume();
        cluster
    }

    /// Starts the server of a cluster that was taken away.
    pub fn resume(&mut self) {
        let settings = [
            "-c",
            "listen_addresses=",
            "-c",
            "shared_buffers=16MB",
            "-c",
            "max_connections=60",
            "-c",
            "fsync=on",
        ];
        let log = std::fs::File::create(self.folder.join("log")).expect("the log can be made");
        let server = as_server_user("postgres")
            .args(["-D", "data", "-k"])
            .arg(&self.folder)
            .args(settings)
            .current_dir(&self.folder)
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .expect("postgres starts");
        self.server = Some(server);
    }

    /// Takes the server away as a crash would.
    pub fn kill(&mut self) {
        self.stop("QUIT");
    }

    /// Address of the cluster's only database.
    pub fn url(&self) -> String {
        let socket = self.folder.display().to_string().replace('/', "%2F");
        format!("postgres://robopheus@{socket}/postgres")
    }

    /// Waits until the server accepts connections.
    pub async fn wait_until_ready(&self) {
        let options = PgConnectOptions::from_str(&self.url()).expect("the address reads");
        let begun = Instant::now();
        loop {
            match options.connect().await {
                Ok(connection) => {
                    let _ = connection.close().await;
                    return;
                }
                Err(error) if begun.elapsed() > START_LIMIT => {
                    let log = std::fs::read_to_string(self.folder.join("log")).unwrap_or_default();
                    panic!("postgres did not start: {error}\n{log}");
                }
                Err(_) => tokio::time::sleep(Duration::from_millis(20)).await,
            }
        }
    }

    fn stop(&mut self, signal: &str) {
        let Some(mut server) = self.server.take() else { return };
        let _ = Command::new("kill")
            .arg(format!("-{signal}"))
            .arg(server.id().to_string())
            .status();
        let _ = server.wait();
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        self.stop("QUIT");
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// PostgreSQL refuses root; then it runs as the first of these that exists.
fn server_user() -> Option<String> {
    let is_root =
        std::fs::metadata("/proc/self").is_ok_and(|metadata| std::os::unix::fs::MetadataExt::uid(&metadata) == 0);
    let accounts = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    let exists = |name: &&str| accounts.lines().any(|line| line.split(':').next() == Some(*name));
    is_root.then(|| {
        ["postgres", "nobody"]
            .into_iter()
            .find(exists)
            .expect("an account for PostgreSQL exists")
            .to_owned()
    })
}

/// Dies with the test process, even when that is killed.
fn as_server_user(program: &str) -> Command {
    let mut command = Command::new("setpriv");
    command.args(["--pdeathsig", "QUIT"]);
    if let Some(user) = server_user() {
        command.args(["--reuid", &user, "--regid", &user_group(&user), "--clear-groups"]);
    }
    command.arg(binary(program));
    command
}

fn user_group(user: &str) -> String {
    let accounts = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    let line = accounts
        .lines()
        .find(|line| line.split(':').next() == Some(user))
        .unwrap_or_default();
    line.split(':').nth(3).unwrap_or("65534").to_owned()
}

fn binary(program: &str) -> PathBuf {
    let packaged = std::fs::read_dir("/usr/lib/postgresql")
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path().join("bin"));
    let on_path = std::env::var_os("PATH")
        .map(|path| std::env::split_paths(&path).collect::<Vec<_>>())
        .unwrap_or_default();
    let found = packaged
        .chain(on_path)
        .map(|folder: PathBuf| folder.join(program))
        .find(|path: &PathBuf| Path::exists(path));
    found.unwrap_or_else(|| panic!("`{program}` is not installed: install PostgreSQL or set TEST_DATABASE_URL"))
}

fn run(command: &mut Command) {
    let output = command
        .output()
        .unwrap_or_else(|error| panic!("{command:?} does not start: {error}"));
    assert!(
        output.status.success(),
        "{command:?} failed: {}",
        String::from_utf8_lossy(&output.stderr)
    );
}
