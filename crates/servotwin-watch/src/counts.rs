//! Irregularities of a stream, counted by kind, with the first place of each kind.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A kind of irregularity in the incoming data, and how it was handled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Irregularity {
    /// Bytes that are not text.
    Noise,
    /// A line longer than the limit.
    TooLong,
    /// The stream ended within a line.
    CutShort,
    /// A number of cells that differs from the header.
    WrongColumns,
    /// A line before the column names are known.
    NoHeader,
    /// Not a JSON object, or an unreadable one.
    BadObject,
    /// No time, or a time that is not a number.
    NoTime,
    /// A value that is not a finite number.
    BadValue,
    /// A number that its sensor cannot produce.
    Impossible,
    /// An older sample that arrived after a newer one and was sorted in.
    Reordered,
    /// A sample whose values are all known already.
    Doubled,
    /// A sample with the time of another, and other values.
    CoarseTime,
    /// A sample that arrived after its period was passed on.
    Late,
    /// A sample whose time no other sample confirms.
    Outlier,
    /// A sample between two periods: the log is faster than the diagnosis.
    Surplus,
    /// A period without any sample.
    Gap,
    /// The clock jumped back and stayed there; the diagnosis restarts.
    ClockBack,
    /// The clock jumped forward beyond the longest gap and stayed there; the diagnosis restarts.
    ClockForward,
    /// The connection was lost.
    Disconnected,
    /// A lost connection was restored.
    Reconnected,
    /// A retained message, which the broker had stored earlier.
    Retained,
    /// A datagram from a sender other than the accepted one.
    ForeignSender,
    /// A datagram dropped because the buffer was full: the diagnosis did not keep up.
    Overflow,
}

impl Irregularity {
    /// All kinds, in the order of reports.
    pub(crate) const ALL: [Irregularity; 23] = [
        Irregularity::Noise,
        Irregularity::TooLong,
        Irregularity::CutShort,
        Irregularity::WrongColumns,
        Irregularity::NoHeader,
        Irregularity::BadObject,
        Irregularity::NoTime,
        Irregularity::BadValue,
        Irregularity::Impossible,
        Irregularity::Reordered,
        Irregularity::Doubled,
        Irregularity::CoarseTime,
        Irregularity::Late,
        Irregularity::Outlier,
        Irregularity::Surplus,
        Irregularity::Gap,
        Irregularity::ClockBack,
        Irregularity::ClockForward,
        Irregularity::Disconnected,
        Irregularity::Reconnected,
        Irregularity::Retained,
        Irregularity::ForeignSender,
        Irregularity::Overflow,
    ];

    /// The name in JSON, and a description of what was found and done.
    pub fn words(self) -> (&'static str, &'static str) {
        match self {
            Irregularity::Noise => ("noise", "bytes that are no text: dropped"),
            Irregularity::TooLong => ("too_long", "line too long: dropped"),
            Irregularity::CutShort => ("cut_short", "the stream ends within a line: dropped"),
            Irregularity::WrongColumns => ("wrong_columns", "wrong number of columns: dropped"),
            Irregularity::NoHeader => ("no_header", "before the names of the columns: dropped"),
            Irregularity::BadObject => ("bad_object", "no JSON object: dropped"),
            Irregularity::NoTime => ("no_time", "no time: dropped"),
            Irregularity::BadValue => ("bad_value", "value that is no finite number: missing"),
            Irregularity::Impossible => {
                ("impossible", "value that its sensor cannot show: missing")
            }
            Irregularity::Reordered => ("reordered", "out of order: put in order"),
            Irregularity::Doubled => ("doubled", "sent twice: dropped"),
            Irregularity::CoarseTime => {
                ("coarse_time", "time of another sample, other values: dropped")
            }
            Irregularity::Late => ("late", "too late: dropped"),
            Irregularity::Outlier => ("outlier", "impossible time: dropped"),
            Irregularity::Surplus => ("surplus", "between two periods: left out"),
            Irregularity::Gap => ("gap", "period without a sample: all values missing"),
            Irregularity::ClockBack => ("clock_back", "clock set back: begun anew"),
            Irregularity::ClockForward => ("clock_forward", "clock set forward: begun anew"),
            Irregularity::Disconnected => ("disconnected", "connection lost"),
            Irregularity::Reconnected => ("reconnected", "connection made again"),
            Irregularity::Retained => ("retained", "kept by the broker from before: no sample"),
            Irregularity::ForeignSender => ("foreign_sender", "from another sender: dropped"),
            Irregularity::Overflow => ("overflow", "came faster than it was diagnosed: dropped"),
        }
    }
}

/// The longest detail in a checkpoint, bytes.
const LONGEST_DETAIL: usize = 10_000;

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

    /// Why these counts do not fit a number of inputs and sensors; `None` if they fit.
    pub(super) fn wrong(&self, channels: usize, counted: &str) -> Option<&'static str> {
        let of_kinds = self.tallies.iter().flat_map(|tally| [tally.count, tally.first]);
        let counters = [self.frames, self.samples, self.judged].into_iter().chain(of_kinds);
        let mut counters = counters.chain(self.missing.iter().copied());
        let is_text = |tally: &Tally| {
            tally.detail.len() <= LONGEST_DETAIL && !tally.detail.contains(char::is_control)
        };
        let checks = [
            (self.tallies.len() == Irregularity::ALL.len(), "the number of kinds"),
            (self.missing.len() == channels, "the number of inputs and sensors"),
            (self.counted == counted, "what is counted"),
            (counters.all(|count| count <= super::LARGEST_COUNT), "a count"),
            (self.judged <= self.samples, "the number of judged samples"),
            (self.tallies.iter().all(is_text), "the first place of a kind"),
        ];
        checks.into_iter().find(|(holds, _)| !holds).map(|(_, what)| what)
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
    pub fn note_with(&mut self, kind: Irregularity, place: u64, detail: &dyn fmt::Display) {
        let tally = &mut self.tallies[kind as usize];
        if tally.count == 0 {
            tally.first = place;
            tally.detail = detail.to_string();
        }
        tally.count += 1;
    }

    /// Counts several occurrences of a kind.
    pub(crate) fn note_many(
        &mut self,
        kind: Irregularity,
        place: u64,
        count: u64,
        detail: &dyn fmt::Display,
    ) {
        if count > 0 {
            self.note_with(kind, place, detail);
            self.tallies[kind as usize].count += count - 1;
        }
    }

    /// How often a kind occurred, and where first.
    pub fn of(&self, kind: Irregularity) -> &Tally {
        &self.tallies[kind as usize]
    }

    /// All kinds that occurred, in the order of `Irregularity::ALL`.
    pub fn met(&self) -> impl Iterator<Item = (Irregularity, &Tally)> {
        Irregularity::ALL.into_iter().map(|kind| (kind, self.of(kind))).filter(|(_, t)| t.count > 0)
    }

    /// Where a kind occurred first: `line 17: 5 cells, 12 are needed`.
    pub fn place(&self, tally: &Tally) -> String {
        let place = format!("{} {}", self.counted, tally.first);
        if tally.detail.is_empty() { place } else { format!("{place}: {}", tally.detail) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_stand_at_their_places_and_have_names_of_their_own() {
        for (place, kind) in Irregularity::ALL.into_iter().enumerate() {
            assert_eq!(kind as usize, place);
            let name = serde_json::to_value(kind).unwrap();
            assert_eq!(name, kind.words().0);
        }
    }

    #[test]
    fn the_first_place_is_kept() {
        let mut counts = WatchCounts::new("line", 0);
        counts.note_with(Irregularity::WrongColumns, 7, &"5 cells, 12 are needed");
        counts.note_with(Irregularity::WrongColumns, 9, &"6 cells, 12 are needed");
        let (kind, tally) = counts.met().next().unwrap();
        assert_eq!((kind, tally.count), (Irregularity::WrongColumns, 2));
        assert_eq!(counts.place(tally), "line 7: 5 cells, 12 are needed");
        assert_eq!(counts.met().count(), 1);
    }
}
