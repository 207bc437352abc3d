//! The separator between cells, detected from the header and the first row.

/// Detects the separator from the beginning of a text, among comma, semicolon and tab. One with equal counts in the
/// header and the first row takes precedence, then the most frequent one in the header. In a tie the tab comes first,
/// then the semicolon: a comma may be part of a name or a number.
pub fn separator_of(beginning: &[u8]) -> u8 {
    let mut lines = Lines { rest: beginning };
    let (header, row) = (lines.next_line(), lines.next_line());
    let count = |line: &Option<Vec<u8>>, separator: u8| {
        line.as_ref().map_or(0, |line| line.iter().filter(|byte| **byte == separator).count())
    };
    let mut best = (false, 0, b',');
    for separator in [b',', b';', b'\t'] {
        let found = count(&header, separator);
        let fits = row.is_none() || count(&row, separator) == found;
        if found > 0 && (fits, found) >= (best.0, best.1) {
            best = (fits, found, separator);
        }
    }
    best.2
}

/// Lines without their quoted parts.
struct Lines<'a> {
    rest: &'a [u8],
}

impl Lines<'_> {
    /// The next line that is not empty.
    fn next_line(&mut self) -> Option<Vec<u8>> {
        let (mut line, mut quoted) = (vec![], false);
        for (place, &byte) in self.rest.iter().enumerate() {
            match byte {
                b'"' => quoted = !quoted,
                b'\n' if !quoted && !line.iter().all(u8::is_ascii_whitespace) => {
                    self.rest = &self.rest[place + 1..];
                    return Some(line);
                }
                b'\n' if !quoted => line.clear(),
                _ if !quoted => line.push(byte),
                _ => {}
            }
        }
        self.rest = &[];
        (!line.is_empty()).then_some(line)
    }
}
