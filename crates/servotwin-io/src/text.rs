//! Readable text: identifiers as words, numbers, and text in HTML.

/// Escapes text for HTML and XML, within quotes too, and drops the characters that XML has no spelling for.
pub fn escaped(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            '\t' | '\n' | '\r' => html.push(character),
            '\0'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{fffe}' | '\u{ffff}' => {}
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
    fn escaped_text_has_no_character_that_xml_forbids() {
        let all: String = (0..0x2_0000).filter_map(char::from_u32).collect();
        let allowed = |c: char| matches!(c, '\t' | '\n' | '\r' | ' '..='~' | '\u{a0}'..='\u{fffd}' | '\u{10000}'..);
        let text = escaped(&all);
        assert!(text.chars().all(allowed));
        assert!(!text.contains(['<', '>', '"']));
        let kept = all.chars().filter(|c| allowed(*c) && !['&', '<', '>', '"'].contains(c));
        assert_eq!(text.chars().count(), kept.count() + "&amp;&lt;&gt;&quot;".len());
        assert_eq!(escaped("bell\u{7}, A & B"), "bell, A &amp; B");
    }

    #[test]
    fn numbers_have_three_significant_digits() {
        let cases = [(0.0, "0"), (0.012_345, "0.0123"), (-12.345, "-12.3"), (1e-7, "1.00e-7")];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
        assert_eq!(number(1234.5), "1234");
    }
}
