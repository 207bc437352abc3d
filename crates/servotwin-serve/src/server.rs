//! HTTP and WebSocket, and who may come in.
//!
//! | path | gives |
//! |---|---|
//! | `/` | the page, with everything that it needs beside it |
//! | `/about` | what the flight is: signals, components, faults |
//! | `/live` | the WebSocket: frames and events to the viewer, requests from it |
//! | `/events` | all events so far |
//! | `/session` | the present flight as a Parquet file, to be saved |
//! | `/page.html` | the present flight as a page that needs no server, to be saved |
//! | `/counts` | viewers, lost frames and refusals, and when the newest sample was made |
//!
//! A browser tells where a page comes from. Requests from any other page than this server's are refused, so no other
//! page that the user has open can inject a fault. Beyond this machine a token is needed as well.

use crate::feed::{Begin, Feed, Message, Newest, Source};
use crate::page::{HTML, PARTS, saved_page};
use crate::request::{LONGEST, Refused, Request, Requests, requests};
use crate::session::{Session, SessionError};
use axum::Router;
use axum::body::Bytes;
use axum::extract::ws::{self, WebSocket, WebSocketUpgrade};
use axum::extract::{Query, State};
use axum::http::header::{
    CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, ORIGIN,
};
use axum::http::{HeaderMap, HeaderName, StatusCode};
use axum::response::{AppendHeaders, IntoResponse, Response};
use axum::routing::get;
use futures_util::stream::SplitSink;
use futures_util::{SinkExt, StreamExt};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use servotwin::flight::runtime::RuntimeError;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;

/// The number of requests that one viewer may have refused before it is sent away.
const MOST_REFUSED: u64 = 100;
/// How often the server looks whether it must end.
const STOP_CHECK: Duration = Duration::from_millis(100);
/// Viewers at the same time.
const MOST_VIEWERS: u64 = 256;

/// Why the page cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address cannot be used.
    #[error("cannot listen on {address}: {error}")]
    Listen {
        /// The address asked for.
        address: SocketAddr,
        /// The reason.
        error: std::io::Error,
    },
    /// The flight ended.
    #[error("{0}")]
    Flight(#[from] RuntimeError),
    /// A file holds no session.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The system gave no thread or no random number.
    #[error("the server cannot begin: {0}")]
    System(std::io::Error),
}

/// Where a server listens, and whom it lets in.
#[derive(Clone, Debug, PartialEq)]
pub struct Access {
    /// The address.
    pub address: SocketAddr,
    /// The token that a viewer needs; `None` on this machine alone.
    pub token: Option<String>,
}

impl Access {
    /// Access from this machine alone without a token, or from elsewhere with a new one.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn to(address: SocketAddr) -> Result<Self, ServeError> {
        let is_local = address.ip().is_loopback();
        let token = if is_local { None } else { Some(token().map_err(ServeError::System)?) };
        Ok(Access { address, token })
    }

    /// Whether the host that a request names is this server: a name that only resolves to this machine would let other
    /// pages in.
    fn is_own_host(&self, host: &str) -> bool {
        if self.token.is_some() {
            return true;
        }
        let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
        let bare = name.trim_start_matches('[').trim_end_matches(']');
        name == "localhost" || bare.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
    }

    /// Why a request may not come in; `None` if it may.
    fn refusal(&self, headers: &HeaderMap, given: Option<&str>) -> Option<&'static str> {
        let header = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let host = header(HOST).unwrap_or_default();
        if !self.is_own_host(host) {
            return Some("the request names another host");
        }
        let own = format!("http://{host}");
        if header(ORIGIN).is_some_and(|origin| origin != own) {
            return Some("the request comes from another page");
        }
        match &self.token {
            Some(token) if given != Some(token) => Some("the token is missing or wrong"),
            _ => None,
        }
    }
}

/// Sixteen random bytes as hexadecimal digits.
fn token() -> std::io::Result<String> {
    let mut bytes = [0u8; 16];
    std::io::Read::read_exact(&mut std::fs::File::open("/dev/urandom")?, &mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// What happened at the server.
#[derive(Debug, Default)]
struct Counts {
    viewers: AtomicU64,
    viewers_so_far: AtomicU64,
    frames_lost: AtomicU64,
    refused_requests: AtomicU64,
    refused_visits: AtomicU64,
}

#[derive(Serialize)]
struct Counted {
    viewers: u64,
    viewers_so_far: u64,
    frames_lost: u64,
    refused_requests: u64,
    refused_visits: u64,
    newest: Option<Newest>,
}

impl Counts {
    fn now(&self, feed: &Feed) -> Counted {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        Counted {
            viewers: of(&self.viewers),
            viewers_so_far: of(&self.viewers_so_far),
            frames_lost: of(&self.frames_lost),
            refused_requests: of(&self.refused_requests),
            refused_visits: of(&self.refused_visits),
            newest: feed.newest(),
        }
    }
}

struct Shared {
    access: Access,
    feed: Feed,
    requests: Requests,
    about: Value,
    /// One session is saved at a time: each takes memory and a file.
    saving: tokio::sync::Mutex<()>,
    counts: Counts,
}

/// A server that listens, before its flight begins.
pub struct Server {
    listener: std::net::TcpListener,
    access: Access,
}

impl Server {
    /// Listens on an address.
    ///
    /// # Errors
    /// [`ServeError::Listen`].
    pub fn listen(access: Access) -> Result<Self, ServeError> {
        let address = access.address;
        let listen = || {
            let listener = std::net::TcpListener::bind(address)?;
            listener.set_nonblocking(true)?;
            let address = listener.local_addr()?;
            Ok((listener, address))
        };
        let (listener, address) =
            listen().map_err(|error| ServeError::Listen { address, error })?;
        Ok(Server { listener, access: Access { address, ..access } })
    }

    /// The address of the page.
    pub fn link(&self) -> String {
        let address = self.access.address;
        match &self.access.token {
            Some(token) => format!("http://{address}/?token={token}"),
            None => format!("http://{address}/"),
        }
    }

    /// Runs a source and serves it until `stop` is set.
    ///
    /// # Errors
    /// The flight cannot be simulated, or the system gives no thread.
    pub fn run(self, source: &impl Source, stop: &AtomicBool) -> Result<(), ServeError> {
        let (requests, waiting) = requests();
        let shared = Arc::new(Shared {
            access: self.access,
            feed: Feed::default(),
            requests,
            about: source.about(),
            saving: tokio::sync::Mutex::default(),
            counts: Counts::default(),
        });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(ServeError::System)?;
        let (ended, feed) = (&AtomicBool::new(false), &shared.feed);
        std::thread::scope(|scope| {
            let flown = scope.spawn(move || {
                let flown = source.run(feed, &waiting, stop);
                ended.store(true, Ordering::Relaxed);
                flown
            });
            let must_stop = || stop.load(Ordering::Relaxed) || ended.load(Ordering::Relaxed);
            let served = runtime.block_on(serve(self.listener, shared.clone(), must_stop));
            // Without a server nobody can end the flight.
            stop.store(true, Ordering::Relaxed);
            let flown = flown.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            served.map_err(ServeError::System)?;
            Ok(flown?)
        })
    }
}

async fn serve(
    listener: std::net::TcpListener,
    shared: Arc<Shared>,
    must_stop: impl Fn() -> bool,
) -> std::io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let router = Router::new()
        .route("/", get(page))
        .route("/{file}", get(file))
        .route("/live", get(join))
        .with_state(shared);
    let server = axum::serve(listener, router);
    let stopped = async {
        while !must_stop() {
            tokio::time::sleep(STOP_CHECK).await;
        }
    };
    tokio::select! {
        served = server => served,
        () = stopped => Ok(()),
    }
}

#[derive(Deserialize)]
struct Pass {
    token: Option<String>,
}

/// Refuses a request, and counts it.
fn refused(shared: &Shared, why: &'static str) -> Response {
    shared.counts.refused_visits.fetch_add(1, Ordering::Relaxed);
    (StatusCode::FORBIDDEN, why).into_response()
}

async fn page(
    State(shared): State<Arc<Shared>>,
    Query(pass): Query<Pass>,
    headers: HeaderMap,
) -> Response {
    match shared.access.refusal(&headers, pass.token.as_deref()) {
        Some(why) => refused(&shared, why),
        None => framed(&shared.access, typed("text/html; charset=utf-8", HTML)),
    }
}

/// Says which pages may show this one inside of them, as Jupyter does. Only pages of this machine may, so that no page
/// from elsewhere can lead a click to *Inject*. Where a token is needed, a page that knows none shows nothing.
fn framed(access: &Access, page: Response) -> Response {
    if access.token.is_some() {
        return page;
    }
    let ancestors = "frame-ancestors 'self' http://localhost:* https://localhost:* \
                     http://127.0.0.1:* https://127.0.0.1:*";
    (AppendHeaders([(CONTENT_SECURITY_POLICY, ancestors)]), page).into_response()
}

fn typed(kind: &'static str, text: impl Into<axum::body::Body>) -> Response {
    // The page asks for nothing elsewhere, and a browser must not let it.
    let policy = "default-src 'self'; style-src 'self' 'unsafe-inline'";
    ([(CONTENT_TYPE.as_str(), kind), ("content-security-policy", policy)], text.into())
        .into_response()
}

async fn file(
    State(shared): State<Arc<Shared>>,
    Query(pass): Query<Pass>,
    axum::extract::Path(name): axum::extract::Path<String>,
    headers: HeaderMap,
) -> Response {
    // Scripts and styles are no secret, and a page that has none shows nothing.
    match name.as_str() {
        // Every browser asks for one.
        "favicon.ico" => return StatusCode::NO_CONTENT.into_response(),
        name => {
            if let Some(part) = PARTS.iter().find(|part| part.name == name) {
                return typed(part.media_type, part.text);
            }
        }
    }
    if let Some(why) = shared.access.refusal(&headers, pass.token.as_deref()) {
        return refused(&shared, why);
    }
    match name.as_str() {
        "about" => typed("application/json", shared.about.to_string()),
        "events" => typed("application/json", shared.feed.events()),
        "session" => session(shared, SavedAs::Table).await,
        "page.html" => session(shared, SavedAs::Page).await,
        "counts" => typed("application/json", json!(shared.counts.now(&shared.feed)).to_string()),
        _ => (StatusCode::NOT_FOUND, "there is no such page").into_response(),
    }
}

/// The file that a session is saved as.
#[derive(Clone, Copy)]
enum SavedAs {
    Table,
    Page,
}

impl SavedAs {
    fn headers(self) -> [(HeaderName, &'static str); 2] {
        let (kind, name) = match self {
            SavedAs::Table => {
                ("application/vnd.apache.parquet", "attachment; filename=\"session.parquet\"")
            }
            SavedAs::Page => ("text/html; charset=utf-8", "attachment; filename=\"session.html\""),
        };
        [(CONTENT_TYPE, kind), (CONTENT_DISPOSITION, name)]
    }

    /// The bytes of the file; `name` is that of a temporary file.
    fn bytes(self, session: &Session, name: &str) -> Result<Vec<u8>, SessionError> {
        match self {
            SavedAs::Table => session.bytes(&std::env::temp_dir().join(name)),
            SavedAs::Page => Ok(saved_page(session).into_bytes()),
        }
    }
}

/// The present flight as a file. It is made on a thread of its own, so that viewers need not wait.
async fn session(shared: Arc<Shared>, saved_as: SavedAs) -> Response {
    let _saving = shared.saving.lock().await;
    let Some(messages) = shared.feed.session() else {
        let why = "the flight has too many events to be saved; begin a new one";
        return (StatusCode::INSUFFICIENT_STORAGE, why).into_response();
    };
    let session = Session { about: shared.about.clone(), messages };
    let name = format!("servotwin-session-{}.parquet", shared.access.address.port());
    match tokio::task::spawn_blocking(move || saved_as.bytes(&session, &name)).await {
        Ok(Ok(bytes)) => (saved_as.headers(), bytes).into_response(),
        Ok(Err(error)) => (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response(),
        Err(panic) => std::panic::resume_unwind(panic.into_panic()),
    }
}

async fn join(
    State(shared): State<Arc<Shared>>,
    Query(pass): Query<Pass>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if let Some(why) = shared.access.refusal(&headers, pass.token.as_deref()) {
        return refused(&shared, why);
    }
    if shared.counts.viewers.load(Ordering::Relaxed) >= MOST_VIEWERS {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many viewers").into_response();
    }
    upgrade.max_message_size(LONGEST).max_frame_size(LONGEST).on_upgrade(move |socket| async move {
        shared.counts.viewers.fetch_add(1, Ordering::Relaxed);
        shared.counts.viewers_so_far.fetch_add(1, Ordering::Relaxed);
        view(socket, &shared).await;
        shared.counts.viewers.fetch_sub(1, Ordering::Relaxed);
    })
}

/// Serves one viewer until it leaves.
async fn view(socket: WebSocket, shared: &Shared) {
    let (mut to_viewer, mut from_viewer) = socket.split();
    let mut refused_here = 0;
    let Some(mut later) = welcome(&mut to_viewer, shared).await else { return };
    loop {
        let message = tokio::select! {
            message = later.recv() => match message {
                Ok(Message::Frame(bytes)) => binary(&bytes),
                Ok(Message::Event(event)) => text(&format!("{{\"event\":{event}}}")),
                Ok(Message::State(state)) => text(&format!("{{\"state\":{state}}}")),
                Ok(Message::Playback(playback)) => text(&format!("{{\"playback\":{playback}}}")),
                Ok(Message::Jump) => match welcome(&mut to_viewer, shared).await {
                    Some(anew) => { later = anew; continue }
                    None => return,
                },
                Err(RecvError::Lagged(lost)) => {
                    shared.counts.frames_lost.fetch_add(lost, Ordering::Relaxed);
                    text(&format!("{{\"lost\":{lost},\"state\":{}}}", shared.feed.state_now()))
                }
                Err(RecvError::Closed) => return,
            },
            request = from_viewer.next() => match request {
                Some(Ok(ws::Message::Text(words))) => match take(&words, shared) {
                    Ok(()) => continue,
                    Err(refused) => refusal(shared, &mut refused_here, &refused),
                },
                Some(Ok(ws::Message::Binary(_))) => {
                    let refused = Refused::NotUnderstood("requests are text".into());
                    refusal(shared, &mut refused_here, &refused)
                }
                Some(Ok(ws::Message::Ping(_) | ws::Message::Pong(_))) => continue,
                Some(Ok(ws::Message::Close(_)) | Err(_)) | None => return,
            },
        };
        if refused_here > MOST_REFUSED || to_viewer.send(message).await.is_err() {
            return;
        }
    }
}

/// Sends all that is kept to a viewer, and returns what comes later; `None` if the viewer has left.
async fn welcome(
    to_viewer: &mut SplitSink<WebSocket, ws::Message>,
    shared: &Shared,
) -> Option<Receiver<Message>> {
    let Begin { frames, events, state, playback, later } = shared.feed.begin();
    let first = format!("{{\"events\":{events},\"state\":{state},\"playback\":{playback}}}");
    to_viewer.send(text(&first)).await.ok()?;
    for frame in frames {
        to_viewer.send(binary(&frame)).await.ok()?;
    }
    Some(later)
}

/// The answer to a refused request, which is counted.
fn refusal(shared: &Shared, refused_here: &mut u64, refused: &Refused) -> ws::Message {
    shared.counts.refused_requests.fetch_add(1, Ordering::Relaxed);
    *refused_here += 1;
    text(&json!({ "refused": refused.to_string() }).to_string())
}

fn take(words: &str, shared: &Shared) -> Result<(), Refused> {
    shared.requests.send(Request::read(words)?)
}

fn text(words: &str) -> ws::Message {
    ws::Message::Text(words.into())
}

fn binary(bytes: &Arc<[u8]>) -> ws::Message {
    ws::Message::Binary(Bytes::copy_from_slice(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pages_of_this_machine_may_show_the_page_inside() {
        let policies = |ip: [u8; 4]| {
            let page = typed("text/html", HTML);
            let page = framed(&Access::to((ip, 80).into()).unwrap(), page);
            let policies = page.headers().get_all(CONTENT_SECURITY_POLICY).iter();
            policies.map(|policy| policy.to_str().unwrap().to_owned()).collect::<Vec<_>>()
        };
        let local = policies([127, 0, 0, 1]);
        assert!(local[0].starts_with("default-src 'self'"), "{local:?}");
        assert!(local[1].starts_with("frame-ancestors 'self' http://localhost:*"), "{local:?}");
        assert!(!local[1].contains("http://*"), "{local:?}");
        assert_eq!(policies([0, 0, 0, 0]).len(), 1, "the token protects");
    }
}
