//! MQTT: a broker of the test's own, which does what it is told and may fall silent, and mosquitto.

use servotwin_watch::counts::Irregularity;
use servotwin_watch::source::{Address, LogRow, Read, Source, SourceError, Wanted};
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// How long anything is waited for before a test has failed.
const PATIENCE: Duration = Duration::from_secs(60);

/// A message: topic, whether it is retained, payload.
type Message = (&'static str, bool, &'static str);

/// The broker's behavior after its messages.
#[derive(Clone, Copy)]
enum Then {
    /// Keeps the connection and says nothing, not even to a ping.
    FallSilent,
    Close,
    AnswerPings,
    /// Sends bytes that are no packet.
    SendNoise,
}

/// A connection: the broker's answer to it and to the subscription, messages, and what comes then.
struct Session {
    connect_code: u8,
    subscribe_code: u8,
    messages: Vec<Message>,
    then: Then,
}

fn session(messages: &[Message], then: Then) -> Session {
    Session { connect_code: 0, subscribe_code: 0, messages: messages.to_vec(), then }
}

/// Serves one connection after the other, in the order of its sessions; then none. Ends when the sender is dropped.
fn broker(sessions: Vec<Session>) -> (u16, Sender<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let (hold, held) = channel::<()>();
    thread::spawn(move || {
        // A client may leave in the middle.
        let serve = |session: Session| -> std::io::Result<Option<TcpStream>> {
            let (mut stream, _) = listener.accept()?;
            stream.set_read_timeout(Some(PATIENCE))?;
            packet(&mut stream)?;
            stream.write_all(&[0x20, 2, 0, session.connect_code])?;
            if session.connect_code > 0 {
                return Ok(None);
            }
            let subscribe = packet(&mut stream)?;
            let code = session.subscribe_code;
            let filters = subscribe[2..].iter().filter(|&&byte| byte <= 1).count() / 2;
            let mut answer = vec![0x90, 2 + filters.max(1) as u8, subscribe[0], subscribe[1]];
            answer.resize(4 + filters.max(1), code);
            stream.write_all(&answer)?;
            for (topic, is_retained, payload) in session.messages {
                stream.write_all(&publication(topic, 0, is_retained, 0, payload))?;
            }
            match session.then {
                Then::FallSilent => return Ok(Some(stream)),
                Then::Close => {}
                Then::SendNoise => stream.write_all(&[0xF7; 64])?,
                Then::AnswerPings => {
                    while packet(&mut stream).is_ok() {
                        stream.write_all(&[0xD0, 0])?;
                    }
                }
            }
            Ok(None)
        };
        let _open: Vec<_> = sessions.into_iter().map(serve).collect();
        let _ = held.recv();
    });
    (port, hold)
}

/// The body of the next packet.
fn packet(stream: &mut TcpStream) -> std::io::Result<Vec<u8>> {
    let mut byte = [0];
    stream.read_exact(&mut byte)?;
    let (mut length, mut shift) = (0, 0);
    loop {
        stream.read_exact(&mut byte)?;
        length |= usize::from(byte[0] & 127) << shift;
        shift += 7;
        if byte[0] < 128 {
            break;
        }
    }
    let mut body = vec![0; length];
    stream.read_exact(&mut body)?;
    Ok(body)
}

fn publication(topic: &str, qos: u8, is_retained: bool, number: u16, payload: &str) -> Vec<u8> {
    let mut body = (topic.len() as u16).to_be_bytes().to_vec();
    body.extend(topic.bytes());
    if qos > 0 {
        body.extend(number.to_be_bytes());
    }
    body.extend(payload.bytes());
    let first = 0x30 | qos << 1 | u8::from(is_retained);
    let mut packet = vec![first];
    let mut length = body.len();
    while length > 127 {
        packet.push(length as u8 | 128);
        length >>= 7;
    }
    packet.push(length as u8);
    packet.extend(body);
    packet
}

fn open(address: &str, names: &[&str]) -> Result<Box<dyn Source>, SourceError> {
    let names = names.iter().map(|name| name.to_string()).collect();
    let wanted = Wanted { names, time: Some(0), ..Wanted::default() };
    Address::parse(address).unwrap().open(&wanted)
}

/// Reads until as many things have come that are neither a pause nor nothing.
fn reads(source: &mut dyn Source, count: usize) -> Vec<(Read, Vec<f64>)> {
    let (mut row, mut found) = (LogRow::default(), vec![]);
    let begin = Instant::now();
    while found.len() < count && begin.elapsed() < PATIENCE {
        match source.read(&mut row).unwrap() {
            Read::Pause | Read::Nothing => {}
            Read::Row => found.push((Read::Row, row.values.clone())),
            other => found.push((other, vec![])),
        }
    }
    found
}

fn row(t: f64, p: f64) -> (Read, Vec<f64>) {
    (Read::Row, vec![t, p])
}

fn lost(cause: &str) -> (Read, Vec<f64>) {
    (Read::Disconnected { cause: cause.into() }, vec![])
}

#[test]
fn a_broker_that_falls_silent_is_reported_and_connected_again() {
    let first = [("rig/a", false, "{\"t\": 1, \"p\": 2}\n{\"t\": 2, \"p\": 3}")];
    let second = [("rig/a", false, "{\"t\": 3, \"p\": 4}")];
    let sessions = vec![session(&first, Then::FallSilent), session(&second, Then::AnswerPings)];
    let (port, _hold) = broker(sessions);
    let mut source =
        open(&format!("mqtt://127.0.0.1:{port}/rig/a?keep_alive=1"), &["t", "p"]).unwrap();
    let expected = vec![
        row(1.0, 2.0),
        row(2.0, 3.0),
        lost("the broker does not answer"),
        (Read::Reconnected, vec![]),
        row(3.0, 4.0),
    ];
    assert_eq!(reads(&mut *source, 5), expected);
}

#[test]
fn a_lost_connection_is_reported_when_it_is_lost_and_once() {
    let (port, hold) = broker(vec![session(&[("a", false, "{\"t\": 1, \"p\": 2}")], Then::Close)]);
    let mut source = open(&format!("mqtt://127.0.0.1:{port}/a?keep_alive=1"), &["t", "p"]).unwrap();
    // Nobody makes the connection again.
    drop(hold);
    assert_eq!(reads(&mut *source, 2), [row(1.0, 2.0), lost("the broker closed the connection")]);
    let mut row = LogRow::default();
    for _ in 0..10 {
        assert_eq!(source.read(&mut row).unwrap(), Read::Pause);
    }
}

#[test]
fn bytes_that_are_no_packet_end_the_connection_and_no_more() {
    let message = [("a", false, "{\"t\": 1, \"p\": 2}")];
    let sessions = vec![session(&[], Then::SendNoise), session(&message, Then::AnswerPings)];
    let (port, _hold) = broker(sessions);
    let mut source = open(&format!("mqtt://127.0.0.1:{port}/a"), &["t", "p"]).unwrap();
    let found = reads(&mut *source, 3);
    let Read::Disconnected { cause } = &found[0].0 else { panic!("{found:?}") };
    assert!(cause.starts_with("a damaged packet"), "{cause}");
    assert_eq!(found[1..], [(Read::Reconnected, vec![]), row(1.0, 2.0)]);
}

#[test]
fn a_message_of_more_than_a_mebibyte_is_counted_and_the_connection_stays() {
    let long: &str = Box::leak("x".repeat(3 << 20).into());
    let messages = [("a", false, long), ("a", false, "{\"t\": 1, \"p\": 2}")];
    let (port, _hold) = broker(vec![session(&messages, Then::AnswerPings)]);
    let mut source = open(&format!("mqtt://127.0.0.1:{port}/a"), &["t", "p"]).unwrap();
    let expected = [(Read::Flawed(Irregularity::TooLong.into()), vec![]), row(1.0, 2.0)];
    assert_eq!(reads(&mut *source, 2), expected);
}

#[test]
fn a_retained_message_is_no_sample() {
    let messages =
        [("rig/one", true, "{\"t\": -9000, \"p\": 7}"), ("rig/one", false, "{\"t\": 1, \"p\": 2}")];
    let (port, _hold) = broker(vec![session(&messages, Then::AnswerPings)]);
    let mut source = open(&format!("mqtt://127.0.0.1:{port}/rig/one"), &["t", "p"]).unwrap();
    let retained = Read::Flawed(Irregularity::Retained.into());
    assert_eq!(reads(&mut *source, 2), [(retained, vec![]), row(1.0, 2.0)]);
}

#[test]
fn a_broker_that_refuses_is_an_error_without_the_password() {
    let mut refusing = session(&[], Then::Close);
    refusing.connect_code = 4;
    let mut forbidding = session(&[], Then::Close);
    forbidding.subscribe_code = 128;
    let (port, _hold) = broker(vec![refusing, forbidding]);
    let address = format!("mqtt://me:geheim@127.0.0.1:{port}/rig/a");
    let told = open(&address, &["t"]).err().unwrap().to_string();
    assert_eq!(told, format!("mqtt://127.0.0.1:{port}/rig/a: wrong user or password"));
    let told = open(&address, &["t"]).err().unwrap().to_string();
    assert!(told.contains("the broker refuses the subscription to rig/a"), "{told}");
    for wrong in
        ["mqtt://me:geheim@rig/a?qos=7", "mqtt://me:ge/heim@rig/a", "mqtx://me:geheim@rig/a"]
    {
        let told = Address::parse(wrong).unwrap_err().to_string();
        assert!(told.contains("names no source") && !told.contains("heim"), "{told}");
    }
    let closed = open("mqtt://127.0.0.1:1/a", &["t"]).err().unwrap().to_string();
    assert!(closed.starts_with("mqtt://127.0.0.1:1/a: "), "{closed}");
}

/// A mosquitto of its own with a folder of its own, both gone at the end.
struct Mosquitto {
    child: Child,
    port: u16,
    folder: PathBuf,
}

impl Mosquitto {
    /// `None` where mosquitto is not installed, unless it must be.
    fn start(name: &str, settings: &str) -> Self {
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = free.local_addr().unwrap().port();
        drop(free);
        let folder =
            std::env::temp_dir().join(format!("servotwin-mqtt-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let shown = folder.display();
        let settings = settings.replace("FOLDER", &shown.to_string());
        let settings =
            format!("listener {port} 127.0.0.1\nallow_anonymous true\nuser root\n{settings}");
        std::fs::write(folder.join("mosquitto.conf"), settings).unwrap();
        let child = Self::spawn(&folder)
            .unwrap_or_else(|error| panic!("mosquitto: {error}; apt-get install mosquitto"));
        let broker = Mosquitto { child, port, folder };
        drop(broker.connected());
        broker
    }

    fn spawn(folder: &std::path::Path) -> std::io::Result<Child> {
        let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin";
        let mut command = Command::new("mosquitto");
        command.env("PATH", path).arg("-c").arg(folder.join("mosquitto.conf"));
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()
    }

    fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    fn start_again(&mut self) {
        self.child = Self::spawn(&self.folder).unwrap();
        drop(self.connected());
    }

    fn signal(&self, signal: &str) {
        let status = Command::new("kill").arg(signal).arg(self.child.id().to_string()).status();
        assert!(status.unwrap().success());
    }

    /// A connection to the broker, which may still be starting.
    fn connected(&self) -> TcpStream {
        let begin = Instant::now();
        loop {
            match TcpStream::connect(("127.0.0.1", self.port)) {
                Ok(stream) => return stream,
                Err(error) if begin.elapsed() > PATIENCE => panic!("{error}"),
                Err(_) => thread::sleep(Duration::from_millis(50)),
            }
        }
    }

    /// Publishes by the bytes of the standard: connect, then each payload with this quality of service.
    fn publish(&self, topic: &str, qos: u8, is_retained: bool, payloads: &[String]) {
        let mut stream = self.connected();
        stream.write_all(b"\x10\x10\x00\x04MQTT\x04\x02\x00\x3c\x00\x04test").unwrap();
        let mut answer = [0; 4];
        stream.read_exact(&mut answer).unwrap();
        assert_eq!(answer, [0x20, 2, 0, 0]);
        for (number, payload) in (1..).zip(payloads) {
            stream.write_all(&publication(topic, qos, is_retained, number, payload)).unwrap();
            if qos > 0 {
                stream.read_exact(&mut answer).unwrap();
            }
        }
    }
}

impl Drop for Mosquitto {
    fn drop(&mut self) {
        self.kill();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn payloads(from: u32, to: u32) -> Vec<String> {
    let payload = |k| format!("{{\"t\": {k}, \"p\": {}}}\n{{\"t\": {k}.5, \"p\": 1}}", 2 * k);
    (from..to).map(payload).collect()
}

fn expected(from: u32, to: u32) -> Vec<(Read, Vec<f64>)> {
    let numbers = (from..to).map(f64::from);
    numbers.flat_map(|k| [row(k, 2.0 * k), row(k + 0.5, 1.0)]).collect()
}

#[test]
fn val_mosquitto_delivers_in_both_qualities_and_after_it_was_killed_twice() {
    let mut broker = Mosquitto::start("qualities", "");
    for qos in [0, 1] {
        let address = format!("mqtt://127.0.0.1:{}/rig/one?qos={qos}", broker.port);
        let mut source = open(&address, &["t", "p"]).unwrap();
        broker.publish("rig/one", qos, false, &payloads(0, 500));
        assert_eq!(reads(&mut *source, 1000), expected(0, 500), "quality {qos}");
        for part in 0..2 {
            broker.kill();
            let found = reads(&mut *source, 1);
            assert!(matches!(found[0].0, Read::Disconnected { .. }), "{found:?}");
            broker.start_again();
            assert_eq!(reads(&mut *source, 1), [(Read::Reconnected, vec![])]);
            broker.publish("rig/one", 1, false, &payloads(7 + part, 9 + part));
            assert_eq!(reads(&mut *source, 4), expected(7 + part, 9 + part));
        }
    }
}

#[test]
fn val_mosquitto_that_is_stopped_is_lost_and_found_again() {
    let broker = Mosquitto::start("stopped", "");
    let address = format!("mqtt://127.0.0.1:{}/rig/one?qos=1&keep_alive=1", broker.port);
    let mut source = open(&address, &["t", "p"]).unwrap();
    broker.publish("rig/one", 1, false, &payloads(0, 2));
    assert_eq!(reads(&mut *source, 4), expected(0, 2));
    // The connection stays open, and nobody answers.
    broker.signal("-STOP");
    assert_eq!(reads(&mut *source, 1), [lost("the broker does not answer")]);
    broker.signal("-CONT");
    assert_eq!(reads(&mut *source, 1), [(Read::Reconnected, vec![])]);
    broker.publish("rig/one", 1, false, &payloads(2, 4));
    assert_eq!(reads(&mut *source, 4), expected(2, 4));
}

#[test]
fn val_mosquitto_retained_messages_and_those_of_other_topics_are_no_samples() {
    let broker = Mosquitto::start("units", "");
    broker.publish("rig/one", 1, true, &["{\"t\": -32400, \"p\": 0}".into()]);
    let one = |topic: &str| format!("mqtt://127.0.0.1:{}/rig/{topic}", broker.port);
    let mut source = open(&one("one"), &["t", "p"]).unwrap();
    let retained = Read::Flawed(Irregularity::Retained.into());
    assert_eq!(reads(&mut *source, 1), [(retained, vec![])]);
    broker.publish("rig/one", 1, false, &payloads(0, 1));
    assert_eq!(reads(&mut *source, 2), expected(0, 1));
    let mut source = open(&one("two"), &["t", "p"]).unwrap();
    broker.publish("rig/one", 1, false, &payloads(5, 7));
    broker.publish("rig/two", 1, false, &payloads(3, 4));
    assert_eq!(reads(&mut *source, 2), expected(3, 4));
}

/// With certificates that openssl makes.
#[cfg(feature = "mqtt-tls")]
#[test]
fn val_mosquitto_is_reached_by_tls_and_an_unknown_certificate_is_refused() {
    let settings = "cafile FOLDER/rig.pem\ncertfile FOLDER/rig.pem\nkeyfile FOLDER/rig.key\n";
    let folder = std::env::temp_dir().join(format!("servotwin-mqtt-tls-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = |name: &str| folder.join(name).display().to_string();
    let (pem, key) = (file("rig.pem"), file("rig.key"));
    let made = Command::new("openssl")
        .args([
            "req",
            "-x509",
            "-newkey",
            "ec",
            "-pkeyopt",
            "ec_paramgen_curve:prime256v1",
            "-nodes",
            "-days",
            "2",
        ])
        .args(["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"])
        .args(["-addext", "basicConstraints=critical,CA:FALSE", "-out", &pem, "-keyout", &key])
        .stderr(Stdio::null())
        .status()
        .expect("openssl runs (apt-get install openssl)");
    assert!(made.success());
    let broker = Mosquitto::start("tls", settings);
    let address = format!("mqtts://localhost:{}/rig/one", broker.port);
    let mut source = open(&format!("{address}?qos=1&ca={pem}"), &["t", "p"]).unwrap();
    drop(source.read(&mut LogRow::default()));
    let told = open(&address, &["t", "p"]).err().unwrap().to_string();
    assert!(told.contains("certificate"), "{told}");
    let told = open(&format!("{address}?ca={key}"), &["t", "p"]).err().unwrap().to_string();
    assert!(told.contains("no certificate"), "{told}");
    let told = open(&format!("{address}?ca=/nowhere.pem"), &["t", "p"]).err().unwrap().to_string();
    assert!(told.contains("/nowhere.pem"), "{told}");
}
