//! The TCP connection of a live stream.

use super::super::SinkError;
use socket2::SockRef;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// A listener that accepts no data for this long is treated as lost.
const PATIENCE: Duration = Duration::from_secs(10);

/// The size of the operating system's send buffer, bytes. A larger one would let a slow listener fall minutes behind.
const SEND_BUFFER: usize = 1 << 18;

/// Writes to the connection. After a loss, it records the reason and drops all data; writing never fails.
pub(super) struct Live {
    socket: BufWriter<TcpStream>,
    /// Bytes written so far.
    position: u64,
    loss: Loss,
}

/// The reason of a lost connection, once lost. It is shared because the MCAP writer owns the connection.
pub(super) type Loss = Arc<OnceLock<String>>;

impl Live {
    /// Connects to `HOST:PORT`.
    ///
    /// # Errors
    /// [`SinkError::Connection`].
    pub fn connect(address: &str) -> Result<Self, SinkError> {
        let connected = TcpStream::connect(address);
        let ready = connected.and_then(|socket| {
            socket.set_write_timeout(Some(PATIENCE))?;
            // A system that keeps its own buffer size works too, but with more delay.
            let _ = SockRef::from(&socket).set_send_buffer_size(SEND_BUFFER);
            Ok(socket)
        });
        let failed = |cause| SinkError::Connection { address: address.into(), cause };
        let socket = BufWriter::new(ready.map_err(failed)?);
        Ok(Live { socket, position: 0, loss: Loss::default() })
    }

    /// The shared reason of a loss.
    pub fn loss(&self) -> Loss {
        self.loss.clone()
    }

    /// Closes the sending side.
    pub fn end(self) {
        // On a lost connection this fails, and nobody is left to read it.
        let _ = self.socket.get_ref().shutdown(Shutdown::Write);
        // Unsent data is dropped: sending it could block again.
        let _ = self.socket.into_parts();
    }

    /// Records the first error; nothing is sent after it.
    fn attempt(&mut self, send: impl FnOnce(&mut BufWriter<TcpStream>) -> io::Result<()>) {
        if self.loss.get().is_some() {
            return;
        }
        if let Err(error) = send(&mut self.socket) {
            self.loss.get_or_init(|| error.to_string());
        }
    }
}

impl Write for Live {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.attempt(|socket| socket.write_all(bytes));
        self.position += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.attempt(BufWriter::flush);
        Ok(())
    }
}

/// Reports its position and supports no other seek: the stream is never sought.
impl Seek for Live {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.position),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}
