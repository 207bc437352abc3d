//! Readable text: identifiers as words, numbers, and text in HTML.

use base64::prelude::{BASE64_STANDARD as STANDARD, Engine};

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

/// A number with `digits` significant digits and no needless zeros.
pub fn number(value: f64, digits: usize) -> String {
    let text = significant(value, digits, 1e7);
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{}e{exponent}", without_zeros(mantissa)),
        None => without_zeros(&text).to_owned(),
    }
}

/// A number with three significant digits, also those that are zeros.
pub fn three_digits(value: f64) -> String {
    significant(value, 3, 1e6)
}

/// Significant digits; a number that is small, or not below `most`, has an exponent.
fn significant(value: f64, digits: usize, most: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let size = value.abs();
    if !(1e-4..most).contains(&size) {
        return format!("{value:.*e}", digits - 1);
    }
    let decimals = (digits as i32 - 1 - size.log10().floor() as i32).max(0) as usize;
    format!("{value:.decimals$}")
}

/// A number rounded to `digits` significant digits, which removes what the calculation of it left in the last ones.
pub fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

fn without_zeros(text: &str) -> &str {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => text,
    }
}

/// The first `most` names, and how many follow.
pub fn first_of(names: &[String], most: usize) -> String {
    let first = names[..names.len().min(most)].join(", ");
    match names.len().saturating_sub(most) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// Bytes in base 64.
pub fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

/// The key of an order in which numbers count as numbers: `flight_2` is before `flight_10`.
pub fn natural_order(name: &str) -> (Vec<(String, u128)>, String) {
    let (mut parts, mut rest) = (vec![], name);
    while !rest.is_empty() {
        let digit = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let (word, behind) = rest.split_at(digit);
        let end = behind.find(|c: char| !c.is_ascii_digit()).unwrap_or(behind.len());
        let (number, behind) = behind.split_at(end);
        parts.push((word.to_lowercase(), number.parse().unwrap_or(0)));
        rest = behind;
    }
    (parts, name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let sorted =
            ["2.csv", "10.csv", "flight_1.csv", "Flight_02.csv", "flight_2.csv", "flight_10.csv"];
        let mut names = sorted;
        names.reverse();
        names.sort_by_cached_key(|name| natural_order(name));
        assert_eq!(names, sorted);
        assert!(natural_order("a_2026-01-09_leg_2") < natural_order("a_2026-01-10_leg_1"));
    }

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
            assert_eq!(three_digits(value), text);
        }
        assert_eq!(three_digits(1234.5), "1234");
    }

    #[test]
    fn short_numbers_keep_their_digits_and_no_zeros() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-1234.5678, "-1234.6"),
            (206.84, "206.84"),
            (0.001_234_56, "0.0012346"),
            (2.0e-14, "2e-14"),
            (1.23456e9, "1.2346e9"),
            (99999.96, "100000"),
            (f64::NAN, "NaN"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value, 5), text);
        }
    }
}
