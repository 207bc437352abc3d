//! Guesses a map from the columns of a log, for a person to review.
//!
//! A column is *certain* where its name without unit is that of an input or a sensor. Separators and a prefix that ends
//! with a point are ignored: `PA1 [bar]`, `p_a_1_pa`, `p_A1` and `measured.p_a_1` all match the sensor `p_a_1` with the
//! label `p_A1`. A column is *likely* where its words match the sensor's `quantity` in the study, its number matches
//! the actuator, and its unit has the same dimension: `PSUP1`, `Kolbenweg Aktor 1 [mm]`. Lines with likely columns
//! carry a comment and are written only on request. A column is used once, and never with a unit of another dimension.
//! If two columns are equally good, both are named and neither is used. A unit that is not known is written as it
//! stands, and the map is then refused: no other unit replaces it.

use super::FORMAT;
use super::times::{other_raster, time_columns};
use super::words::{LONGEST, Named, Topic, key, known, splits, topics, words};
use crate::source::frame::base;
use crate::source::{DATE, LogColumn, is_time_name};
use servotwin::study::Study;
use servotwin::system::System;
use servotwin::units;
use servotwin_diagnosis::features::Quantity;
use servotwin_io::moment;
use servotwin_io::sanitize;
use servotwin_io::text::rounded;
use servotwin_model::spec::Unit;
use std::fmt::Write;

/// The certainty that a column needs to be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trust {
    /// Only columns whose name identifies the signal.
    Certain,
    /// Also likely columns: a person reviews the map.
    Likely,
}

/// A map as text, and its uncertain parts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Guess {
    /// The text of the map file.
    pub text: String,
    /// Whether a time column was found.
    pub time: bool,
    /// The inputs that the log lacks.
    pub inputs: Vec<String>,
    /// The sensors that the log lacks.
    pub sensors: Vec<String>,
    /// Columns without a unit, with the one that is assumed: `p_a in Pa`.
    pub assumed: Vec<String>,
    /// The time column, if it may count rows and contradicts the rate of the study as any unit of time.
    pub counter: Option<String>,
    /// Inputs and sensors with a likely column: `x_p_1 (XRAM1)`.
    pub likely: Vec<String>,
    /// A unit that contradicts the times, and signals that several columns may be, as sentences.
    pub doubts: Vec<String>,
    /// Columns without a matching signal.
    pub unused: Vec<String>,
}

/// The least score of an exact name; above every likely score.
const EXACT: u32 = 100;
/// The least score of an exact name behind a point.
const BEHIND: u32 = 90;
/// The lowest score that counts as likely.
const LIKELY: u32 = 6;

/// Rates that differ by less than this share are the same.
const SAME_RATE: f64 = 0.01;

/// An input or a sensor that needs a column.
struct Target {
    id: String,
    names: Vec<String>,
    unit: Unit,
    /// What a sensor measures; `None` for an input.
    quantity: Option<Quantity>,
    is_command: bool,
    /// The actuator that it belongs to, from 1.
    actuator: Option<usize>,
    default: Option<f64>,
}

/// What the words of a column speak of if it is likely a quantity: of a pressure or a position, and of its part.
const MEANINGS: [(Quantity, Topic, Topic); 7] = [
    (Quantity::PressureA, Topic::Pressure, Topic::ChamberA),
    (Quantity::PressureB, Topic::Pressure, Topic::ChamberB),
    (Quantity::Supply, Topic::Pressure, Topic::Supply),
    (Quantity::Return, Topic::Pressure, Topic::Return),
    (Quantity::Ram, Topic::Position, Topic::Ram),
    (Quantity::Spool, Topic::Position, Topic::Spool),
    (Quantity::Surface, Topic::Position, Topic::Surface),
];

/// A column of the log with its parsed name.
struct Candidate<'c> {
    column: &'c LogColumn,
    /// Its name reduced to letters and digits, for every way to split off a unit, with that unit.
    keys: Vec<(String, Option<Named<'c>>)>,
    /// The same for the part of the name behind a point.
    behind: Vec<(String, Option<Named<'c>>)>,
    /// The unit used for this column.
    unit: Option<Named<'c>>,
    topics: Vec<Topic>,
    numbers: Vec<u32>,
}

/// Guesses a map for a log with these columns.
pub fn guess(columns: &[LogColumn], study: &Study, trust: Trust) -> Guess {
    let system = &study.system;
    let mut guess = Guess { text: head(system), ..Guess::default() };
    let mut used = vec![false; columns.len()];
    let time = guess.time(columns, study.sample_period_s, &mut used);
    let candidates: Vec<Candidate> = columns.iter().map(Candidate::of).collect();
    let targets = targets(study);
    let inputs = system.network().inputs.len();
    let single = study.actuators.len() <= 1;
    let assigned = assign(&targets, &candidates, trust, single, &mut used);
    for (number, (target, choice)) in targets.iter().zip(&assigned).enumerate() {
        match number {
            0 => guess.text += "\n[inputs]\n",
            n if n == inputs => guess.text += "\n[sensors]\n",
            _ => {}
        }
        guess.line(target, choice, &candidates);
    }
    guess.doubts.extend(time.and_then(|time| other_raster(columns, time, &|column| used[column])));
    let unused = columns.iter().zip(used).filter(|(_, used)| !used);
    guess.unused = unused.map(|(column, _)| column.name.clone()).collect();
    if !guess.unused.is_empty() {
        guess.text += "\n# Columns that nothing was found for:\n";
        for name in &guess.unused {
            guess.text += &format!("# {}\n", quoted(name));
        }
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

/// The inputs of a study's system, followed by its sensors.
fn targets(study: &Study) -> Vec<Target> {
    let system = &study.system;
    let network = system.network();
    let input = |(place, input): (usize, &servotwin_model::network::ExternalInput)| Target {
        id: input.id.clone(),
        names: vec![key(&input.id)],
        unit: input.unit,
        quantity: None,
        is_command: place == study.command_input,
        actuator: None,
        default: Some(input.default),
    };
    let sensor = |(place, sensor): (usize, &servotwin::system::Sensor)| {
        let signal = sensor.signal.strip_suffix(".reading").unwrap_or(&sensor.signal);
        let own = study.measured.iter().position(|&measured| measured == place);
        let own = own.and_then(|own| study.sensors.0.get(own));
        Target {
            id: sensor.id.clone(),
            names: vec![key(&sensor.id), key(&sensor.label), key(signal)],
            unit: sensor.unit,
            quantity: own.map(|own| own.quantity),
            is_command: false,
            actuator: own.and_then(|own| own.actuator).map(|unit| unit + 1),
            default: None,
        }
    };
    let inputs = network.inputs.iter().enumerate().map(input);
    inputs.chain(system.sensors.iter().enumerate().map(sensor)).collect()
}

/// The columns that may be a target.
#[derive(Debug, Clone, Default)]
struct Choice {
    places: Vec<usize>,
    /// Why the first one is chosen; `None` where another one is as good.
    trust: Option<Trust>,
}

/// Assigns the best-scoring columns first, each once.
fn assign(
    targets: &[Target],
    candidates: &[Candidate],
    trust: Trust,
    single: bool,
    used: &mut [bool],
) -> Vec<Choice> {
    let mut choices = vec![Choice::default(); targets.len()];
    let mut scores: Vec<(u32, usize, usize)> = vec![];
    for (target, wanted) in targets.iter().enumerate() {
        for (place, candidate) in candidates.iter().enumerate().filter(|(place, _)| !used[*place]) {
            let score = candidate.score(wanted, single);
            if score >= BEHIND || (score >= LIKELY && trust == Trust::Likely) {
                scores.push((score, target, place));
            }
        }
    }
    scores.sort_by_key(|&(score, target, place)| (std::cmp::Reverse(score), target, place));
    for &(score, target, place) in &scores {
        if used[place] || !choices[target].places.is_empty() {
            continue;
        }
        // Pairs with the same score: another column for the target, or another target for the column.
        let is_rival = |&&(other, its, column): &&(u32, usize, usize)| {
            let is_free = !used[column] && choices[its].places.is_empty();
            other == score && is_free && (its == target) != (column == place)
        };
        let rivals: Vec<_> = scores.iter().filter(is_rival).collect();
        let own = rivals.iter().filter(|(_, its, _)| *its == target).map(|(.., column)| *column);
        let places = std::iter::once(place).chain(own).collect();
        let trust = if score >= BEHIND { Trust::Certain } else { Trust::Likely };
        let trust = rivals.is_empty().then_some(trust);
        used[place] = trust.is_some();
        choices[target] = Choice { places, trust };
    }
    choices
}

impl<'c> Candidate<'c> {
    fn of(column: &'c LogColumn) -> Self {
        let name = if column.name.len() > LONGEST { "" } else { &column.name };
        let ways = splits(name);
        let is_unit = |unit: &Named| is_spelt_out(name, *unit);
        let named = ways.iter().find_map(|(stem, unit)| Some((*stem, (*unit).filter(is_unit)?)));
        let stem = named.map_or(name, |(stem, _)| stem);
        let (words, numbers) = words(stem);
        let unit = known(&column.unit).or(named.map(|(_, unit)| unit));
        let keys = ways.iter().map(|(stem, unit)| (key(stem), *unit)).collect();
        let behind = ways.iter().flat_map(|(stem, unit)| {
            let points = stem.match_indices('.').map(|(place, _)| &stem[place + 1..]);
            points.map(|end| (key(end), *unit))
        });
        let behind = behind.collect();
        Candidate { column, keys, behind, unit, topics: topics(&words), numbers }
    }

    /// How well a column fits a target; 0 means not at all.
    fn score(&self, target: &Target, single: bool) -> u32 {
        if self.column.unit == DATE {
            return 0;
        }
        let given = known(&self.column.unit).filter(|(_, text)| *text != "-");
        // Of several columns with the name, one that speaks of a measurement is meant, not `twin.p_a`, and one with a
        // unit before one without.
        let is_measured = 2 * u32::from(!self.topics.contains(&Topic::Other));
        let grade = |(key, unit): &(String, Option<Named>)| {
            let unit = given.or(*unit);
            let fits = unit.is_none_or(|(unit, _)| unit == target.unit);
            (target.names.contains(key) && fits).then(|| is_measured + u32::from(unit.is_some()))
        };
        if let Some(grade) = self.keys.iter().filter_map(grade).max() {
            return EXACT + grade;
        }
        if let Some(grade) = self.behind.iter().filter_map(grade).max() {
            return BEHIND + grade;
        }
        let likeness = self.likeness(target).zip(self.number(target.actuator, single));
        likeness.map_or(0, |(words, number)| words + number + 2 * u32::from(self.unit.is_some()))
    }

    /// How well the words fit a target; `None` means not at all.
    fn likeness(&self, target: &Target) -> Option<u32> {
        let has = |topic: Topic| self.topics.contains(&topic);
        let unit = self.unit.map(|(unit, _)| unit);
        if unit.is_some_and(|unit| unit != target.unit) || has(Topic::Other) {
            return None;
        }
        if target.is_command {
            return has(Topic::Command).then(|| 4 + u32::from(has(Topic::Surface)));
        }
        let (_, what, part) = MEANINGS.iter().find(|(own, ..)| Some(*own) == target.quantity)?;
        let is_what = match what {
            Topic::Pressure => unit == Some(Unit::Pascal),
            _ => matches!(unit, Some(Unit::Metre | Unit::Radian)),
        };
        let mut rivals = MEANINGS.iter().filter(|(_, other, _)| other == what);
        let is_part = rivals.all(|(.., rival)| has(*rival) == (rival == part));
        ((is_what || has(*what)) && is_part && !has(Topic::Command)).then_some(4)
    }

    /// How well the number in a name fits the actuator; `None` if it belongs to another actuator.
    fn number(&self, actuator: Option<usize>, single: bool) -> Option<u32> {
        let Some(actuator) = actuator else { return Some(2) };
        let is_own = self.numbers.iter().any(|&number| number as usize == actuator);
        match (is_own, self.numbers.len()) {
            (true, 1) => Some(2),
            (true, _) => Some(0),
            (false, 0) => single.then_some(1),
            (false, _) => single.then_some(0),
        }
    }
}

impl Guess {
    /// Writes the section of the time; returns the place of its column.
    fn time(&mut self, columns: &[LogColumn], period_s: f64, used: &mut [bool]) -> Option<usize> {
        self.text += "\n[time]\n";
        let times = time_columns(columns);
        let grows = |place: &&usize| columns[**place].step().is_some();
        let Some(place) = times.iter().find(grows).or(times.first()).copied() else {
            self.text += "# Rows follow each other at this rate; or name the column with the time:\n\
                          # column = \"?\", unit = \"s\" (ms, us, ns, or date for dates as text).\n\
                          rate_hz = 100\n";
            return None;
        };
        (self.time, used[place]) = (true, true);
        let column = &columns[place];
        let _ = writeln!(self.text, "column = {}", quoted(&column.name));
        let fitting =
            column.step().and_then(|step| moment::likely_unit(step, period_s, units::of_times()));
        let line = match (column.unit == DATE, time_unit(column), unknown_unit(column)) {
            (true, ..) => format!("unit = \"{DATE}\""),
            (false, Some(unit), _) => {
                format!("unit = {}{}", quoted(spelt(unit)), self.time_doubt(column, unit, fitting))
            }
            (false, None, Some(unknown)) => format!("unit = {}  # {UNKNOWN}", quoted(unknown)),
            (false, None, None) => {
                let (unit, remark) = match fitting {
                    Some((unit, step_s)) => {
                        (days_since(unit, column), format!("the samples are then {step_s} s apart"))
                    }
                    None => ("s", "the name has none. Or ms, us, ns, date".into()),
                };
                self.assumed.push(format!("{} in {unit}", column.name));
                let is_rate =
                    fitting.is_some_and(|(_, step_s)| (step_s / period_s - 1.0).abs() < SAME_RATE);
                self.counter = (column.counts_rows() && !is_rate).then(|| column.name.clone());
                format!("unit = \"{unit}\"  # assumed: {remark}")
            }
        };
        let _ = writeln!(self.text, "{line}");
        Some(place)
    }

    /// Describes that the sampling interval contradicts the unit given by the log; changes nothing.
    fn time_doubt(
        &mut self,
        column: &LogColumn,
        unit: &str,
        fitting: Option<(&str, f64)>,
    ) -> String {
        let claimed_s = units::find(unit).map_or(1.0, |unit| unit.si);
        let step_s = column.step().unwrap_or(f64::NAN) * claimed_s;
        let Some((other, other_s)) = fitting.filter(|_| !moment::is_period(step_s)) else {
            return String::new();
        };
        let remark = format!(
            "samples would be {} s apart; in {other} they are {other_s} s apart",
            rounded(step_s, 3)
        );
        let name = sanitize::text(&column.name);
        self.doubts.push(format!("column '{name}' claims {unit}: {remark}"));
        format!("  # doubtful: {remark}")
    }

    /// What a person should know of this map: warnings, then notes.
    pub fn remarks(&self) -> (Vec<String>, Vec<String>) {
        let (mut warnings, mut notes) = (vec![], vec![]);
        if !self.time {
            warnings.push("no column with the time: 100 rows for a second are assumed".to_owned());
        }
        if !self.assumed.is_empty() {
            let assumed = sanitize::list(&self.assumed);
            warnings.push(format!("no unit is given, so that this is assumed: {assumed}"));
        }
        warnings.extend(self.doubts.iter().cloned());
        if let Some(name) = self.unused.iter().find(|name| base(name) != *name) {
            let (one, name) = (sanitize::text(base(name)), sanitize::text(name));
            warnings.push(format!(
                "several columns are named '{one}': a map file says which, '{name}'"
            ));
        }
        if !self.likely.is_empty() {
            let likely = self.likely.join(", ");
            warnings.push(format!("likely by their names: {likely}; look them over"));
        }
        if !self.sensors.is_empty() {
            notes.push(format!("no column for the sensors {}", self.sensors.join(", ")));
        }
        if !self.inputs.is_empty() {
            let inputs = self.inputs.join(", ");
            notes.push(format!("no column for the inputs {inputs}: they are at their defaults"));
        }
        if !notes.is_empty() && !self.unused.is_empty() {
            let unused = sanitize::list(&self.unused);
            notes.push(format!("columns that are no input and no sensor: {unused}"));
        }
        (warnings, notes)
    }

    /// Writes the map line of an input or a sensor.
    fn line(&mut self, target: &Target, choice: &Choice, candidates: &[Candidate]) {
        let (id, word) = (bare(&target.id), units::word(target.unit));
        let Choice { places, trust: Some(trust) } = choice else {
            return self.lacking(target, choice, candidates);
        };
        let candidate = &candidates[places[0]];
        let name = &candidate.column.name;
        let unit = candidate.unit.filter(|(unit, _)| *unit == target.unit);
        let is_unknown = unit.is_none() && target.unit != Unit::None;
        let declared = declared_unit(candidate.column).filter(|_| is_unknown);
        let mut remarks = vec![];
        if declared.is_some() {
            remarks.push(UNKNOWN.to_owned());
        } else {
            if *trust == Trust::Likely {
                remarks.push("likely by its name: look at it".to_owned());
                self.likely.push(format!("{} ({})", target.id, sanitize::text(name)));
            }
            if is_unknown {
                self.assumed.push(format!("{name} in {word}"));
                remarks.push("unit assumed".into());
            }
        }
        let unit = declared.unwrap_or(unit.map_or(word, |(_, text)| spelt(text)));
        let from = format!("column = {}", quoted(name));
        self.text += &map_line(&id, &from, unit, &remarks.join("; "));
    }

    /// Writes the map line of an input or a sensor without a column.
    fn lacking(&mut self, target: &Target, choice: &Choice, candidates: &[Candidate]) {
        let id = bare(&target.id);
        let name = |place: &usize| quoted(&candidates[*place].column.name);
        let names = choice.places.iter().map(name).collect::<Vec<_>>().join(" or ");
        let mut remark = String::new();
        if !names.is_empty() {
            self.doubts.push(format!("{id} may be {names}: a map file says which"));
            remark = format!("may be {names}");
        }
        let (from, lacking) = match target.default {
            Some(value) => (format!("value = {value:?}"), &mut self.inputs),
            None => ("column = \"?\"".into(), &mut self.sensors),
        };
        let line = map_line(&id, &from, units::word(target.unit), &remark);
        self.text += &format!("# {line}");
        lacking.push(id);
    }
}

/// A line of a map, with a remark if that is not empty.
fn map_line(id: &str, from: &str, unit: &str, remark: &str) -> String {
    let mark = if remark.is_empty() { "" } else { "  # " };
    format!("{id} = {{ {from}, unit = {} }}{mark}{remark}\n", quoted(unit))
}

/// The remark behind a unit that is not known.
const UNKNOWN: &str = "not known: replace it";

/// The unit of a time column, from the log or from its name.
fn time_unit(column: &LogColumn) -> Option<&str> {
    let is_time = |(unit, _): &Named| *unit == Unit::Second;
    let named = || {
        splits(base(&column.name))
            .into_iter()
            .find_map(|(stem, unit)| unit.filter(|_| is_time_name(&key(stem))))
    };
    known(&column.unit).filter(is_time).or_else(|| named().filter(is_time)).map(|(_, text)| text)
}

/// The unit of a log or of brackets behind a name, if it is not known. A number in brackets, or a word for a time, is no
/// unit.
fn unknown_unit(column: &LogColumn) -> Option<&str> {
    declared_unit(column).filter(|text| !matches!(*text, "-" | "–") && known(text).is_none())
}

/// The unit of a log or of brackets behind a name, whether it is known or not.
fn declared_unit(column: &LogColumn) -> Option<&str> {
    let inner = || {
        let inner = column.name.trim().strip_suffix([']', ')'])?;
        Some(&inner[inner.rfind(['[', '('])? + 1..])
    };
    let given = Some(column.unit.trim()).filter(|unit| !unit.is_empty());
    let text = given.or_else(inner)?.trim();
    let is_none = matches!(text, "" | DATE) || text.bytes().all(|b| b.is_ascii_digit());
    (!is_none && !is_time_name(&key(text))).then_some(text)
}

/// The unit of days that count from a known day, by the first of them: spreadsheets count from 1900.
fn days_since(unit: &'static str, column: &LogColumn) -> &'static str {
    match column.head.first() {
        Some(20_000.0..80_000.0) if unit == "d" => "excel",
        Some(690_000.0..800_000.0) if unit == "d" => "datenum",
        _ => unit,
    }
}

/// Whether a unit in a name is unambiguous. A number is not a unit. A letter that also names a chamber or a line
/// (`p_a`, `p_s`, `p_t`) counts only in brackets.
fn is_spelt_out(name: &str, (unit, text): Named) -> bool {
    let is_letter = ["a", "s", "t", "c", "l", "g", "h", "d"]
        .iter()
        .any(|letter| text.eq_ignore_ascii_case(letter));
    let is_plain = unit != Unit::None || text == "%";
    is_plain && (!is_letter || name.trim_end().ends_with([']', ')']))
}

/// A unit in its usual spelling: a name's `_pa` becomes Pa.
fn spelt(text: &str) -> &str {
    units::find(text).filter(|row| row.is_si()).map_or(text, |row| row.symbol)
}

/// An id as a key of TOML.
fn bare(id: &str) -> String {
    if id.contains('.') { quoted(id) } else { id.to_owned() }
}

/// A text as a TOML string, which escapes what a string of JSON escapes, and the character DEL.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string().replace('\u{7f}', "\\u007F")
}
