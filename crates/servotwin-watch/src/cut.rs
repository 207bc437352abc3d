//! A source that keeps the part of a log between two times.

use super::source::{LogRow, Read, Source, SourceError};
use crate::map::Map;
use crate::span::{CutError, LogSpan};
use servotwin_io::moment;

/// A source restricted to a time span.
pub struct Cut {
    source: Box<dyn Source>,
    log: String,
    map: Map,
    span: LogSpan,
    /// The first and the last time seen, s.
    reach: Option<(f64, f64)>,
    rows: u64,
    cut: u64,
    is_empty: bool,
}

impl Cut {
    /// Restricts a source to a span; the map supplies the times of its rows.
    pub fn new(source: Box<dyn Source>, log: String, map: &Map, span: LogSpan) -> Self {
        let map = map.clone();
        Cut { source, log, map, span, reach: None, rows: 0, cut: 0, is_empty: true }
    }

    /// Whether a row lies in the span. Rows without a time are kept.
    fn keeps(&mut self, row: &LogRow) -> Result<bool, SourceError> {
        let time_s = self.map.time_s(row, self.rows);
        self.rows += 1;
        if !time_s.is_finite() {
            return Ok(true);
        }
        let (first_s, _) = *self.reach.get_or_insert((time_s, time_s));
        self.reach = Some((first_s, time_s));
        if !self.span.is_of_kind(first_s) {
            let (log, first) = (self.log.clone(), moment::shown(first_s));
            return Err(SourceError::Cut(CutError::OtherKind { log, first }));
        }
        Ok(self.span.contains(time_s, first_s, self.source.zone_s()))
    }
}

impl Source for Cut {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        row.cut = 0;
        let read = self.source.read(row)?;
        match (&read, self.reach) {
            (Read::Row, _) => {
                if self.keeps(row)? {
                    self.is_empty = false;
                    row.cut = self.cut;
                    return Ok(Read::Row);
                }
                self.cut += 1;
                Ok(Read::Nothing)
            }
            (Read::End, Some((first_s, last_s))) if self.is_empty => {
                let zone = self.source.zone_s().map(moment::zone_in_words);
                let last =
                    moment::shown(last_s) + &zone.map_or("".into(), |zone| format!(" {zone}"));
                let (log, reach) = (self.log.clone(), (moment::shown(first_s), last));
                Err(SourceError::Cut(CutError::Empty { log, reach }))
            }
            (Read::Flawed(_), _) => {
                self.rows += 1;
                Ok(read)
            }
            _ => Ok(read),
        }
    }

    fn counted(&self) -> &'static str {
        self.source.counted()
    }

    fn is_live(&self) -> bool {
        self.source.is_live()
    }

    fn zone_s(&self) -> Option<f64> {
        self.source.zone_s()
    }

    fn share(&self) -> Option<f64> {
        self.source.share()
    }
}
