//! Confusion matrices: the number of cases for each pair of true and predicted class.
//!
//! A cell's shade is its share of its row, from white to dark blue, which stays readable in gray. The text in it is the
//! count and, if it fits, that share in percent.

use super::Figure;
use super::font;
use super::style::{FRAME, GREY, ink_on, scale};
use super::svg::{Anchor, Area, Canvas, Type};

/// A matrix of counts, true classes in rows and predicted ones in columns.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfusionMatrix {
    /// The figure's title, may be empty.
    pub title: String,
    /// The class names, of rows and columns.
    pub classes: Vec<String>,
    /// The counts, `counts[true][predicted]`; missing ones count as zero.
    pub counts: Vec<Vec<u64>>,
}

const MARGIN: f64 = 10.0;
const LABEL_SIZE: f64 = 10.0;

impl ConfusionMatrix {
    /// A matrix from its classes and counts.
    pub fn new(title: impl Into<String>, classes: Vec<String>, counts: Vec<Vec<u64>>) -> Self {
        Self { title: title.into(), classes, counts }
    }

    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let (cell, label_size) = self.sizes();
        let longest = self.classes.iter().map(|name| font::width(name, label_size, false));
        let labels = longest.fold(0.0, f64::max).min(220.0);
        // Short names are horizontal above the columns, long ones vertical.
        let level = labels <= cell - 4.0;
        let left = MARGIN + 18.0 + labels + 6.0;
        let titles = if self.title.is_empty() { 0.0 } else { 22.0 };
        let top = MARGIN + titles + 18.0 + if level { 14.0 } else { labels + 6.0 };
        let side = cell * self.classes.len() as f64;
        if !self.title.is_empty() {
            canvas.text((MARGIN, MARGIN + 12.0), &self.title, Type::new(13.0).bold());
        }
        let middle = Type::new(11.0).anchor(Anchor::Middle);
        canvas.text((left + side / 2.0, MARGIN + titles + 11.0), "predicted class", middle);
        canvas.text((MARGIN + 10.0, top + side / 2.0), "true class", middle.turn(-90.0));
        self.draw_labels(&mut canvas, (left, top), cell, labels, level);
        for row in 0..self.classes.len() {
            self.draw_row(&mut canvas, row, (left, top + cell * row as f64), cell);
        }
        let area = Area { x: left, y: top, width: side, height: side };
        canvas.rect(area, &format!(" fill=\"none\" stroke=\"{FRAME}\""));
        let bar =
            Area { x: left + side + 14.0, y: top, width: 12.0, height: side.clamp(60.0, 240.0) };
        draw_scale(&mut canvas, bar, ["100%", "50%", "0%"]);
        let title = font::width(&self.title, 13.0, true) + 2.0 * MARGIN;
        let bottom = area.bottom().max(bar.bottom()) + MARGIN;
        let figure = canvas.finish((bar.right() + 44.0).max(title), bottom, &self.title);
        figure.with_values(&["true class", "said", "cases"], self.values())
    }

    fn count(&self, row: usize, column: usize) -> u64 {
        self.counts.get(row).and_then(|counts| counts.get(column)).copied().unwrap_or(0)
    }

    /// The count of every pair of classes that occurs.
    fn values(&self) -> Vec<Vec<String>> {
        let places = 0..self.classes.len();
        let pairs = places.clone().flat_map(|row| places.clone().map(move |column| (row, column)));
        let there = pairs.filter(|&(row, column)| self.count(row, column) > 0);
        let value = |(row, column): (usize, usize)| {
            let count = self.count(row, column).to_string();
            vec![self.classes[row].clone(), self.classes[column].clone(), count]
        };
        there.map(value).collect()
    }

    /// The side of a cell, and the font size of the class names.
    fn sizes(&self) -> (f64, f64) {
        match self.classes.len() {
            0..=6 => (58.0, LABEL_SIZE + 0.5),
            7..=12 => (46.0, LABEL_SIZE),
            13..=24 => (38.0, LABEL_SIZE),
            _ => (26.0, LABEL_SIZE - 1.0),
        }
    }

    fn draw_labels(
        &self,
        canvas: &mut Canvas,
        (left, top): (f64, f64),
        cell: f64,
        available: f64,
        level: bool,
    ) {
        let size = self.sizes().1;
        for (place, name) in self.classes.iter().enumerate() {
            let name = font::fit(name, available, size);
            let middle = cell * (place as f64 + 0.5);
            let kind = Type::new(size);
            let row = (left - 6.0, top + middle + size * 0.36);
            canvas.text(row, &name, kind.anchor(Anchor::End));
            if level {
                canvas.text((left + middle, top - 5.0), &name, kind.anchor(Anchor::Middle));
            } else {
                canvas.text((left + middle + size * 0.36, top - 5.0), &name, kind.turn(-90.0));
            }
        }
    }

    fn draw_row(&self, canvas: &mut Canvas, row: usize, (left, top): (f64, f64), cell: f64) {
        let count = |column: usize| self.count(row, column);
        let total: u64 = (0..self.classes.len()).map(count).sum();
        for column in 0..self.classes.len() {
            let x = left + cell * column as f64;
            let area = Area { x, y: top, width: cell, height: cell };
            let share = count(column) as f64 / total.max(1) as f64;
            let fill = scale(share);
            let style = format!(" fill=\"{fill}\" stroke=\"#d5d5d5\" stroke-width=\".5\"");
            if count(column) == 0 {
                canvas.rect(area, &style);
                continue;
            }
            let [truth, said] = [row, column].map(|class| &self.classes[class]);
            let title = format!("{truth} taken for {said}: {} of {total}", count(column));
            canvas.titled(&title, |canvas| {
                canvas.rect(area, &style);
                draw_cell_text(canvas, count(column), share, area, ink_on(&fill));
            });
        }
        if total == 0 {
            let kind = Type::new(9.0).colour(GREY);
            canvas.text((left + 4.0, top + cell / 2.0 + 3.0), "no case", kind);
        }
    }
}

fn draw_cell_text(canvas: &mut Canvas, count: u64, share: f64, area: Area, ink: &'static str) {
    let text = count.to_string();
    let size = [11.0, 10.0, 9.0, 8.0, 7.0, 6.0];
    let fits = |size: &f64| font::width(&text, *size, false) <= area.width - 4.0;
    let size = size.into_iter().find(fits).unwrap_or(5.0);
    let kind = Type::new(size).anchor(Anchor::Middle).colour(ink);
    let x = area.x + area.width / 2.0;
    let middle = area.y + area.height / 2.0;
    if area.height < 34.0 {
        canvas.text((x, middle + size * 0.36), &text, kind);
        return;
    }
    let percent = match share * 100.0 {
        small if small < 0.1 => "<0.1%".to_owned(),
        all if all >= 99.95 => "100%".to_owned(),
        some => format!("{some:.1}%"),
    };
    canvas.text((x, middle - 1.0), &text, kind);
    canvas.text((x, middle + 10.0), &percent, Type { size: 8.0, ..kind });
}

/// Draws the color scale beside a map, with labels of its upper end, middle and lower end.
pub(super) fn draw_scale(canvas: &mut Canvas, area: Area, labels: [&str; 3]) {
    const STEPS: usize = 24;
    let step = area.height / STEPS as f64;
    for place in 0..STEPS {
        let share = 1.0 - (place as f64 + 0.5) / STEPS as f64;
        let y = area.y + step * place as f64;
        // A little overlap hides white seams between the steps.
        let height = if place + 1 == STEPS { step } else { step + 0.5 };
        let fill = scale(share);
        canvas.rect(Area { y, height, ..area }, &format!(" fill=\"{fill}\""));
    }
    canvas.rect(area, &format!(" fill=\"none\" stroke=\"{FRAME}\" stroke-width=\".6\""));
    for (share, label) in [0.0, 0.5, 1.0].into_iter().zip(labels) {
        let y = area.y + area.height * share;
        canvas.text((area.right() + 4.0, y + 3.4), label, Type::new(9.0));
    }
}
