//! Irregularities of a stream, counted by kind, with the first place of each kind.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Declares the kinds, one per row: variant, name in JSON, and what was found and done.
macro_rules! irregularities {
    ($($kind:ident = $name:literal: $words:literal,)*) => {
        /// A kind of irregularity in the incoming data, and how it was handled.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Irregularity {
            $(#[doc = $words] $kind,)*
        }

        impl Irregularity {
            /// All kinds, in the order of reports.
            pub(crate) const ALL: &[Irregularity] = &[$(Irregularity::$kind),*];

            /// The name in JSON, and a description of what was found and done.
            pub fn words(self) -> (&'static str, &'static str) {
                match self {
                    $(Irregularity::$kind => ($name, $words),)*
                }
            }
        }
    };
}

irregularities! {
    Noise = "noise": "bytes that are no text: dropped",
    TooLong = "too_long": "line too long: dropped",
    CutShort = "cut_short": "the stream ends within a line: dropped",
    WrongColumns = "wrong_columns": "wrong number of columns: dropped",
    NoHeader = "no_header": "before the names of the columns: dropped",
    BadObject = "bad_object": "no JSON object: dropped",
    NoTime = "no_time": "no time: dropped",
    BadValue = "bad_value": "value that is no finite number: missing",
    Impossible = "impossible": "value that its sensor cannot show: missing",
    Reordered = "reordered": "out of order: put in order",
    Doubled = "doubled": "sent twice: dropped",
    CoarseTime = "coarse_time": "time of another sample, other values: dropped",
    Late = "late": "too late: dropped",
    Outlier = "outlier": "impossible time: dropped",
    Surplus = "surplus": "between two periods: left out",
    Gap = "gap": "period without a sample: all values missing",
    ClockBack = "clock_back": "clock set back: begun anew",
    ClockForward = "clock_forward": "clock set forward: begun anew",
    ForeignSender = "foreign_sender": "from another sender: dropped",
    Overflow = "overflow": "came faster than it was diagnosed: dropped",
}

/// Input that is not a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Flaw {
    /// What it is.
    pub kind: Irregularity,
    /// How many lines, rows, datagrams or messages it stands for.
    pub count: u64,
    /// What is known of the first; empty if the kind is enough.
    pub detail: String,
}

impl Flaw {
    /// A single flaw.
    pub fn new(kind: Irregularity, detail: impl Into<String>) -> Self {
        Flaw { kind, count: 1, detail: detail.into() }
    }
}

impl From<Irregularity> for Flaw {
    fn from(kind: Irregularity) -> Self {
        Flaw::new(kind, "")
    }
}

/// How often a kind occurred, and where first.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// Number of occurrences.
    pub count: u64,
    /// The first line, row, datagram or message with it, counted from 1.
    pub first: u64,
    /// Details of the first occurrence; empty if the kind is enough.
    pub detail: String,
}

/// All counts of a watch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WatchCounts {
    /// The unit of counting: lines, rows, datagrams or messages.
    pub counted: String,
    /// How many of these arrived.
    pub frames: u64,
    /// How many periods were passed on, including those without a sample.
    pub samples: u64,
    /// In how many of these periods the diagnosis judged the actuators.
    pub judged: u64,
    /// How often each kind of [`Irregularity::ALL`] occurred.
    tallies: Vec<Tally>,
    /// For each input and sensor, the number of periods without a value.
    pub missing: Vec<u64>,
}

impl WatchCounts {
    /// Empty counts for a number of inputs and sensors.
    pub fn new(counted: &str, channels: usize) -> Self {
        let tallies = vec![Tally::default(); Irregularity::ALL.len()];
        WatchCounts {
            counted: counted.into(),
            frames: 0,
            samples: 0,
            judged: 0,
            tallies,
            missing: vec![0; channels],
        }
    }

    /// The kinds that were met, each with how often and where first.
    pub fn met_in_words(&self) -> Vec<String> {
        let met = self.met().map(|(kind, tally)| {
            format!("{} ({}, first {})", kind.words().1, tally.count, self.place(tally))
        });
        met.collect()
    }

    /// Counts one occurrence of a kind.
    pub(crate) fn note(&mut self, kind: Irregularity, place: u64) {
        self.note_with(kind, place, &"");
    }

    /// Counts one occurrence of a kind; the detail of the first is kept.
    pub(crate) fn note_with(&mut self, kind: Irregularity, place: u64, detail: &dyn fmt::Display) {
        let tally = &mut self.tallies[kind as usize];
        if tally.count == 0 {
            tally.first = place;
            tally.detail = detail.to_string();
        }
        tally.count += 1;
    }

    /// Counts what is no row.
    pub(crate) fn note_flaw(&mut self, place: u64, flaw: &Flaw) {
        if flaw.count > 0 {
            self.note_with(flaw.kind, place, &flaw.detail);
            self.tallies[flaw.kind as usize].count += flaw.count - 1;
        }
    }

    /// How often a kind occurred, and where first.
    pub fn of(&self, kind: Irregularity) -> &Tally {
        &self.tallies[kind as usize]
    }

    /// All kinds that occurred, in the order of `Irregularity::ALL`.
    pub fn met(&self) -> impl Iterator<Item = (Irregularity, &Tally)> {
        Irregularity::ALL.iter().map(|kind| (*kind, self.of(*kind))).filter(|(_, t)| t.count > 0)
    }

    /// Where a kind occurred first: `line 17: 5 cells, 12 are needed`.
    pub fn place(&self, tally: &Tally) -> String {
        let place = format!("{} {}", self.counted, tally.first);
        if tally.detail.is_empty() { place } else { format!("{place}: {}", tally.detail) }
    }
}
