//! HTTP and WebSocket, and who may come in.
//!
//! | path | gives |
//! |---|---|
//! | `/` | the page, with everything that it needs beside it |
//! | `/about` | what the flight is: signals, components, faults |
//! | `/live` | the WebSocket: frames and events to the viewer, requests from it |
//! | `/events` | all events so far |
//! | `/session` | the present flight as a Parquet file, to be saved |
//! | `/session.mcap` | the same as MCAP, if the program was built with it |
//! | `/page.html` | the present flight as a page that needs no server, to be saved |
//! | `/counts` | viewers, lost frames and refusals, and when the newest sample was made |
//!
//! With several sources these paths stand below the number of each (`/1/`, `/2/`, …), and two more lead there:
//!
//! | path | gives |
//! |---|---|
//! | `/` | the page of the fleet, with a row for each source |
//! | `/fleet` | state and age of each source |
//!
//! A browser states where a page comes from. Requests from any other page than this server's are refused, so no other
//! page that the user has open can inject a fault. Beyond this machine a token is needed as well.

use crate::feed::{Begin, Feed, LiveSource, Message, Newest, RunError};
use crate::page::{FLEET, HTML, PARTS, saved_page};
use crate::request::{LONGEST, Refused, Request, Requests, requests};
use crate::session::{SavedSession, SessionError};
use crate::state::event;
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
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::Receiver;
use std::thread::ScopedJoinHandle;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::broadcast;
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
    /// A source ended early.
    #[error(transparent)]
    Run(#[from] RunError),
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

/// What a server knows of one source.
struct Shared {
    access: Arc<Access>,
    /// Its number in the fleet, from 1.
    number: usize,
    feed: Feed,
    requests: Requests,
    about: Value,
    /// One session is saved at a time: each takes memory and a file.
    saving: tokio::sync::Mutex<()>,
    counts: Counts,
}

impl Shared {
    fn new(
        access: &Arc<Access>,
        number: usize,
        source: &dyn LiveSource,
    ) -> (Arc<Self>, Receiver<Request>) {
        let (requests, waiting) = requests();
        let mut about = source.about();
        about["formats"] = json!(SavedAs::BUILT);
        let shared = Shared {
            access: access.clone(),
            number,
            feed: Feed::default(),
            requests,
            about,
            saving: tokio::sync::Mutex::default(),
            counts: Counts::default(),
        };
        (Arc::new(shared), waiting)
    }

    /// The row of a fleet: title, state and the time since the last frame, s.
    fn row(&self) -> String {
        let (title, state) = (&self.about["title"], self.feed.state_now());
        let age_s = json!(self.feed.newest().map(Newest::age_s));
        format!("{{\"title\":{title},\"age_s\":{age_s},\"state\":{state}}}")
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

    /// Runs sources, one or a fleet, and serves them until `stop` is set or all have ended.
    ///
    /// # Errors
    /// A source ended early, or the system gives no thread. In a fleet the others go on first.
    pub fn run(self, sources: &[&dyn LiveSource], stop: &AtomicBool) -> Result<(), ServeError> {
        let access = Arc::new(self.access);
        let (members, waiting): (Vec<_>, Vec<_>) =
            sources.iter().zip(1..).map(|(source, k)| Shared::new(&access, k, *source)).unzip();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(ServeError::System)?;
        let under_way = &AtomicUsize::new(members.len());
        std::thread::scope(|scope| {
            let mut threads = vec![];
            for ((source, member), waiting) in sources.iter().zip(&members).zip(waiting) {
                let member = member.clone();
                threads.push(scope.spawn(move || {
                    let ended = run_member(*source, &member, &waiting, stop);
                    under_way.fetch_sub(1, Ordering::Relaxed);
                    ended
                }));
            }
            let must_stop =
                || stop.load(Ordering::Relaxed) || under_way.load(Ordering::Relaxed) == 0;
            let served = runtime.block_on(serve(self.listener, &members, must_stop));
            // Without a server nobody can end the sources.
            stop.store(true, Ordering::Relaxed);
            let join = |thread: ScopedJoinHandle<'_, Result<(), RunError>>| {
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            let ended: Vec<_> = threads.into_iter().map(join).collect();
            served.map_err(ServeError::System)?;
            Ok(ended.into_iter().collect::<Result<(), _>>()?)
        })
    }
}

/// Runs a source of a server; its viewers read why it ended early.
fn run_member(
    source: &dyn LiveSource,
    member: &Shared,
    waiting: &Receiver<Request>,
    stop: &AtomicBool,
) -> Result<(), RunError> {
    let ended = source.run(&member.feed, waiting, stop);
    if let Err(error) = &ended {
        let now_s = member.feed.now_s(member.about["period_s"].as_f64().unwrap_or(0.0));
        member.feed.event(&event(now_s, "failed", json!({ "why": error.to_string() })));
        member.feed.state(&json!({ "alarm": "error", "finding": error.to_string() }));
    }
    ended
}

async fn serve(
    listener: std::net::TcpListener,
    members: &[Arc<Shared>],
    must_stop: impl Fn() -> bool,
) -> std::io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let server = axum::serve(listener, router(members));
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

/// The paths of one source, or those of a fleet above those of each.
fn router(members: &[Arc<Shared>]) -> Router {
    let below = |prefix: &str, member: &Arc<Shared>| {
        Router::new()
            .route(&format!("{prefix}/"), get(page))
            .route(&format!("{prefix}/{{file}}"), get(file))
            .route(&format!("{prefix}/live"), get(join))
            .with_state(member.clone())
    };
    if let [member] = members {
        return below("", member);
    }
    let fleet = Router::new()
        .route("/", get(fleet_page))
        .route("/{file}", get(fleet_file))
        .with_state(Arc::from(members));
    let add = |all: Router, member: &Arc<Shared>| {
        all.merge(below(&format!("/{}", member.number), member))
    };
    members.iter().fold(fleet, add)
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

/// Lets a visit in, or answers why not.
fn let_in(shared: &Shared, pass: &Pass, headers: &HeaderMap) -> Result<(), Box<Response>> {
    match shared.access.refusal(headers, pass.token.as_deref()) {
        Some(why) => Err(Box::new(refused(shared, why))),
        None => Ok(()),
    }
}

async fn page(
    State(shared): State<Arc<Shared>>,
    Query(pass): Query<Pass>,
    headers: HeaderMap,
) -> Response {
    match let_in(&shared, &pass, &headers) {
        Ok(()) => framed(&shared.access, typed("text/html; charset=utf-8", HTML)),
        Err(refused) => *refused,
    }
}

type Members = Arc<[Arc<Shared>]>;

async fn fleet_page(
    State(members): State<Members>,
    Query(pass): Query<Pass>,
    headers: HeaderMap,
) -> Response {
    match let_in(&members[0], &pass, &headers) {
        Ok(()) => typed("text/html; charset=utf-8", FLEET),
        Err(refused) => *refused,
    }
}

async fn fleet_file(
    State(members): State<Members>,
    Query(pass): Query<Pass>,
    axum::extract::Path(name): axum::extract::Path<String>,
    headers: HeaderMap,
) -> Response {
    if let Some(public) = public(&name) {
        return public;
    }
    if let Err(refused) = let_in(&members[0], &pass, &headers) {
        return *refused;
    }
    match name.as_str() {
        "fleet" => {
            let rows: Vec<String> = members.iter().map(|member| member.row()).collect();
            typed("application/json", format!("[{}]", rows.join(",")))
        }
        _ => nothing_there(),
    }
}

fn nothing_there() -> Response {
    (StatusCode::NOT_FOUND, "there is no such page").into_response()
}

/// Scripts and styles are no secret, and a page that has none shows nothing.
fn public(name: &str) -> Option<Response> {
    // Every browser asks for one.
    if name == "favicon.ico" {
        return Some(StatusCode::NO_CONTENT.into_response());
    }
    let part = PARTS.iter().find(|part| part.name == name)?;
    Some(typed(part.media_type, part.text))
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
    if let Some(public) = public(&name) {
        return public;
    }
    if let Err(refused) = let_in(&shared, &pass, &headers) {
        return *refused;
    }
    match name.as_str() {
        "about" => typed("application/json", shared.about.to_string()),
        "events" => typed("application/json", shared.feed.events()),
        "session" => session(shared, SavedAs::Table).await,
        #[cfg(feature = "mcap")]
        "session.mcap" => session(shared, SavedAs::Mcap).await,
        "page.html" => session(shared, SavedAs::Page).await,
        "counts" => typed("application/json", json!(shared.counts.now(&shared.feed)).to_string()),
        _ => nothing_there(),
    }
}

/// The file that a session is saved as.
#[derive(Clone, Copy)]
enum SavedAs {
    Table,
    #[cfg(feature = "mcap")]
    Mcap,
    Page,
}

impl SavedAs {
    /// The formats that this program was built with, by the path that gives them.
    const BUILT: &'static [&'static str] = if cfg!(feature = "mcap") {
        &["session", "session.mcap", "page.html"]
    } else {
        &["session", "page.html"]
    };

    fn headers(self) -> [(HeaderName, &'static str); 2] {
        let (kind, name) = match self {
            SavedAs::Table => {
                ("application/vnd.apache.parquet", "attachment; filename=\"session.parquet\"")
            }
            #[cfg(feature = "mcap")]
            SavedAs::Mcap => ("application/octet-stream", "attachment; filename=\"session.mcap\""),
            SavedAs::Page => ("text/html; charset=utf-8", "attachment; filename=\"session.html\""),
        };
        [(CONTENT_TYPE, kind), (CONTENT_DISPOSITION, name)]
    }

    /// The bytes of the file; `name` is that of a temporary file.
    fn bytes(self, session: &SavedSession, name: &str) -> Result<Vec<u8>, SessionError> {
        let path = std::env::temp_dir().join(name);
        match self {
            SavedAs::Table => session.bytes(&path),
            #[cfg(feature = "mcap")]
            SavedAs::Mcap => session.mcap(&path),
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
    let session = SavedSession { about: shared.about.clone(), messages };
    let name = format!("servotwin-session-{}-{}", shared.access.address.port(), shared.number);
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
    if let Err(refused) = let_in(&shared, &pass, &headers) {
        return *refused;
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

type ToViewer = SplitSink<WebSocket, ws::Message>;

/// Serves one viewer until it leaves.
async fn view(socket: WebSocket, shared: &Shared) {
    let (mut to_viewer, mut from_viewer) = socket.split();
    let mut refused_here = 0;
    let Some(mut seen) = welcome(&mut to_viewer, shared).await else { return };
    loop {
        let message = tokio::select! {
            message = seen.later.recv() => match message {
                Ok(Message::Frame(bytes)) => binary(&bytes),
                Ok(Message::Event(event)) => text(&format!("{{\"event\":{event}}}")),
                Ok(Message::State(state)) => text(&format!("{{\"state\":{state}}}")),
                Ok(Message::Playback(playback)) => text(&format!("{{\"playback\":{playback}}}")),
                Ok(Message::Jump) => match welcome(&mut to_viewer, shared).await {
                    Some(anew) => { seen = anew; continue }
                    None => return,
                },
                Err(RecvError::Lagged(lost)) => match catch_up(&mut to_viewer, shared, seen, lost).await {
                    Some(now) => { seen = now; continue }
                    None => return,
                },
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

/// What a viewer has seen, and what comes later.
struct Seen {
    jumps: u64,
    later: broadcast::Receiver<Message>,
}

/// Sends all that is kept to a viewer; `None` if the viewer has left.
async fn welcome(to_viewer: &mut ToViewer, shared: &Shared) -> Option<Seen> {
    let Begin { frames, events, state, playback, jumps, later } = shared.feed.begin();
    let first = format!("{{\"events\":{events},\"state\":{state},\"playback\":{playback}}}");
    to_viewer.send(text(&first)).await.ok()?;
    for frame in frames {
        to_viewer.send(binary(&frame)).await.ok()?;
    }
    Some(Seen { jumps, later })
}

/// Brings a viewer that was too slow up to date; `None` if it has left. It loses the frames that wait, too: sending them
/// would only make it later.
async fn catch_up(
    to_viewer: &mut ToViewer,
    shared: &Shared,
    seen: Seen,
    lost: u64,
) -> Option<Seen> {
    let lost = lost + seen.later.len() as u64;
    shared.counts.frames_lost.fetch_add(lost, Ordering::Relaxed);
    let Begin { events, state, playback, jumps, later, .. } = shared.feed.begin();
    if jumps != seen.jumps {
        to_viewer.send(text(&format!("{{\"lost\":{lost}}}"))).await.ok()?;
        return welcome(to_viewer, shared).await;
    }
    let now = format!(
        "{{\"lost\":{lost},\"all_events\":{events},\"state\":{state},\"playback\":{playback}}}"
    );
    to_viewer.send(text(&now)).await.ok()?;
    Some(Seen { jumps, later })
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
