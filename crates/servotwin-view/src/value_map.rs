//! A map of values: rows and columns, with a shade and a number in each cell.
//!
//! The shade runs from nearly white for the smallest to dark blue for the largest value, which stays readable in gray.
//! A color bar is beside it. A cell without a value shows a dash on gray, or the color for the worst result if `worst`
//! is set.

use super::Figure;
use super::font;
use super::style::{FRAME, WORST, ink_on, scale};
use super::svg::{Anchor, Area, Canvas, Type};

/// A map of values.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ValueMap {
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The values, `values[row][column]`; `None` for missing ones.
    pub values: Vec<Vec<Option<f64>>>,
    /// The values of the light and the dark end of the scale.
    pub range: (f64, f64),
    /// Decimal places.
    pub digits: usize,
    /// Description of the values, for the line below.
    pub meaning: String,
    /// If a missing value is the worst result: the text in its cell, and its explanation.
    pub worst: Option<(String, String)>,
}

const MARGIN: f64 = 10.0;
const SIZE: f64 = 10.0;
const CELL: (f64, f64) = (62.0, 18.0);
const EMPTY: &str = "#cccccc";

/// The smallest number of decimal places, up to three, that rounds no value.
pub fn digits(values: impl IntoIterator<Item = f64> + Clone) -> usize {
    let is_exact = |digits: &i32| {
        let scale = 10_f64.powi(*digits);
        values
            .clone()
            .into_iter()
            .all(|value| (value * scale - (value * scale).round()).abs() < 1e-6)
    };
    (0..3).find(is_exact).unwrap_or(3) as usize
}

impl ValueMap {
    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let longest = |names: &[String]| {
            let widths = names.iter().map(|name| font::width(name, SIZE, false));
            widths.fold(0.0, f64::max)
        };
        let left = MARGIN + longest(&self.rows).min(330.0) + 6.0;
        // Headers that do not fit are vertical.
        let heads = longest(&self.columns).min(200.0);
        let level = heads <= CELL.0 - 4.0;
        let top = MARGIN + if level { 18.0 } else { heads + 8.0 };
        for (place, name) in self.columns.iter().enumerate() {
            let x = left + CELL.0 * (place as f64 + 0.5);
            let (name, kind) = (font::fit(name, 200.0, SIZE), Type::new(SIZE));
            match level {
                true => canvas.text((x, top - 5.0), &name, kind.anchor(Anchor::Middle)),
                false => canvas.text((x + SIZE * 0.36, top - 5.0), &name, kind.turn(-90.0)),
            }
        }
        for (row, name) in self.rows.iter().enumerate() {
            let y = top + CELL.1 * row as f64;
            let name = font::fit(name, left - MARGIN - 6.0, SIZE);
            let kind = Type::new(SIZE).anchor(Anchor::End);
            canvas.text((left - 6.0, y + CELL.1 / 2.0 + SIZE * 0.36), &name, kind);
            (0..self.columns.len())
                .for_each(|column| self.draw_cell(&mut canvas, row, column, (left, y)));
        }
        let (width, height) = (CELL.0 * self.columns.len() as f64, CELL.1 * self.rows.len() as f64);
        let area = Area { x: left, y: top, width, height };
        canvas.rect(area, &format!(" fill=\"none\" stroke=\"{FRAME}\""));
        let bar =
            Area { x: area.right() + 14.0, y: top, width: 12.0, height: height.clamp(50.0, 220.0) };
        let (low, high) = self.range;
        let labels = [high, (low + high) / 2.0, low].map(|value| self.text(Some(value)));
        draw_scale(&mut canvas, bar, [&labels[0], &labels[1], &labels[2]]);
        let mut below = area.bottom().max(bar.bottom()) + 16.0;
        canvas.text((MARGIN, below), &self.meaning, Type::new(9.5));
        let mut text = font::width(&self.meaning, 9.5, false) + MARGIN;
        if let Some((word, meaning)) = &self.worst {
            below += 15.0;
            let swatch = Area { x: MARGIN, y: below - 10.0, width: 44.0, height: 13.0 };
            draw_box(&mut canvas, swatch, WORST, word);
            canvas.text((swatch.right() + 6.0, below), meaning, Type::new(9.5));
            text = text.max(font::width(meaning, 9.5, false) + swatch.right() + 6.0);
        }
        let figure = canvas.finish((bar.right() + 44.0).max(text) + MARGIN, below + MARGIN, "");
        let heads: Vec<&str> =
            std::iter::once("").chain(self.columns.iter().map(|c| &**c)).collect();
        figure.with_values(&heads, self.table())
    }

    fn value(&self, row: usize, column: usize) -> Option<f64> {
        self.values.get(row).and_then(|row| row.get(column)).copied().flatten()
    }

    fn text(&self, value: Option<f64>) -> String {
        let none = || self.worst.as_ref().map_or("–".into(), |(word, _)| word.clone());
        value.map_or_else(none, |value| format!("{value:.*}", self.digits))
    }

    fn table(&self) -> Vec<Vec<String>> {
        let of_row = |(row, name): (usize, &String)| {
            let cells = (0..self.columns.len()).map(|column| self.text(self.value(row, column)));
            std::iter::once(name.clone()).chain(cells).collect()
        };
        self.rows.iter().enumerate().map(of_row).collect()
    }

    fn draw_cell(&self, canvas: &mut Canvas, row: usize, column: usize, (left, y): (f64, f64)) {
        let value = self.value(row, column);
        let area = Area { x: left + CELL.0 * column as f64, y, width: CELL.0, height: CELL.1 };
        let span = self.range.1 - self.range.0;
        let share = |value: f64| if span > 0.0 { (value - self.range.0) / span } else { 0.0 };
        let empty = if self.worst.is_some() { WORST } else { EMPTY };
        let fill = value.map_or(empty.into(), |value| scale(share(value)));
        let text = self.text(value);
        let title = format!("{}, {}: {text}", self.rows[row], self.columns[column]);
        canvas.titled(&title, |canvas| draw_box(canvas, area, &fill, &text));
    }
}

/// Draws the color scale beside a map, with labels of its upper end, middle and lower end.
fn draw_scale(canvas: &mut Canvas, area: Area, labels: [&str; 3]) {
    const STEPS: usize = 24;
    let step = area.height / STEPS as f64;
    for place in 0..STEPS {
        let share = 1.0 - (place as f64 + 0.5) / STEPS as f64;
        let y = area.y + step * place as f64;
        // A little overlap hides white seams between the steps.
        let height = if place + 1 == STEPS { step } else { step + 0.5 };
        let fill = scale(share);
        canvas.rect(Area { y, height, ..area }, &format!(" fill=\"{fill}\""));
    }
    canvas.rect(area, &format!(" fill=\"none\" stroke=\"{FRAME}\" stroke-width=\".6\""));
    for (share, label) in [0.0, 0.5, 1.0].into_iter().zip(labels) {
        let y = area.y + area.height * share;
        canvas.text((area.right() + 4.0, y + 3.4), label, Type::new(9.0));
    }
}

/// Draws a filled cell with a centered text.
fn draw_box(canvas: &mut Canvas, area: Area, fill: &str, text: &str) {
    canvas.rect(area, &format!(" fill=\"{fill}\" stroke=\"#d5d5d5\" stroke-width=\".5\""));
    let kind = Type::new(SIZE).anchor(Anchor::Middle).colour(ink_on(fill));
    let at = (area.x + area.width / 2.0, area.y + area.height / 2.0 + SIZE * 0.36);
    canvas.text(at, text, kind);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_value_is_rounded_that_three_digits_can_show() {
        let cases =
            [(vec![0.25, 0.5], 2), (vec![0.1, 1.0], 1), (vec![1.0], 0), (vec![1.0 / 3.0], 3)];
        for (values, expected) in cases {
            assert_eq!(digits(values.clone()), expected, "{values:?}");
        }
        let map = ValueMap {
            rows: vec!["seal".into()],
            columns: vec!["a command with a long name/load".into(), "b".into()],
            values: vec![vec![Some(0.25), None]],
            range: (0.0, 1.0),
            digits: digits([0.25]),
            worst: Some(("never".into(), "not at any intensity".into())),
            ..ValueMap::default()
        };
        let figure = map.draw();
        assert!(figure.svg.contains(">0.25<") && figure.svg.contains(WORST));
        assert!(figure.svg.contains(">a command with a long name/load<"), "heads are whole");
        assert_eq!(figure.values[1], ["seal", "0.25", "never"]);
    }
}
