//! Grouped horizontal bars with confidence intervals, to compare several methods.

use super::Figure;
use super::axis::{Axis, extent, plain};
use super::font;
use super::frame::{Frame, TITLE_BELOW};
use super::legend::{self, LegendEntry, Swatch};
use super::style::{GREY, INK, Look, look, tint};
use super::svg::{Area, Canvas, Type};

/// Groups of bars, one bar for each series in each group.
#[derive(Debug, Clone, PartialEq)]
pub struct Bars {
    /// The title of the horizontal axis, with its unit.
    pub(crate) x_label: String,
    /// The names of the series; a single series has no legend.
    pub(crate) series: Vec<String>,
    /// Styles of the series; the others get the default style of their index.
    pub looks: Vec<Look>,
    /// The groups, from top to bottom.
    pub(crate) groups: Vec<Group>,
    /// The range of the axis; `None` for zero to the largest value.
    pub range: Option<(f64, f64)>,
    /// Decimal places of the values beside the bars.
    pub digits: usize,
}

/// The bars of one label.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// The label at the left.
    pub(crate) label: String,
    /// A bar for each series; `None` without a result.
    pub(crate) bars: Vec<Option<Bar>>,
}

/// A value with its confidence interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// The value.
    pub(crate) value: f64,
    /// The interval's ends, if known.
    pub(crate) interval: Option<(f64, f64)>,
}

impl Bar {
    /// A value without an interval.
    pub fn new(value: f64) -> Self {
        Self { value, interval: None }
    }

    /// A value with an interval.
    pub fn with_interval(value: f64, low: f64, high: f64) -> Self {
        Self { value, interval: Some((low, high)) }
    }
}

/// The figure's width, px.
const WIDTH: f64 = 680.0;
const MARGIN: f64 = 10.0;
const BAR: f64 = 13.0;
const GROUP_GAP: f64 = 9.0;
const LABEL_SIZE: f64 = 10.5;
const VALUE_SIZE: f64 = 9.5;

impl Bars {
    /// A figure without groups.
    pub fn new(x_label: impl Into<String>, series: &[&str]) -> Self {
        Self {
            x_label: x_label.into(),
            series: series.iter().map(|name| (*name).to_owned()).collect(),
            looks: Vec::new(),
            groups: Vec::new(),
            range: None,
            digits: 3,
        }
    }

    /// Adds a group below the others.
    pub fn with(mut self, label: impl Into<String>, bars: Vec<Option<Bar>>) -> Self {
        self.groups.push(Group { label: label.into(), bars });
        self
    }

    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let labels = self.groups.iter().map(|group| font::width(&group.label, LABEL_SIZE, false));
        let left = MARGIN + labels.fold(0.0, f64::max).min(WIDTH * 0.4) + 8.0;
        let top = self.draw_header(&mut canvas, left);
        let value_width = font::width(&self.value_text(-0.5), VALUE_SIZE, false) + 16.0;
        let area = Area {
            x: left,
            y: top,
            width: WIDTH - left - MARGIN - value_width,
            height: self.groups.iter().map(|group| self.group_height(group)).sum(),
        };
        let y = Axis { ticks: Vec::new(), ..Axis::linear((0.0, 1.0), 1) };
        let frame = Frame { area, x: Axis::linear(self.range(), 6), y };
        frame.draw_grid(&mut canvas);
        let mut y = top;
        for group in &self.groups {
            self.draw_group(&mut canvas, group, y, &frame);
            y += self.group_height(group);
        }
        frame.draw_outline(&mut canvas);
        frame.draw_x_labels(&mut canvas, &self.x_label);
        let figure = canvas.finish(WIDTH, area.bottom() + TITLE_BELOW + MARGIN / 2.0, "");
        figure.with_values(&["", "series", &self.x_label, "interval"], self.values())
    }

    fn values(&self) -> Vec<Vec<String>> {
        let of_group = |group: &Group| {
            let bars = group.bars.iter().enumerate();
            let bar = |(index, bar): (usize, &Option<Bar>)| {
                let series = self.series.get(index).cloned().unwrap_or_default();
                let [value, interval] = self.in_words(bar.as_ref());
                vec![group.label.clone(), series, value, interval]
            };
            bars.map(bar).collect::<Vec<_>>()
        };
        self.groups.iter().flat_map(of_group).collect()
    }

    fn draw_header(&self, canvas: &mut Canvas, left: f64) -> f64 {
        if self.series.len() < 2 {
            return MARGIN;
        }
        let named = self.series.iter().enumerate();
        let entries: Vec<LegendEntry> = named
            .map(|(index, name)| LegendEntry {
                name: name.clone(),
                swatch: Swatch::Box(look(&self.looks, index)),
            })
            .collect();
        let rows = legend::rows(&entries, WIDTH - left - MARGIN);
        legend::draw(canvas, (left, MARGIN), &rows);
        MARGIN + legend::ROW * rows.len() as f64 + 5.0
    }

    fn group_height(&self, group: &Group) -> f64 {
        BAR * group.bars.len().max(1) as f64 + GROUP_GAP
    }

    fn range(&self) -> (f64, f64) {
        let bars = self.groups.iter().flat_map(|group| group.bars.iter().flatten());
        let ends = bars.flat_map(|bar| {
            let (low, high) = bar.interval.unwrap_or((bar.value, bar.value));
            [bar.value, low, high, 0.0]
        });
        self.range.unwrap_or_else(|| extent(ends).unwrap_or((0.0, 1.0)))
    }

    fn value_text(&self, value: f64) -> String {
        super::axis::signed(format!("{value:.*}", self.digits))
    }

    /// A bar's value and interval as text.
    fn in_words(&self, bar: Option<&Bar>) -> [String; 2] {
        let Some(bar) = bar else {
            return ["no result".to_owned(), String::new()];
        };
        let ends = |(low, high)| format!("({} … {})", self.full(low), self.full(high));
        [self.full(bar.value), bar.interval.map(ends).unwrap_or_default()]
    }

    /// A value with at least the decimal places shown beside the bar.
    fn full(&self, value: f64) -> String {
        let text = plain(value);
        let digits = text.split_once('.').map_or(0, |(_, behind)| behind.len());
        let is_full = digits >= self.digits || text.contains('e') || !value.is_finite();
        if is_full { text } else { self.value_text(value) }
    }

    fn draw_group(&self, canvas: &mut Canvas, group: &Group, y: f64, frame: &Frame) {
        let height = self.group_height(group);
        let label = font::fit(&group.label, frame.area.x - MARGIN - 8.0, LABEL_SIZE);
        let kind = Type::new(LABEL_SIZE).anchor(super::svg::Anchor::End);
        canvas.text((frame.area.x - 6.0, y + height / 2.0 + 3.8), &label, kind);
        for (index, bar) in group.bars.iter().enumerate() {
            let middle = y + GROUP_GAP / 2.0 + BAR * (index as f64 + 0.5);
            match bar {
                Some(bar) => {
                    let series = self.series.get(index).map_or("", String::as_str);
                    let [value, interval] = self.in_words(Some(bar));
                    let title = format!("{}, {series}: {value} {interval}", group.label);
                    canvas.titled(&title, |canvas| {
                        self.draw_bar(canvas, *bar, look(&self.looks, index), middle, frame);
                    });
                }
                None => {
                    let kind = Type::new(VALUE_SIZE).colour(GREY);
                    canvas.text((frame.area.x + 4.0, middle + 3.4), "no result", kind);
                }
            }
        }
    }

    fn draw_bar(&self, canvas: &mut Canvas, bar: Bar, look: Look, middle: f64, frame: &Frame) {
        let (left, right) = (frame.area.x, frame.area.right());
        let at = |value: f64| frame.x_at(value).map(|at| at.clamp(left, right));
        let (Some(zero), Some(end)) = (at(0.0), at(bar.value)) else {
            return;
        };
        let area = Area {
            x: zero.min(end),
            y: middle - BAR / 2.0 + 1.0,
            width: (end - zero).abs(),
            height: BAR - 2.0,
        };
        let fill = tint(look.colour, 0.75);
        canvas.rect(area, &format!("{fill} stroke=\"{}\" stroke-width=\".6\"", look.colour));
        if frame.x.low > 0.0 {
            draw_break(canvas, (area.x, middle));
        }
        if let Some((Some(low), Some(high))) = bar.interval.map(|(low, high)| (at(low), at(high))) {
            let style = format!(" stroke=\"{INK}\" stroke-width=\"1.1\"");
            canvas.line((low, middle), (high, middle), &style);
            for end in [low, high] {
                canvas.line((end, middle - 3.0), (end, middle + 3.0), &style);
            }
        }
        // The values have their own column, which no bar or grid line crosses.
        let column = right + 6.0;
        canvas.text((column, middle + 3.4), &self.value_text(bar.value), Type::new(VALUE_SIZE));
    }
}

/// Marks a bar that does not start at zero: two strokes across its foot.
fn draw_break(canvas: &mut Canvas, (x, y): (f64, f64)) {
    for shift in [3.0, 7.0] {
        let ends = [(x + shift, y + BAR / 2.0), (x + shift + 4.0, y - BAR / 2.0)];
        canvas.line(ends[0], ends[1], " stroke=\"#ffffff\" stroke-width=\"1.6\"");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_at_least_the_digits_of_the_bars_labels() {
        let bar = Bar::with_interval(600.0 / 7.0, 2.125, 100.0);
        let mut bars = Bars::new("accuracy (%)", &["one"]).with("tree", vec![Some(bar), None]);
        bars.digits = 2;
        let values = bars.values();
        assert_eq!(values[0][2..], ["85.71", "(2.125 … 100.00)"]);
        assert_eq!(values[1][2..], ["no result", ""]);
    }
}
