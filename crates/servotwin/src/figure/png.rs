//! SVG to PNG, with the embedded font.

use std::fmt;
use std::sync::{Arc, OnceLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, fontdb};

/// No side of a picture has more pixels than this.
const MAX_PIXELS: f64 = 16_000.0;

/// Why a figure could not be turned into pixels.
#[derive(Debug)]
pub enum PngError {
    /// The SVG text is not well-formed.
    Svg(usvg::Error),
    /// The figure has no area, or more than the memory holds.
    Size,
    /// The PNG could not be encoded.
    Encoding,
}

impl fmt::Display for PngError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PngError::Svg(error) => write!(out, "the figure is no valid SVG: {error}"),
            PngError::Size => write!(out, "the figure's size cannot be drawn"),
            PngError::Encoding => write!(out, "the picture could not be encoded as PNG"),
        }
    }
}

impl std::error::Error for PngError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            PngError::Svg(error) => Some(error),
            _ => None,
        }
    }
}

/// Draws SVG text into a PNG file's bytes.
pub(super) fn render(svg: &str, scale: f64) -> Result<Vec<u8>, PngError> {
    let options = usvg::Options { fontdb: fonts(), ..usvg::Options::default() };
    let tree = usvg::Tree::from_str(svg, &options).map_err(PngError::Svg)?;
    let (width, height) = (f64::from(tree.size().width()), f64::from(tree.size().height()));
    let scale = scale.min(MAX_PIXELS / width.max(height));
    let pixels = |length: f64| (length * scale).round().max(1.0) as u32;
    let mut pixmap = Pixmap::new(pixels(width), pixels(height)).ok_or(PngError::Size)?;
    let transform = Transform::from_scale(scale as f32, scale as f32);
    resvg::render(&tree, transform, &mut pixmap.as_mut());
    pixmap.encode_png().map_err(|_| PngError::Encoding)
}

/// The embedded fonts only: what the machine has installed shall not change a picture.
fn fonts() -> Arc<fontdb::Database> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = fontdb::Database::new();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.load_font_data(dejavu::sans::bold().to_vec());
        fonts.set_sans_serif_family("DejaVu Sans");
        Arc::new(fonts)
    };
    FONTS.get_or_init(load).clone()
}
