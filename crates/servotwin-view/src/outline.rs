//! Text as outlines, so that rendering needs no text engine.
//!
//! Each text is one line in one of two fonts, left to right and without ligatures. Typesetting needs only one glyph per
//! letter, the font's advance widths and its kerning.

use std::fmt::Write;

use resvg::usvg::roxmltree::{Document, Error, Node};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::svg::number;
use servotwin_io::text::escaped;

/// Replaces every text of an SVG document by its outline.
pub(super) fn outlined(svg: &str) -> Result<String, Error> {
    let document = Document::parse(svg)?;
    let mut out = String::with_capacity(2 * svg.len());
    let mut done = 0;
    for text in document.descendants().filter(|node| node.has_tag_name("text")) {
        let range = text.range();
        out.push_str(&svg[done..range.start]);
        push_path(&mut out, text);
        done = range.end;
    }
    out.push_str(&svg[done..]);
    Ok(out)
}

/// The attributes for the position and size of a text; the others are valid for a path as well.
const PLACING: [&str; 5] = ["x", "y", "font-size", "font-weight", "text-anchor"];

fn push_path(out: &mut String, text: Node) {
    // As SVG prescribes: spaces at the ends are dropped, and consecutive ones collapse.
    let words: Vec<&str> = text.text().unwrap_or_default().split_ascii_whitespace().collect();
    let Some(face) = face_of(text) else { return };
    out.push_str("<path");
    for attribute in text.attributes().filter(|one| !PLACING.contains(&one.name())) {
        let _ = write!(out, " {}=\"{}\"", attribute.name(), escaped(attribute.value()));
    }
    let number_of = |name| text.attribute(name).and_then(|value| value.parse().ok());
    let size = number_of("font-size").unwrap_or(12.0);
    let line = Line::new(&face, size, &words.join(" "));
    let anchored = match text.attribute("text-anchor") {
        Some("middle") => line.width / 2.0,
        Some("end") => line.width,
        _ => 0.0,
    };
    let x = number_of("x").unwrap_or(0.0) - anchored;
    let _ = write!(out, " d=\"{}\"/>", line.path(x, number_of("y").unwrap_or(0.0)));
}

/// Only the embedded fonts, so that installed fonts do not change a picture.
fn face_of(text: Node) -> Option<Face<'static>> {
    let data = match text.attribute("font-weight") {
        Some("bold") => dejavu::sans::bold(),
        _ => dejavu::sans::regular(),
    };
    Face::parse(data, 0).ok()
}

/// A typeset line of text.
struct Line<'a> {
    face: &'a Face<'a>,
    /// Length of a font unit, in SVG units.
    unit: f64,
    /// The glyphs with their offsets from the start of the line.
    glyphs: Vec<(GlyphId, f64)>,
    width: f64,
}

impl<'a> Line<'a> {
    fn new(face: &'a Face<'a>, size: f64, text: &str) -> Self {
        let unit = size / f64::from(face.units_per_em());
        let mut line = Self { face, unit, glyphs: Vec::new(), width: 0.0 };
        for letter in text.chars() {
            // Glyph 0 is the frame for letters that the font lacks.
            let glyph = face.glyph_index(letter).unwrap_or_default();
            if let Some((last, _)) = line.glyphs.last() {
                line.width += unit * f64::from(kerning(face, *last, glyph));
            }
            line.glyphs.push((glyph, line.width));
            line.width += unit * f64::from(face.glyph_hor_advance(glyph).unwrap_or(0));
        }
        line
    }

    /// The outline in SVG's path language, with the start of the baseline at (x, y).
    fn path(&self, x: f64, y: f64) -> String {
        let mut pen = Pen { path: String::new(), x, y, unit: self.unit };
        for (glyph, offset) in &self.glyphs {
            pen.x = x + offset;
            self.face.outline_glyph(*glyph, &mut pen);
        }
        pen.path
    }
}

/// Kerning of two glyphs, in font units; negative moves them closer.
fn kerning(face: &Face, left: GlyphId, right: GlyphId) -> i16 {
    let tables = face.tables().kern.into_iter().flat_map(|kern| kern.subtables);
    let pairs = tables.filter(|table| table.horizontal && !table.has_cross_stream);
    pairs.filter_map(|table| table.glyphs_kerning(left, right)).sum()
}

/// Writes a glyph's outline as a path; the font's vertical axis points up.
struct Pen {
    path: String,
    x: f64,
    y: f64,
    unit: f64,
}

impl Pen {
    fn push(&mut self, command: char, points: &[(f32, f32)]) {
        self.path.push(command);
        for (x, y) in points {
            let x = number(self.x + self.unit * f64::from(*x));
            let y = number(self.y - self.unit * f64::from(*y));
            let _ = write!(self.path, "{x} {y} ");
        }
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.push('M', &[(x, y)]);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.push('L', &[(x, y)]);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.push('Q', &[(x1, y1), (x, y)]);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.push('C', &[(x1, y1), (x2, y2), (x, y)]);
    }

    fn close(&mut self) {
        self.push('Z', &[]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::font;

    fn width(text: &str, bold: bool) -> f64 {
        let data = if bold { dejavu::sans::bold() } else { dejavu::sans::regular() };
        Line::new(&Face::parse(data, 0).unwrap(), 100.0, text).width
    }

    /// The layout relies on widths from a table.
    #[test]
    fn letters_are_as_wide_as_the_layout_thinks() {
        for letter in (' '..='~').chain("°–²³⁰⁹⁻₀₉·′−±×≤≥≠→…".chars())
        {
            let (text, expected) =
                (letter.to_string(), font::width(&letter.to_string(), 100.0, false));
            assert!((width(&text, false) - expected).abs() < 0.06, "{letter}: {expected}");
        }
        let sentence = "Time from the fault to its detection (s), healthy";
        assert!(width(sentence, false) <= font::width(sentence, 100.0, false));
        assert!(width(sentence, true) <= font::width(sentence, 100.0, true));
    }

    #[test]
    fn kerning_brings_a_pair_together() {
        assert!(width("AV", false) < width("A", false) + width("V", false) - 3.0);
        assert_eq!(width("HH", false), 2.0 * width("H", false));
    }

    #[test]
    fn texts_become_paths_and_nothing_else_changes() {
        let svg = "<svg><rect x=\"1\"/><text x=\"5\" y=\"20\" font-size=\"10\" \
                   text-anchor=\"end\" fill=\"#123456\">I &lt;</text>\n<g><text x=\"0\" y=\"0\"> \
                   </text></g></svg>";
        let outlined = outlined(svg).unwrap();
        assert!(outlined.starts_with("<svg><rect x=\"1\"/><path fill=\"#123456\" d=\"M"));
        assert!(outlined.ends_with("Z\"/>\n<g><path d=\"\"/></g></svg>"), "{outlined}");
        let path = Document::parse(&outlined).unwrap();
        let path = path.descendants().find(|node| node.has_tag_name("path")).unwrap();
        let numbers =
            path.attribute("d").unwrap().replace(|letter: char| letter.is_ascii_alphabetic(), " ");
        let numbers: Vec<f64> =
            numbers.split_whitespace().map(|text| text.parse().unwrap()).collect();
        let (x, y) = (numbers.iter().step_by(2), numbers.iter().skip(1).step_by(2));
        // "I <" is 2.95 + 3.18 + 8.38 wide and as high as a capital letter, 7.29.
        assert!(x.clone().all(|x| (5.0 - 14.52..=5.0).contains(x)) && x.clone().any(|x| *x < -8.0));
        assert!(
            y.clone().all(|y| (20.0 - 7.29..=20.01).contains(y)) && y.clone().any(|y| *y < 12.8)
        );
    }
}
