//! The part of a log between two times.

use servotwin::signal::WrittenQuantity;
use servotwin_io::moment::{self, DAY_S, Moment};
use servotwin_model::spec::Unit;

/// One end of a span.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Limit {
    /// Seconds after the first sample.
    Behind(f64),
    /// A date or a time of day.
    At(Moment),
}

/// The part of a log that is read, including both ends.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LogSpan {
    from: Option<Limit>,
    to: Option<Limit>,
}

/// Why a span cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of a variant names its fields")]
pub enum CutError {
    /// A text is not a time.
    #[error(
        "{end} '{given}' is no time: seconds behind the first sample (12.5, 2min) or a date (2026-11-21T08:15:02) is \
         needed"
    )]
    NoTime { end: &'static str, given: String },
    /// A date for a log without dates, or a time of day for a log of another kind.
    #[error(
        "{log} begins at {first}: its part needs a time of the same kind, or seconds behind the first sample"
    )]
    OtherKind { log: String, first: String },
    /// No sample lies in the span.
    #[error(
        "{log} has no sample in the part asked for: it reaches from {} to {}",
        .reach.0, .reach.1
    )]
    Empty { log: String, reach: (String, String) },
}

impl LogSpan {
    /// Parses a span: seconds after the first sample, or dates. A missing limit means the log's end.
    ///
    /// # Errors
    /// A text is not a time.
    pub fn parse(from: Option<&str>, to: Option<&str>) -> Result<Self, CutError> {
        let limit = |end, text: Option<&str>| {
            let read = |given: &str| {
                let seconds = WrittenQuantity::in_unit(given, Unit::Second).ok();
                let behind = seconds.filter(|s| s.is_finite()).map(Limit::Behind);
                let limit = behind.or_else(|| Moment::read(given).map(Limit::At));
                limit.ok_or_else(|| CutError::NoTime { end, given: given.into() })
            };
            text.map(read).transpose()
        };
        Ok(LogSpan { from: limit("from", from)?, to: limit("to", to)? })
    }

    /// Whether the span covers the whole log.
    pub(crate) fn is_whole(&self) -> bool {
        self.from.is_none() && self.to.is_none()
    }

    /// Whether its ends are of the same kind (date or time of day) as the first time of a log.
    pub(super) fn is_of_kind(&self, first_s: f64) -> bool {
        let mut limits = [self.from, self.to].into_iter().flatten();
        limits.all(|limit| match limit {
            Limit::Behind(_) => true,
            Limit::At(at) => at.has_date == moment::is_date(first_s),
        })
    }

    /// Whether the span contains a time of a log, whose clock has this offset from UTC. A limit without a zone is on
    /// the clock of the log; a time of day long before the first sample is one of the next day.
    pub(super) fn contains(&self, time_s: f64, first_s: f64, zone_s: Option<f64>) -> bool {
        let at = |limit| match limit {
            Limit::Behind(behind_s) => first_s + behind_s,
            Limit::At(at) => {
                let at_s = at.on_clock(zone_s.unwrap_or(0.0));
                let is_next_day = !at.has_date && at_s < first_s - 0.5 * DAY_S;
                if is_next_day { at_s + DAY_S } else { at_s }
            }
        };
        // A limit written with few digits is meant exactly; dates are accurate to a quarter of a microsecond.
        let rounding = 1e-6;
        self.from.is_none_or(|from| time_s >= at(from) - rounding)
            && self.to.is_none_or(|to| time_s <= at(to) + rounding)
    }
}
