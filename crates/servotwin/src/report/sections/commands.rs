//! The commands that are flown (figure 7 of the seed paper).

use crate::figure::time_series::{Panel, Series, TimeSeries};
use crate::report::page::Page;
use crate::report::{Material, Section};

/// See the module.
pub struct Commands;

/// Seconds that a figure shows: the whole run would be a black band.
const SHOWN_S: f64 = 30.0;

impl Section for Commands {
    fn id(&self) -> &'static str {
        "commands"
    }

    fn title(&self) -> &'static str {
        "Commands"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let study = material.study;
        let unit = study.system.network().inputs[study.command_input].unit;
        let end = study.duration_s.min(SHOWN_S);
        let count = (end / study.sample_period_s) as usize;
        let time: Vec<f64> = (0..=count).map(|k| k as f64 * study.sample_period_s).collect();
        let mut figure = TimeSeries::new("", "time (s)");
        let mut known: Vec<&str> = vec![];
        for case in &study.cases {
            let name = case.name.split('/').next().unwrap_or(&case.name);
            if known.contains(&name) {
                continue;
            }
            known.push(name);
            let signal = &case.inputs[study.command_input];
            let values: Vec<f64> = time.iter().map(|&t| unit.to_shown(signal.value(t))).collect();
            let panel = Panel::new(name, unit.shown());
            figure = figure.with(panel.with(Series::new("", time.clone(), values)));
        }
        page.figure("commands", figure.draw(), &format!(
            "The commands of {} runs, the first {end} s of {} s: noise of different amplitude and \
             spectrum (figure 7 of the seed paper). Operating cases: {}.",
            known.len(),
            study.duration_s,
            study.cases.iter().map(|case| case.name.as_str()).collect::<Vec<_>>().join(", "),
        ));
    }
}
