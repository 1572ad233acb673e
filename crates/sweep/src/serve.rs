//! The live page: a server that reads the store and nothing else.
//!
//! It has three routes, all of them reading: the page, its data, and the movie of a run. Requests must name this machine
//! as their host, so that no page of another site can have its visitor's browser read the store (DNS rebinding).

use crate::report::{Excerpt, PageHost, ReportError, Selection, Units, data, movie, page};
use crate::store::{Store, StoreError, StoreSource};
use axum::Router;
use axum::extract::{Path as Segment, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Mutex;
use tokio::task::AbortHandle;

/// How long an answer about the store is given again.
const FRESH: Duration = Duration::from_secs(1);
/// Frames of a movie at most.
const FRAMES: usize = 120;
/// Connections at a time. With more, those that have asked for nothing yet are let go, the oldest first.
const CONNECTIONS: usize = 24;
/// Readers of the store at a time; each has a few files open.
const READERS: usize = 4;
/// How long a connection may take to say what it asks for.
const ASKING: Duration = Duration::from_secs(5);
/// How long it may take to ask and to be answered in all.
const ANSWERING: Duration = Duration::from_mins(2);
/// How long the server waits where there is no file descriptor or no place for another connection.
const PAUSE: Duration = Duration::from_millis(20);

/// Why there is no live page, or no answer to a request.
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
    /// Something the system would not give.
    #[error("cannot start {what}: {reason}")]
    Start {
        /// What was asked for.
        what: &'static str,
        /// What the system said.
        reason: String,
    },
    /// The address could not be written where it is read.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
}

struct Shared {
    source: StoreSource,
    /// The last data, and when it was read.
    data: Mutex<Option<(Instant, String)>>,
}

/// Serves the page of a store at an address until a signal; `ready` is told the address.
///
/// # Errors
/// An address that cannot be had, a system without sockets or signals.
pub fn serve(
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
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .max_blocking_threads(READERS)
        .build()
        .map_err(start("a server"))?;
    let result = runtime.block_on(async {
        let listener = TcpListener::bind(address)
            .await
            .map_err(start("a server at this address (--listen chooses another)"))?;
        let mut terminate =
            tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())
                .map_err(start("listening to signals"))?;
        ready(listener.local_addr().map_err(start("a server"))?)?;
        let stopped = async move {
            tokio::select! {
                _ = tokio::signal::ctrl_c() => {}
                _ = terminate.recv() => {}
            }
        };
        let routes = routes(source);
        // Open connections are let go: a reader loses nothing.
        tokio::select! {
            () = accept(&listener, &routes) => {}
            () = stopped => {}
        }
        Ok(())
    });
    // A reader may be waiting for the store: nobody waits for it.
    runtime.shutdown_background();
    result
}

/// A connection that was accepted.
struct Open {
    handle: AbortHandle,
    /// Whether it has asked for something.
    asked: Arc<AtomicBool>,
}

/// Accepts connections without end.
async fn accept(listener: &TcpListener, routes: &Router) {
    let mut open: Vec<Open> = Vec::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // As when there is no descriptor left: some connection ends soon.
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        loop {
            open.retain(|connection| !connection.handle.is_finished());
            if open.len() < CONNECTIONS {
                break;
            }
            let idle = open
                .iter()
                .position(|connection| !connection.asked.load(Ordering::Relaxed));
            match idle {
                Some(oldest) => open.remove(oldest).handle.abort(),
                None => tokio::time::sleep(PAUSE).await,
            }
        }
        let asked = Arc::new(AtomicBool::new(false));
        let answered = converse(stream, routes.clone(), Arc::clone(&asked));
        open.push(Open {
            handle: tokio::spawn(answered).abort_handle(),
            asked,
        });
    }
}

/// Reads one request of a connection and answers it, within limits of time.
async fn converse(stream: TcpStream, routes: Router, asked: Arc<AtomicBool>) {
    let routes = TowerToHyperService::new(routes);
    let service = service_fn(move |request| {
        asked.store(true, Ordering::Relaxed);
        routes.call(request)
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(ASKING)
        // An idle connection would take the place of one that asks.
        .keep_alive(false)
        .serve_connection(TokioIo::new(stream), service);
    // Whoever asked has gone, or takes too long: there is nobody to tell.
    let _ = tokio::time::timeout(ANSWERING, connection).await;
}

fn routes(source: StoreSource) -> Router {
    let shared = Arc::new(Shared {
        source,
        data: Mutex::new(None),
    });
    Router::new()
        .route("/", get(send_page))
        .route("/data.json", get(send_data))
        .route("/movie/{key}", get(send_movie))
        .layer(middleware::from_fn(guard))
        .with_state(shared)
}

/// Whether a Host header names this machine: its loopback, or an address rather than a name.
fn is_ours(host: &str) -> bool {
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

/// Refuses foreign hosts; adds the headers that keep the page to itself.
async fn guard(request: Request, next: Next) -> Response {
    let host = request
        .headers()
        .get(header::HOST)
        .and_then(|host| host.to_str().ok());
    if !host.is_some_and(is_ours) {
        let text = "this server answers to localhost and to addresses only\n";
        return (StatusCode::MISDIRECTED_REQUEST, text).into_response();
    }
    let mut response = next.run(request).await;
    let mut headers = HeaderMap::new();
    for (name, value) in [
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
    ] {
        headers.insert(name, header::HeaderValue::from_static(value));
    }
    response.headers_mut().extend(headers);
    response
}

/// Reads the store where that may take its time.
async fn read<T: Send + 'static>(
    shared: &Shared,
    what: impl FnOnce(&Store) -> Result<T, ReportError> + Send + 'static,
) -> Result<T, ServeError> {
    let source = shared.source.clone();
    tokio::task::spawn_blocking(move || Ok(what(&source.open()?)?))
        .await
        .map_err(|error| ServeError::Start {
            what: "a reader of the store",
            reason: error.to_string(),
        })?
}

/// An answer, or why there is none.
fn answer(kind: &'static str, result: Result<String, ServeError>) -> Response {
    match result {
        Ok(text) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        Err(error) => {
            let status = match error {
                ServeError::Report(ReportError::Store(StoreError::NoFrames { .. })) => {
                    StatusCode::NOT_FOUND
                }
                _ => StatusCode::SERVICE_UNAVAILABLE,
            };
            (status, format!("{error}\n")).into_response()
        }
    }
}

/// All of a store.
fn everything<'s>(store: &'s Store, all: &'s Selection) -> Excerpt<'s> {
    Excerpt {
        store,
        selection: all,
        units: Units::default(),
    }
}

async fn send_page(State(shared): State<Arc<Shared>>) -> Response {
    let result = read(&shared, |store| {
        page(everything(store, &Selection::default()), PageHost::Server)
    })
    .await;
    answer("text/html; charset=utf-8", result)
}

/// Its data as it is now.
async fn send_data(State(shared): State<Arc<Shared>>) -> Response {
    // Several pages that ask at once share one reading.
    let mut last = shared.data.lock().await;
    if let Some((_, text)) = last.as_ref().filter(|(at, _)| at.elapsed() < FRESH) {
        return answer("application/json", Ok(text.clone()));
    }
    let result = read(&shared, |store| {
        data(everything(store, &Selection::default()), PageHost::Server)
    })
    .await;
    if let Ok(text) = &result {
        *last = Some((Instant::now(), text.clone()));
    }
    answer("application/json", result)
}

/// The movie of a run.
async fn send_movie(State(shared): State<Arc<Shared>>, Segment(key): Segment<String>) -> Response {
    let result = read(&shared, move |store| {
        Ok(movie(store, &key, FRAMES)?.to_string())
    })
    .await;
    answer("application/json", result)
}

#[cfg(test)]
mod tests {
    use super::is_ours;

    #[test]
    fn only_this_machine_is_ours() {
        for ours in [
            "localhost",
            "localhost:8420",
            "127.0.0.1:8420",
            "[::1]:8420",
            "10.0.0.3:80",
        ] {
            assert!(is_ours(ours), "{ours}");
        }
        for foreign in [
            "evil.example",
            "evil.example:8420",
            "localhost.evil.example",
            "127.0.0.1.nip.io",
            "",
            ":80",
        ] {
            assert!(!is_ours(foreign), "{foreign}");
        }
    }
}
