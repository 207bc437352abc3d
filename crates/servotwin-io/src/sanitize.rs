//! Removes terminal control from file text in messages and on the terminal.
//!
//! The command line writes everything through [`Printable`]. It escapes control characters, and those that change the
//! writing direction, as JSON does (`\\u001b`), so that JSON stays valid. [`text`] and [`list`] shorten names for
//! messages.

use crate::text::first_of;
use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Write};

/// Maximum number of characters of a text.
const TEXT: usize = 40;

/// Maximum number of entries of a list.
const LIST: usize = 12;

/// The beginning of a text, with unprintable characters escaped.
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

/// The first of some names, and the number of the others.
pub fn list<T: AsRef<str>>(names: &[T]) -> String {
    let names: Vec<String> = names.iter().map(|name| text(name.as_ref())).collect();
    first_of(&names, LIST)
}

/// The most characters of a line of a message. A name in a file may be as long as the file.
const MESSAGE: usize = 2000;

/// The beginning of a line of a message.
pub fn clip(text: String) -> String {
    match text.char_indices().nth(MESSAGE) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text,
    }
}

/// Whether a terminal acts on a character instead of showing it. These are control characters (C0 except newline and
/// tab, C1, delete), and those that change the writing direction.
fn is_active(character: char) -> bool {
    let turns = matches!(
        character,
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
    );
    turns || (character.is_control() && !matches!(character, '\n' | '\t'))
}

/// Escapes all characters that a terminal acts on, except newlines and tabs.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_active) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        match is_active(character) {
            // Writing to a string cannot fail.
            true => _ = write!(shown, "\\u{:04x}", u32::from(character)),
            false => shown.push(character),
        }
    }
    Cow::Owned(shown)
}

/// A writer of [`printable`] text. Invalid UTF-8 becomes `U+FFFD`.
#[derive(Debug)]
pub struct Printable<W> {
    inner: W,
    /// The start of a character that the next bytes complete.
    begun: Vec<u8>,
}

impl<W: Write> Printable<W> {
    /// Creates a filter in front of another writer.
    pub fn new(inner: W) -> Self {
        Printable { inner, begun: Vec::new() }
    }
}

impl<W: Write> Write for Printable<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut all = std::mem::take(&mut self.begun);
        all.extend_from_slice(bytes);
        let mut rest = all.as_slice();
        let mut shown = String::new();
        while !rest.is_empty() {
            match std::str::from_utf8(rest) {
                Ok(text) => {
                    shown += &printable(text);
                    break;
                }
                Err(error) => {
                    let (valid, others) = rest.split_at(error.valid_up_to());
                    shown += &printable(&String::from_utf8_lossy(valid));
                    let Some(length) = error.error_len() else {
                        self.begun = others.to_vec();
                        break;
                    };
                    shown.push(char::REPLACEMENT_CHARACTER);
                    rest = &others[length..];
                }
            }
        }
        self.inner.write_all(shown.as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
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

    #[test]
    fn what_is_printed_holds_no_control_character_but_newline_and_tab() {
        let hostile = "a\x1b[31m\x1b]0;x\x07\u{202e}gnp\u{2066}\u{9b}2J\u{7f}\r\u{61c}b\n\tö – 漢";
        let shown = printable(hostile);
        assert_eq!(
            shown,
            "a\\u001b[31m\\u001b]0;x\\u0007\\u202egnp\\u2066\\u009b2J\\u007f\\u000d\\u061cb\n\tö – 漢"
        );
        assert!(matches!(printable("plain ö\n"), Cow::Borrowed(_)));
        let json = serde_json::to_string(hostile).unwrap();
        let read: String = serde_json::from_str(&printable(&json)).unwrap();
        assert_eq!(read, hostile, "JSON means the same");
    }

    #[test]
    fn characters_that_are_written_in_pieces_are_whole() {
        let text = "é\u{202e}漢\u{9b}ü".as_bytes();
        for at_once in 1..text.len() {
            let mut out = Printable::new(Vec::new());
            text.chunks(at_once).for_each(|piece| out.write_all(piece).unwrap());
            assert_eq!(out.inner, "é\\u202e漢\\u009bü".as_bytes(), "{at_once}");
        }
        let mut out = Printable::new(Vec::new());
        out.write_all(b"a\xffb\xe2(").unwrap();
        assert_eq!(String::from_utf8(out.inner).unwrap(), "a\u{fffd}b\u{fffd}(");
    }
}
