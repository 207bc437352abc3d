//! Text tables and JSON for standard output.

pub use servotwin::shown::{number, number_and_unit, shown};

/// A table of text cells. Numeric columns are right-aligned.
pub(crate) struct TextTable {
    heads: Vec<(&'static str, Side)>,
    rows: Vec<Vec<String>>,
}

/// The alignment of a column.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Side {
    /// For words.
    Left,
    /// For numbers.
    Right,
}

impl TextTable {
    /// A table without rows.
    pub(crate) fn new(heads: &[(&'static str, Side)]) -> Self {
        Self { heads: heads.to_vec(), rows: Vec::new() }
    }

    /// Adds a row, one text for each column.
    pub(crate) fn push(&mut self, row: Vec<String>) {
        debug_assert_eq!(row.len(), self.heads.len());
        self.rows.push(row);
    }

    /// Returns the table as lines.
    pub(crate) fn text(&self) -> String {
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

/// Formats JSON in indented lines.
pub(crate) fn json(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_by_characters() {
        let mut grid = TextTable::new(&[("name", Side::Left), ("°", Side::Right)]);
        grid.push(vec!["µ".into(), "1".into()]);
        grid.push(vec!["longer".into(), "-10".into()]);
        assert_eq!(grid.text(), "name      °\nµ         1\nlonger  -10\n");
    }
}
