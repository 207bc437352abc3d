//! The watch as one HTML file for zooming and hovering: states, commands, residuals with bands, measurements, twin and
//! features. It needs no network: uPlot, which draws the charts, is in the file.
//!
//! Memory and file size do not grow with the length of the watch. Every signal is stored as minimum and maximum over at
//! most `BUCKETS` equal parts of time; when these are full, neighbors are merged. No peak is lost, and a short watch
//! is stored completely.

mod series;

use super::{Sample, Scene, Sink, SinkError, Trace};
use crate::counts::WatchCounts;
use crate::watchdog::Notice;
use serde_json::{Value, json};
use series::Series;
use servotwin::observer::{DiagnosisState, Finding};
use servotwin_io::files;
use servotwin_io::moment;
use servotwin_io::text::{escaped, spoken};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

/// The most buckets that are kept.
const BUCKETS: usize = 8192;

/// The most changes of the finding, restarts and band changes that are kept.
const CHANGES: usize = 1000;

/// The library that draws the charts.
pub const CHARTS_SCRIPT: &str = include_str!("../../../page/uplot.js");
/// The styles of the charts.
pub const CHARTS_STYLE: &str = include_str!("../../../page/uplot.css");

const STYLE: &str = include_str!("timeline.css");
/// Charts are finer than a screen, so that a print is sharp.
const FINE: &str = "window.devicePixelRatio = Math.max(2, devicePixelRatio);";
const SCRIPT: &str = include_str!("timeline.js");

/// Gathers the data of the file.
#[derive(Debug)]
pub struct Timeline {
    scene: Scene,
    inputs: Vec<Series>,
    measured: Vec<Series>,
    twin: Vec<Series>,
    residuals: Vec<Series>,
    features: Vec<Series>,
    /// Samples per bucket.
    width: usize,
    samples: usize,
    /// The first sample of each stretch between restarts, with its time.
    stretches: Vec<(usize, f64)>,
    last_s: f64,
    changes: Vec<(usize, f64, Finding)>,
    left_out: usize,
    /// The notices of the watchdog, each with the time of the last sample, s.
    notices: Vec<(f64, String)>,
    /// The half widths of the bands; empty before the first sample.
    bands: Vec<f64>,
}

impl Timeline {
    /// Creates an empty timeline.
    pub fn new(scene: Scene) -> Self {
        let empty = |count: usize| vec![Series::default(); count];
        let sensors = scene.sensors.len();
        Timeline {
            inputs: empty(scene.inputs.len()),
            measured: empty(sensors),
            twin: empty(sensors),
            residuals: empty(sensors),
            features: empty(scene.features.len()),
            scene,
            width: 1,
            samples: 0,
            stretches: vec![],
            last_s: f64::NAN,
            changes: vec![],
            left_out: 0,
            notices: vec![],
            bands: vec![],
        }
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, path: &Path, counts: &WatchCounts) -> Result<(), SinkError> {
        let html = self.html(counts);
        Ok(files::write_atomically(path, |out| out.write_all(html.as_bytes()))?)
    }

    /// The HTML text.
    pub fn html(&self, counts: &WatchCounts) -> String {
        let title = escaped(&self.scene.title);
        let mut html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>\n{CHARTS_STYLE}\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
             <h1>{title}</h1>\n<p class=\"note\">{}</p>\n\
             <div id=\"tools\"></div>\n<div id=\"panels\" tabindex=\"0\"></div>\n\
             <noscript><p>The curves need JavaScript; the tables below do not.</p></noscript>\n",
            escaped(&self.summary())
        );
        self.decisions(&mut html);
        self.stream(&mut html, counts);
        // A text in JSON must not end the script element.
        let data = self.data().to_string().replace('<', "\\u003c");
        let _ = write!(
            html,
            "<script type=\"application/json\" id=\"data\">{data}</script>\n\
             <script>\n{FINE}\n{CHARTS_SCRIPT}</script>\n<script>\n{SCRIPT}</script>\n</main>\n</body>\n</html>\n"
        );
        html
    }

    fn summary(&self) -> String {
        let period_s = self.scene.period_s;
        let Some((_, begin_s)) = self.stretches.first() else {
            return "No sample has come.".into();
        };
        let resolution = match self.width {
            1 => "Every sample is kept.".to_owned(),
            width => format!(
                "Curves keep the least and the greatest value of every {:.3} s.",
                width as f64 * period_s
            ),
        };
        format!(
            "{} samples with a period of {period_s} s, from {} to {}. {resolution}",
            self.samples,
            moment::shown(*begin_s),
            moment::shown(self.last_s)
        )
    }

    fn decisions(&self, html: &mut String) {
        // A study with a single actuator may leave it unnamed.
        let has_units = self.changes.iter().any(|(_, _, f)| !f.unit_in_words().is_empty());
        let head = if has_units { "<th>Unit</th>" } else { "" };
        let _ = write!(
            html,
            "<h2>Decisions</h2>\n<div class=\"sheet\"><table id=\"changes\">\n<thead><tr>\
             <th>Time</th><th>State</th>{head}<th>Command</th><th>Detail</th>\
             <th>Confidence</th><th>Evidence</th></tr></thead>\n<tbody>\n"
        );
        for (sample, time_s, finding) in &self.changes {
            let state = finding.state_in_words();
            let sure = match finding.confidence {
                sure if sure > 0.0 => format!("{:.1} %", 100.0 * sure),
                _ => String::new(),
            };
            let unit = match has_units {
                true => format!("<td>{}</td>", escaped(&finding.unit_in_words())),
                false => String::new(),
            };
            let evidence: Vec<String> = finding.evidence.iter().map(|e| escaped(e)).collect();
            let at = *sample as f64 * self.scene.period_s;
            let time = moment::shown(*time_s);
            let _ = writeln!(
                html,
                "<tr data-at=\"{at}\"><td class=\"number\">{time}</td>\
                 <td><i class=\"{}\"></i>{}</td>{unit}<td>{}</td><td>{}</td>\
                 <td class=\"number\">{sure}</td><td>{}</td></tr>",
                class_of(finding.state),
                escaped(&state),
                escaped(&spoken(&finding.command)),
                escaped(&spoken(&finding.detail)),
                evidence.join("<br>")
            );
        }
        *html += "</tbody></table></div>\n";
        if self.left_out > 0 {
            let _ = writeln!(html, "<p>and {} changes more.</p>", self.left_out);
        }
    }

    fn stream(&self, html: &mut String, counts: &WatchCounts) {
        let _ = write!(
            html,
            "<h2>The stream</h2>\n<p>{} {}s became {} samples.</p>\n",
            counts.frames, counts.counted, counts.samples
        );
        let signals = self.scene.inputs.iter().chain(&self.scene.sensors).zip(&counts.missing);
        let missing: Vec<String> = signals
            .filter(|(_, count)| **count > 0)
            .map(|(trace, count)| format!("{} in {count}", trace.label))
            .collect();
        if !missing.is_empty() {
            let text = escaped(&missing.join(", "));
            let _ = writeln!(html, "<p>Samples without a value: {text}.</p>");
        }
        for (time_s, words) in &self.notices {
            let _ = writeln!(html, "<p>After {time_s:.2} s: {}.</p>", escaped(words));
        }
        if counts.met().next().is_none() {
            return;
        }
        *html += "<div class=\"sheet\"><table>\n<thead><tr><th>What was met</th><th>How often</th>\
            <th>First</th></tr></thead>\n<tbody>\n";
        for (kind, tally) in counts.met() {
            let (words, place) = (escaped(kind.words().1), escaped(&counts.place(tally)));
            let count = tally.count;
            let _ = writeln!(
                html,
                "<tr><td>{words}</td><td class=\"number\">{count}</td><td>{place}</td></tr>"
            );
        }
        *html += "</tbody></table></div>\n";
    }

    fn data(&self) -> Value {
        let all = |traces: &[Trace], series: &[Series]| -> Vec<Value> {
            let pairs = traces.iter().zip(series);
            pairs.map(|(trace, series)| series.json(&trace.label, trace.shown.symbol())).collect()
        };
        let residuals = self.scene.sensors.iter().zip(&self.scene.residual_divisors);
        let residuals = residuals.zip(&self.residuals).map(|((trace, divisor), series)| {
            series.json(&trace.label, &format!("% of {divisor}"))
        });
        let features = self.scene.features.iter().zip(&self.features);
        let features = features.map(|(name, series)| series.json(name, ""));
        let change = |(sample, time_s, finding): &(usize, f64, Finding)| {
            json!({
                "at": *sample as f64 * self.scene.period_s,
                "time": time_s,
                "class": class_of(finding.state),
                "words": finding.words(),
                "state": finding.state_in_words(),
            })
        };
        let met =
            |state: &DiagnosisState| self.changes.iter().any(|(_, _, found)| found.state == *state);
        let legend = DiagnosisState::ALL.into_iter().filter(met);
        let percent = |band: &f64| band.is_finite().then_some(100.0 * band);
        let at = |sample: &usize| *sample as f64 * self.scene.period_s;
        json!({
            "count": self.samples.div_ceil(self.width),
            "bucket": self.width as f64 * self.scene.period_s,
            "length": self.samples as f64 * self.scene.period_s,
            "stretches": self.stretches.iter().map(|(s, t)| json!([at(s), t])).collect::<Vec<_>>(),
            "legend": legend.map(|state| [class_of(state), state.words()]).collect::<Vec<_>>(),
            "changes": self.changes.iter().map(change).collect::<Vec<_>>(),
            "bands": self.bands.iter().map(percent).collect::<Vec<_>>(),
            "inputs": all(&self.scene.inputs, &self.inputs),
            "residuals": residuals.collect::<Vec<_>>(),
            "measured": all(&self.scene.sensors, &self.measured),
            "twin": all(&self.scene.sensors, &self.twin),
            "features": features.collect::<Vec<_>>(),
        })
    }

    fn all_series(&mut self) -> impl Iterator<Item = &mut Series> {
        let lists = [
            &mut self.inputs,
            &mut self.measured,
            &mut self.twin,
            &mut self.residuals,
            &mut self.features,
        ];
        lists.into_iter().flatten()
    }
}

impl Sink for Timeline {
    fn sample(&mut self, sample: &Arc<Sample>) -> Result<(), SinkError> {
        let period_s = self.scene.period_s;
        let follows = (sample.time_s - self.last_s - period_s).abs() < 0.5 * period_s;
        if !follows && self.stretches.len() < CHANGES {
            self.stretches.push((self.samples, sample.time_s));
        }
        self.last_s = sample.time_s;
        let begins = self.samples.is_multiple_of(self.width);
        if begins && self.samples / self.width == BUCKETS {
            self.all_series().for_each(Series::halve);
            self.width *= 2;
        }
        let shown = |series: &mut [Series], traces: &[Trace], values: &[f64]| {
            for ((series, trace), &value) in series.iter_mut().zip(traces).zip(values) {
                series.push(trace.shown.value(value), begins);
            }
        };
        let (inputs, sensors) = (&self.scene.inputs, &self.scene.sensors);
        shown(&mut self.inputs, inputs, &sample.inputs);
        shown(&mut self.measured, sensors, &sample.measured);
        shown(&mut self.twin, sensors, &sample.twin);
        for (series, &residual) in self.residuals.iter_mut().zip(&sample.residuals) {
            series.push(100.0 * residual, begins);
        }
        for (series, &feature) in self.features.iter_mut().zip(&sample.features) {
            series.push(feature, begins);
        }
        if self.bands.is_empty() {
            self.bands.clone_from(&sample.bands);
        }
        match sample.changed {
            true if self.changes.len() < CHANGES => {
                let change = (self.samples, sample.time_s, sample.finding.clone());
                self.changes.push(change);
            }
            true => self.left_out += 1,
            false => {}
        }
        self.samples += 1;
        Ok(())
    }

    fn notice(&mut self, notice: &Notice) -> Result<(), SinkError> {
        let words = notice.words().filter(|_| self.notices.len() < CHANGES);
        self.notices.extend(words.map(|words| (notice.time_s.unwrap_or(0.0), words)));
        Ok(())
    }
}

/// The CSS class that gives a state its color.
fn class_of(state: DiagnosisState) -> &'static str {
    match state {
        DiagnosisState::NoData => "nodata",
        DiagnosisState::Healthy => "healthy",
        DiagnosisState::Undecided => "undecided",
        DiagnosisState::Detected => "detected",
        DiagnosisState::Isolated => "isolated",
        DiagnosisState::Unknown => "unknown",
        DiagnosisState::EnvironmentInvalid => "environment",
    }
}
