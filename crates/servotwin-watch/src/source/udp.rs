//! Reads UDP datagrams, each with one or more lines.
//!
//! A separate thread receives them into a bounded queue, so that a busy diagnosis loses none. [`Lock`] decides whose
//! datagrams are accepted.

use super::frame::{self, Frames};
use super::live::{Live, News};
use super::{PAUSE, Read, Source, SourceError, Wanted};
use crate::counts::{Flaw, Irregularity};
use socket2::SockRef;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

/// The largest possible datagram, bytes.
const LARGEST: usize = 1 << 16;

/// The most datagrams that wait to be read: 20 s at 100 Hz, and at most 128 MiB.
const WAITING: usize = 2048;

/// The requested size of the socket's receive buffer, bytes.
const RECEIVE_BUFFER: usize = 4 << 20;

/// A locked sender that is silent for this long makes room for another.
const RELEASE: Duration = Duration::from_secs(2);

/// Converts an IPv4-mapped IPv6 address to IPv4.
fn canonical(address: SocketAddr) -> SocketAddr {
    SocketAddr::new(address.ip().to_canonical(), address.port())
}

/// The sender that is accepted: the first that sends a sample, until it is silent for [`RELEASE`].
#[derive(Debug, Default)]
struct Lock {
    /// The locked sender, and the time of its last datagram.
    locked: Option<(SocketAddr, Instant)>,
}

impl Lock {
    fn takes(&mut self, sender: SocketAddr, now: Instant) -> bool {
        let sender = canonical(sender);
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

    /// Locks onto a sender after its first sample.
    fn lock(&mut self, sender: SocketAddr, now: Instant) {
        self.locked.get_or_insert((canonical(sender), now));
    }
}

fn locked(lock: &Mutex<Lock>) -> MutexGuard<'_, Lock> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A UDP source.
type Udp = Live<SocketAddr>;

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

/// Listens at an address.
pub(super) fn open(address: SocketAddr, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
    Ok(Box::new(start(bind(address)?, address, wanted)))
}

fn start(socket: UdpSocket, address: SocketAddr, wanted: &Wanted) -> Udp {
    let (queue, news) = sync_channel(WAITING);
    let lock = Arc::new(Mutex::new(Lock::default()));
    let of_thread = Arc::downgrade(&lock);
    thread::spawn(move || receive(&socket, &queue, &of_thread));
    let mut frames = Frames::new(wanted);
    Live::new(format!("udp://{address}"), "datagram", news, move |sender, line, row| {
        // A datagram accepted into the queue is read, even if another sender was locked meanwhile.
        let read = frames.read(line, row);
        if read == Read::Row {
            locked(&lock).lock(*sender, Instant::now());
        }
        read
    })
}

/// Receives datagrams until the reader, who owns the lock, is dropped.
fn receive(socket: &UdpSocket, queue: &SyncSender<News<SocketAddr>>, lock: &Weak<Mutex<Lock>>) {
    let mut buffer = vec![0; LARGEST];
    let mut dropped = Drops { flaws: vec![], last: Instant::now() };
    while let Some(lock) = lock.upgrade() {
        let received = socket.recv_from(&mut buffer);
        let now = Instant::now();
        match received {
            Ok((_, sender)) if !locked(&lock).takes(sender, now) => {
                dropped.add(Irregularity::ForeignSender, sender);
            }
            Ok((bytes, sender)) => {
                dropped.report(queue);
                if queue.try_send(News::Lines(sender, buffer[..bytes].to_vec())).is_err() {
                    dropped.add(Irregularity::Overflow, sender);
                }
            }
            Err(error) if is_pause(&error) => {}
            Err(error) => {
                // A dropped reader does not need the error.
                let _ = queue.send(News::Failed(error.to_string()));
                return;
            }
        }
        if now.saturating_duration_since(dropped.last) >= PAUSE {
            dropped.report(queue);
        }
    }
}

/// The datagrams dropped since the last report, one flaw of each kind: a flood of them does not fill the queue.
struct Drops {
    flaws: Vec<Flaw>,
    last: Instant,
}

impl Drops {
    fn add(&mut self, kind: Irregularity, sender: SocketAddr) {
        match self.flaws.iter_mut().find(|known| known.kind == kind) {
            Some(known) => known.count += 1,
            None => self.flaws.push(Flaw::new(kind, canonical(sender).to_string())),
        }
    }

    /// Reports what fits into the queue.
    fn report(&mut self, queue: &SyncSender<News<SocketAddr>>) {
        self.last = Instant::now();
        while let Some(flaw) = self.flaws.pop() {
            if let Err(TrySendError::Full(News::Other(Read::Dropped(flaw)))) =
                queue.try_send(News::Other(Read::Dropped(flaw)))
            {
                self.flaws.push(flaw);
                return;
            }
        }
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
pub(crate) fn columns(address: SocketAddr) -> Result<Vec<String>, SourceError> {
    let socket = bind(address)?;
    let mut datagram = vec![0; LARGEST];
    loop {
        match socket.recv_from(&mut datagram) {
            Ok((length, _)) => {
                let mut lines = datagram[..length].split(|&byte| byte == b'\n');
                if let Some(names) = lines.find_map(frame::columns) {
                    return Ok(names);
                }
            }
            Err(error) if is_pause(&error) => {}
            Err(error) => return Err(failed(address, &error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::LogRow;
    use super::*;

    fn wanted() -> Wanted {
        let names = ["t", "p"].map(String::from).to_vec();
        let columns = names.clone();
        Wanted { names, columns, time: Some(0), ..Wanted::default() }
    }

    fn open() -> (Udp, SocketAddr) {
        let socket = bind("127.0.0.1:0".parse().unwrap()).unwrap();
        let address = socket.local_addr().unwrap();
        (start(socket, address, &wanted()), address)
    }

    #[test]
    fn datagrams_of_lines_and_noise() {
        let (mut source, address) = open();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        for datagram in [&b"1,2\n2,3\n"[..], b"\x00\xff\x01", b"", b"{\"t\": 3, \"p\": 4}"] {
            sender.send_to(datagram, address).unwrap();
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
            (Read::Flawed(Irregularity::Noise.into()), 2, vec![]),
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
        let (mut source, address) = open();
        let [own, other] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        // Noise does not lock the source to its sender.
        other.send_to(b"\x00\x01", address).unwrap();
        assert_eq!(next(&mut source).0, Read::Flawed(Irregularity::Noise.into()));
        own.send_to(b"1,2", address).unwrap();
        assert_eq!(next(&mut source).0, Read::Row);
        other.send_to(b"1,9", address).unwrap();
        own.send_to(b"2,3", address).unwrap();
        let mut found = [next(&mut source), next(&mut source)];
        found.sort_by_key(|(read, _)| *read != Read::Row);
        assert_eq!((&found[0].0, &found[0].1.values[..]), (&Read::Row, &[2.0, 3.0][..]));
        let detail = other.local_addr().unwrap().to_string();
        let kind = Irregularity::ForeignSender;
        assert_eq!((&found[1].0, found[1].1.place), (&Read::Dropped(Flaw::new(kind, detail)), 3));
    }

    #[test]
    fn a_sender_that_comes_back_from_another_port_is_heard_after_a_silence() {
        let mut senders = Lock::default();
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
        let (mut source, address) = open();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let datagram = vec![b'#'; 60_000];
        // Nobody reads meanwhile. Datagrams that the operating system drops are not counted.
        for _ in 0..20 * WAITING {
            sender.send_to(&datagram, address).unwrap();
        }
        // Until the thread has seen the last one, reading makes room for it.
        thread::sleep(5 * PAUSE);
        let mut row = LogRow::default();
        let (mut waiting, mut dropped) = (0, 0);
        loop {
            match source.read(&mut row).unwrap() {
                Read::Pause => break,
                Read::Dropped(flaw) => dropped += flaw.count,
                _ => waiting += 1,
            }
        }
        assert!(dropped > 0 && waiting <= WAITING, "{dropped} dropped, {waiting} waiting");
    }
}
