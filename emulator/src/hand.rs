//! The hand's socket: one JSON request a line, one JSON reply a line.

use crate::camera::CameraSet;
use crate::camera::faults::CameraFaultRequest;
use crate::faults::FaultRequest;
use crate::hidden::Change;
use crate::laboratory::{Laboratory, Placement};
use crate::socket::SocketFile;
use serde::{Deserialize, Serialize};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

const MAX_LINE_BYTES: usize = 64 << 10;
const MAX_CALLERS: usize = 16;

/// Any of them.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    /// Robots that are neither listed here nor in `keep` are lifted off the floor.
    place: Option<Vec<Placement>>,
    /// Robots on the floor that stay where they are; for `place`.
    #[serde(default)]
    keep: Vec<u8>,
    fault: Option<FaultRequest>,
    camera_fault: Option<CameraFaultRequest>,
    /// Changes robot or floor; a robot on the floor comes to rest for it.
    hide: Option<Change>,
}

#[derive(Debug, Serialize)]
struct Reply {
    ok: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

#[derive(Debug)]
pub struct Hand {
    socket: SocketFile,
    callers: Vec<Caller>,
}

#[derive(Debug)]
struct Caller {
    stream: UnixStream,
    received: Vec<u8>,
}

impl Hand {
    pub fn listen(path: &Path) -> std::io::Result<Self> {
        Ok(Self {
            socket: SocketFile::listen(path)?,
            callers: Vec::new(),
        })
    }

    /// Carries out the requests that have come in.
    pub fn poll(&mut self, laboratory: &mut Laboratory, cameras: &mut CameraSet) {
        while let Some(stream) = self.socket.accept() {
            if self.callers.len() < MAX_CALLERS {
                self.callers.push(Caller {
                    stream,
                    received: Vec::new(),
                });
            }
        }
        self.callers.retain_mut(|caller| caller.serve(laboratory, cameras));
    }
}

impl Caller {
    /// `false` when the caller is gone.
    fn serve(&mut self, laboratory: &mut Laboratory, cameras: &mut CameraSet) -> bool {
        let mut chunk = [0; 4096];
        let open = loop {
            match self.stream.read(&mut chunk) {
                Ok(0) => break false,
                Ok(length) => self.received.extend(chunk.iter().take(length)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break true,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return false,
            }
            if self.received.len() > MAX_LINE_BYTES {
                return false;
            }
        };
        while let Some(end) = self.received.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.received.drain(..=end).collect();
            let mut reply = answer(&line, laboratory, cameras);
            reply.push(b'\n');
            // A reply is far smaller than a socket's buffer; a caller that does not read is let go.
            if self.stream.write_all(&reply).is_err() {
                return false;
            }
        }
        open
    }
}

/// Carries out one request line and returns the reply without its line feed.
pub fn answer(line: &[u8], laboratory: &mut Laboratory, cameras: &mut CameraSet) -> Vec<u8> {
    let outcome = carry_out(line, laboratory, cameras);
    if let Err(error) = &outcome {
        tracing::warn!(error, "hand request refused");
    }
    let reply = Reply {
        ok: outcome.is_ok(),
        error: outcome.err(),
    };
    serde_json::to_vec(&reply).unwrap_or_else(|_| br#"{"ok":false}"#.to_vec())
}

fn carry_out(line: &[u8], laboratory: &mut Laboratory, cameras: &mut CameraSet) -> Result<(), String> {
    let request: Request = serde_json::from_slice(line).map_err(|error| format!("not a request: {error}"))?;
    if request.place.is_none() && request.fault.is_none() && request.camera_fault.is_none() && request.hide.is_none() {
        return Err("neither place nor fault nor camera_fault nor hide".to_owned());
    }
    if let Some(placements) = &request.place {
        laboratory
            .place_some(placements, &request.keep)
            .map_err(|error| error.to_string())?;
        tracing::info!(robots = placements.len(), "robots put on the floor");
    }
    if let Some(fault) = request.fault {
        laboratory.set_fault(fault).map_err(|error| error.to_string())?;
        tracing::info!(robot.number = fault.number, kind = ?fault.kind, "fault set");
    }
    if let Some(change) = &request.hide {
        laboratory.hide(change).map_err(|error| error.to_string())?;
        tracing::info!(?change, "hidden");
    }
    if let Some(fault) = request.camera_fault {
        tracing::info!(camera = fault.camera, fault = ?fault.fault, "camera fault");
        cameras.set_fault(fault).map_err(|error| error.to_string())?;
    }
    Ok(())
}
