//! The separator of a table.

use servotwin_io::table::csv::dialect::separator_of;

#[test]
fn separators_are_found() {
    let cases: [(&str, u8); 9] = [
        ("a,b\n1,2\n", b','),
        ("a;b\n1,5;2,5\n", b';'),
        ("a\tb\n1\t2\n", b'\t'),
        ("p, bar;T, K;ok\n1,5;2,5;x\n", b';'),
        ("\"a;b;c\",d\n1,2\n", b','),
        ("a\n1,5\n", b','),
        ("a;b\n", b';'),
        ("a,b,c\n1;2,3\n", b','),
        ("", b','),
    ];
    for (text, separator) in cases {
        assert_eq!(separator_of(text.as_bytes()), separator, "{text:?}");
    }
}
