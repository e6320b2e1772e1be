//! The stop port: a page with one button, served by a thread of its own, so that it answers when the service, the
//! database or the rest of this process does not.

use crate::durable;
use crate::edge::Edge;
use crate::stop_latch::StopLatch;
use api::lab::RobotStatus;
use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::{ACCESS_CONTROL_ALLOW_ORIGIN, CACHE_CONTROL, CONTENT_TYPE, HOST, HeaderValue, ORIGIN};
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;

/// File with the real address, for port 0.
pub const ADDRESS_FILE: &str = "lab-stop.addr";
/// Connections served at a time; more wait in the kernel's queue.
const CONNECTIONS: usize = 64;
/// A connection that sends no request within this time is closed.
const HEADER_TIMEOUT: Duration = Duration::from_secs(5);

/// Body of `GET /state`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StopState {
    /// Protective stop pressed and not cleared.
    pub stopped: bool,
    pub lab: String,
    /// Run in the arena now.
    pub run: Option<String>,
    /// What it is doing.
    pub phase: Option<String>,
    pub robots: Vec<RobotStatus>,
    /// What came in since the start of the process, used or not.
    #[serde(default)]
    pub edge: Edge,
}

/// What the port needs from the rest of the laboratory.
pub trait StateSource: Send + Sync + 'static {
    /// The state to show.
    fn state(&self) -> StopState;
}

/// Binds, writes the address to `<data>/lab-stop.addr` and serves until the process ends.
pub fn start(
    listen: SocketAddr,
    data: &Path,
    latch: Arc<StopLatch>,
    source: Arc<dyn StateSource>,
) -> io::Result<SocketAddr> {
    let listener = TcpListener::bind(listen)?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    durable::write(&data.join(ADDRESS_FILE), format!("{address}\n").as_bytes())?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    std::thread::Builder::new()
        .name("stop-port".to_owned())
        .spawn(move || {
            if let Err(error) = runtime.block_on(serve(listener, &latch, &source)) {
                tracing::error!(%error, "the stop port is gone; pressing the stop");
                // Without its button the laboratory must not drive.
                if let Err(error) = latch.press("stop port failure") {
                    tracing::error!(%error, "the stop could not be written to disk");
                }
            }
        })?;
    Ok(address)
}

async fn serve(listener: TcpListener, latch: &Arc<StopLatch>, source: &Arc<dyn StateSource>) -> io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let seats = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok(seat) = seats.clone().acquire_owned().await else {
            return Ok(());
        };
        let (stream, peer) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                // Out of descriptors or a peer that left: the button must survive both.
                tracing::warn!(%error, "stop port accept");
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        let (latch, source) = (latch.clone(), source.clone());
        tokio::spawn(async move {
            let service = service_fn(move |request| {
                let reply = answer(&request, peer, &latch, source.as_ref());
                async move { Ok::<_, Infallible>(reply) }
            });
            let connection = hyper::server::conn::http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(HEADER_TIMEOUT)
                .serve_connection(TokioIo::new(stream), service);
            if let Err(error) = connection.await {
                tracing::debug!(%error, "stop port connection");
            }
            drop(seat);
        });
    }
}

type Reply = Response<Full<Bytes>>;

fn answer(request: &Request<Incoming>, peer: SocketAddr, latch: &StopLatch, source: &dyn StateSource) -> Reply {
    match (request.method(), request.uri().path()) {
        (&Method::GET, "/") => reply(
            StatusCode::OK,
            "text/html; charset=utf-8",
            include_str!("stop_port.html"),
        ),
        (&Method::GET, "/state") => state(source),
        (&Method::POST, "/stop") => match latch.press(&format!("from {peer}")) {
            Ok(()) => state(source),
            Err(error) => failure(&format!("Stopped, but a restart would forget it: {error}")),
        },
        (&Method::POST, "/clear") if !same_origin(request) => reply(
            StatusCode::FORBIDDEN,
            "text/plain; charset=utf-8",
            "Only the laboratory's own page may clear the stop.",
        ),
        (&Method::POST, "/clear") => match latch.clear(&format!("from {peer}")) {
            Ok(()) => state(source),
            Err(error) => failure(&format!("Still stopped: {error}")),
        },
        _ => reply(
            StatusCode::NOT_FOUND,
            "text/plain; charset=utf-8",
            "GET /, GET /state, POST /stop, POST /clear",
        ),
    }
}

/// Any page may stop the robots; a foreign page must not be able to clear the stop behind an operator's back.
fn same_origin(request: &Request<Incoming>) -> bool {
    let text = |name| {
        request
            .headers()
            .get(name)
            .and_then(|value: &HeaderValue| value.to_str().ok())
    };
    match (text(ORIGIN), text(HOST)) {
        (None, _) => true,
        (Some(origin), Some(host)) => origin.split_once("://").is_some_and(|(_, from)| from == host),
        (Some(_), None) => false,
    }
}

fn state(source: &dyn StateSource) -> Reply {
    match serde_json::to_string(&source.state()) {
        Ok(body) => reply(StatusCode::OK, "application/json", body),
        Err(error) => failure(&error.to_string()),
    }
}

fn failure(message: &str) -> Reply {
    reply(
        StatusCode::INTERNAL_SERVER_ERROR,
        "text/plain; charset=utf-8",
        message.to_owned(),
    )
}

fn reply(status: StatusCode, content_type: &'static str, body: impl Into<Bytes>) -> Reply {
    let mut reply = Response::new(Full::new(body.into()));
    *reply.status_mut() = status;
    let headers = reply.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(content_type));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    // The dashboard, served from another port, presses this button too.
    headers.insert(ACCESS_CONTROL_ALLOW_ORIGIN, HeaderValue::from_static("*"));
    reply
}
