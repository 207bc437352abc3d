//! Grids of small histograms: the distribution of residuals, sensor by sensor.
//!
//! A bar's height is the share of all finite values of its series (relative frequency). Several series are overlaid as
//! outlines with a light fill. Dashed lines mark the limits of a band, such as the ±3 % of the scaled residuals.

use std::borrow::Cow;

use super::Figure;
use super::axis::{Axis, extent, padded};
use super::font;
use super::frame::{Frame, TICKS_BELOW, labels_width};
use super::legend::{self, LegendEntry, Swatch};
use super::style::{GREY, Look, look};
use super::svg::{Anchor, Area, Canvas, Type};

/// A grid of histograms, filled row by row; each has its own range, from its data and the band.
#[derive(Debug, Clone, PartialEq)]
pub struct HistogramGrid<'a> {
    /// The title of every horizontal axis, with its unit.
    pub(crate) x_label: String,
    /// The names of the overlaid series, the same in every panel.
    pub(crate) series: Vec<String>,
    /// Styles of the series; the others get the default style of their index.
    pub looks: Vec<Look>,
    /// The panels.
    pub panels: Vec<HistogramPanel<'a>>,
    /// Dashed lines at plus and minus this value.
    pub band: Option<f64>,
}

/// One histogram.
#[derive(Debug, Clone, PartialEq)]
pub struct HistogramPanel<'a> {
    /// The title.
    pub(crate) title: String,
    /// The values of each series.
    pub(crate) values: Vec<Cow<'a, [f64]>>,
}

impl<'a> HistogramPanel<'a> {
    /// A panel from its title and the values of its series.
    pub fn new(title: impl Into<String>, values: Vec<Cow<'a, [f64]>>) -> Self {
        Self { title: title.into(), values }
    }
}

/// The most panels in a row.
const COLUMNS: usize = 4;
/// The number of bins.
const BINS: usize = 41;
/// The figure's width, px.
const WIDTH: f64 = 860.0;
const MARGIN: f64 = 10.0;
const PANEL_HEIGHT: f64 = 92.0;
const HEADER: f64 = 17.0;

impl<'a> HistogramGrid<'a> {
    /// A grid without panels and without a band.
    pub fn new(x_label: impl Into<String>, series: &[&str]) -> Self {
        Self {
            x_label: x_label.into(),
            series: series.iter().map(|name| (*name).to_owned()).collect(),
            looks: Vec::new(),
            panels: Vec::new(),
            band: None,
        }
    }

    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let columns = COLUMNS.clamp(1, self.panels.len().max(1));
        let mut top = self.draw_header(&mut canvas);
        let cell = (WIDTH - 2.0 * MARGIN) / columns as f64;
        for row in self.panels.chunks(columns) {
            for (place, panel) in row.iter().enumerate() {
                let corner = (MARGIN + cell * place as f64, top);
                self.draw_panel(&mut canvas, panel, corner, cell);
            }
            top += HEADER + PANEL_HEIGHT + TICKS_BELOW + 8.0;
        }
        let kind = Type::new(11.0).anchor(Anchor::Middle);
        canvas.text((WIDTH / 2.0, top + 8.0), &self.x_label, kind);
        canvas.finish(WIDTH, top + 8.0 + MARGIN, "")
    }

    fn draw_header(&self, canvas: &mut Canvas) -> f64 {
        let series = self.series.iter().enumerate();
        let boxes = series.map(|(index, name)| LegendEntry {
            name: name.clone(),
            swatch: Swatch::Tinted(look(&self.looks, index)),
        });
        let limit =
            self.band.map(|band| LegendEntry { name: format!("±{band}"), swatch: Swatch::Limit });
        let entries: Vec<LegendEntry> = boxes.chain(limit).collect();
        let rows = legend::rows(&entries, WIDTH - 2.0 * MARGIN);
        legend::draw(canvas, (MARGIN, MARGIN), &rows);
        MARGIN + legend::ROW * rows.len() as f64 + 6.0
    }

    fn draw_panel(
        &self,
        canvas: &mut Canvas,
        panel: &HistogramPanel,
        (x, y): (f64, f64),
        width: f64,
    ) {
        let range = self.range_of(panel);
        let shares: Vec<Vec<f64>> =
            panel.values.iter().map(|values| shares(values, range)).collect();
        let tallest = shares.iter().flatten().copied().fold(0.0, f64::max);
        let y_axis = percent_axis(if tallest > 0.0 { tallest * 1.08 } else { 1.0 });
        let left = labels_width(&y_axis) + 2.0;
        let area =
            Area { x: x + left, y: y + HEADER, width: width - left - 10.0, height: PANEL_HEIGHT };
        let frame = Frame { area, x: Axis::linear(range, 5), y: y_axis };
        let title = font::fit(&panel.title, area.width / 1.12, 10.5);
        canvas.text((area.x, y + 12.0), &title, Type::new(10.5).bold());
        frame.draw_grid(canvas);
        for (index, shares) in shares.iter().enumerate() {
            draw_bins(canvas, shares, look(&self.looks, index), &frame);
        }
        self.draw_band(canvas, &frame);
        frame.draw_outline(canvas);
        frame.draw_x_labels(canvas, "");
        frame.draw_y_labels(canvas, "", 0.0);
    }

    fn range_of(&self, panel: &HistogramPanel) -> (f64, f64) {
        let band = self.band.into_iter().flat_map(|band| [-band, band]);
        let values = panel.values.iter().flat_map(|values| values.iter().copied());
        padded(extent(values.chain(band)).unwrap_or((-1.0, 1.0)), 0.04)
    }

    fn draw_band(&self, canvas: &mut Canvas, frame: &Frame) {
        let limits = self.band.into_iter().flat_map(|band| [-band, band]);
        for at in limits.filter_map(|limit| frame.x_at(limit)) {
            if at >= frame.area.x && at <= frame.area.right() {
                let style = format!(" stroke=\"{GREY}\" stroke-dasharray=\"4 3\"");
                canvas.line((at, frame.area.y), (at, frame.area.bottom()), &style);
            }
        }
    }
}

/// The share of the finite values in each bin of a range that holds all of them.
fn shares(values: &[f64], (low, high): (f64, f64)) -> Vec<f64> {
    let mut counts = [0_u64; BINS];
    for value in values.iter().filter(|value| value.is_finite()) {
        let place = (value - low) / (high - low) * BINS as f64;
        counts[(place as usize).min(BINS - 1)] += 1;
    }
    let total = counts.iter().sum::<u64>().max(1) as f64;
    counts.iter().map(|count| *count as f64 / total).collect()
}

fn percent_axis(high: f64) -> Axis {
    let mut axis = Axis::linear((0.0, high * 100.0), 4);
    for tick in &mut axis.ticks {
        tick.at /= 100.0;
        tick.label.push('%');
    }
    Axis { low: 0.0, high, factor: String::new(), ..axis }
}

fn draw_bins(canvas: &mut Canvas, bins: &[f64], look: Look, frame: &Frame) {
    let area = frame.area;
    let step = area.width / bins.len() as f64;
    let mut outline = vec![(area.x, area.bottom())];
    for (place, share) in bins.iter().enumerate() {
        let top = frame.y_at(*share).unwrap_or(area.bottom());
        let x = area.x + step * place as f64;
        // Equal neighbors, mostly empty bins, need no corner between them.
        if outline.last().is_none_or(|last| last.1 != top) {
            let before = outline.last().map_or(top, |last| last.1);
            outline.push((x, before));
            outline.push((x, top));
        }
    }
    let last = outline.last().map_or(area.bottom(), |last| last.1);
    outline.extend([(area.right(), last), (area.right(), area.bottom())]);
    let style = format!(
        " fill=\"{0}\" fill-opacity=\".2\" stroke=\"{0}\" stroke-width=\"1.2\"{1}",
        look.colour,
        look.dash()
    );
    canvas.polygon(&outline, &style);
}
