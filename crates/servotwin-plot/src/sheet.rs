//! An excerpt of a table as a picture: groups of columns with common headers, and rows of texts.
//!
//! Columns are as wide as their texts, which wrap. An ellipsis marks omitted columns and rows.

use super::Figure;
use super::font;
use super::style::{FRAME, GRID, INK};
use super::svg::{Anchor, Area, Canvas, Type};

/// The mark of omitted columns or rows.
pub const LEFT_OUT: &str = "…";

/// Columns with a common header.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// The common header.
    pub title: String,
    /// The headers of its columns; [`LEFT_OUT`] for omitted ones.
    pub columns: Vec<String>,
}

/// An excerpt of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sheet {
    /// Groups of columns, from left to right.
    pub groups: Vec<Group>,
    /// The rows, a text for each column.
    pub rows: Vec<Vec<String>>,
}

const SIZE: f64 = 9.0;
const LINE: f64 = 12.0;
const MARGIN: f64 = 6.0;
/// Horizontal padding of a text, both sides together, px.
const BESIDE: f64 = 8.0;
/// Vertical padding of a row, both sides together, px.
const ABOVE: f64 = 7.0;
/// Maximum width of a text before it wraps, px.
const WIDEST: f64 = 62.0;

/// The left edges of the columns and the right edge of the last one.
struct Columns(Vec<f64>);

impl Sheet {
    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let columns = self.columns();
        let (left, right) = (MARGIN, columns.0.last().copied().unwrap_or(MARGIN));
        let mut y = MARGIN;
        let rule = |canvas: &mut Canvas, y: f64, colour: &str| {
            canvas.line((left, y), (right, y), &format!(" stroke=\"{colour}\""));
        };
        rule(&mut canvas, y, INK);
        y = self.draw_titles(&mut canvas, &columns, y);
        y = draw_row(&mut canvas, &columns, &self.heads(), y);
        rule(&mut canvas, y, INK);
        for row in &self.rows {
            y = draw_row(&mut canvas, &columns, row, y);
            rule(&mut canvas, y, GRID);
        }
        rule(&mut canvas, y, INK);
        let mut first = 0;
        for group in &self.groups {
            first += group.columns.len();
            let x = columns.0[first];
            if first + 1 < columns.0.len() {
                canvas.line((x, MARGIN), (x, y), &format!(" stroke=\"{FRAME}\""));
            }
        }
        canvas.finish(right + MARGIN, y + MARGIN, "").with_values(
            &self.heads().iter().map(String::as_str).collect::<Vec<_>>(),
            self.rows.clone(),
        )
    }

    fn heads(&self) -> Vec<String> {
        self.groups.iter().flat_map(|group| group.columns.clone()).collect()
    }

    /// Each column is as wide as its widest line; the columns of a group share the extra width that its title needs.
    fn columns(&self) -> Columns {
        let heads = self.heads();
        let widest = |column: usize| {
            let texts = self.rows.iter().filter_map(|row| row.get(column));
            let widths = texts.chain([&heads[column]]).flat_map(|text| lines(text));
            widths.map(|line| font::width(&line, SIZE, false)).fold(0.0, f64::max) + BESIDE
        };
        let (mut ends, mut first) = (vec![MARGIN], 0);
        for group in &self.groups {
            let own: Vec<f64> = (first..first + group.columns.len()).map(widest).collect();
            let words = group.title.split(' ').map(|word| font::width(word, SIZE, true));
            let wanted = words.fold(0.0, f64::max) + BESIDE;
            let more = (wanted - own.iter().sum::<f64>()).max(0.0) / own.len().max(1) as f64;
            for width in own {
                ends.push(ends[ends.len() - 1] + width + more);
            }
            first += group.columns.len();
        }
        Columns(ends)
    }

    /// Draws the headers of the groups above their columns. Returns the bottom edge.
    fn draw_titles(&self, canvas: &mut Canvas, columns: &Columns, y: f64) -> f64 {
        let mut first = 0;
        let mut titles = vec![];
        for group in &self.groups {
            let last = first + group.columns.len();
            let (left, right) = (columns.0[first], columns.0[last]);
            titles.push((left, right, font::wrap(&group.title, right - left - BESIDE, SIZE, true)));
            first = last;
        }
        let deepest = titles.iter().map(|(_, _, lines)| lines.len()).max().unwrap_or(0);
        let bottom = y + deepest as f64 * LINE + ABOVE;
        for (left, right, lines) in &titles {
            draw_lines(canvas, lines, (*left, *right), (y, bottom), true);
            let (from, to) = ((left + 3.0, bottom), (right - 3.0, bottom));
            canvas.line(from, to, &format!(" stroke=\"{FRAME}\""));
        }
        bottom
    }
}

fn lines(text: &str) -> Vec<String> {
    font::wrap(text, WIDEST, SIZE, false)
}

/// Draws a row and returns its bottom edge.
fn draw_row(canvas: &mut Canvas, columns: &Columns, row: &[String], y: f64) -> f64 {
    let cells: Vec<Vec<String>> = row.iter().map(|text| lines(text)).collect();
    let deepest = cells.iter().map(Vec::len).max().unwrap_or(0);
    let bottom = y + deepest as f64 * LINE + ABOVE;
    for (cell, ends) in cells.iter().zip(columns.0.windows(2)) {
        draw_lines(canvas, cell, (ends[0], ends[1]), (y, bottom), false);
    }
    bottom
}

/// Draws lines centered in a cell.
fn draw_lines(
    canvas: &mut Canvas,
    lines: &[String],
    (left, right): (f64, f64),
    (top, bottom): (f64, f64),
    bold: bool,
) {
    let area = Area { x: left, y: top, width: right - left, height: bottom - top };
    let x = area.x + area.width / 2.0;
    let first = area.y + (area.height - lines.len() as f64 * LINE) / 2.0;
    let kind = Type::new(SIZE).anchor(Anchor::Middle);
    let kind = if bold { kind.bold() } else { kind };
    for (place, line) in lines.iter().enumerate() {
        let baseline = first + (place as f64 + 0.5) * LINE + SIZE * 0.36;
        canvas.text((x, baseline), line, kind);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_break_and_nothing_is_lost() {
        let group = |title: &str, columns: &[&str]| Group {
            title: title.into(),
            columns: columns.iter().map(|&column| column.into()).collect(),
        };
        let sheet = Sheet {
            groups: vec![
                group("variant", &["no."]),
                group("fault intensities", &["actuator_1.servo_valve.clogging_pa", LEFT_OUT]),
            ],
            rows: vec![vec!["17".into(), "0.25".into(), LEFT_OUT.into()]],
        };
        let figure = sheet.draw();
        for part in [">actuator_1.<", ">servo_valve.<", ">clogging_pa<", ">0.25<", ">17<"] {
            assert!(figure.svg.contains(part), "{part}: {}", figure.svg);
        }
        assert_eq!(figure.values[0][1], "actuator_1.servo_valve.clogging_pa");
        // A column is as wide as its widest line, not as its name.
        assert!(figure.width < 200.0, "{}", figure.width);
    }
}
