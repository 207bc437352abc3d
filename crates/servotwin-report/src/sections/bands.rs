//! The bands of healthy residuals: learned for each sensor, compared with a fixed one of 3 %.

use crate::Material;
use crate::lines;
use crate::words::{NONE, chosen, rate, stacked};
use servotwin::job::results::SubjectResult;
use servotwin::learn::bands::{ALARMS, Band};
use servotwin::measure::{Rates, VISIBLE, VISIBLE_BY_CHANCE};
use servotwin::study::Study;
use servotwin_diagnosis::residual::BAND;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let results: Vec<(&SubjectResult, &[Band])> = lines::scenarios(material.results)
        .into_iter()
        .filter_map(|result| Some((result, lines::learned(result)?)))
        .collect();
    if results.is_empty() {
        return;
    }
    let words = &material.words();
    page.text(format!(
            "A fixed band lets every scaled residual stay within ±3 %{}, whatever the sensor. Where \
             sensors have noise and specimens tolerances, that is too narrow for some sensors and too \
             wide for others. Here each kind of sensor has a band of its own, learned from healthy \
             specimens on the training commands: as many standard deviations above the mean logarithm \
             of their largest residuals as leave {} % of these records outside of any band, the same \
             number for all sensors{}. What is promised is the \
             rate of false alarms of all sensors together, on commands like those of training. A fault \
             counts as detected where any residual leaves its band.",
            words.paper(", as the seed paper has it"),
            chosen(100.0 * ALARMS),
            match words.has_several() {
                true => format!("; like sensors of the {} are pooled", words.actuators()),
                false => String::new(),
            }
        ));
    for (result, _) in &results {
        if let Some(broken) = broken_promise(result) {
            page.text(format!("Scenario: {}. {broken}", result.title));
        }
    }
    let names: Vec<String> =
        results[0].1.iter().map(|band| label(material.study, &band.sensor)).collect();
    page.table(
        "",
        widths(&results, &names).captioned(
            "Half widths in percent of scale; below them how many of the \
            healthy training records (those of like sensors together) leave the band.",
        ),
    );
    page.table("", effect(&results).captioned("What the bands do: share of all faults that is detected, and share of \
            healthy specimens that alarm, on the judged operating cases, from which no band was learned."));
}

/// Reports that more healthy specimens leave the bands than promised, if the interval proves it.
fn broken_promise(result: &SubjectResult) -> Option<String> {
    lines::learned(result)?;
    let alarms = result.evaluation.in_band.counted(&VISIBLE_BY_CHANCE)?;
    let records = result.evaluation.bands.iter().flatten().map(|band| band.records).max()?;
    (alarms.low > ALARMS).then(|| {
        format!(
            "The bands do not keep their promise on the judged commands: {} of {} healthy specimens \
             leave them there, and {} % was promised. They were learned from few records (at most {records} \
             of a kind of sensor), or from commands unlike those judged: more healthy specimens ([training] \
             healthy) or training commands nearer to the judged ones are needed.",
            rate(Some(alarms)),
            alarms.of,
            chosen(100.0 * ALARMS)
        )
    })
}

/// The label of a sensor in the system file, or its name.
fn label(study: &Study, sensor: &str) -> String {
    let place = study.sensors.0.iter().position(|known| known.name == sensor);
    let known = place.and_then(|place| study.measured.get(place));
    known.map_or_else(|| sensor.to_owned(), |&place| study.system.sensors[place].label.clone())
}

fn widths(results: &[(&SubjectResult, &[Band])], names: &[String]) -> Table {
    let mut heads = vec!["sensor".to_owned(), "fixed".into()];
    heads.extend(results.iter().map(|(result, _)| result.title.clone()));
    let mut grid = Table::headed(heads);
    for (place, name) in names.iter().enumerate() {
        let mut row = vec![name.clone(), chosen(100.0 * BAND)];
        let width = |band: Option<&Band>| {
            band.map_or_else(
                || NONE.into(),
                |band| {
                    let width = 100.0 * band.half_width;
                    format!("{width:.2}\n{} of {}", band.exceeded, band.records)
                },
            )
        };
        row.extend(results.iter().map(|(_, bands)| width(bands.get(place))));
        grid.push(row);
    }
    grid
}

/// Detection and false alarms with both bands.
fn effect(results: &[(&SubjectResult, &[Band])]) -> Table {
    let mut grid =
        Table::headed(["scenario", "band", "faults detected", "healthy specimens that alarm"]);
    for (result, _) in results {
        let evaluation = &result.evaluation;
        let cells = |rates: &Rates| {
            [&VISIBLE, &VISIBLE_BY_CHANCE].map(|measure| stacked(rates.counted(measure)))
        };
        let row = |words: [&str; 2], rates: &Rates| {
            words.map(String::from).into_iter().chain(cells(rates)).collect::<Vec<_>>()
        };
        grid.push(row([&result.title, "fixed, ±3 %"], &evaluation.in_paper_band));
        grid.push_strong(row(["", "learned, in use"], &evaluation.in_band));
    }
    grid
}
