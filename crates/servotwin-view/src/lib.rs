//! What readers see: results as [`document`]s with their renderers, display units, and figures.
//!
//! Every kind of figure is a struct of plain data with a `draw` method that returns a [`Figure`]. The bytes depend on the data
//! only. Series differ by color: in a report by their [`SemanticColor`], elsewhere by a palette for color-blind readers. They
//! also differ by dash or marker, so that a figure can be printed in gray. Non-finite numbers are omitted: a line has a
//! gap there.
//!
//! A PNG is rendered from the SVG with an embedded font, DejaVu Sans, and looks the same on every machine. The font is
//! licensed by Bitstream (Vera license: free to use, embed and redistribute). DejaVu's changes to it are in the public
//! domain.

mod axis;
pub mod bars;
pub mod decimate;
pub mod document;
mod font;
mod frame;
pub mod heatmap;
pub mod histogram;
mod legend;
pub mod lines;
mod meaning;
#[cfg(feature = "png")]
mod outline;
#[cfg(feature = "png")]
mod png;
pub mod render;
pub mod schematic;
pub mod shown;
mod style;
mod svg;
pub mod time_series;
pub mod tree;
pub mod value_map;

use std::path::{Path, PathBuf};

pub use meaning::{SemanticColor, dark_rules};
pub use style::Look;

use servotwin_io::files::{FileError, write_atomically};

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
    pub values: Vec<Vec<String>>,
}

/// Maximum number of rows in a figure's table of values.
const MOST_VALUES: usize = 250;

/// Errors of rendering a figure as PNG.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum PngError {
    /// The SVG text is not well-formed.
    #[error("the figure is no valid SVG: {0}")]
    Svg(String),
    /// The figure has no area, or needs more memory than available.
    #[error("the figure's size cannot be drawn")]
    Size,
    /// The PNG could not be encoded.
    #[error("the picture could not be encoded as PNG")]
    Encoding,
    /// The program was built without the feature `png`.
    #[error(
        "a .png file needs the feature 'png', which this program was built without: save the figure as .svg, or \
         cargo install --path crates/servotwin-cli --features png (or cargo run --release --features png -- …)"
    )]
    Feature,
}

/// Errors of saving a figure.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The file could not be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file's extension is neither `svg` nor `png`.
    #[error("{path}: a figure is saved as .svg or .png")]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The figure could not be turned into pixels.
    #[error(transparent)]
    Png(#[from] PngError),
}

impl Figure {
    /// Adds the table of values, unless it is empty or too long.
    fn with_values(mut self, heads: &[&str], rows: Vec<Vec<String>>) -> Self {
        if !rows.is_empty() && rows.len() <= MOST_VALUES {
            self.values.push(heads.iter().map(|head| (*head).to_owned()).collect());
            self.values.extend(rows);
        }
        self
    }

    /// Saves the figure atomically, as SVG or PNG depending on the file's extension.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), FigureError> {
        let path = path.as_ref();
        let extension = path.extension().and_then(|text| text.to_str()).unwrap_or_default();
        let bytes = match extension.to_ascii_lowercase().as_str() {
            "svg" => self.svg.as_bytes().to_vec(),
            "png" => self.png(2.0)?,
            _ => {
                return Err(FigureError::UnknownFormat { path: path.to_path_buf() });
            }
        };
        Ok(write_atomically(path, |out| out.write_all(&bytes))?)
    }

    /// Renders the figure as a PNG file's bytes, with `scale` pixels for one SVG unit.
    ///
    /// A figure that is too large for that scale uses the largest one that fits.
    pub fn png(&self, scale: f64) -> Result<Vec<u8>, PngError> {
        #[cfg(feature = "png")]
        return png::render(&self.svg, scale);
        #[cfg(not(feature = "png"))]
        {
            let _ = scale;
            Err(PngError::Feature)
        }
    }
}
