//! Lines to every reader of a local socket; a slow reader is let go and delays nobody.

use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

/// A reader that is further behind than this is let go: half a second of pictures.
const BACKLOG_MAX_BYTES: usize = 256 << 10;
const READERS_MAX: usize = 8;

/// A listening socket whose file goes when it is dropped.
#[derive(Debug)]
pub struct Outlet {
    listener: UnixListener,
    path: PathBuf,
    readers: Vec<Reader>,
}

#[derive(Debug)]
struct Reader {
    stream: UnixStream,
    backlog: Vec<u8>,
}

impl Outlet {
    /// A file that nobody answers on is left over and replaced; one that somebody answers on is an error.
    pub fn listen(path: &Path) -> io::Result<Self> {
        let at_path = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", path.display()));
        match UnixStream::connect(path) {
            Ok(_) => {
                return Err(at_path(io::Error::new(
                    ErrorKind::AddrInUse,
                    "another process answers here",
                )));
            }
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => {
                std::fs::remove_file(path).map_err(at_path)?
            }
            Err(_) => {}
        }
        let listener = UnixListener::bind(path).map_err(at_path)?;
        std::fs::set_permissions(path, PermissionsExt::from_mode(0o600))?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            path: path.to_owned(),
            readers: Vec::new(),
        })
    }

    /// Sends a line, with its line feed, to everybody who listens.
    pub fn send(&mut self, line: &[u8]) {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.readers.len() < READERS_MAX && stream.set_nonblocking(true).is_ok() {
                self.readers.push(Reader {
                    stream,
                    backlog: Vec::new(),
                });
            }
        }
        self.readers.retain_mut(|reader| reader.send(line));
    }
}

impl Drop for Outlet {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_file(&self.path) {
            tracing::warn!(%error, path = %self.path.display(), "cannot remove the socket file");
        }
    }
}

impl Reader {
    /// `false` when the reader is gone or too slow.
    fn send(&mut self, line: &[u8]) -> bool {
        if self.backlog.len() + line.len() > BACKLOG_MAX_BYTES {
            tracing::warn!("a reader of the camera's poses is too slow and is let go");
            return false;
        }
        self.backlog.extend_from_slice(line);
        match self.stream.write(&self.backlog) {
            Ok(written) => {
                self.backlog.drain(..written);
                true
            }
            Err(error) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
        }
    }
}
