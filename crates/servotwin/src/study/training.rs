//! The training commands. None of them is used in the evaluation.
//!
//! A study file draws some of them from patterns, such as
//! `noise:rms={2..6}deg,bandwidth={0.3..1.1}Hz,seed=10{n}`, and names others.
//!
//! Every `{a..b}` of a pattern becomes a number between a and b, and `{n}` the number of the draw,
//! starting at one. The numbers are points of Halton's sequence (Numerische Mathematik 2, 1960). They fill
//! the box of all ranges evenly for any number of draws. A range whose ends differ by more than a factor
//! of three is filled evenly on a logarithmic scale. Halton's sequence also draws the load of every command, and
//! the intensity of every fault around each of the study's intensities. The spread reveals abrupt changes
//! between two of these intensities.

use super::Environment;
use super::keys::{RUN_S, SPECIMENS};
use super::reader::{Noted, Reader};
use crate::format::{At, Names, Value, not_in_order, section};
use crate::signal::{Signal, SignalError};
use crate::toml_text::TextSpan;
use servotwin_model::math::{exp, ln};

section! {
    /// The section of a study file.
    pub(super) struct Text {
        must pub(super) duration_s: At<f64> = RUN_S, "length of the records with faults";
        may pub(super) healthy: usize = SPECIMENS, "number of healthy specimens for each command";
        may load: Option<At<[f64; 2]>>, "range of the load";
        may intensity_spread: f64 = Value::Number(0.0, 0.5, ""),
            "largest deviation from each intensity of the study";
        may pub(super) draws: Vec<DrawsText>, "commands with numbers drawn from ranges";
        may pub(super) signals: Names<Signal>, "additional commands by name";
    }
}

section! {
    pub(super) struct DrawsText {
        must pub(super) count: usize = SPECIMENS, "number of commands to draw";
        must pub(super) signal: At<String>,
            "signal; {a..b} becomes a number from a to b, {n} the number of the draw";
    }
}

impl Text {
    /// The patterns of all drawn commands.
    pub(super) fn patterns(&self) -> impl Iterator<Item = &At<String>> {
        self.draws.iter().map(|draws| &draws.signal)
    }
}

/// The training flights of a study.
#[derive(Clone, Debug)]
pub struct Training {
    /// Operating cases, each one command at one load.
    pub cases: Vec<Environment>,
    /// Length of the records with faults, s. Records of healthy specimens are as long as those of the evaluation.
    pub duration_s: f64,
    /// The number of fault-free specimens in each case.
    pub healthy: usize,
    /// The maximum difference between a training intensity and the study's.
    intensity_spread: f64,
}

/// The bases of Halton's sequence: the first for the load, the others for the ranges of a pattern.
const BASES: [u64; 6] = [7, 2, 3, 5, 11, 13];

/// A range with a larger ratio of its ends is drawn on a logarithmic scale.
const WIDE: f64 = 3.0;

impl Training {
    pub(super) fn new(
        At { value: text, at: section }: &At<Text>,
        reader: &Reader,
    ) -> Result<Self, Noted> {
        let At { value: length_s, at } = &text.duration_s;
        let duration_s = reader.text.duration_s;
        let allowed = "at most the study's duration_s";
        reader.range(("duration_s", at), *length_s, *length_s <= duration_s, allowed)?;
        let signals = text.commands();
        if signals.is_empty() {
            return Err(reader.empty(section, "training.draws and training.signals"));
        }
        let command = reader.command_input()?;
        for pattern in text.patterns() {
            let _ = check_pattern(reader, pattern, command, duration_s);
        }
        let mut cases = vec![];
        for (place, Command { at, name, said, signal }) in signals.into_iter().enumerate() {
            let mut inputs = reader.default_inputs();
            let Ok(built) = reader.signal((said, at), signal, command, duration_s) else {
                continue;
            };
            inputs[command] = built;
            let mut percent = String::new();
            if let Some(load) = &text.load {
                let (input, value) = load_of(load, place, reader)?;
                inputs[input] = reader.constant(("load", &load.at), input, value)?;
                percent = format!("/{:.0}", 100.0 * value);
            }
            if cases.iter().any(|other: &Environment| other.command == name) {
                reader.repeated("training command", at, &name);
            }
            let (case, parameters) = (format!("{name}{percent}"), vec![]);
            cases.push(Environment { name: case, command: name, inputs, parameters });
        }
        let Text { healthy, intensity_spread, .. } = *text;
        Ok(Training { cases, duration_s: *length_s, healthy, intensity_spread })
    }

    /// The intensity of the n-th variant of a fault whose intensity in the study is `of_study`.
    pub(crate) fn intensity(&self, of_study: f64, n: usize) -> f64 {
        let offset = self.intensity_spread * (2.0 * halton(n as u64 + 1, 2) - 1.0);
        rounded((of_study + offset).clamp(LEAST_INTENSITY, 1.0))
    }
}

/// The minimum intensity of a fault in training.
const LEAST_INTENSITY: f64 = 0.01;

/// A training command.
struct Command<'t> {
    /// The place in the file.
    at: &'t TextSpan,
    name: String,
    /// The pattern or the name.
    said: &'t str,
    signal: Result<Signal, SignalError>,
}

impl Text {
    /// Lists the commands, first the drawn ones, then the named ones.
    fn commands(&self) -> Vec<Command<'_>> {
        let mut commands = vec![];
        for DrawsText { count, signal: At { value: said, at } } in &self.draws {
            let first = commands.len();
            for draw in 1..=*count {
                let (name, signal) = (format!("T{:02}", first + draw), filled(said, draw).parse());
                commands.push(Command { at, name, said, signal });
            }
        }
        let named = self.signals.iter().map(|(At { value: said, at }, signal)| Command {
            at,
            name: said.clone(),
            said,
            signal: Ok(signal.clone()),
        });
        commands.extend(named);
        commands
    }
}

/// The index of the load input and its value in a case.
fn load_of(
    At { value: [low, high], at }: &At<[f64; 2]>,
    place: usize,
    reader: &Reader,
) -> Result<(usize, f64), Noted> {
    let Some(load) = &reader.text.load else { return Err(reader.empty(at, "load")) };
    let value = rounded(low + (high - low) * halton(place as u64 + 1, BASES[0]));
    Ok((reader.input(&load.input.at, &load.input)?, value))
}

/// Checks that the ranges of a pattern are in order, and that the input allows both ends of each range while the others
/// are at their middle. A few draws might miss an end that more of them would reach.
pub(super) fn check_pattern(
    reader: &Reader,
    At { value: pattern, at }: &At<String>,
    input: usize,
    duration_s: f64,
) -> Result<(), Noted> {
    let ranges = ranges(pattern);
    if let Some(&(low, high)) = ranges.iter().find(|(low, high)| low > high) {
        let mistake = not_in_order(&format!("{{{low}..{high}}}"), low, high);
        return Err(reader.note(at, mistake));
    }
    let ends = (0..ranges.len()).flat_map(|range| [(range, 0.0), (range, 1.0)]);
    ends.into_iter().try_for_each(|(range, end)| {
        let drawn = |place| if place == range { end } else { 0.5 };
        let signal = filled_at(pattern, 1, drawn).parse();
        reader.signal((pattern, at), signal, input, duration_s).map(drop)
    })
}

/// The ranges in a pattern.
fn ranges(pattern: &str) -> Vec<(f64, f64)> {
    let behind = pattern.split('{').skip(1);
    behind.filter_map(|text| range(text.split_once('}')?.0)).collect()
}

/// Replaces the ranges of a pattern by the numbers of a draw.
fn filled(pattern: &str, draw: usize) -> String {
    filled_at(pattern, draw, |place| halton_in(draw as u64, place))
}

/// The n-th number of Halton's sequence for a range of a pattern, between 0 and 1.
pub(super) fn halton_in(n: u64, range: usize) -> f64 {
    halton(n, BASES[1 + range % (BASES.len() - 1)])
}

/// Replaces each range by its value at `at(index)`, from 0 for the low end to 1 for the high end.
pub(super) fn filled_at(pattern: &str, draw: usize, at: impl Fn(usize) -> f64) -> String {
    let mut text = String::new();
    let mut rest = pattern;
    let mut ranges = 0;
    while let Some((before, after)) = rest.split_once('{') {
        text += before;
        let Some((inside, behind)) = after.split_once('}') else {
            // Other text stays as it is, and the signal's parser reports it.
            return text + "{" + after;
        };
        match range(inside) {
            Some((low, high)) => {
                text += &rounded(between(low, high, at(ranges))).to_string();
                ranges += 1;
            }
            None if inside == "n" => text += &draw.to_string(),
            None => text += &format!("{{{inside}}}"),
        }
        rest = behind;
    }
    text + rest
}

/// The number of ranges in a pattern.
pub(super) fn count_ranges(pattern: &str) -> usize {
    ranges(pattern).len()
}

fn range(text: &str) -> Option<(f64, f64)> {
    let (low, high) = text.split_once("..")?;
    Some((low.trim().parse().ok()?, high.trim().parse().ok()?))
}

fn between(low: f64, high: f64, at: f64) -> f64 {
    if low > 0.0 && high > WIDE * low {
        exp(ln(low) + at * (ln(high) - ln(low)))
    } else {
        low + at * (high - low)
    }
}

/// Rounds to three decimals, so that the text is the same on every machine.
fn rounded(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

/// The n-th number of Halton's sequence, between 0 and 1.
fn halton(mut n: u64, base: u64) -> f64 {
    let (mut value, mut part) = (0.0, 1.0);
    while n > 0 {
        part /= base as f64;
        value += part * (n % base) as f64;
        n /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_fill_their_ranges_evenly() {
        let parse = |text: &str| -> f64 { text.parse().unwrap() };
        let linear: Vec<f64> = (1..=16).map(|n| parse(&filled("{2..4}", n))).collect();
        for quarter in 0..4 {
            let low = 2.0 + 0.5 * f64::from(quarter);
            let inside = linear.iter().filter(|v| (low..low + 0.5).contains(*v)).count();
            assert_eq!(inside, 4, "{linear:?}");
        }
        // On a logarithmic scale, half of the draws lie below the geometric mean.
        let wide = (1..=16).filter(|&n| parse(&filled("{0.01..1}", n)) < 0.1).count();
        assert_eq!(wide, 8);
    }

    #[test]
    fn a_pattern_keeps_what_is_no_range() {
        assert_eq!(filled("noise:rms={2..2}deg,seed=1{n}", 7), "noise:rms=2deg,seed=17");
        assert_eq!(filled("a{b}c{d", 1), "a{b}c{d");
    }
}
