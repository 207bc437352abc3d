//! Tables and numbers for people.

use servotwin::shown::Shown;
use servotwin_model::spec::Unit;

/// A table of texts; columns of numbers stand at the right.
pub struct Grid {
    heads: Vec<(&'static str, Side)>,
    rows: Vec<Vec<String>>,
}

/// Where the texts of a column stand.
#[derive(Clone, Copy, PartialEq)]
pub enum Side {
    /// Words.
    Left,
    /// Numbers.
    Right,
}

impl Grid {
    /// A table without rows.
    pub fn new(heads: &[(&'static str, Side)]) -> Self {
        Self { heads: heads.to_vec(), rows: Vec::new() }
    }

    /// Adds a row, one text per column.
    pub fn push(&mut self, row: Vec<String>) {
        debug_assert_eq!(row.len(), self.heads.len());
        self.rows.push(row);
    }

    /// The table as lines.
    pub fn text(&self) -> String {
        let width = |column: usize| {
            let cells = self.rows.iter().map(|row| row[column].chars().count());
            cells.chain([self.heads[column].0.chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.heads.len()).map(width).collect();
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            let sides = self.heads.iter().map(|(_, side)| side);
            let padded = cells.zip(&widths).zip(sides).map(|((cell, &width), side)| match side {
                Side::Left => format!("{cell:<width$}"),
                Side::Right => format!("{cell:>width$}"),
            });
            padded.collect::<Vec<_>>().join("  ").trim_end().to_string() + "\n"
        };
        let mut text = line(&mut self.heads.iter().map(|(head, _)| *head));
        for row in &self.rows {
            text += &line(&mut row.iter().map(String::as_str));
        }
        text
    }
}

/// A number with `digits` significant digits and no needless zeros.
pub fn number(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let size = value.abs();
    if !value.is_finite() || !(1e-4..1e7).contains(&size) {
        let text = format!("{value:.*e}", digits - 1);
        let Some((mantissa, exponent)) = text.split_once('e') else {
            return text;
        };
        return format!("{}e{exponent}", without_zeros(mantissa));
    }
    let before = size.log10().floor() as i64;
    let decimals = (digits as i64 - 1 - before).max(0) as usize;
    without_zeros(&format!("{value:.decimals$}")).to_string()
}

fn without_zeros(text: &str) -> &str {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => text,
    }
}

/// A value with the unit that reports show.
pub fn shown(si: f64, unit: Unit) -> String {
    let (text, unit) = number_and_unit(si, unit);
    if unit.is_empty() { text } else { format!("{text} {unit}") }
}

/// A value in the unit that people read, and the unit.
pub fn number_and_unit(si: f64, unit: Unit) -> (String, &'static str) {
    let shown = Shown::of(unit, si);
    (number(shown.value(si), 5), shown.symbol())
}

/// JSON as lines for people and programs.
pub fn json(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_keep_their_digits() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-1234.5678, "-1234.6"),
            (206.84, "206.84"),
            (0.001_234_56, "0.0012346"),
            (2.0e-14, "2e-14"),
            (1.23456e9, "1.2346e9"),
            (99999.96, "100000"),
            (f64::NAN, "NaN"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value, 5), text);
        }
    }

    #[test]
    fn columns_line_up_by_characters() {
        let mut grid = Grid::new(&[("name", Side::Left), ("°", Side::Right)]);
        grid.push(vec!["µ".into(), "1".into()]);
        grid.push(vec!["longer".into(), "-10".into()]);
        assert_eq!(grid.text(), "name      °\nµ         1\nlonger  -10\n");
    }
}
