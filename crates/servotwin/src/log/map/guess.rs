//! A map for a log by the names of its columns: for a person to look over.
//!
//! A column is taken where its name without unit is that of an input or a sensor, whatever stands
//! between letters and digits (`PA1 [bar]`, `p_a_1_pa` and `p_A1` are all the sensor `p_a_1` with the
//! label `p_A1`), also behind a point (`measured.p_a_1`). Similar names are not taken: `p_a_1` and `p_b_1` are similar.

use super::FORMAT;
use crate::log::source::DATE;
use crate::system::{System, units};
use servotwin_model::spec::Unit;
use std::fmt::Write;

/// Names of a column with the time.
const TIMES: [&str; 8] =
    ["time", "t", "timestamp", "stamp", "logtime", "datetime", "zeit", "elapsed"];

/// A map as text, and what is uncertain in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Guess {
    /// The file.
    pub text: String,
    /// Whether the column with the time was found.
    pub time: bool,
    /// The inputs that the log does not have.
    pub inputs: Vec<String>,
    /// The sensors that the log does not have.
    pub sensors: Vec<String>,
    /// The columns whose unit is not known, taken for SI.
    pub assumed: Vec<String>,
    /// The columns that nothing was found for.
    pub unused: Vec<String>,
}

/// A map for a log with some columns, which may have units.
pub fn guess(columns: &[(String, String)], system: &System) -> Guess {
    let mut guess = Guess {
        text: head(system),
        time: false,
        inputs: vec![],
        sensors: vec![],
        assumed: vec![],
        unused: vec![],
    };
    let mut used = vec![];
    guess.time(columns, &mut used);
    let _ = write!(guess.text, "\n[inputs]\n");
    for input in &system.network().inputs {
        let names = [key(&input.id)];
        if !guess.channel(columns, &input.id, &names, input.unit, &mut used) {
            let (id, value) = (bare(&input.id), input.default);
            let unit = units::word(input.unit);
            let _ = writeln!(guess.text, "# {id} = {{ value = {value:?}, unit = \"{unit}\" }}");
            guess.inputs.push(id.clone());
        }
    }
    let _ = write!(guess.text, "\n[sensors]\n");
    for sensor in &system.sensors {
        let signal = sensor.signal.strip_suffix(".reading").unwrap_or(&sensor.signal);
        let names = [key(&sensor.id), key(&sensor.label), key(signal)];
        if !guess.channel(columns, &sensor.id, &names, sensor.unit, &mut used) {
            let (id, unit) = (bare(&sensor.id), units::word(sensor.unit));
            let _ = writeln!(guess.text, "# {id} = {{ column = \"?\", unit = \"{unit}\" }}");
            guess.sensors.push(id.clone());
        }
    }
    let unused = columns.iter().map(|(name, _)| name).filter(|name| !used.contains(name));
    guess.unused = unused.cloned().collect();
    if !guess.unused.is_empty() {
        let names: Vec<String> = guess.unused.iter().map(|name| quoted(name)).collect();
        let _ = write!(guess.text, "\n# Columns that nothing was found for:\n");
        names.iter().for_each(|name| guess.text += &format!("# {name}\n"));
    }
    guess
}

fn head(system: &System) -> String {
    format!(
        "# Which column of a log is which signal of the system '{}'.\n\
         # Look at every unit. A line with # is what the log does not have: inputs are then as given\n\
         # there, sensors missing. All keys: docs/watch.md.\n\
         format = {FORMAT}\n",
        system.name
    )
}

impl Guess {
    fn time(&mut self, columns: &[(String, String)], used: &mut Vec<String>) {
        let found = columns.iter().find_map(|(name, given)| {
            let is_time = |(stem, unit): &(&str, Option<(Unit, &str)>)| {
                TIMES.contains(&&*key(stem)) && unit.is_none_or(|(unit, _)| unit == Unit::Second)
            };
            let (_, unit) = splits(name).into_iter().find(is_time)?;
            let given = known(given).filter(|(unit, _)| *unit == Unit::Second);
            let date = columns.iter().any(|(other, unit)| other == name && unit == DATE);
            let unit = given.or(unit).map(|(_, text)| text);
            Some((name, if date { Some(DATE) } else { unit }))
        });
        self.text += "\n[time]\n";
        let Some((name, unit)) = found else {
            self.text += "# Rows follow each other at this rate; or name the column with the time:\n\
                          # column = \"?\", unit = \"s\" (ms, us, ns, or date for dates as text).\n\
                          rate_hz = 100\n";
            return;
        };
        self.time = true;
        used.push(name.clone());
        let _ = writeln!(self.text, "column = {}", quoted(name));
        match unit {
            Some(unit) => self.text += &format!("unit = {}\n", quoted(unit)),
            None => {
                self.text += "unit = \"s\"  # assumed: the name has none. Or ms, us, ns, date.\n";
                self.assumed.push(name.clone());
            }
        }
    }

    /// Writes the line of an input or a sensor; `false` where no column has its name.
    fn channel(
        &mut self,
        columns: &[(String, String)],
        id: &str,
        names: &[String],
        unit: Unit,
        used: &mut Vec<String>,
    ) -> bool {
        let fits = |found: Option<(Unit, &str)>| found.is_none_or(|(found, _)| found == unit);
        let is_named = |stem: &str| names.contains(&key(stem));
        let is_within = |stem: &str| {
            let mut points = stem.match_indices('.');
            points.any(|(place, _)| is_named(&stem[place + 1..]))
        };
        let find = |is_it: &dyn Fn(&str) -> bool| {
            columns.iter().find_map(|(name, given)| {
                let mut ways = splits(name).into_iter();
                let way = ways.find(|(stem, found)| is_it(stem) && fits(*found))?;
                let given = known(given).filter(|(found, _)| *found == unit);
                Some((name, given.or(way.1).map(|(_, text)| text)))
            })
        };
        let found = find(&is_named).or_else(|| find(&is_within));
        let Some((name, text)) = found else { return false };
        used.push(name.clone());
        let (id, column) = (bare(id), quoted(name));
        let _ = match text {
            Some(text) => {
                let text = quoted(spelt(text));
                writeln!(self.text, "{id} = {{ column = {column}, unit = {text} }}")
            }
            None => {
                let word = units::word(unit);
                if unit != Unit::None {
                    self.assumed.push(name.clone());
                }
                let remark = if unit == Unit::None { "" } else { "  # unit assumed" };
                writeln!(self.text, "{id} = {{ column = {column}, unit = \"{word}\" }}{remark}")
            }
        };
        true
    }
}

/// A unit with its text, where it is known.
fn known(text: &str) -> Option<(Unit, &str)> {
    let text = text.trim();
    let found = units::convert(text).filter(|_| !text.is_empty());
    found.map(|(unit, ..)| (unit, text))
}

/// A unit as people write it: a name's `_pa` is Pa.
fn spelt(text: &str) -> &str {
    let si = units::convert(text).filter(|(_, factor, offset)| (*factor, *offset) == (1.0, 0.0));
    si.map_or(text, |(unit, ..)| units::word(unit))
}

/// The ways to divide a column's name into a name and a unit: the unit in brackets, or behind `_`, a blank
/// or a point; the whole as a name last.
fn splits(name: &str) -> Vec<(&str, Option<(Unit, &str)>)> {
    let mut found = vec![];
    let trimmed = name.trim();
    if let Some(inner) = trimmed.strip_suffix([']', ')'])
        && let Some(open) = inner.rfind(['[', '('])
    {
        let unit = known(&inner[open + 1..]);
        found.push((&inner[..open], unit));
    }
    for (place, mark) in trimmed.match_indices(['_', ' ', '.', '/']) {
        if let Some(unit) = known(&trimmed[place + mark.len()..]) {
            found.push((&trimmed[..place], Some(unit)));
        }
    }
    found.push((trimmed, None));
    found
}

/// A name by its letters and digits alone.
fn key(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// An id as a key of TOML.
fn bare(id: &str) -> String {
    if id.contains('.') { quoted(id) } else { id.to_owned() }
}

/// A text as TOML writes it.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => out.extend(['\\', character]),
            c if c.is_control() => out += &format!("\\u{:04X}", u32::from(c)),
            c => out.push(c),
        }
    }
    out + "\""
}
