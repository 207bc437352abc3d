//! Numbers as people write them.

use servotwin_io::table::csv::growing::Numbers;

#[test]
fn groups_of_three_digits_are_read_where_they_mean_nothing_else() {
    let one = |text: &str| Numbers::new(false).real(text);
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
    let mut points = Numbers::new(true);
    assert_eq!((points.real("1,234"), points.real("0.5")), (Some(1234.0), Some(0.5)));
    let mut commas = Numbers::new(false);
    let found = ["0,5", "1.234", "1.234,5"].map(|text| commas.real(text));
    assert_eq!(found, [Some(0.5), Some(1234.0), Some(1234.5)]);
    for text in
        ["21.11.2026", "1.2.3", "1,23,456", "12 34", "1,234,5", "a 123", "1.234.567.8", " 123"]
    {
        assert_eq!(one(text), None, "{text}");
    }
}

#[test]
fn a_quoted_number_between_commas_may_have_a_decimal_comma() {
    let of = |texts: [&str; 3]| {
        let mut numbers = Numbers::new(true);
        texts.map(|text| numbers.real(text))
    };
    assert_eq!(of(["0,010", "-0,5", "6.726.074,219"]), [0.01, -0.5, 6_726_074.219].map(Some));
    assert_eq!(of(["12,3456", "1,234", "2"]), [12.3456, 1.234, 2.0].map(Some));
    assert_eq!(of(["6,726", "0.5", "14,538,574"]), [6726.0, 0.5, 14_538_574.0].map(Some));
}
