//! Colours, dashes and markers: what tells one series from another.

/// Text and axes.
pub(super) const INK: &str = "#222222";
/// Secondary text.
pub(super) const GREY: &str = "#666666";
/// Grid lines.
pub(super) const GRID: &str = "#e2e2e2";
/// Frames and connections.
pub(super) const FRAME: &str = "#8a8a8a";

/// Colours that differ from each other and from white for colour-blind readers, too: Okabe and Ito's
/// that are dark enough, and others in place of their yellow, amber and light blue, which fade on white.
const COLOURS: [&str; 10] = [
    "#0072b2", "#d55e00", "#009e73", "#c2578f", "#000000", "#7a5c00", "#6f4fa8", "#2f9bd6",
    "#7f7f7f", "#9b1c31",
];

/// Dash patterns; the first is a full line.
const DASHES: [&str; 6] = ["", "7 3", "2 2", "9 3 2 3", "5 2 2 2 2 2", "12 4"];

/// What tells a series from the others: its colour, and without colours its dash and marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Look {
    /// The colour on white.
    pub(super) colour: &'static str,
    /// Which dash and marker.
    pub(super) index: usize,
}

impl Look {
    pub(super) const fn new(colour: &'static str, index: usize) -> Self {
        Look { colour, index }
    }

    /// That of the series at a place in a figure whose colours mean nothing outside of it.
    pub fn nth(index: usize) -> Self {
        Look::new(COLOURS[index % COLOURS.len()], index)
    }

    /// The same colour with the dash and marker of a place.
    pub fn at(self, index: usize) -> Self {
        Look { index, ..self }
    }

    /// The dash attribute, empty for a full line.
    pub(super) fn dash(self) -> String {
        // After a round of colours the dashes move on, so that 30 series differ.
        match DASHES[(self.index + self.index / COLOURS.len()) % DASHES.len()] {
            "" => String::new(),
            pattern => format!(" stroke-dasharray=\"{pattern}\""),
        }
    }
}

/// The look that is given, or that of a place.
pub(super) fn look_or_nth(given: Option<Look>, index: usize) -> Look {
    given.unwrap_or_else(|| Look::nth(index))
}

/// The look that is given for a place, or that of the place.
pub(super) fn look(looks: &[Look], index: usize) -> Look {
    look_or_nth(looks.get(index).copied(), index)
}

/// Black or white, whichever is read better on a colour given as `#rrggbb`.
pub(super) fn ink_on(background: &str) -> &'static str {
    // Where the contrast with both is the same.
    const MIDDLE: f64 = 0.179;
    if luminance(background) > MIDDLE { "#000000" } else { "#ffffff" }
}

/// Relative luminance, as contrast is defined by.
fn luminance(colour: &str) -> f64 {
    let linear = parts(colour).map(|part| {
        let share = part / 255.0;
        if share <= 0.040_45 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    });
    0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
}

/// A colour between two, `share` from 0 to 1.
fn mix(from: [f64; 3], to: [f64; 3], share: f64) -> String {
    let share = share.clamp(0.0, 1.0);
    let part = |index: usize| (from[index] + (to[index] - from[index]) * share).round() as u8;
    format!("#{:02x}{:02x}{:02x}", part(0), part(1), part(2))
}

/// The light end of a scale of values: not quite white, so that it is told from the ground.
const LEAST: [f64; 3] = [247.0, 251.0, 255.0];
/// The dark end.
const MOST: [f64; 3] = [22.0, 84.0, 150.0];

/// The colour of a value on a scale, `share` from 0 to 1: read in grey as well.
pub(super) fn scale(share: f64) -> String {
    mix(LEAST, MOST, share)
}

/// What is worse than the dark end of the scale: as dark, and of another hue.
pub(super) const WORST: &str = "#8c0f2b";

/// A filling with the colour of a series that lets the ground through, light or dark.
pub(super) fn tint(colour: &str, share: f64) -> String {
    format!(" fill=\"{colour}\" fill-opacity=\"{share}\"")
}

/// Red, green and blue of `#rrggbb`, from 0 to 255.
fn parts(colour: &str) -> [f64; 3] {
    [1, 3, 5].map(|start| {
        let digits = colour.get(start..start + 2).unwrap_or("ff");
        f64::from(u8::from_str_radix(digits, 16).unwrap_or(255))
    })
}

#[cfg(test)]
pub(super) fn contrast(one: &str, other: &str) -> f64 {
    let (one, other) = (luminance(one) + 0.05, luminance(other) + 0.05);
    one.max(other) / one.min(other)
}

/// How far two colours are from each other, from 0 to 442.
#[cfg(test)]
pub(super) fn difference(one: &str, other: &str) -> f64 {
    let parts = parts(one).into_iter().zip(parts(other));
    parts.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_differ_from_each_other_and_from_the_ground() {
        for (place, colour) in COLOURS.iter().enumerate() {
            assert!(contrast(colour, "#ffffff") >= 3.0, "{colour} fades on white");
            for other in &COLOURS[place + 1..] {
                assert!(difference(colour, other) > 60.0, "{colour} and {other} look alike");
            }
        }
        let series: Vec<(&str, String)> =
            (0..30).map(Look::nth).map(|look| (look.colour, look.dash())).collect();
        for (place, one) in series.iter().enumerate() {
            assert!(!series[place + 1..].contains(one), "series {place} is drawn twice");
        }
    }

    #[test]
    fn the_worst_stands_out_most() {
        let [worst, most, half] = [WORST, &scale(1.0), &scale(0.5)].map(|c| contrast(c, "#ffffff"));
        assert!(worst > most && most > half, "{worst} {most} {half}");
        // Text in it is read, in cells of any value too.
        for share in 0..=20 {
            let cell = scale(f64::from(share) / 20.0);
            assert!(contrast(&cell, ink_on(&cell)) >= 4.5, "{cell}");
        }
        assert!(contrast(WORST, ink_on(WORST)) >= 7.0);
    }
}
