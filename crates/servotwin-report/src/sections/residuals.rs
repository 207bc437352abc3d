//! The distribution of residuals (figures 5 and 6 of the seed paper), and example faults over time.

use crate::Material;
use crate::examples::Example;
use crate::looks;
use crate::words::spoken;
use servotwin::study::Study;
use servotwin_diagnosis::residual::BAND;
use servotwin_view::SemanticColor;
use servotwin_view::document::Document;
use servotwin_view::histogram::{HistogramGrid, HistogramPanel};
use servotwin_view::time_series::{Band, Panel, Series, TimeSeries};

/// The seconds of the time series that a figure shows.
const SHOWN_S: f64 = 10.0;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let words = material.words();
    for example in material.examples.iter().filter(|example| !example.runs.is_empty()) {
        page.heading(spoken(&example.detail));
        page.figure(
            format!("residuals_{}", example.detail),
            histogram(material.study, example),
            format!(
                "Residuals of all sensors over {} s, {} in case {}{}.",
                material.study.duration_s,
                spoken(&example.fault),
                example.case,
                match words.has_several() {
                    true => format!(
                        " (of every {}: a fault of one may move another's)",
                        words.actuator()
                    ),
                    false => String::new(),
                }
            ),
        );
        page.figure(
            format!("time_{}", example.detail),
            in_time(material.study, example),
            format!(
                "{} of it: measured signals against the twin's, and the \
                     scaled residuals with {} in which a fault goes undetected.",
                match material.study.duration_s > SHOWN_S {
                    true => format!("The first {SHOWN_S} s"),
                    false => "The course".into(),
                },
                words.fixed_band()
            ),
        );
    }
}

/// The scaled residual of a sensor in a run.
fn residual(study: &Study, example: &Example, run: usize, sensor: usize) -> Vec<f64> {
    let scale = study.scales()[sensor];
    let pairs = example.runs[run].1[sensor].iter().zip(&example.twin[sensor]);
    pairs.map(|(measured, twin)| (measured - twin) / scale).collect()
}

fn label(study: &Study, sensor: usize) -> &str {
    &study.system.sensors[study.measured[sensor]].label
}

fn histogram(study: &Study, example: &Example) -> servotwin_view::Figure {
    let names: Vec<String> =
        example.runs.iter().map(|(intensity, _)| format!("intensity {intensity}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut grid = HistogramGrid::new("scaled residual", &names);
    grid.looks = looks::plain();
    grid.band = Some(BAND);
    for sensor in 0..study.base_sensors() {
        let of_run = |run| residual(study, example, run, sensor).into();
        let values = (0..example.runs.len()).map(of_run).collect();
        grid.panels.push(HistogramPanel::new(label(study, sensor), values));
    }
    grid.draw()
}

/// The two sensors with the largest residuals, and these residuals over time.
fn in_time(study: &Study, example: &Example) -> servotwin_view::Figure {
    let last = example.runs.len() - 1;
    let count = ((SHOWN_S / study.sample_period_s) as usize + 1).min(example.twin[0].len());
    let time: Vec<f64> = (0..count).map(|k| k as f64 * study.sample_period_s).collect();
    let mut figure = TimeSeries::new("", "time (s)");
    let largest = |sensor: &usize| {
        residual(study, example, last, *sensor).iter().fold(0.0, |m: f64, r| m.max(r.abs()))
    };
    let mut sensors: Vec<usize> = (0..study.base_sensors()).collect();
    sensors.sort_by(|a, b| largest(b).total_cmp(&largest(a)));
    sensors.truncate(2);
    let mut residuals = Panel::new("scaled residuals", "of scale");
    for (place, &sensor) in sensors.iter().enumerate() {
        let unit = study.system.sensors[study.measured[sensor]].unit;
        let shown = |signal: &[f64]| -> Vec<f64> {
            signal[..count].iter().map(|&value| unit.to_shown(value)).collect()
        };
        let panel = Panel::new(label(study, sensor), unit.shown())
            .with(
                Series::new("measured", time.clone(), shown(&example.runs[last].1[sensor]))
                    .looking(SemanticColor::Measured.look()),
            )
            .with(
                Series::new("twin", time.clone(), shown(&example.twin[sensor]))
                    .looking(SemanticColor::Twin.look()),
            );
        figure = figure.with(panel);
        let values = residual(study, example, last, sensor)[..count].to_vec();
        residuals = residuals.with(
            Series::new(label(study, sensor), time.clone(), values)
                .looking(SemanticColor::Plain(place).look()),
        );
    }
    residuals.band = Some(Band { name: "±3 %".into(), low: -BAND, high: BAND });
    figure.with(residuals).draw()
}
