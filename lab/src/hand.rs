//! The hand that puts robots on the floor (`docs/hand.md`): in the emulated laboratory a socket, in a real one a person with a tablet.

use serde::{Deserialize, Serialize};
use std::io;
use std::path::Path;
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixStream;

/// Placing takes no longer.
const TIME_LIMIT: Duration = Duration::from_secs(5);
/// A reply is one short line.
const REPLY_LIMIT_BYTES: u64 = 64 << 10;

/// Where a robot is to stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    pub number: u8,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
}

#[derive(Debug, Serialize)]
struct Request<'a> {
    place: &'a [Placement],
    keep: &'a [u8],
}

#[derive(Debug, Deserialize)]
struct Reply {
    ok: bool,
    #[serde(default)]
    error: Option<String>,
}

/// Puts these robots on the floor and takes all others off it.
///
/// - `socket`: none where the laboratory has no hand, which is an error: ask only when somebody must be carried.
/// - `keep`: robots on the floor that stay where they are.
pub async fn place(socket: Option<&Path>, robots: &[Placement], keep: &[u8]) -> io::Result<()> {
    let socket =
        socket.ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "this laboratory has no hand (--hand)"))?;
    match tokio::time::timeout(TIME_LIMIT, ask(socket, robots, keep)).await {
        Ok(result) => result,
        Err(_) => Err(io::Error::new(
            io::ErrorKind::TimedOut,
            format!("no reply within {} s", TIME_LIMIT.as_secs()),
        )),
    }
}

async fn ask(socket: &Path, robots: &[Placement], keep: &[u8]) -> io::Result<()> {
    let mut stream = UnixStream::connect(socket).await?;
    let mut line = serde_json::to_vec(&Request { place: robots, keep })?;
    line.push(b'\n');
    stream.write_all(&line).await?;
    let mut reply = String::new();
    BufReader::new(stream.take(REPLY_LIMIT_BYTES))
        .read_line(&mut reply)
        .await?;
    let reply: Reply = serde_json::from_str(&reply)?;
    if reply.ok {
        Ok(())
    } else {
        Err(io::Error::other(reply.error.unwrap_or_else(|| "refused".to_owned())))
    }
}
