//! A map of values: rows against columns, a shade and a number in each cell.
//!
//! The shade goes from white for the least to dark blue for the greatest value, so that it is read
//! in grey too. A cell without a value is grey and shows a dash.

use super::Figure;
use super::font;
use super::style::{FRAME, ink_on, mix};
use super::svg::{Anchor, Area, Canvas, Type};

/// A map of values.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ValueMap {
    /// The figure's title, may be empty.
    pub title: String,
    /// What the rows are.
    pub rows: Vec<String>,
    /// What the columns are.
    pub columns: Vec<String>,
    /// The values, `values[row][column]`; `None` where there is none.
    pub values: Vec<Vec<Option<f64>>>,
    /// The values of the white and the dark end of the scale.
    pub range: (f64, f64),
    /// Digits after the point.
    pub digits: usize,
    /// What a cell without a value means, for the line below.
    pub empty: String,
}

const MARGIN: f64 = 10.0;
const SIZE: f64 = 10.0;
const CELL: (f64, f64) = (62.0, 17.0);
const SCALE: ([f64; 3], [f64; 3]) = ([255.0, 255.0, 255.0], [8.0, 48.0, 107.0]);
const EMPTY: &str = "#cccccc";

impl ValueMap {
    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let widths = self.rows.iter().map(|name| font::width(name, SIZE, false));
        let left = MARGIN + widths.fold(0.0, f64::max).min(330.0) + 6.0;
        let top = MARGIN + if self.title.is_empty() { 18.0 } else { 40.0 };
        if !self.title.is_empty() {
            canvas.text((MARGIN, MARGIN + 12.0), &self.title, Type::new(13.0).bold());
        }
        for (place, name) in self.columns.iter().enumerate() {
            let x = left + CELL.0 * (place as f64 + 0.5);
            let kind = Type::new(SIZE).anchor(Anchor::Middle);
            canvas.text((x, top - 5.0), &font::fit(name, CELL.0 - 4.0, SIZE), kind);
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
        let below = area.bottom() + 16.0;
        canvas.text((left, below), &self.empty, Type::new(9.5));
        let text =
            font::width(&self.title, 13.0, true).max(font::width(&self.empty, 9.5, false) + left);
        canvas.finish(area.right().max(text) + MARGIN, below + MARGIN, &self.title)
    }

    fn draw_cell(&self, canvas: &mut Canvas, row: usize, column: usize, (left, y): (f64, f64)) {
        let value = self.values.get(row).and_then(|row| row.get(column)).copied().flatten();
        let area = Area { x: left + CELL.0 * column as f64, y, width: CELL.0, height: CELL.1 };
        let span = self.range.1 - self.range.0;
        let share = |value: f64| if span > 0.0 { (value - self.range.0) / span } else { 0.0 };
        let fill = value.map_or(EMPTY.into(), |value| mix(SCALE.0, SCALE.1, share(value)));
        canvas.rect(area, &format!(" fill=\"{fill}\" stroke=\"#d5d5d5\" stroke-width=\".5\""));
        let text = value.map_or("–".into(), |value| format!("{value:.*}", self.digits));
        let kind = Type::new(SIZE).anchor(Anchor::Middle).colour(ink_on(&fill));
        canvas.text((area.x + CELL.0 / 2.0, y + CELL.1 / 2.0 + SIZE * 0.36), &text, kind);
    }
}
