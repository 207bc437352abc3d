//! Reads UDP datagrams, each with one or more lines.
//!
//! A separate thread receives them into a bounded queue, so that a busy diagnosis loses none. `Senders` decides which
//! datagrams are accepted.

use super::frame::{self, Frames};
use super::{Dropped, Irregularity, LogRow, PAUSE, Read, Source, SourceError, Wanted};
use socket2::SockRef;
use std::collections::VecDeque;
use std::io;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// The largest possible datagram, bytes.
const LARGEST: usize = 1 << 16;

/// The most datagrams that wait to be read: more than a minute at 100 Hz.
const WAITING: usize = 8192;

/// The most bytes in waiting datagrams.
const WAITING_BYTES: usize = 64 << 20;

/// The requested size of the socket's receive buffer, bytes.
const RECEIVE_BUFFER: usize = 4 << 20;

/// A locked sender that is silent for this long makes room for another.
const RELEASE: Duration = Duration::from_secs(2);

/// The senders that are accepted.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Allowed {
    /// The first that sends a sample, until it is silent for two seconds.
    #[default]
    First,
    /// Every sender.
    Any,
    /// Only these senders.
    These(Vec<Sender>),
}

/// A sender in the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sender {
    /// Any port of a host.
    Host(IpAddr),
    /// One port of a host.
    Port(SocketAddr),
}

impl Allowed {
    /// Parses sender texts: `any`, an IP address, or an address with a port. An empty list selects the first sender.
    ///
    /// # Errors
    /// The first invalid text.
    pub fn parse(texts: &[String]) -> Result<Self, String> {
        if texts.is_empty() {
            return Ok(Allowed::First);
        }
        if texts.iter().any(|text| text == "any") {
            return Ok(Allowed::Any);
        }
        let sender = |text: &String| {
            let host = text.parse().map(|ip: IpAddr| Sender::Host(ip.to_canonical()));
            let port = || text.parse().map(|address| Sender::Port(canonical(address)));
            host.or_else(|_| port()).map_err(|_| text.clone())
        };
        texts.iter().map(sender).collect::<Result<_, _>>().map(Allowed::These)
    }
}

/// Converts an IPv4-mapped IPv6 address to IPv4.
fn canonical(address: SocketAddr) -> SocketAddr {
    SocketAddr::new(address.ip().to_canonical(), address.port())
}

/// Decides whose datagrams are accepted.
#[derive(Debug)]
struct Senders {
    allowed: Allowed,
    /// The locked sender, and the time of its last datagram.
    locked: Option<(SocketAddr, Instant)>,
}

impl Senders {
    fn takes(&mut self, sender: SocketAddr, now: Instant) -> bool {
        let sender = canonical(sender);
        match &self.allowed {
            Allowed::Any => true,
            Allowed::These(these) => these.iter().any(|known| match known {
                Sender::Host(ip) => *ip == sender.ip(),
                Sender::Port(address) => *address == sender,
            }),
            Allowed::First => {
                let Some((known, last)) = &mut self.locked else { return true };
                if *known == sender {
                    *last = now;
                    return true;
                }
                let is_released = now.saturating_duration_since(*last) >= RELEASE;
                if is_released {
                    self.locked = None;
                }
                is_released
            }
        }
    }

    /// Locks onto a sender after its first sample.
    fn lock(&mut self, sender: SocketAddr, now: Instant) {
        if self.allowed == Allowed::First && self.locked.is_none() {
            self.locked = Some((canonical(sender), now));
        }
    }
}

/// A received datagram.
struct Datagram {
    place: u64,
    sender: SocketAddr,
    bytes: Vec<u8>,
}

/// State shared by the receiving thread and the reader.
struct Shared {
    senders: Mutex<Senders>,
    waiting_bytes: AtomicUsize,
    /// The datagrams dropped since the last report.
    dropped: Mutex<Vec<Dropped>>,
    is_over: AtomicBool,
}

impl Shared {
    fn senders(&self) -> MutexGuard<'_, Senders> {
        self.senders.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn dropped(&self) -> MutexGuard<'_, Vec<Dropped>> {
        self.dropped.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn drop_one(&self, kind: Irregularity, place: u64, sender: SocketAddr) {
        let mut dropped = self.dropped();
        match dropped.iter_mut().find(|known| known.kind == kind) {
            Some(known) => known.count += 1,
            None => {
                let detail = canonical(sender).to_string();
                dropped.push(Dropped { kind, count: 1, place, detail });
            }
        }
    }

    /// The next pending report; each call returns one kind.
    fn take_dropped(&self) -> Option<Dropped> {
        self.dropped().pop()
    }
}

/// A UDP source.
pub(crate) struct Udp {
    address: SocketAddr,
    datagrams: Receiver<io::Result<Datagram>>,
    shared: Arc<Shared>,
    frames: Frames,
    /// The unread lines of the current datagram.
    lines: VecDeque<Vec<u8>>,
    place: u64,
    sender: SocketAddr,
}

fn failed(address: SocketAddr, cause: &io::Error) -> SourceError {
    SourceError::Connection { address: format!("udp://{address}"), cause: cause.to_string() }
}

fn bind(address: SocketAddr) -> Result<UdpSocket, SourceError> {
    let socket = UdpSocket::bind(address).map_err(|cause| failed(address, &cause))?;
    socket.set_read_timeout(Some(PAUSE)).map_err(|cause| failed(address, &cause))?;
    // A system that allows less uses its own maximum.
    let _ = SockRef::from(&socket).set_recv_buffer_size(RECEIVE_BUFFER);
    Ok(socket)
}

impl Udp {
    /// Listens at an address.
    pub(crate) fn open(
        address: SocketAddr,
        allowed: Allowed,
        wanted: &Wanted,
    ) -> Result<Self, SourceError> {
        let socket = bind(address)?;
        let address = socket.local_addr().map_err(|cause| failed(address, &cause))?;
        let (queue, datagrams) = sync_channel(WAITING);
        let shared = Arc::new(Shared {
            senders: Mutex::new(Senders { allowed, locked: None }),
            waiting_bytes: AtomicUsize::new(0),
            dropped: Mutex::new(vec![]),
            is_over: AtomicBool::new(false),
        });
        let of_thread = shared.clone();
        thread::spawn(move || receive(&socket, &queue, &of_thread));
        let (frames, lines) = (Frames::new(wanted), VecDeque::new());
        Ok(Udp { address, datagrams, shared, frames, lines, place: 0, sender: address })
    }

    /// Splits the next datagram into lines; `false` if none arrives within [`PAUSE`].
    fn next_datagram(&mut self) -> Result<bool, SourceError> {
        let datagram = match self.datagrams.recv_timeout(PAUSE) {
            Ok(received) => received.map_err(|cause| failed(self.address, &cause))?,
            Err(RecvTimeoutError::Timeout) => return Ok(false),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(failed(self.address, &io::ErrorKind::BrokenPipe.into()));
            }
        };
        let Datagram { place, sender, bytes } = datagram;
        self.shared.waiting_bytes.fetch_sub(bytes.len(), Ordering::Relaxed);
        (self.place, self.sender) = (place, sender);
        let text = bytes.strip_suffix(b"\n").unwrap_or(&bytes);
        self.lines.extend(text.split(|&byte| byte == b'\n').map(<[u8]>::to_vec));
        Ok(true)
    }
}

impl Drop for Udp {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
    }
}

/// Receives datagrams until the reader is dropped.
fn receive(socket: &UdpSocket, queue: &SyncSender<io::Result<Datagram>>, shared: &Shared) {
    let mut buffer = vec![0; LARGEST];
    let mut place = 0;
    while !shared.is_over.load(Ordering::Relaxed) {
        let (length, sender) = match socket.recv_from(&mut buffer) {
            Ok(received) => received,
            Err(error) if is_pause(&error) => continue,
            Err(error) => {
                // A dropped reader does not need the error.
                let _ = queue.send(Err(error));
                return;
            }
        };
        place += 1;
        if !shared.senders().takes(sender, Instant::now()) {
            shared.drop_one(Irregularity::ForeignSender, place, sender);
            continue;
        }
        let waiting = shared.waiting_bytes.fetch_add(length, Ordering::Relaxed);
        let datagram = Datagram { place, sender, bytes: buffer[..length].to_vec() };
        if waiting + length > WAITING_BYTES || queue.try_send(Ok(datagram)).is_err() {
            shared.waiting_bytes.fetch_sub(length, Ordering::Relaxed);
            shared.drop_one(Irregularity::Overflow, place, sender);
        }
    }
}

impl Source for Udp {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        if self.lines.is_empty() {
            if let Some(dropped) = self.shared.take_dropped() {
                return Ok(Read::Dropped(dropped));
            }
            if !self.next_datagram()? {
                row.place = self.place;
                return Ok(Read::Pause);
            }
        }
        row.place = self.place;
        // A datagram accepted into the queue is read, even if another sender was locked meanwhile.
        let Some(line) = self.lines.pop_front() else { return Ok(Read::Nothing) };
        let read = self.frames.read(&line, row);
        if read == Read::Row {
            self.shared.senders().lock(self.sender, Instant::now());
        }
        Ok(read)
    }

    fn counted(&self) -> &'static str {
        "datagram"
    }

    fn is_live(&self) -> bool {
        true
    }
}

/// Whether the error means that nothing arrived. A refused connection concerns an earlier sender.
pub(super) fn is_pause(error: &io::Error) -> bool {
    use io::ErrorKind as Kind;
    matches!(
        error.kind(),
        Kind::WouldBlock | Kind::TimedOut | Kind::Interrupted | Kind::ConnectionRefused
    )
}

/// The columns of the first datagram that names any; waits for it.
pub(crate) fn columns(address: SocketAddr, allowed: &Allowed) -> Result<Vec<String>, SourceError> {
    let socket = bind(address)?;
    let mut senders = Senders { allowed: allowed.clone(), locked: None };
    let mut datagram = vec![0; LARGEST];
    loop {
        match socket.recv_from(&mut datagram) {
            Ok((length, sender)) if senders.takes(sender, Instant::now()) => {
                let mut lines = datagram[..length].split(|&byte| byte == b'\n');
                if let Some(names) = lines.find_map(frame::columns) {
                    return Ok(names);
                }
            }
            Ok(_) => {}
            Err(error) if is_pause(&error) => {}
            Err(error) => return Err(failed(address, &error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Flaw;
    use super::*;

    fn wanted() -> Wanted {
        let names = ["t", "p"].map(String::from).to_vec();
        let columns = names.clone();
        Wanted { names, columns, time: Some(0), ..Wanted::default() }
    }

    fn open(allowed: Allowed) -> Udp {
        Udp::open("127.0.0.1:0".parse().unwrap(), allowed, &wanted()).unwrap()
    }

    #[test]
    fn datagrams_of_lines_and_noise() {
        let mut source = open(Allowed::First);
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        for datagram in [&b"1,2\n2,3\n"[..], b"\x00\xff\x01", b"", b"{\"t\": 3, \"p\": 4}"] {
            sender.send_to(datagram, source.address).unwrap();
        }
        let (mut row, mut found) = (LogRow::default(), vec![]);
        while found.len() < 5 {
            let read = source.read(&mut row).unwrap();
            let values = if read == Read::Row { row.values.clone() } else { vec![] };
            if read != Read::Pause {
                found.push((read, row.place, values));
            }
        }
        let expected = [
            (Read::Row, 1, vec![1.0, 2.0]),
            (Read::Row, 1, vec![2.0, 3.0]),
            (Read::Flawed(Flaw::Noise), 2, vec![]),
            (Read::Nothing, 3, vec![]),
            (Read::Row, 4, vec![3.0, 4.0]),
        ];
        assert_eq!(found, expected);
        assert_eq!(source.read(&mut row).unwrap(), Read::Pause);
    }

    /// Reads until something other than a pause arrives.
    fn next(source: &mut Udp) -> (Read, LogRow) {
        let mut row = LogRow::default();
        loop {
            let read = source.read(&mut row).unwrap();
            if read != Read::Pause {
                return (read, row);
            }
        }
    }

    #[test]
    fn a_second_sender_is_counted_and_not_mixed_in() {
        let mut source = open(Allowed::First);
        let [own, other] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        // Noise does not lock the source to its sender.
        other.send_to(b"\x00\x01", source.address).unwrap();
        assert_eq!(next(&mut source).0, Read::Flawed(Flaw::Noise));
        own.send_to(b"1,2", source.address).unwrap();
        assert_eq!(next(&mut source).0, Read::Row);
        other.send_to(b"1,9", source.address).unwrap();
        own.send_to(b"2,3", source.address).unwrap();
        let mut found = [next(&mut source), next(&mut source)];
        found.sort_by_key(|(read, _)| *read != Read::Row);
        assert_eq!((&found[0].0, &found[0].1.values[..]), (&Read::Row, &[2.0, 3.0][..]));
        let detail = other.local_addr().unwrap().to_string();
        let kind = Irregularity::ForeignSender;
        assert_eq!(found[1].0, Read::Dropped(Dropped { kind, count: 1, place: 3, detail }));
    }

    #[test]
    fn only_senders_that_are_named_are_heard() {
        let [own, other] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        let address = own.local_addr().unwrap();
        for (texts, expected) in [
            (vec![address.to_string()], [true, false]),
            (vec!["10.9.8.7".into(), address.to_string()], [true, false]),
            (vec!["127.0.0.1".into()], [true, true]),
            (vec!["any".into()], [true, true]),
            (vec!["10.9.8.7".into()], [false, false]),
        ] {
            let mut source = open(Allowed::parse(&texts).unwrap());
            for (sender, is_heard) in [&own, &other].into_iter().zip(expected) {
                sender.send_to(b"1,2", source.address).unwrap();
                let (read, _) = next(&mut source);
                assert_eq!(read == Read::Row, is_heard, "{texts:?}: {read:?}");
            }
        }
        assert_eq!(Allowed::parse(&["rig".into()]), Err("rig".into()));
        assert_eq!(Allowed::parse(&[]), Ok(Allowed::First));
    }

    #[test]
    fn a_sender_that_comes_back_from_another_port_is_heard_after_a_silence() {
        let mut senders = Senders { allowed: Allowed::First, locked: None };
        let [own, again]: [SocketAddr; 2] =
            ["10.0.0.1:1000", "[::ffff:10.0.0.1]:1001"].map(|text| text.parse().unwrap());
        let begin = Instant::now();
        let after = |ms| begin + Duration::from_millis(ms);
        assert!(senders.takes(own, begin));
        senders.lock(own, begin);
        assert!(senders.takes(own, after(1500)) && !senders.takes(again, after(2500)));
        assert!(senders.takes(again, after(3500)));
        senders.lock(again, after(3500));
        assert!(!senders.takes(own, after(3600)));
    }

    #[test]
    fn what_does_not_fit_into_the_queue_is_counted() {
        let mut source = open(Allowed::Any);
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let big = vec![b'#'; 60_000];
        // Nobody reads until the queue overflows. Datagrams that the operating system drops are not counted.
        let mut sent = 0;
        while source.shared.dropped().is_empty() {
            sender.send_to(&big, source.address).unwrap();
            sent += 1;
            assert!(sent < 1_000_000, "nothing is dropped");
        }
        let (read, _) = next(&mut source);
        assert!(
            matches!(&read, Read::Dropped(Dropped { kind: Irregularity::Overflow, count, .. }) if *count >= 1),
            "{read:?}"
        );
        let waiting = source.shared.waiting_bytes.load(Ordering::Relaxed);
        assert!(waiting <= WAITING_BYTES + big.len(), "{waiting}");
    }
}
