//! Readable text: identifiers as words, numbers, and text in HTML.

/// Escapes text for HTML and drops the characters U+0001 to U+0004.
pub fn escaped(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            '\u{1}'..='\u{4}' => {}
            other => html.push(other),
        }
    }
    html
}

/// An identifier as words: `external_leakage` → `external leakage`.
pub fn spoken(name: &str) -> String {
    name.replace('.', ": ").replace('_', " ")
}

/// A number with three significant digits.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let size = value.abs();
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.2e}");
    }
    let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        let cases = [(0.0, "0"), (0.012_345, "0.0123"), (-12.345, "-12.3"), (1e-7, "1.00e-7")];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
        assert_eq!(number(1234.5), "1234");
    }
}
