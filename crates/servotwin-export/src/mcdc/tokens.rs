//! The words of a C text: no comments, and no lines of the preprocessor.

use crate::error::ExportError;

/// Symbols of several characters, the longest first.
const SYMBOLS: [&str; 23] = [
    "<<=", ">>=", "...", "->", "++", "--", "<<", ">>", "<=", ">=", "==", "!=", "&&", "||", "+=",
    "-=", "*=", "/=", "%=", "&=", "|=", "^=", "##",
];

/// A word, a number, a quoted text or a symbol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Token<'t> {
    pub text: &'t str,
    /// Its first byte.
    pub start: usize,
}

impl Token<'_> {
    /// The byte after it.
    pub fn end(&self) -> usize {
        self.start + self.text.len()
    }

    /// Whether it is a name or a keyword.
    pub fn is_word(&self) -> bool {
        self.text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
    }

    /// Whether it is a number or a quoted text.
    pub fn is_constant(&self) -> bool {
        self.text.starts_with(|c: char| c.is_ascii_digit() || c == '"' || c == '\'' || c == '.')
            && self.text != "."
            && self.text != "..."
    }
}

/// The number of the line with this byte, from 1.
pub(crate) fn line_of(text: &str, start: usize) -> usize {
    1 + text.as_bytes()[..start].iter().filter(|byte| **byte == b'\n').count()
}

/// The place of a text that is not understood.
pub(crate) fn refused(file: &'static str, text: &str, start: usize) -> ExportError {
    let what = text[start..].lines().next().unwrap_or_default().trim().to_owned();
    ExportError::NotUnderstood { file, line: line_of(text, start), what }
}

/// All tokens of a file.
///
/// # Errors
/// [`ExportError::NotUnderstood`] for a comment or text without an end, and for a macro that could hold a decision.
pub(crate) fn tokens<'t>(file: &'static str, text: &'t str) -> Result<Vec<Token<'t>>, ExportError> {
    let (mut all, mut at) = (Vec::new(), 0);
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let length = match first {
            _ if first.is_whitespace() => Some(first.len_utf8()),
            '#' => preprocessor_line(rest),
            _ if rest.starts_with("/*") => rest.find("*/").map(|end| end + 2),
            _ if rest.starts_with("//") => Some(rest.find('\n').unwrap_or(rest.len())),
            _ => {
                let length = length_of_token(rest);
                let token = length.map(|length| Token { text: &rest[..length], start: at });
                all.extend(token);
                length
            }
        };
        at += length.ok_or_else(|| refused(file, text, at))?;
    }
    Ok(all)
}

/// The length of a line of the preprocessor; `None` for a macro that could hold a decision.
fn preprocessor_line(rest: &str) -> Option<usize> {
    let mut length = 0;
    for line in rest.split_inclusive('\n') {
        length += line.len();
        if !line.trim_end().ends_with('\\') {
            break;
        }
    }
    let line = &rest[..length];
    let Some(definition) = line.strip_prefix("#define ") else { return Some(length) };
    let name = definition.split([' ', '\t', '\n']).next().unwrap_or_default();
    let has_unknown_argument = name.contains('(') && !is_cast(definition);
    let may_decide =
        has_unknown_argument || ["&&", "||", "?"].iter().any(|sign| line.contains(sign));
    (!may_decide).then_some(length)
}

/// Whether a macro only casts its argument, as `REAL(x) ((servotwin_real)(x))` does: it is evaluated once, like that of a
/// function.
fn is_cast(definition: &str) -> bool {
    let Some((head, body)) = definition.trim_end().split_once(')') else { return false };
    let Some((_, argument)) = head.split_once('(') else { return false };
    let is_word =
        |text: &str| text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    let cast = body.trim_start().strip_prefix("((").and_then(|body| body.split_once(")("));
    let is_same = |(kind, rest): (&str, &str)| {
        is_word(kind) && is_word(argument) && rest.strip_suffix("))") == Some(argument)
    };
    cast.is_some_and(is_same)
}

/// The length of the token at the start of a text.
fn length_of_token(rest: &str) -> Option<usize> {
    let first = rest.chars().next()?;
    if first == '"' || first == '\'' {
        return length_of_quoted(rest, first);
    }
    let is_number = first.is_ascii_digit()
        || first == '.' && rest[1..].starts_with(|c: char| c.is_ascii_digit());
    if is_number {
        return Some(length_of_number(rest));
    }
    if first.is_ascii_alphabetic() || first == '_' {
        let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        return Some(rest.find(|c| !is_part(c)).unwrap_or(rest.len()));
    }
    let symbol = SYMBOLS.iter().find(|symbol| rest.starts_with(**symbol));
    match symbol {
        Some(symbol) => Some(symbol.len()),
        None => "(){}[];,.<>=+-*/%&|^!~?:".contains(first).then_some(1),
    }
}

/// A number may have signs after the letter of an exponent.
fn length_of_number(rest: &str) -> usize {
    let bytes = rest.as_bytes();
    let is_hexadecimal = rest.starts_with("0x") || rest.starts_with("0X");
    let exponents: &[u8] = if is_hexadecimal { b"pP" } else { b"eE" };
    let is_part = |place: usize| {
        let byte = bytes[place];
        let is_sign = byte == b'+' || byte == b'-';
        byte.is_ascii_alphanumeric()
            || byte == b'.'
            || is_sign && exponents.contains(&bytes[place - 1])
    };
    (1..bytes.len()).find(|place| !is_part(*place)).unwrap_or(bytes.len())
}

fn length_of_quoted(rest: &str, quote: char) -> Option<usize> {
    let mut is_escaped = false;
    for (place, c) in rest.char_indices().skip(1) {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            _ if c == quote => return Some(place + 1),
            _ => {}
        }
    }
    None
}
