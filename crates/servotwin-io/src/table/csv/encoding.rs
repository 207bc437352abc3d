//! Bytes as text: UTF-8, UTF-16 with its mark, or else Latin-1 as Windows writes it.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;

/// How much is read at once; also what the separator is found by.
const BUFFER: usize = 1 << 20;

/// How bytes stand for text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// As this toolkit writes.
    Utf8,
    /// Was turned into UTF-8 when the file was opened.
    Utf16,
    /// One byte for each character: Windows-1252, which holds Latin-1.
    Latin1,
}

/// Opens a file at its first character. Only UTF-16 is read at once, to be turned into UTF-8.
pub fn open(path: &Path) -> io::Result<(Box<dyn BufRead>, Encoding)> {
    let mut reader = BufReader::with_capacity(BUFFER, File::open(path)?);
    let beginning = reader.fill_buf()?;
    let (skip, big_endian) = match beginning {
        [0xEF, 0xBB, 0xBF, ..] => (3, None),
        [0xFE, 0xFF, ..] => (2, Some(true)),
        [0xFF, 0xFE, ..] => (2, Some(false)),
        // Without a mark: every other byte of plain letters is zero.
        [0, a, 0, b, ..] if *a > 0 && *b > 0 => (0, Some(true)),
        [a, 0, b, 0, ..] if *a > 0 && *b > 0 => (0, Some(false)),
        _ => (0, None),
    };
    reader.consume(skip);
    let Some(big_endian) = big_endian else {
        return Ok((Box::new(reader), Encoding::Utf8));
    };
    let mut bytes = vec![];
    reader.read_to_end(&mut bytes)?;
    let unit = |pair: &[u8; 2]| match big_endian {
        true => u16::from_be_bytes(*pair),
        false => u16::from_le_bytes(*pair),
    };
    let units = bytes.as_chunks().0.iter().map(unit);
    let text: String =
        char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Ok((Box::new(Cursor::new(text.into_bytes())), Encoding::Utf16))
}

/// Some bytes as text; `None` where they are not what the encoding promises.
pub fn text(bytes: &[u8], encoding: Encoding) -> Option<String> {
    match encoding {
        Encoding::Latin1 => Some(bytes.iter().map(|&byte| latin1(byte)).collect()),
        _ => std::str::from_utf8(bytes).ok().map(str::to_owned),
    }
}

/// A character of Windows-1252; the five bytes that it leaves out stand for themselves.
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
