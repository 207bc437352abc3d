//! Conversion of SVG to PNG, with the embedded font.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg;

use super::PngError;
use super::outline::outlined;

/// Maximum side length of a picture, pixels.
const MAX_PIXELS: f64 = 16_000.0;

/// Renders SVG text as a PNG file's bytes.
pub(super) fn render(svg: &str, scale: f64) -> Result<Vec<u8>, PngError> {
    let svg = outlined(svg).map_err(|error| PngError::Svg(error.to_string()))?;
    let tree = usvg::Tree::from_str(&svg, &usvg::Options::default())
        .map_err(|error| PngError::Svg(error.to_string()))?;
    let (width, height) = (f64::from(tree.size().width()), f64::from(tree.size().height()));
    let scale = scale.min(MAX_PIXELS / width.max(height));
    let pixels = |length: f64| (length * scale).round().max(1.0) as u32;
    let mut pixmap = Pixmap::new(pixels(width), pixels(height)).ok_or(PngError::Size)?;
    let transform = Transform::from_scale(scale as f32, scale as f32);
    resvg::render(&tree, transform, &mut pixmap.as_mut());
    pixmap.encode_png().map_err(|_| PngError::Encoding)
}
