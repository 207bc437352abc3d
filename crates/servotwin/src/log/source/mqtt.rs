//! An MQTT subscription: every message is one or several lines.
//!
//! MQTT 3.1.1, as much of it as a subscriber needs; quality of service 0 and 1, no TLS. A connection that is
//! lost is made again.

use super::frame::{self, Frames};
use super::udp::is_pause;
use super::{PAUSE, Read, Row, Source, SourceError, Wanted};
use std::collections::VecDeque;
use std::fmt;
use std::io::{self, Read as _, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// The largest packet that is read.
const LARGEST: usize = 1 << 20;

/// How long a broker may take to answer.
const PATIENCE: Duration = Duration::from_secs(5);

/// A broker hears of us this often at least, s; after one and a half times of it, it hangs up.
const KEEP_ALIVE_S: u16 = 30;

/// What to subscribe to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Subscription {
    /// Host and port.
    pub broker: String,
    /// User and password.
    pub user: Option<(String, String)>,
    /// The topics; `+` and `#` stand for any.
    pub filter: String,
    /// The quality of service: 0 at most once, 1 at least once.
    pub qos: u8,
}

impl Subscription {
    /// `[user:password@]host[:port]/filter[?qos=1]`; without a port 1883.
    pub fn parse(text: &str) -> Option<Self> {
        let (text, qos) = match text.split_once("?qos=") {
            Some((text, "0")) => (text, 0),
            Some((text, "1")) => (text, 1),
            Some(_) => return None,
            None => (text, 0),
        };
        let (place, filter) = text.split_once('/')?;
        let (user, host) = match place.rsplit_once('@') {
            Some((user, host)) => {
                let (name, password) = user.split_once(':').unwrap_or((user, ""));
                (Some((name.to_owned(), password.to_owned())), host)
            }
            None => (None, place),
        };
        let (name, port) = host.split_once(':').unwrap_or((host, "1883"));
        let broker = format!("{name}:{}", port.parse::<u16>().ok()?);
        let sound = !name.is_empty() && !filter.is_empty();
        sound.then(|| Subscription { broker, user, filter: filter.to_owned(), qos })
    }
}

impl fmt::Display for Subscription {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The password is nobody's business.
        write!(out, "mqtt://{}/{}", self.broker, self.filter)
    }
}

/// A subscription that is being served.
pub struct Mqtt {
    subscription: Subscription,
    connection: Option<Connection>,
    frames: Frames,
    /// The lines that were received and not read.
    lines: VecDeque<(u64, Vec<u8>)>,
    place: u64,
    /// When to try again.
    retry: Instant,
}

impl Mqtt {
    /// Connects and subscribes.
    pub fn open(subscription: &Subscription, wanted: &Wanted) -> Result<Self, SourceError> {
        let connection = Connection::open(subscription).map_err(|e| failed(subscription, &e))?;
        Ok(Mqtt {
            subscription: subscription.clone(),
            connection: Some(connection),
            frames: Frames::new(wanted),
            lines: VecDeque::new(),
            place: 0,
            retry: Instant::now(),
        })
    }

    /// Takes a message if there is one, and makes lines of it.
    fn receive(&mut self) -> Received {
        let Some(connection) = &mut self.connection else {
            if Instant::now() < self.retry {
                std::thread::sleep(PAUSE);
                return Received::Nothing;
            }
            self.retry = Instant::now() + PATIENCE;
            self.connection = Connection::open(&self.subscription).ok();
            let again = self.connection.is_some();
            return if again { Received::Reconnected } else { Received::Nothing };
        };
        match connection.message() {
            Ok(Some(payload)) => {
                self.place += 1;
                let lines = payload.split(|&byte| byte == b'\n');
                self.lines.extend(lines.map(|line| (self.place, line.to_vec())));
                Received::Message
            }
            Ok(None) => Received::Nothing,
            Err(_) => {
                (self.connection, self.retry) = (None, Instant::now());
                Received::Nothing
            }
        }
    }
}

enum Received {
    Message,
    Nothing,
    Reconnected,
}

impl Source for Mqtt {
    fn read(&mut self, row: &mut Row) -> Result<Read, SourceError> {
        if self.lines.is_empty() {
            match self.receive() {
                Received::Message => {}
                Received::Nothing => return Ok(Read::Pause),
                Received::Reconnected => return Ok(Read::Reconnected),
            }
        }
        let Some((place, line)) = self.lines.pop_front() else { return Ok(Read::Nothing) };
        row.place = place;
        Ok(self.frames.read(&line, row))
    }

    fn counted(&self) -> &'static str {
        "message"
    }

    fn is_live(&self) -> bool {
        true
    }
}

/// The columns of the first message that names any; waits for it.
pub fn columns(subscription: &Subscription) -> Result<Vec<String>, SourceError> {
    let failed = |error: io::Error| failed(subscription, &error);
    let mut connection = Connection::open(subscription).map_err(failed)?;
    loop {
        if let Some(payload) = connection.message().map_err(failed)?
            && let Some(names) = payload.split(|&byte| byte == b'\n').find_map(frame::columns)
        {
            return Ok(names);
        }
    }
}

fn failed(subscription: &Subscription, cause: &io::Error) -> SourceError {
    SourceError::Connection { address: subscription.to_string(), cause: cause.to_string() }
}

/// A connection to a broker.
struct Connection {
    stream: TcpStream,
    buffer: Vec<u8>,
    spoken: Instant,
}

// The types of packets, in the upper half of their first byte.
const CONNECT: u8 = 1;
const CONNECT_ANSWER: u8 = 2;
const PUBLISH: u8 = 3;
const PUBLISH_ANSWER: u8 = 4;
const SUBSCRIBE: u8 = 8;
const SUBSCRIBE_ANSWER: u8 = 9;
const PING: u8 = 12;

impl Connection {
    fn open(subscription: &Subscription) -> io::Result<Self> {
        let mut last = io::Error::new(io::ErrorKind::NotFound, "no such host");
        for address in subscription.broker.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, PATIENCE) {
                Ok(stream) => return Self::begin(stream, subscription),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    fn begin(stream: TcpStream, subscription: &Subscription) -> io::Result<Self> {
        stream.set_read_timeout(Some(PAUSE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        let mut connection = Connection { stream, buffer: vec![], spoken: Instant::now() };
        connection.send(CONNECT << 4, &connect(subscription))?;
        let answer = connection.answer(CONNECT_ANSWER)?;
        if let Some(&code) = answer.get(1).filter(|&&code| code != 0) {
            return Err(refused(match code {
                1 => "the broker does not know MQTT 3.1.1",
                2 => "the broker refuses our name",
                3 => "the broker does not serve",
                4 => "wrong user or password",
                _ => "not allowed",
            }));
        }
        let mut body = vec![0, 1];
        put_text(&mut body, &subscription.filter);
        body.push(subscription.qos);
        connection.send(SUBSCRIBE << 4 | 2, &body)?;
        match connection.answer(SUBSCRIBE_ANSWER)?.get(2) {
            Some(0..=2) => Ok(connection),
            _ => Err(refused("the broker refuses the subscription")),
        }
    }

    /// Waits for a packet of a type. What is published before is lost, as before a subscription.
    fn answer(&mut self, wanted: u8) -> io::Result<Vec<u8>> {
        let deadline = Instant::now() + PATIENCE;
        while Instant::now() < deadline {
            match self.packet()? {
                Some((first, body)) if first >> 4 == wanted => return Ok(body),
                _ => {}
            }
        }
        Err(io::ErrorKind::TimedOut.into())
    }

    /// A message, if one comes within a pause.
    fn message(&mut self) -> io::Result<Option<Vec<u8>>> {
        if self.spoken.elapsed() > Duration::from_secs(u64::from(KEEP_ALIVE_S) / 2) {
            self.send(PING << 4, &[])?;
        }
        let Some((first, body)) = self.packet()? else { return Ok(None) };
        if first >> 4 != PUBLISH {
            return Ok(None);
        }
        let published = publish(first, &body).ok_or_else(|| refused("a damaged packet"))?;
        if let Some(number) = published.number {
            self.send(PUBLISH_ANSWER << 4, &number)?;
        }
        Ok(Some(published.payload.to_vec()))
    }

    fn send(&mut self, first: u8, body: &[u8]) -> io::Result<()> {
        let mut packet = vec![first];
        let mut rest = body.len();
        loop {
            let more = rest >= 128;
            packet.push((rest % 128) as u8 | if more { 128 } else { 0 });
            rest /= 128;
            if !more {
                break;
            }
        }
        packet.extend_from_slice(body);
        self.spoken = Instant::now();
        self.stream.write_all(&packet)
    }

    /// A packet, if there is one within a pause: its first byte and its body.
    fn packet(&mut self) -> io::Result<Option<(u8, Vec<u8>)>> {
        loop {
            match frame_of(&self.buffer)? {
                Some((head, length)) => {
                    let first = self.buffer[0];
                    let body = self.buffer[head..head + length].to_vec();
                    self.buffer.drain(..head + length);
                    return Ok(Some((first, body)));
                }
                None => {
                    let mut part = [0; 1 << 14];
                    match self.stream.read(&mut part) {
                        Ok(0) => return Err(io::ErrorKind::ConnectionAborted.into()),
                        Ok(length) => self.buffer.extend_from_slice(&part[..length]),
                        Err(error) if is_pause(&error) => return Ok(None),
                        Err(error) => return Err(error),
                    }
                }
            }
        }
    }
}

fn refused(cause: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, cause)
}

fn put_text(body: &mut Vec<u8>, text: &str) {
    body.extend((text.len() as u16).to_be_bytes());
    body.extend(text.as_bytes());
}

/// The body of the packet with which everything begins.
fn connect(subscription: &Subscription) -> Vec<u8> {
    let mut body = vec![];
    put_text(&mut body, "MQTT");
    // A clean session: what was missed is not sent behind.
    let (clean, with_name, with_password) = (2, 1 << 7, 1 << 6);
    let user = if subscription.user.is_some() { with_name | with_password } else { 0 };
    body.extend([4, clean | user]);
    body.extend(KEEP_ALIVE_S.to_be_bytes());
    // The broker makes a name for us.
    put_text(&mut body, "");
    if let Some((name, password)) = &subscription.user {
        put_text(&mut body, name);
        put_text(&mut body, password);
    }
    body
}

/// The lengths of the head and the body of the first packet in a buffer, once it is there whole.
fn frame_of(buffer: &[u8]) -> io::Result<Option<(usize, usize)>> {
    let mut length = 0;
    for place in 0..4 {
        let Some(&byte) = buffer.get(1 + place) else { return Ok(None) };
        length |= usize::from(byte & 127) << (7 * place);
        if byte < 128 {
            let head = 2 + place;
            return match length {
                0..=LARGEST => Ok((buffer.len() >= head + length).then_some((head, length))),
                _ => Err(refused("a packet that is too large")),
            };
        }
    }
    Err(refused("a damaged packet"))
}

/// A message.
#[derive(Debug, PartialEq)]
struct Published<'p> {
    /// The number to answer with, where an answer is wanted.
    number: Option<[u8; 2]>,
    payload: &'p [u8],
}

/// A message from the body of its packet.
fn publish(first: u8, body: &[u8]) -> Option<Published<'_>> {
    let (length, rest) = body.split_first_chunk()?;
    let (_, rest) = rest.split_at_checked(usize::from(u16::from_be_bytes(*length)))?;
    match first >> 1 & 3 {
        0 => Some(Published { number: None, payload: rest }),
        1 => {
            let (number, payload) = rest.split_first_chunk()?;
            Some(Published { number: Some(*number), payload })
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn addresses() {
        let parse = |text: &str| Subscription::parse(text);
        let full = parse("me:se/cret@rig:1884/a/+/b?qos=1");
        assert_eq!(full, None, "a slash ends the host");
        let full = parse("me:secret@rig:1884/a/+/b?qos=1").unwrap();
        assert_eq!(full.user, Some(("me".into(), "secret".into())));
        assert_eq!((&*full.broker, &*full.filter, full.qos), ("rig:1884", "a/+/b", 1));
        assert_eq!(full.to_string(), "mqtt://rig:1884/a/+/b");
        assert_eq!(parse("rig/a").unwrap().broker, "rig:1883");
        for wrong in ["rig", "rig/", "/a", "rig/a?qos=2"] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn packets_as_the_standard_has_them() {
        assert_eq!(frame_of(&[0x30]).unwrap(), None);
        assert_eq!(frame_of(&[0x30, 2, 0]).unwrap(), None);
        assert_eq!(frame_of(&[0xD0, 0]).unwrap(), Some((2, 0)));
        // The standard's example: 321 = 65 + 2 * 128.
        let mut packet = vec![0x30, 193, 2];
        packet.resize(3 + 321, 7);
        assert_eq!(frame_of(&packet).unwrap(), Some((3, 321)));
        assert!(frame_of(&[0x30, 255, 255, 255, 255]).is_err());
        let body = [0, 3, b'a', b'/', b'b', 0, 10, b'x'];
        let once = Published { number: Some([0, 10]), payload: b"x" };
        assert_eq!(publish(0x32, &body), Some(once));
        assert_eq!(publish(0x30, &body).unwrap().payload, [0, 10, b'x']);
        assert_eq!(publish(0x30, &[0, 9, b'a']), None);
        let subscription = Subscription::parse("u:p@h/t").unwrap();
        let expected = b"\x00\x04MQTT\x04\xC2\x00\x1E\x00\x00\x00\x01u\x00\x01p";
        assert_eq!(connect(&subscription), expected);
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
            if let Ok(Some((head, length))) = frame_of(&bytes) {
                prop_assert!(head + length <= bytes.len());
                let _ = publish(bytes[0], &bytes[head..head + length]);
            }
        }
    }
}
