//! The separator between cells, detected from the header and the first row.

use super::records::Records;

/// Detects the separator from the beginning of a text, among comma, semicolon and tab. One with equal counts in the
/// header and the first row takes precedence, then the most frequent one in the header. In a tie the tab comes first,
/// then the semicolon: a comma may be part of a name or a number.
pub fn separator_of(beginning: &[u8]) -> u8 {
    let mut best = (false, 0, b',');
    for separator in [b',', b';', b'\t'] {
        let mut records = Records::new(beginning, separator);
        let mut count =
            || records.advance().is_ok_and(|any| any).then(|| records.cells().len() - 1);
        let (header, row) = (count().unwrap_or(0), count());
        let fits = row.is_none_or(|row| row == header);
        if header > 0 && (fits, header) >= (best.0, best.1) {
            best = (fits, header, separator);
        }
    }
    best.2
}
