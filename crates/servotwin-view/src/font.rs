//! Text widths, to avoid overlaps.
//!
//! The widths are those of DejaVu Sans, one of the widest common fonts. A viewer with another sans-serif font shows
//! slightly more space, not less.

/// Advance widths of the printable ASCII characters, in thousandths of the font size.
#[rustfmt::skip]
const WIDTHS: [u16; 95] = [
    318, 401, 460, 838, 636, 950, 780, 275, 390, 390, 500, 838, 318, 361, 318, 337, 636, 636, 636,
    636, 636, 636, 636, 636, 636, 636, 337, 337, 838, 838, 838, 531, 1000, 684, 686, 698, 770, 632,
    575, 775, 752, 295, 295, 656, 557, 863, 748, 787, 603, 787, 695, 635, 611, 732, 684, 989, 685,
    611, 685, 390, 337, 390, 838, 500, 500, 613, 635, 550, 635, 615, 352, 635, 634, 278, 278, 579,
    278, 974, 634, 612, 635, 635, 411, 521, 392, 634, 592, 818, 592, 592, 525, 636, 337, 636, 838,
];

/// Upper limit of the average width ratio of bold and regular words.
const BOLD: f64 = 1.14;

/// The width of a text at a font size.
pub(super) fn width(text: &str, size: f64, bold: bool) -> f64 {
    let thousandths: f64 = text.chars().map(|letter| f64::from(letter_width(letter))).sum();
    thousandths * size / 1000.0 * if bold { BOLD } else { 1.0 }
}

fn letter_width(letter: char) -> u16 {
    let place = (letter as usize).wrapping_sub(32);
    match letter {
        _ if place < WIDTHS.len() => WIDTHS[place],
        '°' | '–' => 500,
        '²' | '³' | '⁰'..='⁹' | '₀'..='₉' => 401,
        '⁻' => 528,
        '·' => 318,
        '′' => 227,
        '−' | '±' | '×' | '≤' | '≥' | '≠' | '→' => 838,
        '…' => 1000,
        _ => 700,
    }
}

/// The text, or as much of its beginning as fits, with an ellipsis.
pub(super) fn fit(text: &str, available: f64, size: f64) -> String {
    if width(text, size, false) <= available {
        return text.to_owned();
    }
    let mut short = String::new();
    let mut used = width("…", size, false);
    for letter in text.chars() {
        used += f64::from(letter_width(letter)) * size / 1000.0;
        if used > available {
            break;
        }
        short.push(letter);
    }
    short.truncate(short.trim_end().len());
    short + "…"
}

/// Wraps text into lines that fit: at spaces, and in long words after `_`, `.` or `/`.
pub(super) fn wrap(text: &str, available: f64, size: f64, bold: bool) -> Vec<String> {
    let fits = |line: &str| width(line.trim_end(), size, bold) <= available;
    let mut lines: Vec<String> = vec![String::new()];
    let mut push = |part: &str| {
        let last = lines.last_mut().expect("there is always a line");
        if last.is_empty() || fits(&format!("{last}{part}")) {
            last.push_str(part);
        } else {
            lines.push(part.to_owned());
        }
    };
    for word in text.split_inclusive(' ') {
        match fits(word) {
            true => push(word),
            false => word.split_inclusive(['_', '.', '/']).for_each(&mut push),
        }
    }
    lines.iter().map(|line| line.trim_end().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_wrapped_without_losing_a_letter() {
        let text = "variance_of_pressure_a_less_variance_of_pressure_b ≤ 3.2 %";
        let lines = wrap(text, 100.0, 10.0, true);
        assert!(lines.len() > 2 && lines.iter().all(|line| width(line, 10.0, true) <= 100.0));
        assert_eq!(lines.concat().replace(' ', ""), text.replace(' ', ""));
        assert_eq!(wrap("a b", 100.0, 10.0, false), ["a b"]);
    }
}
