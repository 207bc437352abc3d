//! Signals over time: a column of panels with a common horizontal axis.

use std::borrow::Cow;

use super::Figure;
use super::axis::{Axis, extent, padded};
use super::decimate::decimate;
use super::font;
use super::frame::{Frame, TICKS_BELOW, TITLE_BELOW, labels_width};
use super::legend::{self, LegendEntry, Swatch};
use super::style::{Look, look_or_nth};
use super::svg::{Anchor, Area, Canvas, Type};

/// A figure of panels above each other.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeSeries<'a> {
    /// The figure's title, may be empty.
    pub title: String,
    /// The title of the shared horizontal axis, with its unit.
    pub x_label: String,
    /// The panels, from top to bottom.
    pub panels: Vec<Panel<'a>>,
    /// Times marked in all panels.
    pub marks: Vec<Mark>,
}

/// A marked time: a vertical line through all panels, with its name in the first one.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// The time, in the unit of the horizontal axis.
    pub at: f64,
    /// The label of the mark.
    pub name: String,
}

/// One panel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Panel<'a> {
    /// The title, may be empty.
    pub title: String,
    /// The title of the vertical axis, with its unit.
    pub y_label: String,
    /// The signals.
    pub series: Vec<Series<'a>>,
    /// A shaded band behind them.
    pub band: Option<Band>,
}

/// One signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Series<'a> {
    /// The name in the legend.
    pub(crate) name: String,
    /// The times.
    pub(crate) x: Cow<'a, [f64]>,
    /// The values; non-finite ones make a gap.
    pub(crate) y: Cow<'a, [f64]>,
    /// The style; `None` for the default style of its index in the panel.
    pub(crate) look: Option<Look>,
}

/// A shaded band between two constant limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// The name in the legend.
    pub name: String,
    /// The lower limit.
    pub low: f64,
    /// The upper limit.
    pub high: f64,
}

impl<'a> Series<'a> {
    /// A signal from its name, times and values, borrowed or owned.
    pub fn new(
        name: impl Into<String>,
        x: impl Into<Cow<'a, [f64]>>,
        y: impl Into<Cow<'a, [f64]>>,
    ) -> Self {
        Self { name: name.into(), x: x.into(), y: y.into(), look: None }
    }

    /// Sets the style.
    pub fn looking(mut self, look: Look) -> Self {
        self.look = Some(look);
        self
    }
}

impl<'a> Panel<'a> {
    /// A panel without signals.
    pub fn new(title: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self { title: title.into(), y_label: y_label.into(), ..Self::default() }
    }

    /// Adds a signal.
    pub fn with(mut self, series: Series<'a>) -> Self {
        self.series.push(series);
        self
    }

    fn y_axis(&self) -> Axis {
        let band = self.band.iter().flat_map(|band| [band.low, band.high]);
        let values = self.series.iter().flat_map(|series| series.y.iter().copied());
        Axis::linear(padded(extent(values.chain(band)).unwrap_or((0.0, 1.0)), 0.05), 5)
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let series = self.series.iter().enumerate();
        let line = |(index, series): (usize, &Series)| LegendEntry {
            name: series.name.clone(),
            swatch: Swatch::Line(look_or_nth(series.look, index)),
        };
        let band = self
            .band
            .iter()
            .map(|band| LegendEntry { name: band.name.clone(), swatch: Swatch::Band });
        series.map(line).chain(band).filter(|entry| !entry.name.is_empty()).collect()
    }
}

/// The figure's width, px.
const WIDTH: f64 = 760.0;
/// The height of each panel's plotting area, px.
const PANEL_HEIGHT: f64 = 110.0;
const TITLE_SIZE: f64 = 13.0;
const PANEL_TITLE_SIZE: f64 = 11.0;
const MARK_SIZE: f64 = 9.5;
const MARGIN: f64 = 10.0;

impl<'a> TimeSeries<'a> {
    /// A figure without panels.
    pub fn new(title: impl Into<String>, x_label: impl Into<String>) -> Self {
        Self { title: title.into(), x_label: x_label.into(), panels: Vec::new(), marks: Vec::new() }
    }

    /// Adds a panel below the others.
    pub fn with(mut self, panel: Panel<'a>) -> Self {
        self.panels.push(panel);
        self
    }

    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let x_axis = self.x_axis();
        let y_axes: Vec<Axis> = self.panels.iter().map(Panel::y_axis).collect();
        let labels = y_axes.iter().map(labels_width).fold(0.0, f64::max);
        let left = MARGIN + 14.0 + labels;
        let width = WIDTH - left - 1.5 * MARGIN;
        let mut y = MARGIN;
        if !self.title.is_empty() {
            canvas.text((left, y + 12.0), &self.title, Type::new(TITLE_SIZE).bold());
            y += 22.0;
        }
        let last = self.panels.len().saturating_sub(1);
        for (place, (panel, y_axis)) in self.panels.iter().zip(y_axes).enumerate() {
            y += draw_header(&mut canvas, panel, (left, y), width);
            let area = Area { x: left, y, width, height: PANEL_HEIGHT };
            let frame = Frame { area, x: x_axis.clone(), y: y_axis };
            draw_panel(&mut canvas, panel, &frame);
            self.draw_marks(&mut canvas, &frame, place == 0);
            frame.draw_y_labels(&mut canvas, &panel.y_label, MARGIN + 9.0);
            if place == last {
                frame.draw_x_labels(&mut canvas, &self.x_label);
            }
            y += PANEL_HEIGHT + if place == last { TITLE_BELOW } else { TICKS_BELOW - 8.0 };
        }
        canvas.finish(WIDTH, y + MARGIN / 2.0, &self.title)
    }

    /// Draws the lines of all marks, with their names below each other, so that close marks do not overlap.
    fn draw_marks(&self, canvas: &mut Canvas, frame: &Frame, is_named: bool) {
        let area = frame.area;
        for (place, mark) in self.marks.iter().enumerate() {
            let Some(x) = frame.x_at(mark.at) else { continue };
            let style = " stroke=\"#888888\" stroke-width=\"1\" stroke-dasharray=\"3 3\"";
            canvas.line((x, area.y), (x, area.bottom()), style);
            if !is_named {
                continue;
            }
            let is_right = x + font::width(&mark.name, MARK_SIZE, false) + 8.0 < area.right();
            let (side, anchor) = if is_right { (4.0, Anchor::Start) } else { (-4.0, Anchor::End) };
            let y = area.y + (MARK_SIZE + 2.0) * (place as f64 + 1.0);
            canvas.text((x + side, y), &mark.name, Type::new(MARK_SIZE).anchor(anchor).rim());
        }
    }

    fn x_axis(&self) -> Axis {
        let series = self.panels.iter().flat_map(|panel| &panel.series);
        let times = series.flat_map(|series| series.x.iter().copied());
        Axis::linear(extent(times).unwrap_or((0.0, 1.0)), 10).reaching_ticks()
    }
}

/// Draws title and legend on one line, or the legend below. Returns the height.
fn draw_header(canvas: &mut Canvas, panel: &Panel, (x, y): (f64, f64), width: f64) -> f64 {
    let title = font::fit(&panel.title, width / 1.12, PANEL_TITLE_SIZE);
    canvas.text((x, y + 11.0), &title, Type::new(PANEL_TITLE_SIZE).bold());
    let title_width = font::width(&title, PANEL_TITLE_SIZE, true) + 16.0;
    let entries = panel.legend();
    let beside = legend::rows(&entries, (width - title_width).max(60.0));
    match beside.as_slice() {
        [] => 16.0,
        [row] if title_width + legend::row_width(row) <= width => {
            legend::draw(canvas, (x + width - legend::row_width(row), y), &beside);
            legend::ROW + 3.0
        }
        _ => {
            let top = if title.is_empty() { 0.0 } else { 15.0 };
            let below = legend::rows(&entries, width);
            legend::draw(canvas, (x, y + top), &below);
            top + legend::ROW * below.len() as f64 + 3.0
        }
    }
}

fn draw_panel(canvas: &mut Canvas, panel: &Panel, frame: &Frame) {
    frame.draw_grid(canvas);
    canvas.clipped(frame.area, |canvas| {
        if let Some(band) = &panel.band {
            draw_band(canvas, band, frame);
        }
        for (index, series) in panel.series.iter().enumerate() {
            draw_series(canvas, series, look_or_nth(series.look, index), frame);
        }
    });
    frame.draw_outline(canvas);
}

fn draw_band(canvas: &mut Canvas, band: &Band, frame: &Frame) {
    let (left, right) = (frame.x.low, frame.x.high);
    let corners = [(left, band.low), (right, band.low), (right, band.high), (left, band.high)];
    let corners = corners.into_iter().filter_map(|(x, y)| frame.point(x, y));
    let style = " fill=\"#888888\" fill-opacity=\".2\"";
    canvas.polygon(&corners.collect::<Vec<_>>(), style);
}

fn draw_series(canvas: &mut Canvas, series: &Series, look: Look, frame: &Frame) {
    let style = format!(
        " stroke=\"{}\" stroke-width=\"1.4\" stroke-linejoin=\"round\"{}",
        look.colour,
        look.dash()
    );
    let kept = decimate(&series.x, &series.y, frame.area.width as usize);
    let points = kept.into_iter().map(|index| frame.point(series.x[index], series.y[index]));
    for run in runs(points) {
        match run.as_slice() {
            [only] => canvas.circle(*only, 1.2, &format!(" fill=\"{}\"", look.colour)),
            run => canvas.path(run, &style),
        }
    }
}

/// Splits points at gaps.
pub(super) fn runs(points: impl Iterator<Item = Option<(f64, f64)>>) -> Vec<Vec<(f64, f64)>> {
    let mut runs = vec![Vec::new()];
    for point in points {
        match (point, runs.last_mut()) {
            (Some(point), Some(run)) => run.push(point),
            _ => runs.push(Vec::new()),
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}
