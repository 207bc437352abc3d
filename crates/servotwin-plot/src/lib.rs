//! Static figures for reports: an SVG writer of our own and the chart kinds drawn with it.
//!
//! Every kind is a struct of plain data with a `draw` that returns a [`Figure`]. The bytes depend
//! on the data only. Series differ by colour (in a report, by what they
//! mean: [`Meaning`]; elsewhere by a palette for colour-blind readers) and again by dash or marker, so that a figure
//! survives a grey printer. Numbers that
//! are not finite are left out: a line has a gap there.
//!
//! A PNG is made from the SVG with an embedded font, DejaVu Sans, and looks the same on every
//! machine. The font is licensed by Bitstream (Vera licence: free to use, embed and redistribute);
//! DejaVu's changes to it are in the public domain.

mod axis;
pub mod bars;
pub mod decimate;
pub mod diagram;
mod font;
mod frame;
pub mod heatmap;
pub mod histogram;
mod junction;
mod legend;
pub mod lines;
mod meaning;
#[cfg(feature = "png")]
mod outline;
#[cfg(feature = "png")]
mod png;
pub mod sheet;
mod style;
mod svg;
pub mod time_series;
pub mod tree;
pub mod value_map;

use std::path::{Path, PathBuf};

pub use meaning::{Meaning, dark_rules};
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
    /// The values that are drawn, for readers who cannot point at them: heads first. Empty where a
    /// table would be longer than anybody reads.
    pub values: Vec<Vec<String>>,
}

/// A table of values with more rows than this is read by nobody.
const MOST_VALUES: usize = 250;

/// Why a figure could not be turned into pixels.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum PngError {
    /// The SVG text is not well-formed.
    #[error("the figure is no valid SVG: {0}")]
    Svg(String),
    /// The figure has no area, or more than the memory holds.
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

/// Why a figure could not be saved.
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
    /// The figure with the values in it.
    fn with_values(mut self, heads: &[&str], rows: Vec<Vec<String>>) -> Self {
        if !rows.is_empty() && rows.len() <= MOST_VALUES {
            self.values.push(heads.iter().map(|head| (*head).to_owned()).collect());
            self.values.extend(rows);
        }
        self
    }

    /// Saves the figure atomically, as SVG or PNG after the file's extension.
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

    /// The figure as a PNG file's bytes, with `scale` pixels for one SVG unit.
    ///
    /// A figure too large for that scale is drawn at the largest one it fits in.
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
