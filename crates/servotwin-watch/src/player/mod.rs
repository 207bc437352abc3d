//! What was shown of a watch or a flight, as one HTML file without network: its signals over time, and what happened.
//!
//! The live page draws with the same script. Memory and file size do not grow with the length of the record. Every
//! signal is stored as minimum and maximum over at most `BUCKETS` equal parts of time; when these are full, neighbors
//! are merged. No peak is lost, and a short record is stored completely. The content security policy of the file allows
//! no request and no script but its own.

mod series;

use askama::Template;
use serde::Serialize;
use serde_json::{Value, json};
use series::Series;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_io::moment;
use servotwin_io::text::base64;
use sha2::{Digest, Sha256};

/// The library that draws the charts.
pub const CHARTS_SCRIPT: &str = include_str!("../../page/uplot.js");
/// The styles of the charts.
pub const CHARTS_STYLE: &str = include_str!("../../page/uplot.css");
/// The script that draws signals over time.
pub const PLAYER_SCRIPT: &str = include_str!("../../page/player.js");
/// The styles of a page with such charts.
pub const PLAYER_STYLE: &str = include_str!("../../page/player.css");
/// Charts of a record are finer than a screen, so that a print is sharp.
const FINE: &str = "window.devicePixelRatio = Math.max(2, devicePixelRatio);";
/// Begins the page of a record.
const START: &str = "const player = showRecord(JSON.parse($(\"record\").textContent));";

/// The most buckets that are kept.
const BUCKETS: usize = 8192;
/// The most stretches between restarts that are kept.
const STRETCHES: usize = 1000;
/// The most events that are kept.
const EVENTS: usize = 5000;

/// The charts in which a signal is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SignalGroup {
    /// Command, what follows it, and the same without a diagnosis.
    Motion,
    /// The force fight, with and without a diagnosis.
    Fight,
    /// Another input of the system.
    Input,
    /// A sensor reading.
    Reading,
    /// The twin's value of a reading with the same label.
    Twin,
    /// A residual, in percent of its sensor's scale, and of its spread if that grows.
    Residual,
    /// The evidence for an action of an actuator, in parts of the limit to raise it.
    Evidence,
    /// The fluid left in a reservoir.
    Fluid,
    /// Whether an actuator is on.
    Mode,
}

/// A signal of a record or of the live page.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlayerSignal {
    /// The id, unique in a frame.
    pub id: String,
    /// The name to be shown.
    pub label: String,
    /// The unit of the values.
    pub unit: String,
    /// The charts that show it.
    pub group: SignalGroup,
    /// The index of the actuator; `None` if it belongs to none.
    pub actuator: Option<usize>,
    /// Half the width of the band, in the signal's unit.
    pub band: Option<f64>,
}

impl PlayerSignal {
    /// A signal of no actuator and without a band.
    pub fn new(id: &str, label: &str, unit: &str, group: SignalGroup) -> Self {
        let (id, label, unit) = (id.into(), label.into(), unit.into());
        PlayerSignal { id, label, unit, group, actuator: None, band: None }
    }

    /// The residual of a sensor, in percent of what a diagnoser divides it by, with its band if the diagnoser reads it.
    pub fn residual(id: &str, label: &str, diagnoser: &Diagnoser, sensor: &str) -> Self {
        let mut judged = diagnoser.sensors.iter().zip(&diagnoser.lengths[0].panel.bands);
        let own = judged.find(|(judged, _)| judged.name == sensor);
        let divisor = own.map_or("scale", |(judged, _)| judged.residual_divisor());
        let band = own.map(|(_, band)| 100.0 * band.half_width).filter(|band| band.is_finite());
        let unit = format!("% of {divisor}");
        PlayerSignal { band, ..PlayerSignal::new(id, label, &unit, SignalGroup::Residual) }
    }
}

/// Receives what a watch shows.
pub trait Screen {
    /// A sample follows, which was taken at a time, s.
    fn begin(&mut self, time_s: f64);

    /// The time of the sample, s, from the beginning without its gaps.
    fn now_s(&self) -> f64;

    /// Receives what happened.
    fn event(&mut self, event: Value);

    /// Receives the value of each signal, in its unit; what is not finite is a gap.
    fn sample(&mut self, values: impl IntoIterator<Item = f64>);
}

/// An event: its time, s, its kind, and what there is to say of it.
pub fn event(time_s: f64, kind: &str, about: Value) -> Value {
    let mut event = json!({ "time_s": time_s, "kind": kind });
    if let (Some(event), Value::Object(about)) = (event.as_object_mut(), about) {
        event.extend(about);
    }
    event
}

/// The file; the template escapes every text.
#[derive(Template)]
#[template(path = "player.html")]
struct Page<'p> {
    title: &'p str,
    verdict: &'p str,
    summary: String,
    report: &'p str,
    left_out: usize,
    /// The record as JSON.
    data: String,
    scripts: [&'static str; 4],
}

/// Gathers the data of the file.
#[derive(Debug)]
pub struct PlayerRecord {
    title: String,
    period_s: f64,
    signals: Vec<PlayerSignal>,
    series: Vec<Series>,
    /// Samples per bucket.
    width: usize,
    samples: usize,
    /// The first sample of each stretch between restarts, with its time, s.
    stretches: Vec<(usize, f64)>,
    last_s: f64,
    events: Vec<Value>,
    /// How many later events are not kept.
    left_out: usize,
}

impl PlayerRecord {
    /// An empty record of signals with a sampling period, s.
    pub fn new(title: &str, period_s: f64, signals: Vec<PlayerSignal>) -> Self {
        PlayerRecord {
            title: title.into(),
            period_s,
            series: vec![Series::default(); signals.len()],
            signals,
            width: 1,
            samples: 0,
            stretches: vec![],
            last_s: f64::NAN,
            events: vec![],
            left_out: 0,
        }
    }

    /// The file, with a verdict on top and, below the charts, a report as lines of text.
    ///
    /// # Panics
    /// Never: the template renders texts alone.
    pub fn page(&self, verdict: &str, report: &str) -> String {
        let page = Page {
            title: &self.title,
            verdict,
            summary: self.summary(),
            report,
            left_out: self.left_out,
            // A text in JSON must not end the script element.
            data: self.data().to_string().replace('<', "\\u003c"),
            scripts: [FINE, CHARTS_SCRIPT, PLAYER_SCRIPT, START],
        };
        page.render().expect("texts are rendered")
    }

    fn summary(&self) -> String {
        let Some((_, begin_s)) = self.stretches.first() else {
            return "No sample has come.".into();
        };
        let resolution = match self.width {
            1 => "Every sample is kept.".to_owned(),
            width => format!(
                "Curves keep the least and the greatest value of every {:.3} s.",
                width as f64 * self.period_s
            ),
        };
        format!(
            "{} samples with a period of {} s, from {} to {}. {resolution} Drag to zoom, double-click to see everything.",
            self.samples,
            self.period_s,
            moment::shown(*begin_s),
            moment::shown(self.last_s)
        )
    }

    fn data(&self) -> Value {
        let signal = |(signal, series): (&PlayerSignal, &Series)| {
            let mut all = json!(signal);
            series.add_to(&mut all);
            all
        };
        let stretch =
            |(sample, time_s): &(usize, f64)| json!([*sample as f64 * self.period_s, time_s]);
        json!({
            "count": self.samples.div_ceil(self.width),
            "bucket_s": self.width as f64 * self.period_s,
            "stretches": self.stretches.iter().map(stretch).collect::<Vec<_>>(),
            "signals": self.signals.iter().zip(&self.series).map(signal).collect::<Vec<_>>(),
            "events": self.events,
        })
    }
}

impl Screen for PlayerRecord {
    fn begin(&mut self, time_s: f64) {
        let follows = (time_s - self.last_s - self.period_s).abs() < 0.5 * self.period_s;
        if !follows && self.stretches.len() < STRETCHES {
            self.stretches.push((self.samples, time_s));
        }
        self.last_s = time_s;
    }

    fn now_s(&self) -> f64 {
        self.samples as f64 * self.period_s
    }

    fn event(&mut self, event: Value) {
        if self.events.len() < EVENTS {
            self.events.push(event);
        } else {
            self.left_out += 1;
        }
    }

    fn sample(&mut self, values: impl IntoIterator<Item = f64>) {
        let begins = self.samples.is_multiple_of(self.width);
        if begins && self.samples / self.width == BUCKETS {
            self.series.iter_mut().for_each(Series::halve);
            self.width *= 2;
        }
        for (series, value) in self.series.iter_mut().zip(values) {
            series.push(value, begins);
        }
        self.samples += 1;
    }
}
