//! The training commands, and how the diagnosis performs with fewer of them.

use crate::Material;
use crate::lines;
use crate::looks;
use crate::page::{Alignment, HtmlTable, Page};
use crate::vocabulary::Vocabulary;
use crate::words::{chosen, number, stacked};
use servotwin::evaluation::metrics::Rate;
use servotwin::evaluation::protocol::{Protocol, ProtocolResult};
use servotwin::job::results::SubjectResult;
use servotwin::shown::Shown;
use servotwin::signal::Signal;
use servotwin::study::{OperatingCase, Study, Training};
use servotwin_plot::Figure;
use servotwin_plot::lines::{Curve, Lines};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
    let study = material.study;
    let Some(training) = &study.training else {
        return;
    };
    page.text(&format!(
        "Trees and committee learn from {} commands that are not among those on which they are \
             judged, run for {} s each at a load of its own; of every command there are {} healthy \
             specimens, which run {} s.",
        commands(training).len(),
        chosen(training.duration_s),
        training.healthy,
        chosen(study.duration_s),
    ));
    page.table(
        &list(study, training),
        "The training commands as the study file has them. Of a \
            pattern every range is filled evenly by the draws, wide ones on a logarithmic scale.",
    );
    let curves: Vec<(&SubjectResult, Vec<(usize, &ProtocolResult)>)> =
        lines::settings(material.results)
            .into_iter()
            .map(|result| (result, curve(result, training)))
            .filter(|(_, curve)| curve.len() > 1)
            .collect();
    if curves.is_empty() {
        return;
    }
    page.figure(
        "training_commands",
        figure(&curves),
        "Accuracy of the trees on new commands, end to \
            end, against the number of commands that they learned from (the first of the list); \
            whiskers: 95 %, from drawing kinds of fault at their intensities.",
    );
    let words = material.words();
    page.table(
        &table(&curves, &words),
        &match words.has_off() {
            true => {
                format!("The same in numbers, with each missed {} of detected faults.", words.off())
            }
            false => "The same in numbers.".into(),
        },
    );
}

/// The names of the training commands.
fn commands(training: &Training) -> Vec<&str> {
    let mut names: Vec<&str> = vec![];
    for case in &training.cases {
        if !names.contains(&case.command.as_str()) {
            names.push(&case.command);
        }
    }
    names
}

/// Results by the number of training commands. The result with all of them comes last.
fn curve<'r>(result: &'r SubjectResult, training: &Training) -> Vec<(usize, &'r ProtocolResult)> {
    let evaluation = &result.evaluation;
    let fewer = evaluation.commands.iter().map(|(count, result)| (*count, result));
    let all = evaluation.protocol(Protocol::NewCommand);
    fewer.chain(all.map(|result| (commands(training).len(), result))).collect()
}

fn figure(curves: &[(&SubjectResult, Vec<(usize, &ProtocolResult)>)]) -> Figure {
    let mut lines = Lines::new("", "training commands", "end to end right (%)");
    lines.x_log = true;
    for (result, curve) in curves {
        let known = curve.iter().filter_map(|(count, result)| Some((*count, result.end_to_end?)));
        let known: Vec<(usize, Rate)> = known.filter(|(_, rate)| rate.share.is_some()).collect();
        let point =
            |(count, rate): &(usize, Rate)| (*count as f64, 100.0 * rate.share.unwrap_or_default());
        let ends = known.iter().map(|(_, rate)| (100.0 * rate.low, 100.0 * rate.high)).collect();
        let points = known.iter().map(point).collect();
        lines = lines.with(
            Curve::new(&result.title, points)
                .with_intervals(ends)
                .looking(looks::subject(result.subject)),
        );
    }
    lines.draw()
}

fn table(
    curves: &[(&SubjectResult, Vec<(usize, &ProtocolResult)>)],
    words: &Vocabulary,
) -> HtmlTable {
    let mut heads = vec![("training commands".to_owned(), Alignment::Right)];
    let mut measures = vec!["end to end right".to_owned()];
    if words.has_off() {
        measures.push(format!("{} missed", words.off()));
    }
    for what in &measures {
        let head = |(result, _): &(&SubjectResult, _)| {
            (format!("{what}, {}", result.title), Alignment::Right)
        };
        heads.extend(curves.iter().map(head));
    }
    let mut grid = HtmlTable::new(heads);
    let mut counts: Vec<usize> =
        curves.iter().flat_map(|(_, curve)| curve.iter().map(|(count, _)| *count)).collect();
    counts.sort_unstable();
    counts.dedup();
    for count in counts {
        let of = |curve: &[(usize, &ProtocolResult)], rate: fn(&ProtocolResult) -> Option<Rate>| {
            let own = curve.iter().find(|(own, _)| *own == count);
            stacked(own.and_then(|(_, result)| rate(result)))
        };
        let mut row = vec![count.to_string()];
        row.extend(curves.iter().map(|(_, curve)| of(curve, |result| result.end_to_end)));
        let missed = |result: &ProtocolResult| Some(result.safety.as_ref()?.missed_shutdown);
        if words.has_off() {
            row.extend(curves.iter().map(|(_, curve)| of(curve, missed)));
        }
        grid.push(row);
    }
    grid
}

/// Lists the training commands with a description. Draws of one pattern share a row.
fn list(study: &Study, training: &Training) -> HtmlTable {
    let mut grid = HtmlTable::new([
        ("command", Alignment::Left),
        ("what it is", Alignment::Left),
        ("load", Alignment::Right),
    ]);
    let text: toml::Table = study.text.parse().unwrap_or_default();
    let driven = text.get("load").and_then(|load| load.get("input")).and_then(toml::Value::as_str);
    let inputs = &study.system.network().inputs;
    let load = driven.and_then(|name| inputs.iter().position(|input| input.id == name));
    let section = text.get("training");
    let named = section.and_then(|section| section.get("signals")).and_then(toml::Value::as_table);
    let signal = |name: &str| named.and_then(|signals| signals.get(name)).map(in_words);
    let drawn = section.and_then(|section| section.get("draws")).and_then(toml::Value::as_array);
    // The draws of all patterns come first, in their order.
    let mut cases: Vec<&OperatingCase> = training.cases.iter().collect();
    for draws in drawn.into_iter().flatten() {
        let count = draws.get("count").and_then(toml::Value::as_integer).unwrap_or(0);
        let own: Vec<&OperatingCase> = cases.drain(..(count as usize).min(cases.len())).collect();
        let Some((first, last)) = own.first().zip(own.last()) else { continue };
        let names = match own.len() {
            1 => first.command.clone(),
            _ => format!("{} … {}", first.command, last.command),
        };
        grid.push(vec![
            names,
            draws.get("signal").map(in_words).unwrap_or_default(),
            loads(study, load, &own),
        ]);
    }
    for case in cases {
        let words = signal(&case.command).unwrap_or_default();
        grid.push(vec![case.command.clone(), words, loads(study, load, &[case])]);
    }
    grid
}

/// The loads of cases, in the unit of the load input; empty if the study has no load.
fn loads(study: &Study, load: Option<usize>, cases: &[&OperatingCase]) -> String {
    let Some(input) = load else { return String::new() };
    let read = Shown::of_input(study.system.network(), input);
    let value = |case: &&OperatingCase| read.value(case.inputs[input].value(0.0));
    let least = cases.iter().map(value).fold(f64::INFINITY, f64::min);
    let most = cases.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
    let size = match number(least) == number(most) {
        true => number(least),
        false => format!("{} … {}", number(least), number(most)),
    };
    match read.symbol() {
        "" | "1" => size,
        unit => format!("{size} {unit}"),
    }
}

/// A signal in readable form: `noise:rms={1.8..6}deg,seed=1{n}` → `noise: rms 1.8 … 6 deg`.
pub(super) fn in_words(signal: &toml::Value) -> String {
    let text = match signal.as_str() {
        Some(text) => text.to_owned(),
        None => signal.clone().try_into().map_or_else(|_| String::new(), |s: Signal| s.to_string()),
    };
    let term = |term: &str| {
        let (kind, parameters) = term.split_once(':').unwrap_or((term, ""));
        let shown = parameters.split(',').filter(|one| !one.trim().starts_with("seed="));
        let shown: Vec<String> = shown.map(|one| with_spaces(&one.replace('=', " "))).collect();
        let parameters = shown.join(", ").replace("..", " … ").replace(['{', '}'], "");
        format!("{}: {parameters}", kind.trim()).trim_end_matches([':', ' ']).to_owned()
    };
    text.split(" + ").map(term).collect::<Vec<_>>().join("; plus ")
}

/// Puts a space between every number and its unit.
fn with_spaces(text: &str) -> String {
    let mut spaced = String::new();
    for character in text.chars() {
        if character.is_alphabetic()
            && spaced.ends_with(|last: char| matches!(last, '0'..='9' | '}'))
        {
            spaced.push(' ');
        }
        spaced.push(character);
    }
    spaced
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_read_without_its_seed() {
        let words = |text: &str| in_words(&toml::Value::String(text.into()));
        let pattern = "noise:rms={1.8..6}deg,bandwidth={0.3..2.6}Hz,seed=10{n}";
        assert_eq!(words(pattern), "noise: rms 1.8 … 6 deg, bandwidth 0.3 … 2.6 Hz");
        assert_eq!(
            words("step:size=6deg + ramp:rate=1deg/s"),
            "step: size 6 deg; plus ramp: rate 1 deg/s"
        );
    }
}
