//! Assigns columns to topics.
//!
//! A column `p` is the key `p` of the one topic that sends it. A second topic with the same key is another actuator,
//! and the two are never mixed. `rig/one:p` and `one:p` are the key `p` of the topic `rig/one` alone. The time is sent
//! with every topic.

use super::super::frame::Frames;
use super::super::{LogRow, Read, SourceError, Wanted};
use super::Subscription;
use crate::counts::{Flaw, Irregularity};
use servotwin_io::sanitize;
use std::collections::BTreeMap;

/// The most topics that are remembered; beyond that, topics that have sent no column are forgotten.
const MAX_TOPICS: usize = 4096;

/// All topics that have sent a message.
pub(super) struct Topics {
    wanted: Wanted,
    broker: String,
    has_several: bool,
    topics: BTreeMap<String, Topic>,
    /// For each wanted column, the topic that sends it.
    owners: Vec<Option<String>>,
}

/// The columns read from one topic.
struct Topic {
    frames: Frames,
    /// The index of each of its columns among those wanted.
    chosen: Vec<usize>,
    row: LogRow,
}

impl Topics {
    pub(super) fn new(subscription: &Subscription, wanted: &Wanted) -> Self {
        Topics {
            owners: vec![None; wanted.names.len()],
            wanted: wanted.clone(),
            broker: subscription.broker(),
            has_several: subscription.has_several_topics(),
            topics: BTreeMap::new(),
        }
    }

    /// Reads a line from a topic.
    ///
    /// # Errors
    /// Another topic sends the same column.
    pub(super) fn read(
        &mut self,
        name: &str,
        line: &[u8],
        row: &mut LogRow,
    ) -> Result<Read, SourceError> {
        if !self.topics.contains_key(name) {
            self.remember(name);
        }
        let Some(topic) = self.topics.get_mut(name) else { return Ok(Read::Nothing) };
        let read = topic.frames.read(line, &mut topic.row);
        row.begin(self.wanted.names.len());
        row.bad = topic.row.bad;
        for (&place, &value) in topic.chosen.iter().zip(&topic.row.values) {
            row.values[place] = value;
        }
        let time = self.wanted.time;
        let is_empty = row.bad == 0
            && (0..row.values.len()).all(|place| Some(place) == time || row.values[place].is_nan());
        match read {
            // An unrelated message in a subscription to several topics.
            Read::Row | Read::Flawed(Flaw { kind: Irregularity::NoTime, .. })
                if self.has_several && is_empty =>
            {
                Ok(Read::Nothing)
            }
            Read::Row => self.claim(name, row).map(|()| Read::Row),
            other => Ok(other),
        }
    }

    fn remember(&mut self, name: &str) {
        if self.topics.len() >= MAX_TOPICS {
            let owners = &self.owners;
            self.topics.retain(|topic, _| owners.iter().flatten().any(|owner| owner == topic));
        }
        self.topics.insert(name.to_owned(), Topic::new(name, &self.wanted, self.has_several));
    }

    /// Records which topic sends the values of a row.
    fn claim(&mut self, name: &str, row: &LogRow) -> Result<(), SourceError> {
        for place in 0..row.values.len() {
            if Some(place) == self.wanted.time || row.values[place].is_nan() {
                continue;
            }
            // Without a time column, values of two topics cannot be aligned, whatever they send.
            let owner = match self.wanted.time {
                Some(_) => &self.owners[place],
                None => self.owners.iter().find(|owner| owner.is_some()).unwrap_or(&None),
            };
            match owner {
                Some(owner) if owner != name => return Err(self.mixed(place, owner, name)),
                Some(_) if self.owners[place].is_some() => {}
                _ => self.owners[place] = Some(name.to_owned()),
            }
        }
        Ok(())
    }

    fn mixed(&self, place: usize, first: &str, second: &str) -> SourceError {
        // Complete, with control characters escaped.
        let plain = |topic: &str| topic.chars().flat_map(char::escape_debug).collect::<String>();
        let (broker, ending) = (&self.broker, plain(short(first, second)));
        let (first, second) = (plain(first), plain(second));
        let column = sanitize::text(&self.wanted.names[place]);
        SourceError::Mixed(match self.wanted.time {
            Some(_) => format!(
                "{broker}: both topics {first} and {second} send the column '{column}', and the values of two units are \
                 not mixed; subscribe to one, {broker}/{first}, or name the topic in the map, column = \"{ending}:{column}\""
            ),
            None => format!(
                "{broker}: both topics {first} and {second} send columns, and without a time they cannot be joined; name \
                 the column with the time in the map ([time] column = \"…\"), or subscribe to one, {broker}/{first}"
            ),
        })
    }
}

impl Topic {
    fn new(topic: &str, wanted: &Wanted, has_several: bool) -> Self {
        let mut local = vec![];
        for name in &wanted.names {
            local.push(local_name(topic, name, has_several));
        }
        // A column that names this topic takes precedence over one without a topic, which then belongs to another
        // topic.
        for place in 0..local.len() {
            let Some((name, false)) = local[place] else { continue };
            if local.contains(&Some((name, true))) && wanted.time != Some(place) {
                local[place] = None;
            }
        }
        let chosen: Vec<usize> = (0..local.len()).filter(|&place| local[place].is_some()).collect();
        let plain = |name: &String| match local_name(topic, name, has_several) {
            Some((name, _)) => name.to_owned(),
            None => name.clone(),
        };
        let names = chosen.iter().map(|&place| plain(&wanted.names[place])).collect();
        let time = chosen.iter().position(|&place| Some(place) == wanted.time);
        let columns = wanted.columns.iter().map(plain).collect();
        let flag = |&place: &usize| wanted.flags.get(place).copied().unwrap_or_default();
        let flags = chosen.iter().map(flag).collect();
        let (dates, day) = (wanted.dates, wanted.day);
        let frames = Frames::new(&Wanted { names, time, dates, day, columns, flags });
        Topic { frames, chosen, row: LogRow::default() }
    }
}

/// The key of a column in the messages of a topic, and whether the column names this topic. `None` if it names another
/// topic.
fn local_name<'n>(topic: &str, column: &'n str, has_several: bool) -> Option<(&'n str, bool)> {
    let mut marks = column.match_indices(':').map(|(mark, _)| mark);
    match marks.find(|&mark| is_ending(topic, &column[..mark])) {
        Some(mark) => Some((&column[mark + 1..], true)),
        None if has_several && column.contains(':') => None,
        None => Some((column, false)),
    }
}

/// Whether a text is a topic or its last levels.
fn is_ending(topic: &str, text: &str) -> bool {
    let before = topic.strip_suffix(text).filter(|_| !text.is_empty());
    before.is_some_and(|before| before.is_empty() || before.ends_with('/'))
}

/// The shortest ending of a topic that distinguishes it from another.
fn short<'t>(topic: &'t str, other: &str) -> &'t str {
    let starts = topic.rmatch_indices('/').map(|(slash, _)| &topic[slash + 1..]);
    starts.filter(|end| !end.is_empty()).find(|end| !is_ending(other, end)).unwrap_or(topic)
}

/// The columns of several topics, each once; a column of two topics is repeated with each topic.
pub(super) fn union(found: &[(String, Vec<String>)]) -> Vec<String> {
    let mut names: Vec<String> = vec![];
    for name in found.iter().flat_map(|(_, names)| names) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    let mut qualified = vec![];
    for (topic, own) in found {
        for name in own {
            let other = found.iter().find(|(other, names)| other != topic && names.contains(name));
            if let Some((other, _)) = other {
                qualified.push(format!("{}:{name}", short(topic, other)));
            }
        }
    }
    names.extend(qualified);
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topics(filter: &str, names: &[&str]) -> Topics {
        let names = names.iter().map(|name| name.to_string()).collect();
        let subscription = Subscription::parse(&format!("mqtt://h/{filter}")).unwrap();
        Topics::new(&subscription, &Wanted { names, time: Some(0), ..Wanted::default() })
    }

    fn read(topics: &mut Topics, topic: &str, line: &str) -> Result<(Read, Vec<f64>), String> {
        let mut row = LogRow::default();
        let read = topics.read(topic, line.as_bytes(), &mut row);
        read.map(|read| (read, row.values)).map_err(|error| error.to_string())
    }

    #[test]
    fn two_units_with_the_same_keys_are_refused_and_both_are_named() {
        let mut topics = topics("rig/+", &["t", "p"]);
        assert_eq!(
            read(&mut topics, "rig/one", r#"{"t": 1, "p": 2}"#),
            Ok((Read::Row, vec![1.0, 2.0]))
        );
        // Another topic may send the time and unwanted keys.
        assert_eq!(
            read(&mut topics, "rig/state", r#"{"t": 1, "on": true}"#).unwrap().0,
            Read::Nothing
        );
        assert_eq!(read(&mut topics, "rig/state", r#"{"on": true}"#).unwrap().0, Read::Nothing);
        let told = read(&mut topics, "rig/two", r#"{"t": 1, "p": 3}"#).unwrap_err();
        for part in ["rig/one", "rig/two", "'p'", "mqtt://h:1883/rig/one", "\"one:p\""] {
            assert!(told.contains(part), "{told}");
        }
    }

    #[test]
    fn columns_of_several_topics_are_joined_by_time() {
        let mut topics = topics("rig/#", &["t", "pressure:p", "rig/position:p", "x"]);
        let found = read(&mut topics, "rig/pressure", r#"{"t": 1, "p": 2, "q": 0}"#).unwrap();
        assert_eq!((&found.0, found.1[0], found.1[1]), (&Read::Row, 1.0, 2.0));
        assert!(found.1[2].is_nan() && found.1[3].is_nan());
        // CSV lines have a header for each topic, with its own columns.
        assert_eq!(read(&mut topics, "rig/position", "x,p,t").unwrap().0, Read::Nothing);
        let found = read(&mut topics, "rig/position", "5,4,1").unwrap();
        assert_eq!((found.0, &found.1[2..]), (Read::Row, &[4.0, 5.0][..]));
        assert!(found.1[1].is_nan());
    }

    #[test]
    fn one_topic_may_have_keys_with_colons() {
        let mut topics = topics("rig/one", &["t", "a:p", "one:q"]);
        let found = read(&mut topics, "rig/one", r#"{"t": 1, "a:p": 2, "q": 3}"#);
        assert_eq!(found, Ok((Read::Row, vec![1.0, 2.0, 3.0])));
    }

    #[test]
    fn two_topics_need_a_time_to_be_joined() {
        let mut topics = topics("a,b", &["p", "q"]);
        topics.wanted.time = None;
        assert!(read(&mut topics, "a", r#"{"p": 1}"#).is_ok());
        let told = read(&mut topics, "b", r#"{"q": 1}"#).unwrap_err();
        assert!(told.contains("time"), "{told}");
    }

    #[test]
    fn topics_without_columns_are_forgotten() {
        let mut topics = topics("#", &["t", "p"]);
        let _ = read(&mut topics, "owner", r#"{"t": 1, "p": 2}"#);
        for k in 0..2 * MAX_TOPICS {
            let _ = read(&mut topics, &format!("noise/{k}"), "{}");
        }
        assert!(topics.topics.len() <= MAX_TOPICS + 1 && topics.topics.contains_key("owner"));
    }

    #[test]
    fn names_are_found_by_the_last_levels_of_a_topic() {
        assert_eq!(local_name("a/b/c", "c:x", true), Some(("x", true)));
        assert_eq!(local_name("a/b/c", "b/c:x:y", true), Some(("x:y", true)));
        assert_eq!(local_name("a/b/c", "/c:x", true), None);
        assert_eq!(local_name("a/bc", "c:x", true), None);
        assert_eq!(local_name("a/b/c", "d:x", false), Some(("d:x", false)));
        assert_eq!(
            (short("u1/p", "u2/p"), short("r/u1", "r/u2"), short("p", "x/p")),
            ("u1/p", "u1", "p")
        );
        let found = [("r/a", ["t", "p"]), ("r/b", ["t", "x"])];
        let found =
            found.map(|(topic, names)| (topic.to_owned(), names.map(String::from).to_vec()));
        assert_eq!(union(&found), ["t", "p", "x", "a:t", "b:t"]);
    }
}
