//! A page of our own in a real browser, without a driver: it loads the bundle, computes, and posts what it found.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::{bundle, run, sys};

/// Longest answer that is taken from the page, bytes.
const ANSWER_LIMIT: u64 = 4 << 20;
/// Longest wait for the rest of one request.
const REQUEST_LIMIT: Duration = Duration::from_secs(10);
const PAUSE: Duration = Duration::from_millis(20);

/// Runs JavaScript with the bundle `sim_wasm` as `sim` and gives the text that it evaluates to.
///
/// - `script` is the body of an async function; it returns a string. `await cpu_ms()` gives it the processor time that the
///   threads running scripts have had so far, ms.
/// - Errors: no browser, nothing within `limit`, or what the script threw.
pub fn evaluate(chromium: &Path, script: &str, limit: Duration) -> Result<String> {
    let listener = TcpListener::bind("127.0.0.1:0").context("a port of our own")?;
    listener.set_nonblocking(true)?;
    let address = format!("http://{}/", listener.local_addr()?);
    let browser = Running::start(chromium, &address)?;
    let begun = Instant::now();
    while begun.elapsed() < limit {
        match listener.accept() {
            Ok((stream, _)) => {
                if let Some(answer) = serve(stream, script, || browser.script_cpu_ms())? {
                    return answer.map_err(|thrown| anyhow::anyhow!("in the browser: {thrown}"));
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => std::thread::sleep(PAUSE),
            Err(error) => return Err(error).context("waiting for the browser"),
        }
    }
    bail!("no answer of {} within {} s", chromium.display(), limit.as_secs())
}

/// Answers one request. What the page posted, when it did: the script's text, or the error it ended with.
fn serve(stream: TcpStream, script: &str, cpu_ms: impl Fn() -> f64) -> Result<Option<Result<String, String>>> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(REQUEST_LIMIT))?;
    let mut reader = BufReader::new(stream);
    let mut head = String::new();
    // Browsers open connections ahead of time and close them unused.
    while !head.ends_with("\r\n\r\n") {
        match reader.read_line(&mut head) {
            Ok(0) | Err(_) => return Ok(None),
            Ok(_) => {}
        }
    }
    let (method, path) = request_line(&head);
    if method == "POST" {
        let mut body = String::new();
        reader
            .by_ref()
            .take(length(&head).min(ANSWER_LIMIT))
            .read_to_string(&mut body)?;
        answer(reader.into_inner(), "200 OK", "text/plain", b"")?;
        return Ok(Some(if path == "/done" { Ok(body) } else { Err(body) }));
    }
    let stream = reader.into_inner();
    if path == "/cpu_ms" {
        answer(stream, "200 OK", "text/plain", cpu_ms().to_string().as_bytes())?;
        return Ok(None);
    }
    match file(path, script) {
        Some((kind, bytes)) => answer(stream, "200 OK", kind, &bytes)?,
        None => answer(stream, "404 Not Found", "text/plain", b"")?,
    }
    Ok(None)
}

fn request_line(head: &str) -> (&str, &str) {
    let mut words = head.split(' ');
    (words.next().unwrap_or_default(), words.next().unwrap_or_default())
}

fn length(head: &str) -> u64 {
    let lower = head.to_ascii_lowercase();
    let value = lower.lines().find_map(|line| line.strip_prefix("content-length:"));
    value.and_then(|value| value.trim().parse().ok()).unwrap_or(0)
}

/// The page, or a file of the bundle: nothing else is there to see.
fn file(path: &str, script: &str) -> Option<(&'static str, Vec<u8>)> {
    if path == "/" {
        return Some(("text/html; charset=utf-8", page(script).into_bytes()));
    }
    let name = path.strip_prefix("/bundle/")?;
    let kind = match name {
        "sim_wasm.js" => "text/javascript",
        "sim_wasm_bg.wasm" => "application/wasm",
        _ => return None,
    };
    Some((kind, fs::read(bundle::folder().join(name)).ok()?))
}

fn page(script: &str) -> String {
    format!(
        "<!doctype html><script type=module>
const cpu_ms = async () => Number(await (await fetch('/cpu_ms')).text());
const post = (path, body) => fetch(path, {{ method: 'POST', body }});
try {{
  const sim = await import('/bundle/sim_wasm.js');
  await sim.default({{ module_or_path: '/bundle/sim_wasm_bg.wasm' }});
  await post('/done', await (async () => {{ {script} }})());
}} catch (error) {{ await post('/thrown', String(error)); }}
</script>"
    )
}

fn answer(mut stream: TcpStream, status: &str, kind: &str, body: &[u8]) -> Result<()> {
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    // A browser that has gone away is none of our errors: the wait for its answer will end.
    stream
        .write_all(head.as_bytes())
        .and_then(|()| stream.write_all(body))
        .ok();
    Ok(())
}

/// A headless browser with a profile of its own; ended and swept away when dropped.
struct Running {
    child: Child,
    profile: PathBuf,
}

impl Running {
    fn start(chromium: &Path, address: &str) -> Result<Running> {
        use std::os::unix::process::CommandExt;
        let profile = std::env::temp_dir().join(format!("robopheus-page-{}", std::process::id()));
        let mut command = run::command(chromium);
        command
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-sync",
                "--disable-dev-shm-usage",
            ])
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg(address)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0);
        let child = command
            .spawn()
            .with_context(|| format!("cannot start {}", chromium.display()))?;
        Ok(Running { child, profile })
    }

    /// Time that the main threads of this browser's pages have been on a processor, ms.
    fn script_cpu_ms(&self) -> f64 {
        let profile = self.profile.display().to_string();
        let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
        let mut nanoseconds = 0.0;
        for process in processes.map(|entry| entry.path()) {
            let line = fs::read(process.join("cmdline")).unwrap_or_default();
            let line = String::from_utf8_lossy(&line);
            if line.contains("--type=renderer") && line.contains(&profile) {
                let times = fs::read_to_string(process.join("schedstat")).unwrap_or_default();
                nanoseconds += times
                    .split(' ')
                    .next()
                    .and_then(|time| time.parse().ok())
                    .unwrap_or(0.0);
            }
        }
        nanoseconds * 1e-6
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        sys::signal_group(self.child.id(), libc::SIGKILL);
        self.child.wait().ok();
        fs::remove_dir_all(&self.profile).ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read() {
        let head = "POST /done HTTP/1.1\r\nHost: a\r\nContent-Length: 12\r\n\r\n";
        assert_eq!(request_line(head), ("POST", "/done"));
        assert_eq!((length(head), length("GET / HTTP/1.1\r\n\r\n")), (12, 0));
    }

    #[test]
    fn nothing_but_the_page_and_the_bundle_is_served() {
        assert!(file("/", "return 'x'").is_some_and(|(_, page)| String::from_utf8_lossy(&page).contains("return 'x'")));
        for path in ["/bundle/../../Cargo.toml", "/etc/passwd", "/bundle/", "/favicon.ico"] {
            assert!(file(path, "").is_none(), "{path}");
        }
    }

    #[test]
    fn a_posted_answer_ends_the_wait() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let client = std::thread::spawn(move || {
            let mut stream = TcpStream::connect(address).unwrap();
            stream
                .write_all(b"POST /thrown HTTP/1.1\r\nContent-Length: 4\r\n\r\nboom")
                .unwrap();
            let mut text = String::new();
            stream.read_to_string(&mut text).unwrap();
            text
        });
        let got = serve(listener.accept().unwrap().0, "", || 0.0).unwrap();
        assert_eq!(got, Some(Err("boom".to_owned())));
        assert!(client.join().unwrap().starts_with("HTTP/1.1 200"));
    }
}
