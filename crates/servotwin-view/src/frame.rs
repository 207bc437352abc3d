//! The frame of a chart: grid, ticks, labels and axis titles around a plotting area.

use super::axis::Axis;
use super::font;
use super::style::{FRAME, GRID};
use super::svg::{Anchor, Area, Canvas, Type};

/// The font size of tick labels.
pub(super) const TICK_SIZE: f64 = 10.0;
/// The font size of axis titles.
pub(super) const TITLE_SIZE: f64 = 11.0;
/// The space below a plotting area for tick labels alone.
pub(super) const TICKS_BELOW: f64 = 18.0;
/// The space below a plotting area for tick labels and a title.
pub(super) const TITLE_BELOW: f64 = 34.0;

/// A plotting area with its two axes.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(crate) area: Area,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
}

impl Frame {
    /// A point's coordinates; `None` if the axes cannot show it.
    pub(crate) fn point(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        Some((self.x_at(x)?, self.y_at(y)?))
    }

    /// A value's horizontal coordinate.
    pub(crate) fn x_at(&self, value: f64) -> Option<f64> {
        self.x.place(value, self.area.x, self.area.right())
    }

    /// A value's vertical coordinate.
    pub(crate) fn y_at(&self, value: f64) -> Option<f64> {
        self.y.place(value, self.area.bottom(), self.area.y)
    }

    /// Draws the grid lines; call it before the data.
    pub(crate) fn draw_grid(&self, canvas: &mut Canvas) {
        let Area { x, y, .. } = self.area;
        let style = format!(" stroke=\"{GRID}\"");
        for at in self.x.ticks.iter().filter_map(|tick| self.x_at(tick.at)) {
            canvas.line((at, y), (at, self.area.bottom()), &style);
        }
        for at in self.y.ticks.iter().filter_map(|tick| self.y_at(tick.at)) {
            canvas.line((x, at), (self.area.right(), at), &style);
        }
    }

    /// Draws the outline; call it after the data.
    pub(crate) fn draw_outline(&self, canvas: &mut Canvas) {
        canvas.rect(self.area, &format!(" fill=\"none\" stroke=\"{FRAME}\""));
    }

    /// Draws labels and title of the horizontal axis.
    pub(crate) fn draw_x_labels(&self, canvas: &mut Canvas, title: &str) {
        let bottom = self.area.bottom();
        let kind = Type::new(TICK_SIZE).anchor(Anchor::Middle);
        let mut free_from = f64::NEG_INFINITY;
        for tick in &self.x.ticks {
            let Some(at) = self.x_at(tick.at) else {
                continue;
            };
            canvas.line((at, bottom), (at, bottom + 3.0), &format!(" stroke=\"{FRAME}\""));
            let half = font::width(&tick.label, TICK_SIZE, false) / 2.0;
            // Omits a label that would touch the previous one; its tick stays.
            if at - half >= free_from {
                canvas.text((at, bottom + 14.0), &tick.label, kind);
                free_from = at + half + 4.0;
            }
        }
        let middle = self.area.x + self.area.width / 2.0;
        let kind = Type::new(TITLE_SIZE).anchor(Anchor::Middle);
        canvas.text((middle, bottom + 29.0), &self.x.title(title), kind);
    }

    /// Draws labels and title of the vertical axis; the title's baseline is at `title_x`.
    pub(crate) fn draw_y_labels(&self, canvas: &mut Canvas, title: &str, title_x: f64) {
        let kind = Type::new(TICK_SIZE).anchor(Anchor::End);
        for tick in &self.y.ticks {
            let Some(at) = self.y_at(tick.at) else {
                continue;
            };
            canvas.line(
                (self.area.x - 3.0, at),
                (self.area.x, at),
                &format!(" stroke=\"{FRAME}\""),
            );
            canvas.text((self.area.x - 5.0, at + 3.6), &tick.label, kind);
        }
        let title = font::fit(&self.y.title(title), self.area.height + 24.0, TITLE_SIZE);
        let kind = Type::new(TITLE_SIZE).anchor(Anchor::Middle).turn(-90.0);
        canvas.text((title_x, self.area.y + self.area.height / 2.0), &title, kind);
    }
}

/// Width of an axis's labels at the left of a plotting area.
pub(super) fn labels_width(axis: &Axis) -> f64 {
    let widths = axis.ticks.iter().map(|tick| font::width(&tick.label, TICK_SIZE, false));
    widths.fold(0.0, f64::max) + 7.0
}
