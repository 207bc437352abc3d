//! A growing column that infers its kind cell by cell.

use super::super::{ColumnKind, Values};

/// Words for a missing number, besides an empty cell.
const MISSING: [&str; 13] =
    ["NA", "N/A", "n/a", "NaN", "nan", "NAN", "null", "NULL", "Null", "#N/A", "?", "-", "--"];

/// The cells of a column so far.
pub(crate) enum Growing {
    /// Only empty cells and words for missing numbers.
    Unknown(Vec<String>),
    /// Values of a known kind.
    Values(Values),
}

/// The number format. The first number with a point or a comma sets the decimal mark. With commas between cells, a comma
/// in a quoted number is that of groups if it can be: `"6,726"`, but not `"0,726"`. Groups of three digits are read where
/// they can mean nothing else: `14,538,574.25`, `14 538 574`.
pub struct Numbers {
    between_cells: bool,
    mark: Option<u8>,
    text: String,
}

impl Numbers {
    /// `between_cells` states whether commas stand between the cells.
    pub fn new(between_cells: bool) -> Self {
        Numbers { between_cells, mark: None, text: String::new() }
    }

    /// Whether the decimal mark is a comma.
    pub(crate) fn has_comma(&self) -> bool {
        self.mark == Some(b',')
    }

    /// Parses a number; `None` for any other text.
    pub fn real(&mut self, text: &str) -> Option<f64> {
        let mark = text.bytes().find(|byte| matches!(byte, b'.' | b','));
        if mark == Some(b',')
            && self.between_cells
            && self.mark.is_none()
            && let Some((value, _)) = self.ungrouped(text, Some(b'.'))
        {
            return Some(value);
        }
        let value = match (mark, self.mark) {
            (Some(b'.'), Some(b'.') | None) => text.parse().ok(),
            (Some(b','), Some(b',') | None) => {
                self.text.clear();
                self.text.push_str(text);
                self.text.replacen(',', ".", 1).parse().ok()
            }
            (Some(_), _) => None,
            (None, _) => {
                return text.parse().ok().or_else(|| Some(self.ungrouped(text, self.mark)?.0));
            }
        };
        let (value, mark) = match value {
            Some(value) => (value, mark),
            None => self.ungrouped(text, self.mark)?,
        };
        self.mark = mark.or(self.mark);
        Some(value)
    }

    /// A number with groups of three digits, and its decimal mark; `known` is the mark of other numbers.
    fn ungrouped(&self, text: &str, known: Option<u8>) -> Option<(f64, Option<u8>)> {
        let count = |mark: u8| text.bytes().filter(|byte| *byte == mark).count();
        let last = text.bytes().rfind(|byte| matches!(byte, b'.' | b','));
        let decimal = match (count(b'.'), count(b','), known) {
            (1.., 1.., _) => last,
            (2.., 0, _) => Some(b','),
            (0, 2.., _) => Some(b'.'),
            // One mark is that of groups only if the other one is known to be the decimal mark.
            (_, _, mark) => mark.or(last),
        };
        let other = |mark: u8| known.is_some_and(|own| own != mark) || count(mark) > 1;
        if decimal.is_some_and(other) {
            return None;
        }
        let place = decimal.and_then(|mark| text.bytes().position(|byte| byte == mark));
        let (whole, part) = text.split_at(place.unwrap_or(text.len()));
        let is_group = |c: char| matches!(c, '.' | ',' | ' ' | '\'' | '’' | '\u{a0}' | '\u{202f}');
        let groups: Vec<&str> = whole.trim_start_matches(['-', '+']).split(is_group).collect();
        let is_digits = |group: &&str| group.bytes().all(|byte| byte.is_ascii_digit());
        let is_grouped = groups.len() > 1
            && groups[0] != "0"
            && (1..=3).contains(&groups[0].len())
            && groups[1..].iter().all(|group| group.len() == 3)
            && groups.iter().all(is_digits);
        let number = whole.replace(is_group, "") + &part.replace(',', ".");
        is_grouped.then(|| Some((number.parse().ok()?, place.and(decimal))))?
    }
}

impl Growing {
    /// A column without cells; `is_text` if it is known to be text.
    pub(crate) fn new(is_text: bool) -> Self {
        match is_text {
            true => Growing::Values(Values::Text(vec![])),
            false => Growing::Unknown(vec![]),
        }
    }

    /// Adds a cell.
    ///
    /// # Errors
    /// The column holds values of another kind.
    pub(crate) fn push(
        &mut self,
        text: &str,
        quoted: bool,
        numbers: &mut Numbers,
    ) -> Result<(), ColumnKind> {
        let bare = text.trim();
        match self {
            Growing::Values(Values::Text(texts)) => texts.push(text.to_owned()),
            Growing::Values(values) if quoted => return Err(values.kind()),
            Growing::Values(values) => return push_value(values, bare, numbers),
            Growing::Unknown(words) if !quoted && is_missing(bare.as_bytes()) => {
                words.push(text.to_owned());
            }
            Growing::Unknown(words) => {
                let before = words.len();
                let values = match bare {
                    _ if quoted => None,
                    _ if before == 0 && bare.parse::<i64>().is_ok() => {
                        Some(Values::Integer(vec![]))
                    }
                    _ if numbers.real(bare).is_some() => {
                        Some(Values::Float(vec![f64::NAN; before]))
                    }
                    _ if before == 0 && flag(bare).is_some() => Some(Values::Flag(vec![])),
                    _ => None,
                };
                let words = std::mem::take(words);
                *self = Growing::Values(values.unwrap_or(Values::Text(words)));
                return self.push(text, quoted, numbers);
            }
        }
        Ok(())
    }

    /// The values of the whole column; a column without any value has missing numbers.
    pub(crate) fn finish(self) -> Values {
        match self {
            Growing::Values(values) => values,
            Growing::Unknown(words) => Values::Float(vec![f64::NAN; words.len()]),
        }
    }
}

/// Whether a cell stands for a missing value.
pub fn is_missing(cell: &[u8]) -> bool {
    let text = cell.trim_ascii();
    text.is_empty() || MISSING.iter().any(|word| word.as_bytes() == text)
}

fn push_value(values: &mut Values, text: &str, numbers: &mut Numbers) -> Result<(), ColumnKind> {
    let is_missing = |text: &str| is_missing(text.as_bytes());
    match values {
        Values::Float(reals) => match numbers.real(text) {
            Some(value) => reals.push(value),
            None if is_missing(text) => reals.push(f64::NAN),
            None => return Err(ColumnKind::Float),
        },
        Values::Integer(whole) => match text.parse() {
            Ok(value) => whole.push(value),
            Err(_) => {
                let value = numbers.real(text).or_else(|| is_missing(text).then_some(f64::NAN));
                let value = value.ok_or(ColumnKind::Float)?;
                let mut reals: Vec<f64> = whole.iter().map(|value| *value as f64).collect();
                reals.push(value);
                *values = Values::Float(reals);
            }
        },
        Values::Flag(flags) => {
            flags.push(flag(text).ok_or(ColumnKind::Flag)?);
        }
        Values::Unsigned(_) | Values::Text(_) => {}
    }
    Ok(())
}

fn flag(text: &str) -> Option<bool> {
    match text {
        "true" | "True" | "TRUE" => Some(true),
        "false" | "False" | "FALSE" => Some(false),
        _ => None,
    }
}
