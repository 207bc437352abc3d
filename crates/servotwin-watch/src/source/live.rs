//! Live sources: a thread receives what arrives into a queue, and the lines in it are read one by one.

use super::frame::Frames;
use super::{LogRow, PAUSE, Read, Source, SourceError};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError};

/// What the thread passes on.
pub(super) enum News<Origin> {
    /// One or more lines, and where they come from.
    Lines(Origin, Vec<u8>),
    /// Anything else that a source returns.
    Other(Read),
    /// Nothing more comes, for this reason.
    Failed(String),
}

/// Turns lines into rows.
pub(super) trait LineReader<Origin>: Send {
    fn read(&mut self, origin: &Origin, line: &[u8], row: &mut LogRow)
    -> Result<Read, SourceError>;

    /// See [`Source::zone_s`].
    fn zone_s(&self) -> Option<f64> {
        None
    }
}

impl LineReader<()> for Frames {
    fn read(&mut self, (): &(), line: &[u8], row: &mut LogRow) -> Result<Read, SourceError> {
        Ok(Frames::read(self, line, row))
    }

    fn zone_s(&self) -> Option<f64> {
        Frames::zone_s(self)
    }
}

/// A source behind a queue.
pub(super) struct Live<Origin, Reader> {
    address: String,
    counted: &'static str,
    news: Receiver<News<Origin>>,
    reader: Reader,
    /// The unread lines of what came last, and where it comes from.
    lines: VecDeque<Vec<u8>>,
    origin: Option<Origin>,
    place: u64,
}

impl<Origin, Reader> Live<Origin, Reader> {
    pub(super) fn new(
        address: String,
        counted: &'static str,
        news: Receiver<News<Origin>>,
        reader: Reader,
    ) -> Self {
        Live { address, counted, news, reader, lines: VecDeque::new(), origin: None, place: 0 }
    }

    /// Takes the next news; `None` for lines.
    fn receive(&mut self, row: &mut LogRow) -> Result<Option<Read>, SourceError> {
        let failed = |cause| SourceError::Connection { address: self.address.clone(), cause };
        match self.news.recv_timeout(PAUSE) {
            Ok(News::Lines(origin, bytes)) => {
                self.place += 1;
                let text = bytes.strip_suffix(b"\n").unwrap_or(&bytes);
                self.lines.extend(text.split(|&byte| byte == b'\n').map(<[u8]>::to_vec));
                self.origin = Some(origin);
                Ok(None)
            }
            Ok(News::Other(read)) => {
                row.place = match &read {
                    Read::Flawed(_) | Read::Dropped(_) => self.place + 1,
                    _ => self.place,
                };
                if let Read::Flawed(flaw) | Read::Dropped(flaw) = &read {
                    self.place += flaw.count;
                }
                Ok(Some(read))
            }
            Ok(News::Failed(cause)) => Err(failed(cause)),
            Err(RecvTimeoutError::Timeout) => {
                row.place = self.place;
                Ok(Some(Read::Pause))
            }
            Err(RecvTimeoutError::Disconnected) => Err(failed("its thread has ended".into())),
        }
    }
}

impl<Origin: Send, Reader: LineReader<Origin>> Source for Live<Origin, Reader> {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        if self.lines.is_empty()
            && let Some(read) = self.receive(row)?
        {
            return Ok(read);
        }
        row.place = self.place;
        match (self.lines.pop_front(), &self.origin) {
            (Some(line), Some(origin)) => self.reader.read(origin, &line, row),
            _ => Ok(Read::Nothing),
        }
    }

    fn counted(&self) -> &'static str {
        self.counted
    }

    fn is_live(&self) -> bool {
        true
    }

    fn zone_s(&self) -> Option<f64> {
        self.reader.zone_s()
    }
}
