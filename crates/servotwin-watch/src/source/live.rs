//! Live sources: a thread receives what arrives into a queue, and the lines in it are read one by one.

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

/// Reads a line of an origin into a row.
type LineReader<Origin> = Box<dyn FnMut(&Origin, &[u8], &mut LogRow) -> Read + Send>;

/// A source behind a queue.
pub(super) struct Live<Origin> {
    address: String,
    counted: &'static str,
    news: Receiver<News<Origin>>,
    reader: LineReader<Origin>,
    /// The unread lines of what came last, and where it comes from.
    lines: VecDeque<Vec<u8>>,
    origin: Option<Origin>,
    place: u64,
}

impl<Origin> Live<Origin> {
    pub(super) fn new(
        address: String,
        counted: &'static str,
        news: Receiver<News<Origin>>,
        reader: impl FnMut(&Origin, &[u8], &mut LogRow) -> Read + Send + 'static,
    ) -> Self {
        let (reader, lines) = (Box::new(reader), VecDeque::new());
        Live { address, counted, news, reader, lines, origin: None, place: 0 }
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
                let count = match &read {
                    Read::Flawed(flaw) | Read::Dropped(flaw) => flaw.count,
                    _ => 0,
                };
                row.place = self.place + count.min(1);
                self.place += count;
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

impl<Origin: Send> Source for Live<Origin> {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        if self.lines.is_empty()
            && let Some(read) = self.receive(row)?
        {
            return Ok(read);
        }
        row.place = self.place;
        Ok(match (self.lines.pop_front(), &self.origin) {
            (Some(line), Some(origin)) => (self.reader)(origin, &line, row),
            _ => Read::Nothing,
        })
    }

    fn counted(&self) -> &'static str {
        self.counted
    }

    fn is_live(&self) -> bool {
        true
    }
}
