//! SVG to PNG, with the embedded font.

use std::fmt;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg;

use super::outline::outlined;

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
    let svg = outlined(svg).map_err(|error| PngError::Svg(error.into()))?;
    let tree = usvg::Tree::from_str(&svg, &usvg::Options::default()).map_err(PngError::Svg)?;
    let (width, height) = (f64::from(tree.size().width()), f64::from(tree.size().height()));
    let scale = scale.min(MAX_PIXELS / width.max(height));
    let pixels = |length: f64| (length * scale).round().max(1.0) as u32;
    let mut pixmap = Pixmap::new(pixels(width), pixels(height)).ok_or(PngError::Size)?;
    let transform = Transform::from_scale(scale as f32, scale as f32);
    resvg::render(&tree, transform, &mut pixmap.as_mut());
    pixmap.encode_png().map_err(|_| PngError::Encoding)
}
