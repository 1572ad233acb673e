//! The live page: a server that only reads the store.
//!
//! It has read-only routes: the page, its data, the figure of a number against an axis
//! (`/figure.svg?name=viscosity&along=shear_rate&where=friction=0.3`), the runs of a point
//! (`/runs.svg?point=3`), and the movie of a run (`/movie/KEY`). Requests must name
//! this machine as their host, so that no other site can read the store through a visitor's browser
//! (DNS rebinding). A connection carries one request, and a fixed number of threads answers one
//! connection each; the system queues the others.

use crate::report::{
    Excerpt, PageHost, ReportError, Selection, Units, data, movie, page, page_figure, page_runs,
};
use crate::store::{Store, StoreError, StoreSource};
use crate::system::lock;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::io::{self, Read as _, Write as _};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How long an answer about the store is reused.
const FRESH: Duration = Duration::from_secs(1);
/// Maximum number of frames of a movie.
const FRAMES: usize = 120;
/// Maximum number of connections.
const CONNECTIONS: usize = 24;
/// Time for a connection to send its request: an idle one would block others.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(3);
/// Time for a connection to take its response.
const RESPONSE_TIMEOUT: Duration = Duration::from_mins(2);
/// Maximum size of the head of a request, in bytes.
const HEAD_LIMIT: usize = 16 << 10;

/// Errors of the server.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum ServeError {
    /// What the page shows.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Report(#[from] ReportError),
    /// The store.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Store(#[from] StoreError),
    /// A resource that the system refused.
    #[error("cannot start {what}: {reason}")]
    Start {
        /// The resource.
        what: &'static str,
        /// What the system said.
        reason: String,
    },
    /// The address could not be printed.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
}

/// State shared by the threads.
struct Server {
    source: StoreSource,
    /// The last data, and when it was read.
    data: Mutex<Option<(Instant, String)>>,
    /// One connection at a time reads the store, so that few files are open.
    reading: Mutex<()>,
}

/// A response: its status, the type of its content, and its content.
type Response = (Status, &'static str, String);

/// A status with its text.
type Status = (u16, &'static str);

const OK: Status = (200, "OK");
const BAD_REQUEST: Status = (400, "Bad Request");
const NOT_FOUND: Status = (404, "Not Found");
const METHOD_NOT_ALLOWED: Status = (405, "Method Not Allowed");
const MISDIRECTED: Status = (421, "Misdirected Request");
const UNAVAILABLE: Status = (503, "Service Unavailable");

const TEXT: &str = "text/plain; charset=utf-8";

/// Serves the page of a store at an address until a signal; calls `ready` with the address.
///
/// # Errors
/// An unavailable address, a system without sockets or signals.
pub(crate) fn serve(
    source: StoreSource,
    address: SocketAddr,
    ready: impl FnOnce(SocketAddr) -> io::Result<()>,
) -> Result<(), ServeError> {
    let start = |what| {
        move |error: io::Error| ServeError::Start {
            what,
            reason: error.to_string(),
        }
    };
    let mut signals = Signals::new([SIGINT, SIGTERM]).map_err(start("listening to signals"))?;
    let listener = TcpListener::bind(address)
        .map_err(start("a server at this address (--listen chooses another)"))?;
    let address = listener.local_addr().map_err(start("a server"))?;
    let shared = Arc::new((
        listener,
        Server {
            source,
            data: Mutex::new(None),
            reading: Mutex::new(()),
        },
    ));
    for _ in 0..CONNECTIONS {
        let shared = Arc::clone(&shared);
        std::thread::Builder::new()
            .spawn(move || accept(&shared.0, &shared.1))
            .map_err(start("a thread of the server"))?;
    }
    ready(address)?;
    // Open connections are closed with the process: the server only reads.
    signals.forever().next();
    Ok(())
}

/// Answers one connection after the other.
fn accept(listener: &TcpListener, shared: &Server) {
    loop {
        match listener.accept() {
            // A client that is gone or too slow is of no interest.
            Ok((stream, _)) => drop(visit(stream, shared)),
            // The process has no free file descriptors until a connection closes.
            Err(_) => std::thread::sleep(FRESH),
        }
    }
}

/// Reads a request and answers it.
fn visit(mut stream: TcpStream, shared: &Server) -> io::Result<()> {
    let head = read_head(&mut stream)?;
    let head = String::from_utf8_lossy(&head);
    let (is_head, (status, kind, content)) = match HttpRequest::parse(&head) {
        Ok(request) => (request.method == "HEAD", respond(&request, shared)),
        Err((status, text)) => (false, (status, TEXT, text.to_owned())),
    };
    let mut response = format!(
        "HTTP/1.1 {} {}\r\ncontent-type: {kind}\r\ncontent-length: {}\r\nconnection: close\r\n\
         cache-control: no-store\r\nx-content-type-options: nosniff\r\nx-frame-options: DENY\r\n\
         referrer-policy: no-referrer\r\n\r\n",
        status.0,
        status.1,
        content.len()
    );
    if !is_head {
        response.push_str(&content);
    }
    let mut rest = response.as_bytes();
    let end = Instant::now() + RESPONSE_TIMEOUT;
    while !rest.is_empty() {
        stream.set_write_timeout(Some(time_until(end)?))?;
        let sent = stream.write(rest)?;
        if sent == 0 {
            return Err(io::ErrorKind::WriteZero.into());
        }
        rest = &rest[sent..];
    }
    stream.flush()
}

/// The time left until an end.
fn time_until(end: Instant) -> io::Result<Duration> {
    let left = end.saturating_duration_since(Instant::now());
    if left.is_zero() {
        return Err(io::ErrorKind::TimedOut.into());
    }
    Ok(left)
}

/// Reads a request up to the empty line that ends its head.
fn read_head(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let end = Instant::now() + REQUEST_TIMEOUT;
    let mut head = Vec::new();
    let mut part = [0; 2048];
    while !head.windows(4).any(|bytes| bytes == b"\r\n\r\n") {
        stream.set_read_timeout(Some(time_until(end)?))?;
        let read = stream.read(&mut part)?;
        if read == 0 || head.len() + read > HEAD_LIMIT {
            return Err(io::ErrorKind::InvalidData.into());
        }
        head.extend_from_slice(&part[..read]);
    }
    Ok(head)
}

/// A request to this machine.
struct HttpRequest<'h> {
    method: &'h str,
    path: &'h str,
    query: &'h str,
}

impl<'h> HttpRequest<'h> {
    /// Reads its head; on a request that must not be answered, the reason.
    fn parse(head: &'h str) -> Result<Self, (Status, &'static str)> {
        let mut lines = head.split("\r\n").take_while(|line| !line.is_empty());
        let mut first = lines.next().unwrap_or_default().split(' ');
        let (Some(method), Some(target), Some(version), None) =
            (first.next(), first.next(), first.next(), first.next())
        else {
            return Err((BAD_REQUEST, "this is not a request\n"));
        };
        if !version.starts_with("HTTP/1.") {
            return Err((BAD_REQUEST, "this server speaks HTTP/1.1\n"));
        }
        let fields = lines.filter_map(|line| line.split_once(':'));
        let mut hosts = fields.filter(|(name, _)| name.eq_ignore_ascii_case("host"));
        let (Some((_, host)), None) = (hosts.next(), hosts.next()) else {
            return Err((
                BAD_REQUEST,
                "a request needs one Host header and no second one\n",
            ));
        };
        if !is_local_host(host.trim()) {
            return Err((
                MISDIRECTED,
                "this server answers to localhost and to addresses only\n",
            ));
        }
        if !target.starts_with('/') {
            return Err((BAD_REQUEST, "this server is no proxy\n"));
        }
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        Ok(Self {
            method,
            path,
            query,
        })
    }

    /// An argument of the query; empty if it is not there.
    fn argument(&self, name: &str) -> String {
        let mut all = self
            .query
            .split('&')
            .filter_map(|part| part.split_once('='));
        let (_, value) = all.find(|(key, _)| *key == name).unwrap_or_default();
        decoded(value)
    }
}

/// Text as forms send it: `+` for spaces, and other bytes as `%XX`.
fn decoded(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    let digit = |byte: Option<u8>| {
        let digit = char::from(byte.unwrap_or(b'0')).to_digit(16);
        u8::try_from(digit.unwrap_or(0)).unwrap_or(0)
    };
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'+' => b' ',
            b'%' => 16 * digit(rest.next()) + digit(rest.next()),
            byte => byte,
        });
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Whether a Host header names this machine: its loopback, or an address rather than a name.
fn is_local_host(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let bare = name
        .strip_prefix('[')
        .and_then(|name| name.strip_suffix(']'))
        .unwrap_or(name);
    name.eq_ignore_ascii_case("localhost") || bare.parse::<IpAddr>().is_ok()
}

/// The response to a request.
fn respond(request: &HttpRequest<'_>, shared: &Server) -> Response {
    let (json, svg) = ("application/json", "image/svg+xml");
    let route = match request.path {
        "/" | "/data.json" | "/figure.svg" | "/runs.svg" => Some(request.path),
        path => path.strip_prefix("/movie/").filter(|key| !key.is_empty()),
    };
    let Some(route) = route else {
        return (NOT_FOUND, TEXT, "there is no such page\n".into());
    };
    if !["GET", "HEAD"].contains(&request.method) {
        return (METHOD_NOT_ALLOWED, TEXT, "this server only reads\n".into());
    }
    let all = Selection::default();
    match route {
        "/" => answer(
            "text/html; charset=utf-8",
            read(shared, |store| {
                page(everything(store, &all), PageHost::Server)
            }),
        ),
        "/data.json" => {
            // Pages that poll at the same time share one reading.
            let mut last = lock(&shared.data);
            if let Some((_, text)) = last.as_ref().filter(|(at, _)| at.elapsed() < FRESH) {
                return (OK, json, text.clone());
            }
            let result = read(shared, |store| {
                data(everything(store, &all), PageHost::Server)
            });
            if let Ok(text) = &result {
                *last = Some((Instant::now(), text.clone()));
            }
            answer(json, result)
        }
        "/figure.svg" => {
            let [name, along, wanted] = ["name", "along", "where"].map(|of| request.argument(of));
            answer(
                svg,
                read(shared, |store| {
                    page_figure(everything(store, &all), &name, &along, &wanted)
                }),
            )
        }
        "/runs.svg" => {
            let point = request.argument("point").parse().unwrap_or(usize::MAX);
            let runs = read(shared, |store| {
                Ok(page_runs(everything(store, &all), point)?.unwrap_or_default())
            });
            answer(svg, runs)
        }
        key => answer(
            json,
            read(shared, |store| Ok(movie(store, key, FRAMES)?.to_string())),
        ),
    }
}

/// Reads the store.
fn read(
    shared: &Server,
    what: impl FnOnce(&Store) -> Result<String, ReportError>,
) -> Result<String, ServeError> {
    let _alone = lock(&shared.reading);
    Ok(what(&shared.source.open()?)?)
}

/// A response, or an error.
fn answer(kind: &'static str, result: Result<String, ServeError>) -> Response {
    match result {
        Ok(text) => (OK, kind, text),
        Err(ServeError::Report(ReportError::Store(
            error @ (StoreError::NoFrames { .. } | StoreError::EarlierFrames { .. }),
        ))) => (NOT_FOUND, TEXT, format!("{error}\n")),
        Err(ServeError::Report(ReportError::Argument { message, .. })) => {
            (BAD_REQUEST, TEXT, message)
        }
        // The reason may name files of this machine, so it is not sent to the client.
        Err(_) => {
            let text = "the store cannot be read; `sweep check STORE` shows why\n";
            (UNAVAILABLE, TEXT, text.into())
        }
    }
}

/// The whole store.
fn everything<'s>(store: &'s Store, all: &'s Selection) -> Excerpt<'s> {
    Excerpt {
        store,
        selection: all,
        units: Units::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::{decoded, is_local_host};

    #[test]
    fn arguments_are_decoded() {
        assert_eq!(decoded("%CE%93=0.1..%E2%88%9E"), "Γ=0.1..∞");
        assert_eq!(decoded("c=0.6+friction=1%2C2"), "c=0.6 friction=1,2");
        assert_eq!(decoded("%zz%"), "\0\0");
    }

    #[test]
    fn only_this_machine_is_ours() {
        for ours in [
            "localhost",
            "localhost:8420",
            "127.0.0.1:8420",
            "[::1]:8420",
            "10.0.0.3:80",
        ] {
            assert!(is_local_host(ours), "{ours}");
        }
        for foreign in [
            "evil.example",
            "evil.example:8420",
            "localhost.evil.example",
            "127.0.0.1.nip.io",
            "",
            ":80",
        ] {
            assert!(!is_local_host(foreign), "{foreign}");
        }
    }
}
