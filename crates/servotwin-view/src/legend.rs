//! Legends: a swatch and a name for each series, wrapped into rows.

use super::font;
use super::style::{GREY, Look};
use super::svg::{Area, Canvas, Type};

/// The symbol before a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Swatch {
    /// The line of a series.
    Line(Look),
    /// The line of a series with its marker.
    Marked(Look),
    /// A filled box in the color of a series.
    Box(Look),
    /// A box in a tint of the series' color, with an outline.
    Tinted(Look),
    /// A translucent gray band.
    Band,
    /// Dashed gray lines.
    Limit,
}

/// A name with its swatch.
#[derive(Debug, Clone)]
pub(super) struct LegendEntry {
    pub(crate) name: String,
    pub(crate) swatch: Swatch,
}

/// The height of one row.
pub(super) const ROW: f64 = 14.0;
const SIZE: f64 = 10.0;
const SWATCH: f64 = 22.0;
const GAP: f64 = 14.0;

fn entry_width(entry: &LegendEntry) -> f64 {
    SWATCH + 4.0 + font::width(&entry.name, SIZE, false)
}

/// Distributes entries over rows that fit a width, in order.
pub(super) fn rows(entries: &[LegendEntry], width: f64) -> Vec<Vec<LegendEntry>> {
    let mut rows: Vec<Vec<LegendEntry>> = Vec::new();
    let mut used = 0.0;
    for entry in entries {
        let mut entry = entry.clone();
        entry.name = font::fit(&entry.name, width - SWATCH - 4.0, SIZE);
        let needed = entry_width(&entry);
        match rows.last_mut() {
            Some(row) if used + GAP + needed <= width => {
                used += GAP + needed;
                row.push(entry);
            }
            _ => {
                used = needed;
                rows.push(vec![entry]);
            }
        }
    }
    rows
}

/// The width of a row.
pub(super) fn row_width(row: &[LegendEntry]) -> f64 {
    row.iter().map(entry_width).sum::<f64>() + GAP * row.len().saturating_sub(1) as f64
}

/// Draws the rows downwards from their top left corner.
pub(super) fn draw(canvas: &mut Canvas, corner: (f64, f64), rows: &[Vec<LegendEntry>]) {
    for (place, row) in rows.iter().enumerate() {
        let middle = corner.1 + ROW * (place as f64 + 0.5);
        let mut x = corner.0;
        for entry in row {
            draw_swatch(canvas, entry.swatch, x, middle);
            canvas.text((x + SWATCH + 4.0, middle + 3.5), &entry.name, Type::new(SIZE));
            x += entry_width(entry) + GAP;
        }
    }
}

fn draw_swatch(canvas: &mut Canvas, swatch: Swatch, x: f64, y: f64) {
    let area = Area { x: x + 5.0, y: y - 5.0, width: 12.0, height: 10.0 };
    let line = |canvas: &mut Canvas, look: Look| {
        let style = format!(" stroke=\"{}\" stroke-width=\"1.8\"{}", look.colour, look.dash());
        canvas.line((x, y), (x + SWATCH, y), &style);
    };
    match swatch {
        Swatch::Line(look) => line(canvas, look),
        Swatch::Marked(look) => {
            line(canvas, look);
            marker(canvas, look, (x + SWATCH / 2.0, y));
        }
        Swatch::Box(look) => canvas.rect(area, &format!(" fill=\"{}\"", look.colour)),
        Swatch::Tinted(look) => canvas.rect(
            area,
            &format!(
                " fill=\"{0}\" fill-opacity=\".25\" stroke=\"{0}\"{1}",
                look.colour,
                look.dash()
            ),
        ),
        Swatch::Band => canvas.rect(area, " fill=\"#888888\" fill-opacity=\".25\""),
        Swatch::Limit => canvas.line(
            (x, y),
            (x + SWATCH, y),
            &format!(" stroke=\"{GREY}\" stroke-dasharray=\"4 3\""),
        ),
    }
}

/// The marker of a series.
pub(super) fn marker(canvas: &mut Canvas, look: Look, (x, y): (f64, f64)) {
    let style = format!(" fill=\"{}\" stroke=\"#ffffff\" stroke-width=\".7\"", look.colour);
    let r = 3.6;
    let at = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        points.iter().map(|(dx, dy)| (x + dx * r, y + dy * r)).collect()
    };
    match look.index % 6 {
        0 => canvas.circle((x, y), r, &style),
        1 => canvas.rect(Area { x: x - 3.2, y: y - 3.2, width: 6.4, height: 6.4 }, &style),
        2 => canvas.polygon(&at(&[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)]), &style),
        3 => canvas.polygon(&at(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)]), &style),
        4 => canvas.polygon(&at(&[(0.0, 1.2), (1.1, -0.8), (-1.1, -0.8)]), &style),
        _ => canvas.circle(
            (x, y),
            r - 0.6,
            &format!(" fill=\"#ffffff\" stroke=\"{}\" stroke-width=\"1.6\"", look.colour),
        ),
    }
}
