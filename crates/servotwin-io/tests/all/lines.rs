//! Lines of a text and their cells.

use servotwin_io::table::csv::records::{Cells, Line, next_line};
use std::io::BufReader;

#[test]
fn lines_end_and_are_not_too_long() {
    const LIMIT: usize = 5000;
    let text = format!("a\r\n\r{}\nb", "x".repeat(LIMIT));
    // Lines are longer than this buffer.
    let mut reader = BufReader::with_capacity(1000, text.as_bytes());
    let mut found = vec![];
    for _ in 0..5 {
        let mut line = vec![];
        let kind = next_line(&mut reader, &mut line, LIMIT).unwrap();
        found.push((kind, String::from_utf8(line).unwrap()));
    }
    let expected = [
        (Line::Whole, "a\r\n"),
        (Line::Whole, "\r"),
        (Line::TooLong, ""),
        (Line::Unended, "b"),
        (Line::None, ""),
    ];
    assert_eq!(found, expected.map(|(kind, text)| (kind, text.to_owned())));
}

#[test]
fn a_quote_that_does_not_enclose_a_cell_is_a_letter() {
    for (line, separator, expected) in [
        ("a, \"b,c\",\"d\"\"e\"\r\n", b',', &["a", "b,c", "d\"e"][..]),
        ("\"a\"b,\"c", b',', &["\"a\"b", "\"c"]),
        ("a\"\"b,", b',', &["a\"\"b", ""]),
        ("  1.5   \"x y\" 2 ", b' ', &["1.5", "x y", "2"]),
        ("", b';', &[""]),
    ] {
        let found: Vec<_> =
            Cells::new(line.as_bytes(), separator).map(|cell| cell.text()).collect();
        assert_eq!(found, expected, "{line}");
    }
}
