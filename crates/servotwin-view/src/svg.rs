//! A small SVG writer: short numbers, escaped text, no identifiers, no time stamps.

use std::fmt::Write;

use super::Figure;
use super::style::INK;
use servotwin_io::text::escaped;

/// A rectangle in SVG units; `y` grows downwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Area {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

impl Area {
    pub(crate) fn right(self) -> f64 {
        self.x + self.width
    }

    pub(crate) fn bottom(self) -> f64 {
        self.y + self.height
    }
}

/// The point of a text at its position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// The style of a text.
#[derive(Debug, Clone, Copy)]
pub(super) struct Type {
    pub(crate) size: f64,
    pub(crate) anchor: Anchor,
    pub(crate) bold: bool,
    pub(crate) colour: &'static str,
    /// Rotation in degrees, clockwise.
    pub(crate) turn: f64,
    /// A white rim, for text over lines.
    pub(crate) rim: bool,
}

impl Type {
    pub(crate) fn new(size: f64) -> Self {
        Self { size, anchor: Anchor::Start, bold: false, colour: INK, turn: 0.0, rim: false }
    }

    pub(crate) fn anchor(self, anchor: Anchor) -> Self {
        Self { anchor, ..self }
    }

    pub(crate) fn bold(self) -> Self {
        Self { bold: true, ..self }
    }

    pub(crate) fn colour(self, colour: &'static str) -> Self {
        Self { colour, ..self }
    }

    pub(crate) fn turn(self, turn: f64) -> Self {
        Self { turn, ..self }
    }

    pub(crate) fn rim(self) -> Self {
        Self { rim: true, ..self }
    }
}

/// SVG elements in the order drawn.
#[derive(Debug, Default)]
pub(super) struct Canvas {
    body: String,
}

impl Canvas {
    /// Draws a rectangle; `style` holds further attributes, each after a space.
    pub(crate) fn rect(&mut self, area: Area, style: &str) {
        let Area { x, y, width, height } = area;
        let [x, y, width, height] = [x, y, width, height].map(number);
        let _ = writeln!(
            self.body,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{style}/>"
        );
    }

    pub(crate) fn line(&mut self, from: (f64, f64), to: (f64, f64), style: &str) {
        self.path(&[from, to], style);
    }

    /// Draws a line through points, without a fill.
    pub(crate) fn path(&mut self, points: &[(f64, f64)], style: &str) {
        self.shape(&outline(points), &format!(" fill=\"none\"{style}"));
    }

    /// Draws a closed and filled polygon.
    pub(crate) fn polygon(&mut self, points: &[(f64, f64)], style: &str) {
        self.shape(&(outline(points) + "Z"), style);
    }

    /// Draws a shape given in SVG's path language.
    pub(crate) fn shape(&mut self, path: &str, style: &str) {
        let _ = writeln!(self.body, "<path d=\"{path}\"{style}/>");
    }

    pub(crate) fn circle(&mut self, centre: (f64, f64), radius: f64, style: &str) {
        let [x, y, radius] = [centre.0, centre.1, radius].map(number);
        let _ = writeln!(self.body, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"{style}/>");
    }

    /// Draws a text; its anchor is at a point of the baseline.
    pub(crate) fn text(&mut self, at: (f64, f64), text: &str, kind: Type) {
        if text.is_empty() {
            return;
        }
        let [x, y, size] = [at.0, at.1, kind.size].map(number);
        let _ = write!(self.body, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"");
        match kind.anchor {
            Anchor::Start => {}
            Anchor::Middle => self.body.push_str(" text-anchor=\"middle\""),
            Anchor::End => self.body.push_str(" text-anchor=\"end\""),
        }
        if kind.bold {
            self.body.push_str(" font-weight=\"bold\"");
        }
        if kind.colour != INK {
            let _ = write!(self.body, " fill=\"{}\"", kind.colour);
        }
        if kind.turn != 0.0 {
            let _ = write!(self.body, " transform=\"rotate({} {x} {y})\"", number(kind.turn));
        }
        if kind.rim {
            self.body.push_str(
                " stroke=\"#ffffff\" stroke-width=\"3\" stroke-linejoin=\"round\" \
                 paint-order=\"stroke\"",
            );
        }
        let _ = writeln!(self.body, ">{}</text>", escaped(text));
    }

    /// Clips everything that `draw` draws at the area's edge.
    pub(crate) fn clipped(&mut self, area: Area, draw: impl FnOnce(&mut Canvas)) {
        let mut inner = Canvas::default();
        draw(&mut inner);
        let shifted = format!("{} {}", number(-area.x), number(-area.y));
        let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(number);
        // A nested document clips without an identifier, which `clipPath` would need.
        let _ = write!(
            self.body,
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\">\n\
             <g transform=\"translate({shifted})\">\n{}</g>\n</svg>\n",
            inner.body
        );
    }

    /// Adds the tooltip `title` to everything that `draw` draws.
    pub(crate) fn titled(&mut self, title: &str, draw: impl FnOnce(&mut Canvas)) {
        let _ = writeln!(self.body, "<g><title>{}</title>", escaped(title));
        draw(self);
        self.body.push_str("</g>\n");
    }

    /// Marks everything that `draw` draws as a component, by which scripts and style sheets find it.
    pub(crate) fn component(&mut self, id: &str, draw: impl FnOnce(&mut Canvas)) {
        let _ = writeln!(self.body, "<g data-component=\"{}\">", escaped(id));
        draw(self);
        self.body.push_str("</g>\n");
    }

    /// Shifts everything that `draw` draws.
    pub(crate) fn shifted(&mut self, by: (f64, f64), draw: impl FnOnce(&mut Canvas)) {
        let _ =
            writeln!(self.body, "<g transform=\"translate({} {})\">", number(by.0), number(by.1));
        draw(self);
        self.body.push_str("</g>\n");
    }

    /// The finished document on a white background, with a title for screen readers.
    pub(crate) fn finish(self, width: f64, height: f64, title: &str) -> Figure {
        let (width, height) = (width.ceil(), height.ceil());
        let title = match title {
            "" => String::new(),
            title => format!("<title>{}</title>\n", escaped(title)),
        };
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" \
             font-family=\"DejaVu Sans, Verdana, Helvetica, Arial, sans-serif\" fill=\"{INK}\">\n\
             {title}<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            self.body
        );
        Figure { svg, width, height, values: vec![] }
    }
}

/// A line as a path of steps in tenths of a unit: half the bytes of absolute coordinates.
///
/// Each step leads to the rounded position of its point, so that rounding errors do not add up.
fn outline(points: &[(f64, f64)]) -> String {
    let tenths = |value: f64| (value * 10.0).round() as i64;
    let mut path = String::new();
    let mut at = (0, 0);
    for (place, (x, y)) in points.iter().enumerate() {
        let next = (tenths(*x), tenths(*y));
        let step = (next.0 - at.0, next.1 - at.1);
        if place == 0 || step != (0, 0) || points.len() == 2 {
            path.push(if place == 0 { 'M' } else { 'l' });
            push_tenths(&mut path, step.0);
            if step.1 >= 0 {
                path.push(' ');
            }
            push_tenths(&mut path, step.1);
        }
        at = next;
    }
    path
}

fn push_tenths(path: &mut String, tenths: i64) {
    if tenths < 0 {
        path.push('-');
    }
    let (whole, part) = (tenths.unsigned_abs() / 10, tenths.unsigned_abs() % 10);
    if whole > 0 || part == 0 {
        let _ = write!(path, "{whole}");
    }
    if part > 0 {
        let _ = write!(path, ".{part}");
    }
}

/// A coordinate with at most two decimal places; non-finite values become 0.
pub(super) fn number(value: f64) -> String {
    let rounded = (value * 100.0).round() / 100.0;
    // Adding zero turns negative zero into positive zero.
    if rounded.is_finite() { format!("{}", rounded + 0.0) } else { "0".to_owned() }
}
