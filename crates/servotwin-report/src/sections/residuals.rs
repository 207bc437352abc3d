//! Residuals of example faults over time.

use crate::Material;
use crate::examples::Example;
use crate::words::{begun, chosen, spoken};
use servotwin::study::Study;
use servotwin_diagnosis::residual::BAND;
use servotwin_view::SemanticColor;
use servotwin_view::document::Document;
use servotwin_view::time_series::{Band, Panel, Series, TimeSeries};

/// The seconds of the time series that a figure shows.
const SHOWN_S: f64 = 10.0;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let words = material.words();
    for example in material.examples {
        page.heading(spoken(&example.detail));
        page.figure(
            format!("time_{}", example.detail),
            in_time(material.study, example),
            format!(
                "{}, intensity {}, case {}: {} of measured signals against the twin's, and the \
                     scaled residuals with {} in which a fault goes undetected.",
                begun(&spoken(&example.fault)),
                chosen(example.intensity),
                example.case,
                match material.study.duration_s > SHOWN_S {
                    true => format!("the first {SHOWN_S} s"),
                    false => "the course".into(),
                },
                words.fixed_band()
            ),
        );
    }
}

/// The scaled residual of a sensor.
fn residual(study: &Study, example: &Example, sensor: usize) -> Vec<f64> {
    let scale = study.scales()[sensor];
    let pairs = example.plant[sensor].iter().zip(&example.twin[sensor]);
    pairs.map(|(measured, twin)| (measured - twin) / scale).collect()
}

fn label(study: &Study, sensor: usize) -> &str {
    &study.system.sensors[study.measured[sensor]].label
}

/// The two sensors with the largest residuals, and these residuals over time.
fn in_time(study: &Study, example: &Example) -> servotwin_view::Figure {
    let count = ((SHOWN_S / study.sample_period_s) as usize + 1).min(example.twin[0].len());
    let time: Vec<f64> = (0..count).map(|k| k as f64 * study.sample_period_s).collect();
    let mut figure = TimeSeries::new("", "time (s)");
    let largest = |sensor: &usize| {
        residual(study, example, *sensor).iter().fold(0.0, |m: f64, r| m.max(r.abs()))
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
                Series::new("measured", time.clone(), shown(&example.plant[sensor]))
                    .looking(SemanticColor::Measured.look()),
            )
            .with(
                Series::new("twin", time.clone(), shown(&example.twin[sensor]))
                    .looking(SemanticColor::Twin.look()),
            );
        figure = figure.with(panel);
        let values = residual(study, example, sensor)[..count].to_vec();
        residuals = residuals.with(
            Series::new(label(study, sensor), time.clone(), values)
                .looking(SemanticColor::Plain(place).look()),
        );
    }
    residuals.band = Some(Band { name: "±3 %".into(), low: -BAND, high: BAND });
    figure.with(residuals).draw()
}
