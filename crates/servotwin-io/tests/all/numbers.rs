//! Numbers as people write them.

use servotwin_io::table::csv::growing::Numbers;

#[test]
fn groups_of_three_digits_are_read_where_they_mean_nothing_else() {
    let one = |text: &str| Numbers::new(true).real(text);
    for text in [
        "14,538,574.25",
        "14.538.574,25",
        "14 538 574.25",
        "14'538'574,25",
        "14\u{202f}538\u{a0}574.25",
    ] {
        assert_eq!(one(text), Some(14_538_574.25), "{text}");
    }
    assert_eq!(one("-14.538.574"), Some(-14_538_574.0));
    assert_eq!(one("1 234"), Some(1234.0));
    assert_eq!((one("1,234"), one("1.234")), (Some(1.234), Some(1.234)), "a decimal mark");
    let mut points = Numbers::new(false);
    assert_eq!((points.real("1,234"), points.real("0.5")), (Some(1234.0), Some(0.5)));
    let mut commas = Numbers::new(true);
    let found = ["0,5", "1.234", "1.234,5"].map(|text| commas.real(text));
    assert_eq!(found, [Some(0.5), Some(1234.0), Some(1234.5)]);
    for text in
        ["21.11.2026", "1.2.3", "1,23,456", "12 34", "1,234,5", "a 123", "1.234.567.8", " 123"]
    {
        assert_eq!(one(text), None, "{text}");
    }
}
