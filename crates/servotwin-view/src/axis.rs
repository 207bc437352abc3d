//! Axes: ranges, ticks at round numbers, and their labels.

use crate::document::NONE;
use servotwin_io::text::number;

/// A tick with its label.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    pub(crate) at: f64,
    pub(crate) label: String,
}

/// A range with ticks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) ticks: Vec<Tick>,
    /// The labels' common factor, such as `×10⁶`; empty for one.
    pub(crate) factor: String,
}

impl Axis {
    /// An axis over a range, with about `count` ticks.
    pub(crate) fn linear(range: (f64, f64), count: usize) -> Self {
        let (low, high) = widened(range);
        let step = round_step((high - low) / count.max(1) as f64);
        let largest = low.abs().max(high.abs());
        let exponent = engineering_exponent(largest);
        let unit = 10_f64.powi(exponent);
        let digits = digits_after_point(step / unit);
        let first = (low / step - 1e-9).ceil() as i64;
        let last = (high / step + 1e-9).floor() as i64;
        let tick = |index: i64| {
            let at = index as f64 * step;
            Tick { at, label: signed(format!("{:.digits$}", at / unit)) }
        };
        let ticks = (first..=last).map(tick).collect();
        let factor = if exponent == 0 { String::new() } else { format!("×{}", power(exponent)) };
        Self { low, high, ticks, factor }
    }

    /// Extends the axis to the next tick if that is very near, like 90 s for 9000 samples at 100 Hz.
    pub(crate) fn reaching_ticks(self) -> Self {
        let [first, second, ..] = self.ticks.as_slice() else {
            return self;
        };
        let (step, margin) = (second.at - first.at, 0.01 * (self.high - self.low));
        let lower = (self.low / step).floor() * step;
        let upper = (self.high / step).ceil() * step;
        let low = if self.low - lower <= margin { lower } else { self.low };
        let high = if upper - self.high <= margin { upper } else { self.high };
        let count = ((high - low) / step).ceil().max(1.0) as usize;
        Self::linear((low, high), count)
    }

    /// Maps a value to a coordinate between `from` and `to`; `None` if the axis cannot show it.
    pub(crate) fn place(&self, value: f64, from: f64, to: f64) -> Option<f64> {
        let share = (value - self.low) / (self.high - self.low);
        share.is_finite().then_some(from + share * (to - from))
    }

    /// An axis title with the ticks' factor.
    pub(crate) fn title(&self, label: &str) -> String {
        match (label, self.factor.as_str()) {
            (label, "") => label.to_owned(),
            ("", factor) => factor.to_owned(),
            (label, factor) => format!("{label} ({factor})"),
        }
    }
}

/// The smallest and largest finite value; `None` without any.
pub(super) fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|value| value.is_finite()).fold(None, |range, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    })
}

/// A range with a share of its width added on both sides.
pub(super) fn padded((low, high): (f64, f64), share: f64) -> (f64, f64) {
    let (low, high) = widened((low, high));
    let pad = (high - low) * share;
    (low - pad, high + pad)
}

/// A range, widened if it is a single value.
fn widened((low, high): (f64, f64)) -> (f64, f64) {
    let scale = low.abs().max(high.abs());
    if !(high - low).is_finite() {
        return (0.0, 1.0);
    }
    if high - low > scale * 1e-12 {
        return (low, high);
    }
    let margin = if scale > 0.0 { scale * 0.1 } else { 1.0 };
    (low - margin, high + margin)
}

/// The next larger of 1, 2, 2.5, 5 times a power of ten.
fn round_step(rough: f64) -> f64 {
    if !(rough.is_finite() && rough > 0.0) {
        return 1.0;
    }
    let decade = 10_f64.powi(rough.log10().floor() as i32);
    let parts = [1.0, 2.0, 2.5, 5.0, 10.0];
    let part = parts.into_iter().find(|part| part * decade >= rough * (1.0 - 1e-9));
    part.unwrap_or(10.0) * decade
}

/// The exponent of the labels' common factor: a multiple of three, 0 for numbers of usual size.
fn engineering_exponent(largest: f64) -> i32 {
    if !(1e-2..1e4).contains(&largest) && largest > 0.0 && largest.is_finite() {
        return (largest.log10() / 3.0).floor() as i32 * 3;
    }
    0
}

fn digits_after_point(step: f64) -> usize {
    (0..12)
        .find(|digits| {
            let scaled = step * 10_f64.powi(*digits);
            (scaled - scaled.round()).abs() < 1e-6 * scaled
        })
        .unwrap_or(12) as usize
}

/// A number for a tooltip: four significant digits, no trailing zeros.
pub(super) fn plain(value: f64) -> String {
    if value.is_finite() { signed(number(value, 4)) } else { NONE.to_owned() }
}

/// Uses the typographic minus sign, and removes the sign of zero.
fn signed(text: String) -> String {
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|digit| matches!(digit, '0' | '.')) => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

fn power(exponent: i32) -> String {
    let raised = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit.to_digit(10).unwrap_or(0)).unwrap_or('⁰'),
    };
    format!("10{}", exponent.to_string().chars().map(raised).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn a_value_has_four_digits_and_no_idle_zeros() {
        let cases = [
            (0.25, "0.25"),
            (100.0, "100"),
            (-1.0, "−1"),
            (0.123_456, "0.1235"),
            (98.765_43, "98.77"),
            (0.0, "0"),
            (f64::NAN, "–"),
            (1e-7, "1e-7"),
        ];
        for (value, text) in cases {
            assert_eq!(plain(value), text);
        }
    }
}
