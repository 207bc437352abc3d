//! The commands on which the diagnosis is evaluated (figure 7 of the seed paper).

use super::commands_curve::in_words;
use crate::Material;
use crate::page::{Alignment, HtmlTable, Page};
use servotwin::shown::Shown;
use servotwin_plot::SemanticColor;
use servotwin_plot::time_series::{Panel, Series, TimeSeries};

/// The seconds that a figure shows. A whole run would look like a solid band.
const SHOWN_S: f64 = 30.0;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
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
        &format!(
            "The commands on which the diagnosis is judged, {shown}{}. Operating cases: {}.",
            material.words().paper(" (figure 7 of the seed paper)"),
            study.cases.iter().map(|case| case.name.as_str()).collect::<Vec<_>>().join(", "),
        ),
    );
    let mut grid = HtmlTable::new([("command", Alignment::Left), ("what it is", Alignment::Left)]);
    let text: toml::Table = study.text.parse().unwrap_or_default();
    let signals = text.get("command").and_then(|section| section.get("signals"));
    for name in known {
        let signal = signals.and_then(|signals| signals.get(name));
        grid.push(vec![name.to_owned(), signal.map(in_words).unwrap_or_default()]);
    }
    page.table(&grid, "The same commands in words.");
}
