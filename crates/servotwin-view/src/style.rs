//! Colors, dashes and markers that distinguish series.

/// Text and axes.
pub(super) const INK: &str = "#222222";
/// Secondary text.
pub(super) const GREY: &str = "#666666";
/// Grid lines.
pub(super) const GRID: &str = "#e2e2e2";
/// Frames and connections.
pub(super) const FRAME: &str = "#8a8a8a";

/// Colors that color-blind readers can distinguish, from each other and from white. They are the darker ones of Okabe
/// and Ito, with replacements for their yellow, amber and light blue, which are too pale on white.
const COLOURS: [&str; 10] = [
    "#0072b2", "#d55e00", "#009e73", "#c2578f", "#000000", "#7a5c00", "#6f4fa8", "#2f9bd6",
    "#7f7f7f", "#9b1c31",
];

/// Dash patterns; the first is a solid line.
const DASHES: [&str; 6] = ["", "7 3", "2 2", "9 3 2 3", "5 2 2 2 2 2", "12 4"];

/// The style of a series: its color, and without colors its dash and marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Look {
    /// The color on white.
    pub(super) colour: &'static str,
    /// Index of dash and marker.
    pub(super) index: usize,
}

impl Look {
    pub(super) const fn new(colour: &'static str, index: usize) -> Self {
        Look { colour, index }
    }

    /// The default style of the series at an index, in a figure whose colors have no meaning elsewhere.
    pub fn nth(index: usize) -> Self {
        Look::new(COLOURS[index % COLOURS.len()], index)
    }

    /// The same color with another dash and marker.
    pub fn at(self, index: usize) -> Self {
        Look { index, ..self }
    }

    /// The dash attribute; empty for a solid line.
    pub(super) fn dash(self) -> String {
        // After each round of colors the dashes shift, so that 30 series differ.
        match DASHES[(self.index + self.index / COLOURS.len()) % DASHES.len()] {
            "" => String::new(),
            pattern => format!(" stroke-dasharray=\"{pattern}\""),
        }
    }
}

/// The given style, or the default style of the index.
pub(super) fn look_or_nth(given: Option<Look>, index: usize) -> Look {
    given.unwrap_or_else(|| Look::nth(index))
}

/// The given style for an index, or the default style of the index.
pub(super) fn look(looks: &[Look], index: usize) -> Look {
    look_or_nth(looks.get(index).copied(), index)
}

/// Black or white, whichever is more readable on a color given as `#rrggbb`.
pub(super) fn ink_on(background: &str) -> &'static str {
    // The luminance with equal contrast to both.
    const MIDDLE: f64 = 0.179;
    if luminance(background) > MIDDLE { "#000000" } else { "#ffffff" }
}

/// Relative luminance, which defines the contrast.
fn luminance(colour: &str) -> f64 {
    let linear = parts(colour).map(|part| {
        let share = part / 255.0;
        if share <= 0.040_45 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    });
    0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
}

/// Interpolates two colors, `share` from 0 to 1.
fn mix(from: [f64; 3], to: [f64; 3], share: f64) -> String {
    let share = share.clamp(0.0, 1.0);
    let part = |index: usize| (from[index] + (to[index] - from[index]) * share).round() as u8;
    format!("#{:02x}{:02x}{:02x}", part(0), part(1), part(2))
}

/// The light end of a value scale: not quite white, to differ from the background.
const LEAST: [f64; 3] = [247.0, 251.0, 255.0];
/// The dark end.
const MOST: [f64; 3] = [22.0, 84.0, 150.0];

/// The color of a value on a scale, `share` from 0 to 1; readable in gray as well.
pub(super) fn scale(share: f64) -> String {
    mix(LEAST, MOST, share)
}

/// The color for values beyond the dark end of the scale: equally dark, but another hue.
pub(super) const WORST: &str = "#8c0f2b";

/// A translucent fill in the color of a series, for light or dark backgrounds.
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

/// Distance of two colors, from 0 to 442.
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
        // Text on it is readable, also in cells of any value.
        for share in 0..=20 {
            let cell = scale(f64::from(share) / 20.0);
            assert!(contrast(&cell, ink_on(&cell)) >= 4.5, "{cell}");
        }
        assert!(contrast(WORST, ink_on(WORST)) >= 7.0);
    }
}
