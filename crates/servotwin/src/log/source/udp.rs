//! UDP datagrams, each of one or several lines.

use super::frame::{self, Frames};
use super::{PAUSE, Read, Row, Source, SourceError, Wanted};
use std::io;
use std::net::{SocketAddr, UdpSocket};

/// The largest datagram there is.
const LARGEST: usize = 1 << 16;

/// A socket.
pub struct Udp {
    address: SocketAddr,
    socket: UdpSocket,
    frames: Frames,
    datagram: Vec<u8>,
    /// What of the datagram is not read so far.
    rest: std::ops::Range<usize>,
    place: u64,
}

fn failed(address: SocketAddr, cause: &io::Error) -> SourceError {
    SourceError::Connection { address: format!("udp://{address}"), cause: cause.to_string() }
}

fn bind(address: SocketAddr) -> Result<UdpSocket, SourceError> {
    let socket = UdpSocket::bind(address).map_err(|cause| failed(address, &cause))?;
    socket.set_read_timeout(Some(PAUSE)).map_err(|cause| failed(address, &cause))?;
    Ok(socket)
}

impl Udp {
    /// Listens at an address.
    pub fn open(address: SocketAddr, wanted: &Wanted) -> Result<Self, SourceError> {
        let socket = bind(address)?;
        let frames = Frames::new(wanted);
        Ok(Udp { address, socket, frames, datagram: vec![0; LARGEST], rest: 0..0, place: 0 })
    }

    /// Where datagrams are to be sent: the port that was free, if none was asked for.
    #[cfg(test)]
    fn local(&self) -> SocketAddr {
        self.socket.local_addr().unwrap()
    }
}

impl Source for Udp {
    fn read(&mut self, row: &mut Row) -> Result<Read, SourceError> {
        row.place = self.place;
        if self.rest.is_empty() {
            match self.socket.recv(&mut self.datagram) {
                Ok(length) => self.rest = 0..length,
                Err(error) if is_pause(&error) => return Ok(Read::Pause),
                Err(error) => return Err(failed(self.address, &error)),
            }
            self.place += 1;
            row.place = self.place;
        }
        let rest = &self.datagram[self.rest.clone()];
        let end = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        let read = self.frames.read(&rest[..end], row);
        self.rest.start = (self.rest.start + end + 1).min(self.rest.end);
        Ok(read)
    }

    fn counted(&self) -> &'static str {
        "datagram"
    }

    fn is_live(&self) -> bool {
        true
    }
}

/// Whether nothing came, which is no failure. (A refused connection is news of an earlier sender.)
pub(super) fn is_pause(error: &io::Error) -> bool {
    use io::ErrorKind as Kind;
    matches!(
        error.kind(),
        Kind::WouldBlock | Kind::TimedOut | Kind::Interrupted | Kind::ConnectionRefused
    )
}

/// The columns of the first datagram that names any; waits for it.
pub fn columns(address: SocketAddr) -> Result<Vec<String>, SourceError> {
    let socket = bind(address)?;
    let mut datagram = vec![0; LARGEST];
    loop {
        match socket.recv(&mut datagram) {
            Ok(length) => {
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
    use super::super::Flaw;
    use super::*;

    #[test]
    fn datagrams_of_lines_and_noise() {
        let names = ["t", "p"].map(String::from).to_vec();
        let columns = names.clone();
        let wanted = Wanted { names, columns, time: Some(0), ..Wanted::default() };
        let mut source = Udp::open("127.0.0.1:0".parse().unwrap(), &wanted).unwrap();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        for datagram in [&b"1,2\n2,3\n"[..], b"\x00\xff\x01", b"", b"{\"t\": 3, \"p\": 4}"] {
            sender.send_to(datagram, source.local()).unwrap();
        }
        let (mut row, mut found) = (Row::default(), vec![]);
        for _ in 0..5 {
            let read = source.read(&mut row).unwrap();
            let values = if read == Read::Row { row.values.clone() } else { vec![] };
            found.push((read, row.place, values));
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
}
