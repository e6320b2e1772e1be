//! The emulated laboratory of a running system, from outside: its fault menu, its stop port, its robots.

use crate::system::System;
use anyhow::{Context, ensure};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

/// Asks the hand of an emulator; an error when it refuses.
pub fn ask_hand(socket: &Path, request: &Value) -> anyhow::Result<()> {
    let mut stream = UnixStream::connect(socket).with_context(|| format!("no hand at {}", socket.display()))?;
    writeln!(stream, "{request}")?;
    let mut reply = String::new();
    BufReader::new(stream).read_line(&mut reply)?;
    let reply: Value = serde_json::from_str(&reply)?;
    ensure!(reply["ok"] == true, "{request}: {reply}");
    Ok(())
}

/// A request to a stop port; when it was sent, and the state that came back.
pub fn ask_stop_port(data: &Path, request: &str) -> anyhow::Result<(Instant, Value)> {
    let address: SocketAddr = std::fs::read_to_string(data.join("lab-stop.addr"))?.trim().parse()?;
    let mut stream = TcpStream::connect(address)?;
    let text = format!("{request} HTTP/1.1\r\nHost: {address}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
    let sent = Instant::now();
    stream.write_all(text.as_bytes())?;
    let mut reply = String::new();
    stream.read_to_string(&mut reply)?;
    let (head, body) = reply.split_once("\r\n\r\n").context("no HTTP answer")?;
    ensure!(head.starts_with("HTTP/1.1 200"), "{request}: {reply}");
    Ok((sent, serde_json::from_str(body)?))
}

impl System {
    /// One entry of the fault menu for a robot, by its number: for example `{"kind": "low_battery", "charge": 0.1}`.
    pub fn fault(&self, number: u8, mut kind: Value) -> anyhow::Result<()> {
        kind["number"] = number.into();
        self.hand(&serde_json::json!({ "fault": kind }))
    }

    /// A request to the hand that puts robots on the floor (`docs/laboratory.md`).
    pub fn hand(&self, request: &Value) -> anyhow::Result<()> {
        ask_hand(&self.data.join("hand.sock"), request)
    }

    /// A request to the stop port, for example `POST /stop`.
    pub fn stop_port(&self, request: &str) -> anyhow::Result<Value> {
        Ok(ask_stop_port(&self.data, request)?.1)
    }

    /// A robot as the service shows it.
    pub async fn robot(&self, name: &str) -> anyhow::Result<Value> {
        let robots = self.get("/api/v1/robots").await?;
        let robot = robots
            .as_array()
            .and_then(|all| all.iter().find(|robot| robot["name"] == name));
        robot.cloned().with_context(|| format!("no robot {name}"))
    }

    /// Waits until a robot is as `is` says.
    pub async fn wait_for_robot(
        &self,
        name: &str,
        what: &str,
        limit: Duration,
        is: impl Fn(&Value) -> bool,
    ) -> anyhow::Result<Value> {
        let sought = format!("{name}: {what}");
        let is = &is;
        let found = crate::wait_for(&sought, limit, || async move {
            Ok(self.robot(name).await.ok().filter(|robot| is(robot)))
        });
        match found.await {
            Ok(robot) => Ok(robot),
            Err(error) => Err(error.context(format!("{:#}\n{}", self.robot(name).await?, self.process_log("lab")))),
        }
    }

    /// The whole log of a process.
    pub fn process_log(&self, name: &str) -> String {
        let bytes = std::fs::read(self.data.join(format!("logs/{name}.log"))).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// Waits until a process has logged this.
    pub async fn wait_for_log(&self, name: &str, words: &str, limit: Duration) -> anyhow::Result<()> {
        let seen = crate::wait_for(words, limit, || async {
            Ok(self.process_log(name).contains(words).then_some(()))
        });
        seen.await.with_context(|| self.process_log(name))
    }
}
