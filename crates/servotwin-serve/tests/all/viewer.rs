//! A study to be shown, its server, and a viewer that asks it.

use serde_json::{Value, json};
use servotwin::job::Folder;
use servotwin::job::{Crew, Job};
use servotwin::parallel::Workers;
use servotwin::study::{Scenario, Study};
use servotwin::table::{Table, parquet};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_serve::{Access, Live, LiveSource, Server};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

pub const FAULT: &str = "actuator_1.servo_valve.bias_positive";
/// No answer within this time is none.
pub const PATIENCE: Duration = Duration::from_secs(30);

pub fn study() -> Study {
    let head = include_str!("../../../servotwin/tests/tiny.toml");
    let rest = include_str!("../../../servotwin/tests/tiny_flights.toml");
    Study::parse(&format!("{head}{rest}"), "tiny.toml").unwrap()
}

pub fn diagnoser() -> Arc<Diagnoser> {
    static MADE: OnceLock<Arc<Diagnoser>> = OnceLock::new();
    let make = || {
        let path = std::env::temp_dir().join(format!("servotwin-serve-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        let (study, folder) = (study(), Folder::new(&path));
        let crew = Crew::quiet(Workers::new(2));
        let job = Job { crew, ..Job::new(&study, &folder) };
        let learned = job.learn(Scenario::Noise).unwrap();
        std::fs::remove_dir_all(&path).unwrap();
        Arc::new(learned)
    };
    MADE.get_or_init(make).clone()
}

pub fn live() -> Live {
    let study = study();
    let mut inputs = study.system.default_inputs();
    let unit = study.system.network().inputs[study.command_input].unit;
    let signal: servotwin::signal::Signal = "noise:rms=3deg,bandwidth=1Hz,seed=4".parse().unwrap();
    inputs[study.command_input] = signal.build(unit, 600.0).unwrap();
    Live { study, diagnoser: diagnoser(), inputs, duration_s: 600.0, specimen: None }
}

/// Serves a flight on a free port while `visit` runs.
pub fn served(visit: impl FnOnce(SocketAddr)) {
    served_from(&live(), visit);
}

/// Serves a source on a free port while `visit` runs.
pub fn served_from(source: &impl LiveSource, visit: impl FnOnce(SocketAddr)) {
    let access = Access::to(([127, 0, 0, 1], 0).into()).unwrap();
    let server = Server::listen(access).unwrap();
    let link = server.link();
    let address = link.trim_start_matches("http://").trim_end_matches('/').parse().unwrap();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let run = scope.spawn(|| server.run(source, &stop));
        // A failed visit must end the server, too.
        let visited = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| visit(address)));
        stop.store(true, Ordering::Relaxed);
        run.join().unwrap().unwrap();
        visited.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}

/// The status and the body of a page, asked for with further header lines.
pub fn get(address: SocketAddr, path: &str, host: &str, more: &str) -> (u16, String) {
    let (status, body) = get_bytes(address, path, host, more);
    (status, String::from_utf8(body).unwrap())
}

pub fn get_bytes(address: SocketAddr, path: &str, host: &str, more: &str) -> (u16, Vec<u8>) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{more}\r\n")
        .unwrap();
    let mut answer = vec![];
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    let status = std::str::from_utf8(&answer[9..12]).unwrap().parse().unwrap();
    (status, answer.split_off(end + 4))
}

/// Saves the session of a source of a server and reads it.
pub fn save(address: SocketAddr) -> Table {
    let (status, bytes) = get_bytes(address, "/session", &address.to_string(), "");
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&bytes));
    let name = format!("servotwin-saved-{}-{}.parquet", std::process::id(), address.port());
    let path = std::env::temp_dir().join(name);
    std::fs::write(&path, bytes).unwrap();
    let table = parquet::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    table
}

/// The events and states of a saved session.
pub fn messages(session: &Table) -> Vec<Value> {
    let texts = session.text("messages").unwrap().iter();
    texts.flat_map(|text| text.lines()).map(|line| serde_json::from_str(line).unwrap()).collect()
}

pub fn own(address: SocketAddr, path: &str) -> Value {
    let (status, body) = get(address, path, &address.to_string(), "");
    assert_eq!(status, 200, "{path}");
    serde_json::from_str(&body).unwrap()
}

pub fn join(address: SocketAddr) -> WebSocket<TcpStream> {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let request = format!("ws://{address}/live").into_client_request().unwrap();
    tungstenite::client(request, stream).unwrap().0
}

pub fn ask(viewer: &mut WebSocket<TcpStream>, request: &Value) {
    viewer.send(Message::text(request.to_string())).unwrap();
}

pub fn inject_request() -> Value {
    json!({ "inject": { "fault": FAULT, "intensity": 1.0, "onset": "step" } })
}

/// The first text in which `wanted` finds something.
pub fn wait_for<T>(viewer: &mut WebSocket<TcpStream>, wanted: impl Fn(&Value) -> Option<T>) -> T {
    loop {
        if let Message::Text(text) = viewer.read().unwrap()
            && let Some(found) = wanted(&serde_json::from_str(&text).unwrap())
        {
            return found;
        }
    }
}

pub fn event_of(said: &Value, kind: &str) -> Option<Value> {
    Some(said["event"].clone()).filter(|event| event["kind"] == kind)
}

/// The first sample, the number of samples and of signals of a frame.
pub fn frame(message: &Message) -> Option<(u64, u32, u32)> {
    let Message::Binary(bytes) = message else { return None };
    let four = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let first = u64::from_le_bytes(bytes[..8].try_into().unwrap());
    assert_eq!(bytes.len(), 16 + 4 * (four(8) * four(12)) as usize);
    Some((first, four(8), four(12)))
}
