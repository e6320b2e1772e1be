//! Lines of JSON from a local socket, for ever: connect, read until it fails, wait, connect again.

use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// Wait before connecting again.
const RECONNECT: Duration = Duration::from_millis(200);
/// A sender that says nothing for this long is connected anew.
const SILENCE: Duration = Duration::from_secs(2);
/// The longest line: 250 robots of a camera take about 60 KiB.
const LINE_LIMIT_BYTES: u64 = 256 << 10;

/// Hands every line to `take` until the process ends; a line that `take` refuses ends the connection.
///
/// - `name`: of the sender, for the log.
pub(super) fn read_for_ever(name: &str, socket: &Path, mut take: impl FnMut(&[u8]) -> io::Result<()>) {
    let mut quiet = false;
    loop {
        let mut heard = false;
        let result = read(socket, &mut |line| {
            if !std::mem::replace(&mut heard, true) {
                tracing::info!(sender = name, socket = %socket.display(), "connected");
            }
            take(line)
        });
        if heard || !quiet {
            tracing::warn!(sender = name, socket = %socket.display(), result = ?result.err(), "disconnected");
        }
        quiet = true;
        std::thread::sleep(RECONNECT);
    }
}

fn read(socket: &Path, take: &mut dyn FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
    let stream = UnixStream::connect(socket)?;
    stream.set_read_timeout(Some(SILENCE))?;
    let mut reader = BufReader::with_capacity(64 << 10, stream);
    let mut line = Vec::new();
    loop {
        line.clear();
        if reader.by_ref().take(LINE_LIMIT_BYTES).read_until(b'\n', &mut line)? == 0 {
            return Ok(());
        }
        take(&line)?;
    }
}
