//! HTTP and WebSocket, and who may come in.
//!
//! | path | gives |
//! |---|---|
//! | `/` | the page, with everything that it needs beside it |
//! | `/about` | what the flight is: signals, components, faults, and the drawing of the system |
//! | `/live` | the WebSocket: frames and events to the viewer, requests from it |
//! | `/events` | all events so far |
//! | `/session` | the present flight as a Parquet file, to be saved |
//! | `/page.html` | the present flight as a page that needs no server, to be saved |
//! | `/counts` | viewers, lost frames and refusals, and when the newest sample was made |
//!
//! A browser states where a page comes from. Requests from any other page than this server's are refused, so no other
//! page that the user has open can inject a fault or ask for a session. Behind a proxy that ends TLS the page has
//! another scheme, so hosts are compared. Beyond this machine a token is needed as well.
//!
//! A connection that sends no request within ten seconds ends, as does a viewer that takes nothing for so long.

use crate::feed::{Begin, Feed, FeedError, LiveSource, Message};
use crate::page::{HTML, PARTS, page_of};
use crate::request::{LONGEST, Refused, Request, WAITING};
use crate::session::table_of;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::ws::{self, WebSocket, WebSocketUpgrade};
use axum::extract::{Query, State};
use axum::http::header::{
    CONTENT_DISPOSITION, CONTENT_LENGTH, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, ORIGIN,
};
use axum::http::{HeaderMap, HeaderName, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{AppendHeaders, IntoResponse, Response};
use axum::routing::get;
use futures_util::stream::{SplitSink, unfold};
use futures_util::{SinkExt, StreamExt};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde::Deserialize;
use serde_json::{Value, json};
use servotwin::files::{FileError, write_text};
use servotwin::leftovers::TemporaryFolder;
use servotwin::table::{TableError, parquet};
use servotwin_watch::player::{PlayerSignal, event};
use std::fs::File;
use std::io::Read;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, broadcast, mpsc};
use tokio::time::{sleep, timeout};

/// The number of requests that one viewer may have refused before it is sent away.
const MOST_REFUSED: u64 = 100;
/// How often the server looks whether it must end.
const STOP_CHECK: Duration = Duration::from_millis(100);
/// Viewers at the same time.
const MOST_VIEWERS: u64 = 256;
/// Connections at the same time that are no viewers; a browser opens about six.
const MAX_CONNECTIONS: usize = 128;
/// Sessions that are saved at the same time: each takes memory and a file.
const MAX_SAVING: usize = 2;
/// How long a connection may take to send a request, or to take a part of an answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// The bytes of a file that are sent at once.
const PIECE: usize = 1 << 16;

/// The media type of a page.
const PAGE: &str = "text/html; charset=utf-8";

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
    /// A source ended early.
    #[error(transparent)]
    Run(#[from] FeedError),
    /// The system gave no thread or no random number.
    #[error("the server cannot begin: {0}")]
    System(std::io::Error),
}

/// Where a server listens, and whom it lets in.
#[derive(Clone, Debug, PartialEq)]
pub struct Access {
    /// The address.
    pub(crate) address: SocketAddr,
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
        let (name, port) = match host.rsplit_once(':') {
            Some((name, port)) if !port.ends_with(']') => (name, port),
            _ => (host, "80"),
        };
        let bare = name.trim_start_matches('[').trim_end_matches(']');
        port.parse::<u16>().is_ok()
            && (name == "localhost" || bare.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback()))
    }

    /// Why a request may not come in; `None` if it may. A link on another page may lead to a page, and to nothing else.
    fn refusal(
        &self,
        asked: Asked,
        headers: &HeaderMap,
        given: Option<&str>,
    ) -> Option<&'static str> {
        let header = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let host = header(HOST).unwrap_or_default();
        if !self.is_own_host(host) {
            return Some("the request names another host");
        }
        let is_own = |origin: &str| {
            let named = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
            named == Some(host)
        };
        let site = header(HeaderName::from_static("sec-fetch-site"));
        let is_own_site = site.is_none_or(|site| ["same-origin", "none"].contains(&site));
        if !header(ORIGIN).is_none_or(is_own) || (asked == Asked::Data && !is_own_site) {
            return Some("the request comes from another page");
        }
        match &self.token {
            Some(token) if given != Some(token) => Some("the token is missing or wrong"),
            _ => None,
        }
    }
}

/// What a request asks for.
#[derive(Clone, Copy, PartialEq)]
enum Asked {
    Page,
    Data,
}

/// Sixteen random bytes as hexadecimal digits.
fn token() -> std::io::Result<String> {
    let mut bytes = [0u8; 16];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
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

impl Counts {
    fn now(&self, feed: &Feed) -> Value {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        json!({
            "viewers": of(&self.viewers),
            "viewers_so_far": of(&self.viewers_so_far),
            "frames_lost": of(&self.frames_lost),
            "refused_requests": of(&self.refused_requests),
            "refused_visits": of(&self.refused_visits),
            "newest": feed.newest(),
        })
    }
}

/// What a server knows of its source.
struct Shared {
    access: Access,
    feed: Feed,
    requests: SyncSender<Request>,
    about: Value,
    signals: Vec<PlayerSignal>,
    saving: Arc<Semaphore>,
    counts: Counts,
}

impl Shared {
    fn new(access: Access, source: &dyn LiveSource) -> (Arc<Self>, Receiver<Request>) {
        let (requests, waiting) = sync_channel(WAITING);
        let shared = Shared {
            access,
            feed: Feed::default(),
            requests,
            about: source.about(),
            signals: source.signals(),
            saving: Arc::new(Semaphore::new(MAX_SAVING)),
            counts: Counts::default(),
        };
        (Arc::new(shared), waiting)
    }

    fn period_s(&self) -> f64 {
        self.about["period_s"].as_f64().unwrap_or(0.0)
    }
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

    /// Runs a source, and serves it until `stop` is set or it has ended.
    ///
    /// # Errors
    /// The source ended early, or the system gives no thread.
    pub fn run(self, source: &dyn LiveSource, stop: &AtomicBool) -> Result<(), ServeError> {
        let (shared, waiting) = Shared::new(self.access, source);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(ServeError::System)?;
        std::thread::scope(|scope| {
            let of_thread = &shared;
            let run = scope.spawn(move || run_source(source, of_thread, &waiting, stop));
            let must_stop = || stop.load(Ordering::Relaxed) || run.is_finished();
            let served = runtime.block_on(serve(self.listener, &shared, must_stop));
            // Without a server nobody can end the source.
            stop.store(true, Ordering::Relaxed);
            let ended = run.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            served.map_err(ServeError::System)?;
            Ok(ended?)
        })
    }
}

/// Runs the source of a server; its viewers read why it ended early.
fn run_source(
    source: &dyn LiveSource,
    shared: &Shared,
    waiting: &Receiver<Request>,
    stop: &AtomicBool,
) -> Result<(), FeedError> {
    let ended = source.run(&shared.feed, waiting, stop);
    if let Err(error) = &ended {
        let now_s = shared.feed.now_s(shared.period_s());
        shared.feed.event(&event(now_s, "failed", json!({ "why": error.to_string() })));
        shared.feed.state(&json!({ "alarm": "error", "finding": error.to_string() }));
    }
    ended
}

async fn serve(
    listener: std::net::TcpListener,
    shared: &Arc<Shared>,
    must_stop: impl Fn() -> bool,
) -> std::io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let stopped = async {
        while !must_stop() {
            sleep(STOP_CHECK).await;
        }
    };
    tokio::select! {
        () = accept(listener, router(shared)) => {}
        () = stopped => {}
    }
    Ok(())
}

/// Serves connections without end; one more than [`MAX_CONNECTIONS`] is closed at once.
async fn accept(listener: TcpListener, router: Router) {
    let room = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(PATIENCE);
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // The process has too many open files, for example.
            sleep(STOP_CHECK).await;
            continue;
        };
        let Ok(place) = room.clone().try_acquire_owned() else { continue };
        let service = TowerToHyperService::new(router.clone());
        let connection = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
        tokio::spawn(async move {
            // A connection that breaks concerns its viewer alone.
            let _ = connection.await;
            drop(place);
        });
    }
}

type Member = State<Arc<Shared>>;

/// The paths of the source.
fn router(shared: &Arc<Shared>) -> Router {
    let json = "application/json";
    let data = Router::new()
        .route(
            "/about",
            get(async move |State(shared): Member| typed(json, shared.about.to_string())),
        )
        .route("/events", get(async move |State(shared): Member| typed(json, shared.feed.events())))
        .route(
            "/counts",
            get(async move |State(shared): Member| {
                typed(json, shared.counts.now(&shared.feed).to_string())
            }),
        )
        .route("/session", get(|State(shared): Member| session(shared, SavedAs::Table)))
        .route("/page.html", get(|State(shared): Member| session(shared, SavedAs::Page)))
        .route("/live", get(join));
    let page = async |State(shared): Member| framed(&shared.access, typed(PAGE, HTML));
    guarded(data, shared, Asked::Data)
        .merge(guarded(Router::new().route("/", get(page)), shared, Asked::Page))
        .route("/{file}", get(public))
        .with_state(shared.clone())
}

#[derive(Deserialize)]
struct Pass {
    token: Option<String>,
}

/// The same paths for requests that are let in.
fn guarded(paths: Router<Arc<Shared>>, shared: &Arc<Shared>, asked: Asked) -> Router<Arc<Shared>> {
    paths.route_layer(from_fn_with_state((shared.clone(), asked), let_in))
}

/// Lets a request in, or answers why not, and counts it.
async fn let_in(
    State((shared, asked)): State<(Arc<Shared>, Asked)>,
    Query(pass): Query<Pass>,
    headers: HeaderMap,
    request: axum::extract::Request,
    next: Next,
) -> Response {
    match shared.access.refusal(asked, &headers, pass.token.as_deref()) {
        Some(why) => {
            shared.counts.refused_visits.fetch_add(1, Ordering::Relaxed);
            (StatusCode::FORBIDDEN, why).into_response()
        }
        None => next.run(request).await,
    }
}

/// Scripts and styles are no secret, and a page that has none shows nothing.
async fn public(axum::extract::Path(name): axum::extract::Path<String>) -> Response {
    // Every browser asks for one.
    if name == "favicon.ico" {
        return StatusCode::NO_CONTENT.into_response();
    }
    match PARTS.iter().find(|part| part.name == name) {
        Some(part) => typed(part.media_type, part.text),
        None => (StatusCode::NOT_FOUND, "there is no such page").into_response(),
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

fn typed(kind: &'static str, text: impl Into<Body>) -> Response {
    // The page asks for nothing elsewhere, and a browser must not let it.
    let policy = "default-src 'self'; style-src 'self' 'unsafe-inline'";
    ([(CONTENT_TYPE.as_str(), kind), ("content-security-policy", policy)], text.into())
        .into_response()
}

/// The file that a session is saved as.
#[derive(Clone, Copy)]
enum SavedAs {
    Table,
    Page,
}

/// Why a session cannot be saved.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
enum SaveError {
    Table(#[from] TableError),
    File(#[from] FileError),
}

impl SavedAs {
    fn headers(self) -> [(HeaderName, &'static str); 2] {
        let (kind, name) = match self {
            SavedAs::Table => {
                ("application/vnd.apache.parquet", "attachment; filename=\"session.parquet\"")
            }
            SavedAs::Page => (PAGE, "attachment; filename=\"session.html\""),
        };
        [(CONTENT_TYPE, kind), (CONTENT_DISPOSITION, name)]
    }

    /// The file and its length in bytes. It has no name any more, and is gone when it is closed.
    fn file(self, shared: &Shared, messages: &[Message]) -> Result<(File, u64), SaveError> {
        let failed = |cause| FileError::from_io(&std::env::temp_dir(), cause);
        let folder = TemporaryFolder::new().map_err(failed)?;
        let path = folder.path().join("session");
        let (period_s, signals) = (shared.period_s(), &shared.signals);
        match self {
            SavedAs::Table => parquet::write(&path, &table_of(period_s, signals, messages)?)?,
            SavedAs::Page => {
                let title = shared.about["title"].as_str().unwrap_or_default();
                write_text(&path, &page_of(title, period_s, signals, messages))?;
            }
        }
        let file = File::open(&path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        Ok((file, length))
    }
}

/// The present flight as a file. It is made on a thread of its own, so that viewers need not wait.
async fn session(shared: Arc<Shared>, saved_as: SavedAs) -> Response {
    let Ok(place) = shared.saving.clone().try_acquire_owned() else {
        let why = "two sessions are being saved; try again when one of them is complete";
        return (StatusCode::SERVICE_UNAVAILABLE, why).into_response();
    };
    let Some(messages) = shared.feed.session() else {
        let why = "the flight has too many events to be saved; begin a new one";
        return (StatusCode::INSUFFICIENT_STORAGE, why).into_response();
    };
    match tokio::task::spawn_blocking(move || saved_as.file(&shared, &messages)).await {
        Ok(Ok((file, length))) => {
            let length = [(CONTENT_LENGTH, length)];
            (saved_as.headers(), length, streamed(file, place)).into_response()
        }
        Ok(Err(error)) => (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response(),
        Err(panic) => std::panic::resume_unwind(panic.into_panic()),
    }
}

/// Sends a file piece by piece. Its place is free when all is sent, or when the viewer takes nothing any more.
fn streamed(mut file: File, place: OwnedSemaphorePermit) -> Body {
    let (send, pieces) = mpsc::channel::<std::io::Result<Bytes>>(1);
    tokio::spawn(async move {
        let _place = place;
        loop {
            let mut piece = vec![0; PIECE];
            let read = file.read(&mut piece).map(|count| {
                piece.truncate(count);
                Bytes::from(piece)
            });
            let is_last = !read.as_ref().is_ok_and(|piece| !piece.is_empty());
            let sent = timeout(PATIENCE, send.send(read)).await;
            if is_last || !matches!(sent, Ok(Ok(()))) {
                return;
            }
        }
    });
    let next = |mut pieces: mpsc::Receiver<_>| async move { Some((pieces.recv().await?, pieces)) };
    Body::from_stream(unfold(pieces, next))
}

async fn join(State(shared): Member, upgrade: WebSocketUpgrade) -> Response {
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

type ToViewer = SplitSink<WebSocket, ws::Message>;

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
                Err(RecvError::Lagged(lost)) => {
                    match catch_up(&mut to_viewer, shared, later.len() as u64 + lost).await {
                        Some(now) => { later = now; continue }
                        None => return,
                    }
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
        if refused_here > MOST_REFUSED || send(&mut to_viewer, message).await.is_none() {
            return;
        }
    }
}

/// Sends a message to a viewer; `None` if it has left or takes nothing any more.
async fn send(to_viewer: &mut ToViewer, message: ws::Message) -> Option<()> {
    timeout(PATIENCE, to_viewer.send(message)).await.ok()?.ok()
}

/// Everything that comes later.
type Later = broadcast::Receiver<Message>;

/// Sends all that is kept to a viewer; `None` if the viewer has left.
async fn welcome(to_viewer: &mut ToViewer, shared: &Shared) -> Option<Later> {
    let Begin { frames, events, state, later } = shared.feed.begin();
    let first = format!("{{\"events\":{events},\"state\":{state}}}");
    send(to_viewer, text(&first)).await?;
    for frame in frames {
        send(to_viewer, binary(&frame)).await?;
    }
    Some(later)
}

/// Brings a viewer that was too slow up to date; `None` if it has left. It loses the frames that wait, too: sending them
/// would only make it later.
async fn catch_up(to_viewer: &mut ToViewer, shared: &Shared, lost: u64) -> Option<Later> {
    shared.counts.frames_lost.fetch_add(lost, Ordering::Relaxed);
    let Begin { events, state, later, .. } = shared.feed.begin();
    let now = format!("{{\"lost\":{lost},\"all_events\":{events},\"state\":{state}}}");
    send(to_viewer, text(&now)).await?;
    Some(later)
}

/// The answer to a refused request, which is counted.
fn refusal(shared: &Shared, refused_here: &mut u64, refused: &Refused) -> ws::Message {
    shared.counts.refused_requests.fetch_add(1, Ordering::Relaxed);
    *refused_here += 1;
    text(&json!({ "refused": refused.to_string() }).to_string())
}

fn take(words: &str, shared: &Shared) -> Result<(), Refused> {
    // The flight does not wait for requests, and one that has ended needs none.
    match shared.requests.try_send(Request::read(words)?) {
        Err(TrySendError::Full(_)) => Err(Refused::TooMany),
        Ok(()) | Err(TrySendError::Disconnected(_)) => Ok(()),
    }
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
    use servotwin_watch::player::SignalGroup;

    /// A source without a sample.
    struct Nothing;

    impl LiveSource for Nothing {
        fn about(&self) -> Value {
            json!({ "period_s": 0.01 })
        }

        fn signals(&self) -> Vec<PlayerSignal> {
            vec![PlayerSignal::new("a", "a", "kN", SignalGroup::Fight)]
        }

        fn run(&self, _: &Feed, _: &Receiver<Request>, _: &AtomicBool) -> Result<(), FeedError> {
            Ok(())
        }
    }

    #[tokio::test]
    async fn a_third_session_is_not_saved_beside_two() {
        let access = Access::to(([127, 0, 0, 1], 0).into()).unwrap();
        let (shared, _waiting) = Shared::new(access, &Nothing);
        let save = async || session(shared.clone(), SavedAs::Table).await;
        let two = [save().await, save().await];
        assert!(two.iter().all(|answer| answer.status() == StatusCode::OK));
        // Their bodies are of one piece, so both places are free when it is taken.
        assert_eq!(save().await.status(), StatusCode::SERVICE_UNAVAILABLE);
        for answer in two {
            let length: usize = answer.headers()[CONTENT_LENGTH].to_str().unwrap().parse().unwrap();
            let body = axum::body::to_bytes(answer.into_body(), usize::MAX).await.unwrap();
            assert_eq!((&body[..4], body.len()), (&b"PAR1"[..], length));
        }
        assert_eq!(save().await.status(), StatusCode::OK);
    }

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
