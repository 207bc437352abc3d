//! What others wrote, in messages: cut short, and with nothing in it that a terminal would act on.

/// So many characters of a text are shown.
const TEXT: usize = 40;

/// So many of a list.
const LIST: usize = 12;

/// The beginning of a text, with what cannot be printed escaped.
pub fn text(text: &str) -> String {
    let mut shown = String::new();
    for character in text.chars().take(TEXT) {
        match character {
            '"' | '\'' | '\\' => shown.push(character),
            _ => shown.extend(character.escape_debug()),
        }
    }
    shown + if text.chars().nth(TEXT).is_some() { "…" } else { "" }
}

/// The first of some names, and how many there are more.
pub fn list<T: AsRef<str>>(names: &[T]) -> String {
    let first = names.iter().take(LIST).map(|name| text(name.as_ref()));
    let first = first.collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(LIST) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_act_on_is_escaped_and_what_is_long_cut() {
        assert_eq!(text("p_A1 of \"ö\" °C"), "p_A1 of \"ö\" °C");
        assert_eq!(text("\u{1b}[2J\u{7}\0"), r"\u{1b}[2J\u{7}\0");
        let long = text(&"x".repeat(3000));
        assert_eq!(long.chars().count(), TEXT + 1);
        assert_eq!(list(&["a", "b"]), "a, b");
        assert!(list(&["a"; 30]).ends_with(", a and 18 more"));
    }
}
