//! Curves of one quantity over another, with markers and optional intervals.

use super::Figure;
use super::axis::{Axis, extent, padded, plain};
use super::frame::{Frame, TITLE_BELOW, labels_width};
use super::legend::{self, LegendEntry, Swatch};
use super::style::Look;
use super::svg::{Area, Canvas, Type};
use super::time_series::runs;

/// A chart of curves.
#[derive(Debug, Clone, PartialEq)]
pub struct Lines {
    /// The figure's title, may be empty.
    pub(crate) title: String,
    /// The title of the horizontal axis, with its unit.
    pub(crate) x_label: String,
    /// The title of the vertical axis, with its unit.
    pub(crate) y_label: String,
    /// The range of the vertical axis; `None` for that of the data.
    pub y_range: Option<(f64, f64)>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// One curve.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// The name in the legend.
    pub(crate) name: String,
    /// The points, from left to right.
    pub points: Vec<(f64, f64)>,
    /// The interval of each point's `y`; empty for none.
    pub(crate) intervals: Vec<(f64, f64)>,
    /// Whether the points have markers; otherwise only the line is drawn.
    pub(crate) marked: bool,
}

impl Curve {
    /// A curve with marked points.
    pub fn new(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, intervals: Vec::new(), marked: true }
    }

    /// Sets an interval for each point.
    pub fn with_intervals(mut self, intervals: Vec<(f64, f64)>) -> Self {
        self.intervals = intervals;
        self
    }

    /// Draws the line without markers.
    pub fn unmarked(mut self) -> Self {
        self.marked = false;
        self
    }
}

/// The figure's width, px.
const WIDTH: f64 = 620.0;
/// The height of the plotting area, px.
const HEIGHT: f64 = 300.0;
const MARGIN: f64 = 10.0;

impl Lines {
    /// A chart without curves.
    pub fn new(
        title: impl Into<String>,
        x_label: impl Into<String>,
        y_label: impl Into<String>,
    ) -> Self {
        Self {
            title: title.into(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            y_range: None,
            curves: Vec::new(),
        }
    }

    /// Adds a curve.
    pub fn with(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let y_axis = self.y_axis();
        let left = MARGIN + 16.0 + labels_width(&y_axis);
        let width = WIDTH - left - 1.5 * MARGIN;
        let mut top = MARGIN;
        if !self.title.is_empty() {
            canvas.text((left, top + 12.0), &self.title, Type::new(13.0).bold());
            top += 22.0;
        }
        let rows = legend::rows(&self.legend(), width);
        legend::draw(&mut canvas, (left, top), &rows);
        top += legend::ROW * rows.len() as f64 + 6.0;
        let area = Area { x: left, y: top, width, height: HEIGHT };
        let frame = Frame { area, x: self.x_axis(), y: y_axis };
        frame.draw_grid(&mut canvas);
        let wide = Area {
            x: area.x - 5.0,
            y: area.y - 5.0,
            width: area.width + 10.0,
            height: area.height + 10.0,
        };
        canvas.clipped(wide, |canvas| {
            for (index, curve) in self.curves.iter().enumerate() {
                draw_curve(canvas, curve, Look::nth(index), &frame);
            }
        });
        frame.draw_outline(&mut canvas);
        frame.draw_x_labels(&mut canvas, &self.x_label);
        frame.draw_y_labels(&mut canvas, &self.y_label, MARGIN + 9.0);
        let figure = canvas.finish(WIDTH, area.bottom() + TITLE_BELOW + MARGIN / 2.0, &self.title);
        figure.with_values(&["", &self.x_label, &self.y_label, "interval"], self.values())
    }

    fn values(&self) -> Vec<Vec<String>> {
        let of_curve = |curve: &Curve| {
            let points = (0..curve.points.len()).map(|place| in_words(curve, place));
            points.map(|[x, y, ends]| vec![curve.name.clone(), x, y, ends]).collect::<Vec<_>>()
        };
        self.curves.iter().flat_map(of_curve).collect()
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let curves = self.curves.iter().enumerate();
        curves
            .filter(|(_, curve)| !curve.name.is_empty())
            .map(|(index, curve)| LegendEntry {
                name: curve.name.clone(),
                swatch: match curve.marked {
                    true => Swatch::Marked(Look::nth(index)),
                    false => Swatch::Line(Look::nth(index)),
                },
            })
            .collect()
    }

    fn x_axis(&self) -> Axis {
        let values = self.curves.iter().flat_map(|curve| &curve.points).map(|point| point.0);
        axis(values, None, 8)
    }

    fn y_axis(&self) -> Axis {
        let points = self.curves.iter().flat_map(|curve| &curve.points).map(|point| point.1);
        let ends = self.curves.iter().flat_map(|curve| &curve.intervals);
        axis(points.chain(ends.flat_map(|(low, high)| [*low, *high])), self.y_range, 6)
    }
}

fn axis(values: impl Iterator<Item = f64>, range: Option<(f64, f64)>, count: usize) -> Axis {
    // A margin keeps a curve at the end of the range visible beside the frame.
    let padded = match range {
        Some(range) => padded(range, 0.025),
        None => padded(extent(values).unwrap_or((0.0, 1.0)), 0.03),
    };
    Axis::linear(padded, count)
}

fn draw_curve(canvas: &mut Canvas, curve: &Curve, look: Look, frame: &Frame) {
    let stroke = format!(" stroke=\"{}\" stroke-width=\"1.7\"", look.colour);
    let place = |point: &(f64, f64)| frame.point(point.0, point.1);
    for run in runs(curve.points.iter().map(place)) {
        canvas.path(&run, &format!("{stroke} stroke-linejoin=\"round\"{}", look.dash()));
    }
    for ((x, _), (low, high)) in curve.points.iter().zip(&curve.intervals) {
        if let (Some(low), Some(high)) = (frame.point(*x, *low), frame.point(*x, *high)) {
            canvas.line(low, high, &format!(" stroke=\"{}\" stroke-width=\"1\"", look.colour));
            for (x, y) in [low, high] {
                canvas.line((x - 3.0, y), (x + 3.0, y), &format!(" stroke=\"{}\"", look.colour));
            }
        }
    }
    for (place, at) in curve.points.iter().map(place).enumerate().filter(|_| curve.marked) {
        let Some(at) = at else { continue };
        let [x, y, ends] = in_words(curve, place);
        canvas.titled(&format!("{}: {x}, {y} {ends}", curve.name), |canvas| {
            legend::marker(canvas, look, at);
        });
    }
}

/// A point's coordinates and interval as text.
fn in_words(curve: &Curve, place: usize) -> [String; 3] {
    let (x, y) = curve.points[place];
    let ends = curve.intervals.get(place);
    let ends = ends.map(|(low, high)| format!("({} … {})", plain(*low), plain(*high)));
    [plain(x), plain(y), ends.unwrap_or_default()]
}
