//! The live page: a server that only reads the store.
//!
//! It has three read-only routes: the page, its data, and the movie of a run. Requests must name
//! this machine as their host, so that no other site can read the store through a visitor's browser
//! (DNS rebinding). A connection carries one request.

use crate::report::{Excerpt, PageHost, ReportError, Selection, Units, data, movie, page};
use crate::store::{Store, StoreError, StoreSource};
use axum::Router;
use axum::extract::{Path as Segment, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::{Mutex, Semaphore};
use tokio::time::{Instant, sleep, timeout};

/// How long an answer about the store is reused.
const FRESH: Duration = Duration::from_secs(1);
/// Maximum number of frames of a movie.
const FRAMES: usize = 120;
/// Maximum number of connections.
const CONNECTIONS: usize = 24;
/// Maximum number of readers of the store; each has a few files open.
const READERS: usize = 4;
/// Time for a connection to send its request.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(3);
/// Time for a response; after it the status is 503.
const RESPONSE_TIMEOUT: Duration = Duration::from_mins(1);
/// Maximum duration of a connection.
const VISIT: Duration = Duration::from_mins(2);

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

struct Shared {
    source: StoreSource,
    /// The last data, and when it was read.
    data: Mutex<Option<(Instant, String)>>,
}

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
        // Open connections are closed immediately: the server only reads.
        tokio::select! {
            () = accept(listener, routes(source)) => {}
            () = stopped => {}
        }
        Ok(())
    });
    // A reader may still wait for the store; it is abandoned.
    runtime.shutdown_background();
    result
}

/// Answers one request per connection, up to the maximum number in parallel; the system queues the
/// others.
async fn accept(listener: TcpListener, routes: Router) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    while let Ok(place) = Arc::clone(&places).acquire_owned().await {
        let Ok((stream, _)) = listener.accept().await else {
            // The process has no free file descriptors until a connection closes.
            sleep(FRESH).await;
            continue;
        };
        // An idle connection would block one that sends a request.
        let visit = http1::Builder::new()
            .keep_alive(false)
            .timer(TokioTimer::new())
            .header_read_timeout(REQUEST_TIMEOUT)
            .serve_connection(
                TokioIo::new(stream),
                TowerToHyperService::new(routes.clone()),
            );
        tokio::spawn(async move {
            // One that takes too long is ended.
            let _ = timeout(VISIT, visit).await;
            drop(place);
        });
    }
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

/// Checks that a request names this machine as its host; otherwise returns the reason for the
/// refusal.
fn check_host(request: &Request) -> Result<(), (StatusCode, &'static str)> {
    let mut hosts = request.headers().get_all(header::HOST).iter();
    let (Some(host), None) = (hosts.next(), hosts.next()) else {
        let text = "a request needs one Host header and no second one\n";
        return Err((StatusCode::BAD_REQUEST, text));
    };
    if !host.to_str().is_ok_and(is_local_host) {
        let text = "this server answers to localhost and to addresses only\n";
        return Err((StatusCode::MISDIRECTED_REQUEST, text));
    }
    let authority = request.uri().authority();
    if authority.is_some_and(|authority| authority.as_str().as_bytes() != host.as_bytes()) {
        let text = "the host in the request line is not the one of the Host header\n";
        return Err((StatusCode::BAD_REQUEST, text));
    }
    Ok(())
}

/// Refuses other hosts and adds the security headers of the page.
async fn guard(request: Request, next: Next) -> Response {
    let mut response = match check_host(&request) {
        Ok(()) => timeout(RESPONSE_TIMEOUT, next.run(request))
            .await
            .unwrap_or_else(|_| {
                let text = "reading the store takes too long: try again later\n";
                (StatusCode::SERVICE_UNAVAILABLE, text).into_response()
            }),
        Err(refusal) => refusal.into_response(),
    };
    let headers = [
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    let headers = headers.map(|(name, value)| (name, HeaderValue::from_static(value)));
    response.headers_mut().extend(HeaderMap::from_iter(headers));
    response
}

/// Reads the store on a thread that may block.
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

/// A response, or an error.
fn answer(kind: &'static str, result: Result<String, ServeError>) -> Response {
    match result {
        Ok(text) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        Err(ServeError::Report(ReportError::Store(error @ StoreError::NoFrames { .. }))) => {
            (StatusCode::NOT_FOUND, format!("{error}\n")).into_response()
        }
        // The reason may name files of this machine, so it is not sent to the client.
        Err(_) => {
            let text = "the store cannot be read; `sweep check STORE` shows why\n";
            (StatusCode::SERVICE_UNAVAILABLE, text).into_response()
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

async fn send_page(State(shared): State<Arc<Shared>>) -> Response {
    let result = read(&shared, |store| {
        page(everything(store, &Selection::default()), PageHost::Server)
    })
    .await;
    answer("text/html; charset=utf-8", result)
}

/// Its present data.
async fn send_data(State(shared): State<Arc<Shared>>) -> Response {
    // Pages that poll at the same time share one reading.
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
    use super::is_local_host;

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
