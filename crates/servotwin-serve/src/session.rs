//! A session: everything that viewers of one flight were sent, in this order, as one table. The page that replays it
//! shows the same bytes again.

use crate::feed::{Feed, Frame, LiveSource, Message, RunError};
use crate::page::page_of;
use crate::request::Request;
use serde::de::IgnoredAny;
use serde_json::Value;
use servotwin::files::FileError;
use servotwin::table::{Column, Table, TableError, parquet};
#[cfg(feature = "mcap")]
use servotwin_watch::sink::mcap::recording::{Recording, Topic};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::Duration;

/// The metadata key of the description of the flight.
const ABOUT: &str = "servotwin:about";
/// The column of events and states: at the first sample of a frame one JSON object a line, as sent before that frame.
const MESSAGES: &str = "messages";
/// The time after which a session that is shown looks whether it must end.
const PAUSED: Duration = Duration::from_millis(20);

/// Why a file cannot be replayed, or a session not be saved.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The table cannot be read or written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// An MCAP cannot be written.
    #[error(transparent)]
    Mcap(#[from] servotwin_watch::sink::SinkError),
    /// The table is something else.
    #[error("{}: not a saved session: {problem}", .path.display())]
    NotASession {
        /// The file.
        path: PathBuf,
        /// The first problem.
        problem: String,
    },
}

/// A flight as its viewers saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedSession {
    /// What the flight is, as [`LiveSource::about`] describes it.
    pub about: Value,
    /// Frames, events and states in the order in which they were sent.
    pub messages: Vec<Message>,
}

impl SavedSession {
    /// Writes the session as a Parquet file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), SessionError> {
        Ok(parquet::write(path, &self.table()?)?)
    }

    /// Writes the session as an MCAP file: a topic for each part of the page, and `/events` and `/states`.
    ///
    /// # Errors
    /// The file cannot be written.
    #[cfg(feature = "mcap")]
    pub(crate) fn write_mcap(&self, path: &Path) -> Result<(), SessionError> {
        let groups = Groups::of(&self.about);
        let mut recording = Recording::create(path, &groups.topics)?;
        let (period_s, width) = (period_s(&self.about), groups.width);
        let (mut time_s, mut samples) = (0.0, 0);
        let json = |text: &str| serde_json::from_str(text).unwrap_or_default();
        for message in &self.messages {
            match message {
                Message::Event(text) => recording.note("/events", time_s, &json(text))?,
                Message::State(text) => recording.note("/states", time_s, &json(text))?,
                Message::Frame(bytes) => {
                    let values: Vec<f64> = Frame::values_in(bytes).map(f64::from).collect();
                    for sample in values.chunks_exact(width) {
                        time_s = f64::from(samples) * period_s;
                        for (topic, places) in groups.places.iter().enumerate() {
                            let own: Vec<f64> = places.iter().map(|&at| sample[at]).collect();
                            recording.numbers(topic, time_s, &own)?;
                        }
                        samples += 1;
                    }
                }
            }
        }
        Ok(recording.finish()?)
    }

    /// One row for each sample of the diagnosis up to the last full frame: its time, all signals, and what was sent.
    ///
    /// # Errors
    /// Two signals have the same id.
    pub(crate) fn table(&self) -> Result<Table, TableError> {
        let ids = ids(&self.about);
        let mut signals = vec![vec![]; ids.len()];
        let (mut messages, mut waiting) = (vec![], vec![]);
        for message in &self.messages {
            match message {
                Message::Event(event) => waiting.push(format!("{{\"event\":{event}}}")),
                Message::State(state) => waiting.push(format!("{{\"state\":{state}}}")),
                Message::Frame(bytes) => {
                    for (place, value) in Frame::values_in(bytes).enumerate() {
                        signals[place % ids.len()].push(f64::from(value));
                    }
                    messages.push(std::mem::take(&mut waiting).join("\n"));
                    messages.resize(signals[0].len(), String::new());
                }
            }
        }
        let period_s = period_s(&self.about);
        let times_s: Vec<f64> = (0..messages.len()).map(|k| k as f64 * period_s).collect();
        let units = (0..ids.len()).map(|k| self.about["signals"][k]["unit"].as_str().unwrap_or(""));
        let columns = ids.iter().zip(units).zip(signals);
        let columns = columns.map(|((id, unit), values)| Column::new(*id, unit, values));
        let time = std::iter::once(Column::new("time_s", "s", times_s));
        let messages = std::iter::once(Column::new(MESSAGES, "", messages));
        let table = Table::from_columns(time.chain(columns).chain(messages).collect())?;
        Ok(table.with_metadata(ABOUT, self.about.to_string()))
    }

    /// Reads a saved session.
    ///
    /// # Errors
    /// The file cannot be read or holds no session.
    pub fn read(path: &Path) -> Result<Self, SessionError> {
        let table = parquet::read(path)?;
        let wrong = |problem: &str| SessionError::NotASession {
            path: path.to_owned(),
            problem: problem.to_owned(),
        };
        let about =
            table.metadata.get(ABOUT).ok_or_else(|| wrong("it does not describe a flight"))?;
        let about: Value =
            serde_json::from_str(about).map_err(|error| wrong(&error.to_string()))?;
        let ids = ids(&about);
        let is_flight = period_s(&about) > 0.0 && !ids.is_empty() && table.row_count() > 0;
        if !is_flight {
            return Err(wrong("it needs a sampling period, a signal and a sample"));
        }
        let columns = ids.iter().map(|id| table.f64(id)).collect::<Result<Vec<_>, _>>()?;
        let mut messages = vec![];
        let mut frame = Frame::new(0, ids.len());
        for (row, texts) in table.text(MESSAGES)?.iter().enumerate() {
            for line in texts.lines() {
                let message = message(line);
                messages.push(message.ok_or_else(|| wrong(&format!("row {}: {line}", row + 1)))?);
            }
            frame.values().extend(columns.iter().map(|column| column[row] as f32));
            if frame.is_full(period_s(&about)) || row + 1 == table.row_count() {
                messages.push(Message::Frame(frame.bytes()));
                frame = Frame::new(row as u64 + 1, ids.len());
            }
        }
        Ok(SavedSession { about, messages })
    }
}

/// The topics of the signals, one for each part of the page.
#[cfg(feature = "mcap")]
struct Groups {
    topics: Vec<Topic>,
    /// For each topic, the places of its signals in a frame.
    places: Vec<Vec<usize>>,
    /// The number of signals in a frame.
    width: usize,
}

#[cfg(feature = "mcap")]
impl Groups {
    fn of(about: &Value) -> Self {
        let mut groups = Groups { topics: vec![], places: vec![], width: ids(about).len() };
        for place in 0..groups.width {
            let signal = &about["signals"][place];
            let text = |key: &str| signal[key].as_str().unwrap_or_default().to_owned();
            let (topic, number) = (format!("/{}", text("group")), (text("id"), text("unit")));
            let known = groups.topics.iter().position(|known| known.name == topic);
            let at = known.unwrap_or_else(|| {
                let numbers = vec![];
                groups.topics.push(Topic { name: topic, numbers });
                groups.places.push(vec![]);
                groups.topics.len() - 1
            });
            groups.topics[at].numbers.push(number);
            groups.places[at].push(place);
        }
        groups
    }
}

fn ids(about: &Value) -> Vec<&str> {
    let signals = about["signals"].as_array().map_or(&[][..], Vec::as_slice);
    signals.iter().filter_map(|signal| signal["id"].as_str()).collect()
}

fn period_s(about: &Value) -> f64 {
    about["period_s"].as_f64().unwrap_or(f64::NAN)
}

/// An event or a state of a line; `None` if it is neither.
fn message(line: &str) -> Option<Message> {
    serde_json::from_str::<IgnoredAny>(line).ok()?;
    // The text is kept as it is: a number that is read and written again may lose its last bit.
    let inner = |key| line.strip_prefix(key)?.strip_suffix('}');
    let event = inner("{\"event\":").map(|event| Message::Event(event.into()));
    event.or_else(|| inner("{\"state\":").map(|state| Message::State(state.into())))
}

impl LiveSource for SavedSession {
    fn about(&self) -> Value {
        self.about.clone()
    }

    fn page(&self, about: &Value) -> Option<String> {
        Some(page_of(about, self))
    }

    /// Publishes the whole session at once: the page of each viewer plays its own copy.
    fn run(
        &self,
        feed: &Feed,
        requests: &Receiver<Request>,
        stop: &AtomicBool,
    ) -> Result<(), RunError> {
        self.messages.iter().for_each(|message| feed.publish(message.clone()));
        while !stop.load(Ordering::Relaxed) {
            requests.try_iter().for_each(drop);
            std::thread::sleep(PAUSED);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Ten samples of one signal, of which one is missing, in frames of five.
    fn session() -> SavedSession {
        let about = json!({ "period_s": 0.01, "signals": [{ "id": "a", "unit": "kN" }] });
        let frame = |first: u64| {
            let mut frame = Frame::new(first, 1);
            let value = |k: u64| if k == 3 { f32::NAN } else { 0.1 * k as f32 };
            frame.values().extend((first..first + 5).map(value));
            Message::Frame(frame.bytes())
        };
        let event = |text: &str| Message::Event(text.into());
        let state = Message::State(r#"{"confidence":0.30000000000000004}"#.into());
        let messages =
            vec![event(r#"{"time_s":0.0}"#), state, frame(0), event(r#"{"why":"a\nb"}"#), frame(5)];
        SavedSession { about, messages }
    }

    fn path(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("servotwin-{}-{name}.parquet", std::process::id()))
    }

    fn bits(session: &SavedSession) -> String {
        format!("{:?}", session.messages)
    }

    #[test]
    fn a_saved_session_is_read_to_the_bit() {
        let (session, path) = (session(), path("bits"));
        session.write(&path).unwrap();
        let read = SavedSession::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!((read.about.clone(), bits(&read)), (session.about.clone(), bits(&session)));
        let table = session.table().unwrap();
        assert_eq!((table.row_count(), table.columns()[1].unit.as_str()), (10, "kN"));
    }

    #[test]
    fn other_tables_are_refused_with_the_reason() {
        let path = path("other");
        let refusal = |table: Table| {
            parquet::write(&path, &table).unwrap();
            SavedSession::read(&path).unwrap_err().to_string()
        };
        let table = session().table().unwrap();
        let mut bare = table.clone();
        bare.metadata.clear();
        assert!(refusal(bare).ends_with("it does not describe a flight"));
        assert!(refusal(table.without_rows()).ends_with("a signal and a sample"));
        let mut columns = table.clone().into_columns();
        let texts = columns.pop().unwrap();
        let spoiled = texts.with_values(vec!["{\"event\":".to_owned(); 10]);
        columns.push(spoiled);
        let about = table.metadata[ABOUT].clone();
        let spoiled = Table::from_columns(columns).unwrap().with_metadata(ABOUT, about);
        assert!(refusal(spoiled).ends_with("row 1: {\"event\":"));
        std::fs::remove_file(&path).unwrap();
    }

    #[cfg(feature = "mcap")]
    #[test]
    fn a_session_as_mcap_is_a_log_of_its_signals() {
        use servotwin_watch::source::{Address, LogRow, Read, Wanted};

        let path = path("mcap").with_extension("mcap");
        let mut session = session();
        session.about["signals"][0]["group"] = "fight".into();
        session.write_mcap(&path).unwrap();
        let address = Address::File(path.clone());
        let names: Vec<String> = address.columns().unwrap().into_iter().map(|c| c.name).collect();
        let name = names.iter().find(|name| name.ends_with('a')).expect("the signal is a column");
        let wanted = Wanted { names: vec![name.clone()], ..Wanted::default() };
        let mut source = address.open(&wanted).unwrap();
        let (mut row, mut read) = (LogRow::default(), vec![]);
        loop {
            match source.read(&mut row).unwrap() {
                Read::Row => read.push(row.values[0] as f32),
                Read::End => break,
                _ => {}
            }
        }
        std::fs::remove_file(&path).unwrap();
        let expected = (0..10).map(|k| if k == 3 { f32::NAN } else { 0.1 * k as f32 });
        assert_eq!(format!("{read:?}"), format!("{:?}", expected.collect::<Vec<_>>()), "{names:?}");
    }
}
