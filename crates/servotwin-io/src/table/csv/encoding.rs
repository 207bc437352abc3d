//! Text encodings: UTF-8, UTF-16 with or without a byte order mark, or else Latin-1 as Windows writes it.

use crate::files::{self, FileError};
use std::borrow::Cow;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::Path;

/// Buffer size, bytes; the separator is detected in the first buffer.
const BUFFER: usize = 1 << 20;

/// Opens a file at its first character, and reports whether it is UTF-16; such a file is read whole and converted to
/// UTF-8.
pub fn open(path: &Path) -> Result<(Box<dyn BufRead + Send>, bool), FileError> {
    let failed = |cause| FileError::from_io(path, cause);
    let mut reader = BufReader::with_capacity(BUFFER, files::open(path)?);
    let beginning = reader.fill_buf().map_err(failed)?;
    let (skip, big_endian) = match beginning {
        [0xEF, 0xBB, 0xBF, ..] => (3, None),
        [0xFE, 0xFF, ..] => (2, Some(true)),
        [0xFF, 0xFE, ..] => (2, Some(false)),
        // Without a mark: every other byte of ASCII letters is zero.
        [0, a, 0, b, ..] if *a > 0 && *b > 0 => (0, Some(true)),
        [a, 0, b, 0, ..] if *a > 0 && *b > 0 => (0, Some(false)),
        _ => (0, None),
    };
    reader.consume(skip);
    let Some(big_endian) = big_endian else {
        return Ok((Box::new(reader), false));
    };
    let mut bytes = vec![];
    reader.read_to_end(&mut bytes).map_err(failed)?;
    let unit = |pair: &[u8; 2]| match big_endian {
        true => u16::from_be_bytes(*pair),
        false => u16::from_le_bytes(*pair),
    };
    let units = bytes.as_chunks().0.iter().map(unit);
    let text: String =
        char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Ok((Box::new(Cursor::new(text.into_bytes())), true))
}

/// Decodes bytes: UTF-8, or else Windows-1252, which includes Latin-1.
pub fn text(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => bytes.iter().map(|&byte| latin1(byte)).collect::<String>().into(),
    }
}

/// Whether Windows-1252 has a character.
pub fn is_latin(letter: char) -> bool {
    (0..=u8::MAX).any(|byte| latin1(byte) == letter)
}

/// A character of Windows-1252; the five undefined bytes keep their own value.
fn latin1(byte: u8) -> char {
    const HIGH: [char; 32] = [
        '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž',
        '\u{8f}', '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}',
        'ž', 'Ÿ',
    ];
    match byte {
        0x80..0xA0 => HIGH[usize::from(byte - 0x80)],
        byte => char::from(byte),
    }
}
