//! One line as a row.

use servotwin_watch::counts::{Flaw, Irregularity};
use servotwin_watch::source::frame::{Frames, columns};
use servotwin_watch::source::{LogRow, Read, Wanted};

fn wanted(names: &[&str]) -> Wanted {
    let names = names.iter().map(|name| name.to_string()).collect();
    Wanted { names, time: Some(0), ..Wanted::default() }
}

fn read(frames: &mut Frames, line: &str) -> (Read, Vec<f64>, u64) {
    let mut row = LogRow::default();
    let read = frames.read(line.as_bytes(), &mut row);
    (read, row.values, row.bad)
}

#[test]
fn cells_are_found_by_their_names() {
    let mut frames = Frames::new(&wanted(&["t", "p [bar]"]));
    assert_eq!(
        read(&mut frames, "measured on a Friday").0,
        Read::Flawed(Irregularity::NoHeader.into())
    );
    assert_eq!(read(&mut frames, "# note").0, Read::Nothing);
    assert_eq!(read(&mut frames, "\"p [bar]\";x;t\r").0, Read::Nothing);
    assert_eq!(read(&mut frames, "1,5;;2\r"), (Read::Row, vec![2.0, 1.5], 0));
    assert_eq!(read(&mut frames, "\"p [bar]\";x;t").0, Read::Nothing);
    assert_eq!(read(&mut frames, "\"2,5\";a;\"3\"").1, [3.0, 2.5]);
    let (found, values, bad) = read(&mut frames, "abc;;4");
    assert_eq!((found, values[0], bad), (Read::Row, 4.0, 1));
    assert!(values[1].is_nan());
    assert_eq!(read(&mut frames, ";;4").2, 0, "missing is no mistake");
    let short = Flaw::new(Irregularity::WrongColumns, "2 cells, 3 are needed");
    assert_eq!(read(&mut frames, "1;2").0, Read::Flawed(short));
    let no_time = Flaw::new(Irregularity::NoTime, "'x'");
    assert_eq!(read(&mut frames, "1;2;x").0, Read::Flawed(no_time));
    assert_eq!(read(&mut frames, "1;\u{0};3").0, Read::Flawed(Irregularity::Noise.into()));
}

#[test]
fn numbers_with_decimal_commas_name_nothing() {
    let header = columns(b"time_s;\"p [bar]\";x_m");
    assert_eq!(header, Some(["time_s", "p [bar]", "x_m"].map(String::from).to_vec()));
    for row in ["0,01;-3,17e-5;1,0", "0.5,1e-3,abc", "1;2;3"] {
        assert_eq!(columns(row.as_bytes()), None, "{row}");
    }
}

#[test]
fn a_cell_means_the_same_in_utf_8_and_in_windows_1252() {
    for row in ["14\u{a0}538,5;\u{a0}2".as_bytes(), b"14\xa0538,5;\xa02"] {
        let mut frames = Frames::new(&wanted(&["t", "p"]));
        read(&mut frames, "p;t");
        let mut found = LogRow::default();
        assert_eq!(frames.read(row, &mut found), Read::Row);
        assert_eq!((found.values, found.bad), (vec![2.0, 14_538.5], 0));
    }
}

#[test]
fn columns_without_a_header_are_named_by_the_map() {
    let columns = ["p", "t"].map(String::from).to_vec();
    let mut frames = Frames::new(&Wanted { columns, ..wanted(&["t", "p"]) });
    assert_eq!(read(&mut frames, "7,0.5").1, [0.5, 7.0]);
    assert_eq!(read(&mut frames, "p,t").0, Read::Nothing, "a header that is sent anyway");
}

#[test]
fn an_object_with_a_key_twice_is_refused() {
    let mut frames = Frames::new(&wanted(&["t", "m.p"]));
    for line in [
        r#"{"t": 1, "m": {"p": 2, "p": 3}}"#,
        r#"{"t": 1, "m.p": NaN, "m": {"p": 2}, "m": {"p": 3}}"#,
    ] {
        let Read::Flawed(flaw) = read(&mut frames, line).0 else { panic!("{line}") };
        assert_eq!(flaw.detail, "the key 'm.p' is there twice");
    }
    let line = r#"{"t": 1, "x": 1, "x": 2, "m": {"p": 2}}"#;
    assert_eq!(read(&mut frames, line), (Read::Row, vec![1.0, 2.0], 0), "of no interest");
}

#[test]
fn objects_are_read_with_what_is_in_them() {
    let mut frames = Frames::new(&wanted(&["t", "m.p", "v.1"]));
    let line = r#"{"t": 1.25, "m": {"p": "3e5", "q": [1]}, "v": [1, 2.5], "t2": "x"}"#;
    assert_eq!(read(&mut frames, line), (Read::Row, vec![1.25, 3e5, 2.5], 0));
    let (found, values, bad) = read(&mut frames, r#"{"t": 1, "m": {"p": NaN}, "v": {}}"#);
    assert_eq!((found, bad), (Read::Row, 0));
    assert!(values[1].is_nan() && values[2].is_nan());
    assert_eq!(read(&mut frames, r#"{"t": 1, "m""#).0, Read::Flawed(Irregularity::CutShort.into()));
    let Read::Flawed(flaw) = read(&mut frames, r#"{"t": 1}}"#).0 else { panic!() };
    assert_eq!(flaw.kind, Irregularity::BadObject);
    assert_eq!(read(&mut frames, "{}").0, Read::Flawed(Irregularity::NoTime.into()));
}

#[test]
fn dates_are_times_where_the_map_says_so() {
    let mut frames = Frames::new(&Wanted { dates: true, ..wanted(&["t"]) });
    let (found, values, _) = read(&mut frames, r#"{"t": "1970-01-01T00:01:00.5Z"}"#);
    assert_eq!((found, values), (Read::Row, vec![60.5]));
    read(&mut frames, "t,x");
    assert_eq!(read(&mut frames, "1970-01-01 00:01:00.5,1").1, [60.5]);
}

#[test]
fn words_for_on_and_off_are_numbers_of_an_input_from_0_to_1_and_bad_elsewhere() {
    let flags = vec![false, true, false];
    let mode = Wanted { flags, ..wanted(&["t", "mode", "p"]) };
    let mut frames = Frames::new(&mode);
    let mut row = LogRow::default();
    let line = br#"{"t": "1759967600000", "mode": "on", "p": "101.60"}"#;
    assert_eq!(frames.read(line, &mut row), Read::Row);
    assert_eq!((row.values.clone(), row.bad), (vec![1_759_967_600_000.0, 1.0, 101.6], 0));
    frames.read(br#"{"t": 1, "mode": "stand-by", "p": "on"}"#, &mut row);
    let bad = row.bad_in_words(&mode);
    assert_eq!(bad, "column 'mode' has 'stand-by', 2 of 3 values");
    frames.read(b"t,mode,p", &mut row);
    frames.read(b"1,OFF,true", &mut row);
    assert_eq!((row.values[1], row.bad), (0.0, 1));
    assert_eq!(row.bad_in_words(&mode), "column 'p' has 'true'");
}

#[test]
fn a_row_of_units_is_no_sample_even_without_a_time() {
    let mut frames = Frames::new(&Wanted { time: None, ..wanted(&["p", "x"]) });
    read(&mut frames, "p;x;n");
    let Read::Flawed(flaw) = read(&mut frames, "bar;mm;-").0 else { panic!() };
    assert_eq!(flaw.kind, Irregularity::BadValue);
    assert_eq!(read(&mut frames, "1;;-").0, Read::Row);
}

#[test]
fn headers_behind_a_mark_quotes_blanks_and_separators_at_the_ends_are_read() {
    for (header, row) in [
        ("# t,p", "0.5,7"),
        ("#t,p", "0.5,7"),
        ("# t p", "5.0e-01  7.0e+00 "),
        (r#"t, "p""#, r#"0.5, "7""#),
        ("t;p", "0,5;7;;"),
        ("t;p;", "0,5;7"),
        ("t;p;;", "0,5;7;;"),
    ] {
        let mut frames = Frames::new(&wanted(&["t", "p"]));
        assert_eq!(read(&mut frames, "# a recording").0, Read::Nothing);
        assert_eq!(read(&mut frames, header).0, Read::Nothing, "{header}");
        assert_eq!(read(&mut frames, row), (Read::Row, vec![0.5, 7.0], 0), "{header}");
    }
    let mut frames = Frames::new(&wanted(&["t", "p"]));
    for line in ["[", r#"{"t": 1, "p": 2},"#, r#"{"t": 2, "p": 3}]"#, r#"[{"t": 3, "p": 4}]"#] {
        let is_row = line.contains('t');
        assert_eq!(read(&mut frames, line).0 == Read::Row, is_row, "{line}");
    }
    let several = read(&mut frames, r#"[{"t": 1}, {"t": 2}]"#).0;
    let Read::Flawed(Flaw { kind: Irregularity::BadObject, detail, .. }) = several else {
        panic!("{several:?}")
    };
    assert!(detail.contains("one a line"), "{detail}");
}

#[test]
fn columns_of_one_name_have_numbers() {
    let mut frames = Frames::new(&wanted(&["t", "p#2"]));
    assert_eq!(columns(b"t,p,p").unwrap(), ["t", "p#1", "p#2"]);
    read(&mut frames, "t,p,p");
    assert_eq!(read(&mut frames, "0,1,2").1, [0.0, 2.0]);
    assert_eq!(read(&mut frames, "t,p,p").0, Read::Nothing, "the header again");
    assert_eq!(
        read(&mut Frames::new(&wanted(&["t", "p"])), "t,p,p").0,
        Read::Flawed(Irregularity::NoHeader.into())
    );
}

#[test]
fn columns_of_a_line() {
    let columns = |line: &str| columns(line.as_bytes());
    assert_eq!(columns("a, b ;c").unwrap(), ["a, b", "c"]);
    assert_eq!(columns(r#"{"a": {"b": 1, "c": [2, 3]}}"#).unwrap(), ["a.b", "a.c.0", "a.c.1"]);
    assert_eq!(columns("1,2"), None);
    assert_eq!(columns("# x"), None);
}
