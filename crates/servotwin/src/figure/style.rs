//! Colours, dashes and markers: what tells one series from another.

/// Text and axes.
pub(super) const INK: &str = "#222222";
/// Secondary text.
pub(super) const GREY: &str = "#666666";
/// Grid lines.
pub(super) const GRID: &str = "#e2e2e2";
/// Frames and connections.
pub(super) const FRAME: &str = "#8a8a8a";

/// Okabe and Ito's colours, those that stand out best on white first; a brown in place of their yellow,
/// which nobody sees there.
const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#7a5c00"];

/// Dash patterns; the first is a full line.
const DASHES: [&str; 6] = ["", "7 3", "2 2", "9 3 2 3", "5 2 2 2 2 2", "12 4"];

/// The colour of the series of an index.
pub(super) fn colour(index: usize) -> &'static str {
    COLOURS[index % COLOURS.len()]
}

/// The dash attribute of the series of an index, empty for a full line.
pub(super) fn dash(index: usize) -> String {
    // After a round of colours the dashes move on, so that 24 series differ.
    match DASHES[(index + index / COLOURS.len()) % DASHES.len()] {
        "" => String::new(),
        pattern => format!(" stroke-dasharray=\"{pattern}\""),
    }
}

/// Black or white, whichever is read better on a colour given as `#rrggbb`.
pub(super) fn ink_on(background: &str) -> &'static str {
    let [red, green, blue] = parts(background);
    if 0.299 * red + 0.587 * green + 0.114 * blue > 140.0 { "#000000" } else { "#ffffff" }
}

/// A colour between two, `share` from 0 to 1.
pub(super) fn mix(from: [f64; 3], to: [f64; 3], share: f64) -> String {
    let share = share.clamp(0.0, 1.0);
    let part = |index: usize| (from[index] + (to[index] - from[index]) * share).round() as u8;
    format!("#{:02x}{:02x}{:02x}", part(0), part(1), part(2))
}

/// A colour made darker, for the edge of a box filled with its tint.
pub(super) fn shade(colour: &str) -> String {
    mix([0.0; 3], parts(colour), 0.7)
}

/// A colour made lighter, as a background for text.
pub(super) fn tint(colour: &str, share: f64) -> String {
    mix([255.0; 3], parts(colour), share)
}

/// Red, green and blue of `#rrggbb`, from 0 to 255.
fn parts(colour: &str) -> [f64; 3] {
    [1, 3, 5].map(|start| {
        let digits = colour.get(start..start + 2).unwrap_or("ff");
        f64::from(u8::from_str_radix(digits, 16).unwrap_or(255))
    })
}
