//! What readers see: results as [`document`]s with their renderers, display units, and figures.
//!
//! Every kind of figure is a struct of plain data with a `draw` method that returns a [`Figure`]. The bytes depend on the data
//! only. Series differ by color: in a report by their [`SemanticColor`], elsewhere by a palette for color-blind readers. They
//! also differ by dash or marker, so that a figure can be printed in gray. Non-finite numbers are omitted: a line has a
//! gap there.

mod axis;
pub mod decimate;
pub mod document;
mod font;
mod frame;
pub mod histogram;
mod legend;
pub mod lines;
mod meaning;
pub mod render;
pub mod schematic;
pub mod shown;
mod style;
mod svg;
pub mod time_series;
pub mod tree;
pub mod value_map;

use std::path::Path;

pub use meaning::SemanticColor;
pub(crate) use meaning::dark_rules;
pub use style::Look;

use servotwin_io::files::{FileError, write_text};

/// A drawn figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// The figure as a complete SVG document.
    pub svg: String,
    /// The width in SVG units (pixels at 96 dpi).
    pub width: f64,
    /// The height in SVG units.
    pub height: f64,
    /// The drawn values as a table with a header row, for readers who cannot hover over the figure. Empty if the table
    /// would be too long.
    pub(crate) values: Vec<Vec<String>>,
}

/// Maximum number of rows in a figure's table of values.
const MOST_VALUES: usize = 250;

impl Figure {
    /// Adds the table of values, unless it is empty or too long.
    fn with_values(mut self, heads: &[&str], rows: Vec<Vec<String>>) -> Self {
        if !rows.is_empty() && rows.len() <= MOST_VALUES {
            self.values.push(heads.iter().map(|head| (*head).to_owned()).collect());
            self.values.extend(rows);
        }
        self
    }

    /// Saves the figure atomically as SVG.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        write_text(path, &self.svg)
    }
}
