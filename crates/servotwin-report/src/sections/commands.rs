//! The commands on which the diagnosis is evaluated (figure 7 of the seed paper), and those from which it learns.

use crate::Material;
use crate::words::{chosen, distinct, three_digits};
use servotwin::shown::Shown;
use servotwin::study::{Environment, Study, Training};
use servotwin_view::SemanticColor;
use servotwin_view::document::{Document, Table};
use servotwin_view::time_series::{Panel, Series, TimeSeries};

/// The seconds that a figure shows. A whole run would look like a solid band.
const SHOWN_S: f64 = 30.0;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let study = material.study;
    let read = Shown::of_input(study.system.network(), study.command_input);
    let end = study.duration_s.min(SHOWN_S);
    let count = (end / study.sample_period_s) as usize;
    let time: Vec<f64> = (0..=count).map(|k| k as f64 * study.sample_period_s).collect();
    // A degree sign alone is easy to overlook.
    let label = match read.symbol() {
        "" | "1" => "command".to_owned(),
        symbol => format!("command ({symbol})"),
    };
    let mut figure = TimeSeries::new("", "time (s)");
    let mut known: Vec<&str> = vec![];
    for case in &study.cases {
        let name = case.name.split('/').next().unwrap_or(&case.name);
        if known.contains(&name) {
            continue;
        }
        known.push(name);
        let signal = &case.inputs[study.command_input];
        let values: Vec<f64> = time.iter().map(|&t| read.value(signal.value(t))).collect();
        let panel = Panel::new(name, &label);
        figure =
            figure.with(panel.with(
                Series::new("", time.clone(), values).looking(SemanticColor::Plain(0).look()),
            ));
    }
    let shown = match end < study.duration_s {
        true => format!("the first {end} s of {} s", study.duration_s),
        false => format!("all {end} s"),
    };
    page.figure(
        "commands",
        figure.draw(),
        format!(
            "The commands on which the diagnosis is judged, {shown}{}. Operating cases: {}.",
            material.words().paper(" (figure 7 of the seed paper)"),
            study.cases.iter().map(|case| case.name.as_str()).collect::<Vec<_>>().join(", "),
        ),
    );
    let mut grid = Table::headed(["command", "what it is"]);
    for name in known {
        let signal = study.command_signal(name).map(|signal| in_words(&signal.to_string()));
        grid.push(vec![name.to_owned(), signal.unwrap_or_default()]);
    }
    page.table("", grid.captioned("The same commands in words."));
    if let Some(training) = &study.training {
        page.table("", list(study, training).captioned(format!(
            "Trees and committee learn from {} other commands, run for {} s each at a load of its own; of every command \
             there are {} healthy specimens, which run {} s. Of a pattern every range is filled evenly by the draws, \
             wide ones on a logarithmic scale. Each of their windows also teaches in copies that are perturbed within its \
             uncertainty or farther; half of the copies of a fault are weaker.",
            commands(training).len(),
            chosen(training.duration_s),
            training.healthy,
            chosen(study.duration_s),
        )));
    }
}

/// The names of the training commands.
fn commands(training: &Training) -> Vec<&str> {
    distinct(training.cases.iter().map(|case| case.command.as_str()))
}

/// Lists the training commands with a description. Draws of one pattern share a row.
fn list(study: &Study, training: &Training) -> Table {
    let mut grid = Table::headed(["command", "what it is", "load"]);
    let load = study.load_input();
    // The draws of all patterns come first, in their order.
    let mut cases: Vec<&Environment> = training.cases.iter().collect();
    for (count, pattern) in study.training_draws() {
        let own: Vec<&Environment> = cases.drain(..count.min(cases.len())).collect();
        let Some((first, last)) = own.first().zip(own.last()) else { continue };
        let names = match own.len() {
            1 => first.command.clone(),
            _ => format!("{} … {}", first.command, last.command),
        };
        grid.push(vec![names, in_words(pattern), loads(study, load, &own)]);
    }
    for case in cases {
        let signal = study.training_signal(&case.command);
        let words = signal.map(|signal| in_words(&signal.to_string())).unwrap_or_default();
        grid.push(vec![case.command.clone(), words, loads(study, load, &[case])]);
    }
    grid
}

/// The loads of cases, in the unit of the load input; empty if the study has no load.
fn loads(study: &Study, load: Option<usize>, cases: &[&Environment]) -> String {
    let Some(input) = load else { return String::new() };
    let read = Shown::of_input(study.system.network(), input);
    let value = |case: &&Environment| read.value(case.inputs[input].value(0.0));
    let least = cases.iter().map(value).fold(f64::INFINITY, f64::min);
    let most = cases.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
    let size = match three_digits(least) == three_digits(most) {
        true => three_digits(least),
        false => format!("{} … {}", three_digits(least), three_digits(most)),
    };
    match read.symbol() {
        "" | "1" => size,
        unit => format!("{size} {unit}"),
    }
}

/// A signal in readable form: `noise:rms={1.8..6}deg,seed=1{n}` → `noise: rms 1.8 … 6 deg`.
fn in_words(text: &str) -> String {
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
        let pattern = "noise:rms={1.8..6}deg,bandwidth={0.3..2.6}Hz,seed=10{n}";
        assert_eq!(in_words(pattern), "noise: rms 1.8 … 6 deg, bandwidth 0.3 … 2.6 Hz");
        assert_eq!(
            in_words("step:size=6deg + ramp:rate=1deg/s"),
            "step: size 6 deg; plus ramp: rate 1 deg/s"
        );
    }
}
