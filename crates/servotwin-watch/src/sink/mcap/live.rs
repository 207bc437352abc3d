//! A connection that a stream goes to.

use super::super::SinkError;
use socket2::SockRef;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// A listener that takes nothing for so long is as good as lost.
const PATIENCE: Duration = Duration::from_secs(10);

/// The most bytes that wait in the operating system. A slow listener would otherwise see what was minutes ago.
const SEND_BUFFER: usize = 1 << 18;

/// Takes what is written. Once the connection is lost that is noted, and whatever comes is dropped: what is written is
/// never an error.
pub(super) struct Live {
    socket: BufWriter<TcpStream>,
    /// How many bytes were written.
    position: u64,
    loss: Loss,
}

/// Why the connection was lost, once it is: the writer of the format keeps the connection to itself.
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
            // A system that keeps its own size is as good, but slower.
            let _ = SockRef::from(&socket).set_send_buffer_size(SEND_BUFFER);
            Ok(socket)
        });
        let failed = |cause| SinkError::Connection { address: address.into(), cause };
        let socket = BufWriter::new(ready.map_err(failed)?);
        Ok(Live { socket, position: 0, loss: Loss::default() })
    }

    /// Where it is said that it was lost.
    pub fn loss(&self) -> Loss {
        self.loss.clone()
    }

    /// Says that nothing more comes.
    pub fn end(self) {
        // Of a connection that is lost already nobody hears it.
        let _ = self.socket.get_ref().shutdown(Shutdown::Write);
        // What was not sent is not sent now, where it would have to wait once more.
        let _ = self.socket.into_parts();
    }

    /// Notes what went wrong; nothing is sent after the first.
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

/// It knows where it is, and is nowhere else.
impl Seek for Live {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.position),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}
