//! Tables survive their files, and files that are no tables are refused in plain words.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use servotwin_io::table::parquet::{Limits, ParquetReader, ParquetWriter, read_within};
use servotwin_io::table::{self, Column, ColumnKind, Table, TableError, Values};

use crate::folder::Folder;

fn sample() -> Table {
    let columns = vec![
        Column::new("time_s", "s", vec![0.0, 0.1, -0.0, f64::INFINITY]),
        Column::new("pressure_a_pa", "Pa", vec![2.1e7, 1.0e-300, f64::MIN_POSITIVE, 1.0 / 3.0]),
        Column::new("offset", "", vec![i64::MIN, -1, 0, i64::MAX]),
        Column::new("variant", "", vec![0_u32, 7, 8, u32::MAX]),
        Column::new("healthy", "", vec![true, false, true, true]),
        Column::new(
            "fault",
            "",
            ["none", "12", "say \"hi\", all\r\nof you", ""].map(str::to_owned).to_vec(),
        ),
    ];
    Table::from_columns(columns).unwrap().with_metadata("seed", "42").with_metadata("a", "ü")
}

/// What CSV keeps of a table: no units, no descriptions, no metadata, and `u32` becomes `i64`.
fn as_csv_keeps(table: &Table) -> Table {
    let keep = |column: &Column| match &column.values {
        Values::Unsigned(values) => {
            let values: Vec<i64> = values.iter().map(|value| i64::from(*value)).collect();
            Column::new(&column.name, "", values)
        }
        values => Column::new(&column.name, "", values.clone()),
    };
    Table::from_columns(table.columns().iter().map(keep).collect()).unwrap()
}

fn bits(values: &Values) -> Vec<u64> {
    match values {
        // Every NaN reads back as a NaN; its payload is not kept by text.
        Values::Float(values) => {
            values.iter().map(|value| if value.is_nan() { 1 } else { value.to_bits() }).collect()
        }
        _ => Vec::new(),
    }
}

fn assert_same(found: &Table, expected: &Table) {
    assert_eq!(found.names().collect::<Vec<_>>(), expected.names().collect::<Vec<_>>());
    for (one, other) in found.columns().iter().zip(expected.columns()) {
        assert_eq!(bits(&one.values), bits(&other.values), "{}", one.name);
        if one.values.kind() != ColumnKind::Float {
            assert_eq!(one.values, other.values, "{}", one.name);
        }
        assert_eq!(one.values.kind(), other.values.kind());
        assert_eq!((&one.unit, &one.description), (&other.unit, &other.description));
    }
    assert_eq!(found.metadata, expected.metadata);
}

#[test]
fn every_format_keeps_its_promise() {
    let folder = Folder::new("formats");
    for format in table::ALL {
        let path = folder.file(&format!("a.{}", format.extension));
        sample().write(&path).unwrap();
        let first = fs::read(&path).unwrap();
        let expected = if format.extension == "csv" { as_csv_keeps(&sample()) } else { sample() };
        assert_same(&Table::read(&path).unwrap(), &expected);
        sample().write(&path).unwrap();
        assert_eq!(first, fs::read(&path).unwrap(), "{} is not deterministic", format.name);
        sample().without_rows().write(&path).unwrap();
        let empty = Table::read(&path).unwrap();
        assert_eq!((empty.row_count(), empty.columns().len()), (0, 6));
        assert!(matches!(
            sample().write(folder.file("none").join(path.file_name().unwrap())),
            Err(TableError::File(_))
        ));
    }
}

#[test]
fn an_unknown_extension_is_told_the_known_ones() {
    for name in ["a.xlsx", "a", "a.CSVX"] {
        let message = Table::read(name).unwrap_err().to_string();
        let expected = "no known table format; known are .parquet (Parquet), .csv (CSV)";
        assert!(message.contains(expected), "{message}");
    }
    assert_eq!(table::format_of("a.CSV".as_ref()).unwrap().name, "CSV");
}

fn values(rows: usize) -> impl Strategy<Value = Values> {
    let float = prop::num::f64::ANY;
    prop_oneof![
        prop::collection::vec(float, rows).prop_map(Values::Float),
        prop::collection::vec(any::<i64>(), rows).prop_map(Values::Integer),
        prop::collection::vec(any::<u32>(), rows).prop_map(Values::Unsigned),
        prop::collection::vec(any::<bool>(), rows).prop_map(Values::Flag),
        prop::collection::vec("[ -~äß\"\n\r,]{0,8}", rows).prop_map(Values::Text),
    ]
}

fn tables() -> impl Strategy<Value = Table> {
    let columns = (1..40_usize).prop_flat_map(|rows| prop::collection::vec(values(rows), 1..6));
    columns.prop_map(|columns| {
        let named = columns.into_iter().enumerate();
        let column = |(place, values): (usize, Values)| {
            let name = format!("c{place}, \"x\"");
            Column::new(name, "Pa", values).described(format!("Column {place} – with ÄÖ."))
        };
        Table::from_columns(named.map(column).collect()).unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_table_survives(table in tables()) {
        let folder = Folder::new("any");
        let (csv, parquet) = (folder.file("t.csv"), folder.file("t.parquet"));
        table.write(&csv).unwrap();
        assert_same(&Table::read(&csv).unwrap(), &as_csv_keeps(&table));
        table.write(&parquet).unwrap();
        assert_same(&Table::read(&parquet).unwrap(), &table);
    }

    #[test]
    fn no_text_makes_the_csv_reader_panic(text in "[a1.,\"\n\r; -]{0,40}") {
        let folder = Folder::new("no-panic");
        fs::write(folder.file("a.csv"), text).unwrap();
        let _ = Table::read(folder.file("a.csv"));
    }
}

#[test]
fn broken_csv_is_refused_with_its_place() {
    let cases = [
        ("", "the file is empty"),
        ("\n\n", "the file is empty"),
        ("a,b\n1,2\n3\n", "line 3 has 1 cells, the header has 2"),
        ("a,b\n1,2,3\n", "line 2 has 3 cells, the header has 2"),
        ("a,b\n1,2\n\n3,x\n", "line 4, column 'b': 'x' among numbers"),
        ("a\n1.5\n1,5\n", "line 3 has 2 cells, the header has 1"),
        ("a\n1.5\n1.5.2\n", "line 3, column 'a': '1.5.2' among numbers"),
        ("a\ntrue\nyes\n", "line 3, column 'a': 'yes' among true or false"),
        ("a,b,a\n1,2,3\n", "two columns are named 'a'"),
        ("a,,c\n1,2,3\n", "line 1: column 2 has no name"),
        ("a;b\n1,5;2\n1.5;3\n", "line 3, column 'a': '1.5' among numbers"),
        ("a\0,b\n1,2\n", "line 1 holds a byte zero"),
        ("a\n\"x\ny\n", "line 2: a quote is opened and never closed"),
        ("a,b\n1,\"x\ny\"z\n", "line 3: a separator is needed after the closing quote"),
    ];
    let folder = Folder::new("broken-csv");
    for (text, expected) in cases {
        let path = folder.file("broken.csv");
        fs::write(&path, text).unwrap();
        let message = Table::read(&path).unwrap_err().to_string();
        assert!(message.contains("broken.csv: "), "{message}");
        assert!(message.contains(expected), "{text:?}: {message}");
    }
}

#[test]
fn csv_in_other_dialects_is_understood_and_said() {
    let folder = Folder::new("dialects");
    let read = |bytes: &[u8]| {
        fs::write(folder.file("a.csv"), bytes).unwrap();
        Table::read(folder.file("a.csv")).unwrap()
    };
    let utf16 = |text: &str, big: bool| -> Vec<u8> {
        let bytes = |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
        std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(bytes).collect()
    };
    let german = "Druck °;Ort\r\n1,5;Köln\r\n-2;\"a;b\"\r\n?;x\r\n";
    let latin: Vec<u8> = german.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let tabs = german.replace(';', "\t").replace("a\tb", "a;b");
    for (bytes, dialect) in [
        (german.as_bytes(), "semicolons between cells, decimal commas"),
        (&latin, "semicolons between cells, decimal commas, Latin-1"),
        (&utf16(german, false), "semicolons between cells, decimal commas, UTF-16"),
        (&utf16(german, true), "semicolons between cells, decimal commas, UTF-16"),
        (tabs.as_bytes(), "tabs between cells, decimal commas"),
    ] {
        let table = read(bytes);
        let numbers = table.f64("Druck °").unwrap();
        assert!(numbers[0] == 1.5 && numbers[1] == -2.0 && numbers[2].is_nan());
        assert_eq!(table.text("Ort").unwrap(), ["Köln", "a;b", "x"]);
        assert_eq!(table.origin().dialect.as_deref(), Some(dialect));
    }
    assert_eq!(read(b"a,b\n1,2\n").origin().dialect, None);
}

#[test]
fn what_contradicts_the_beginning_of_a_column_is_understood_where_it_can_be() {
    let folder = Folder::new("mixed");
    let parse = |text: &str| {
        fs::write(folder.file("a.csv"), text).unwrap();
        Table::read(folder.file("a.csv"))
    };
    let quoted = parse("a,b\n1,true\n\"2\",\n").unwrap();
    assert_eq!(quoted.text("a").unwrap(), ["1", "2"]);
    assert_eq!(quoted.text("b").unwrap(), ["true", ""]);
    let words = parse("a,b\nNA,NA\n3,x\n").unwrap();
    assert!(words.f64("a").unwrap()[0].is_nan());
    assert_eq!(words.text("b").unwrap(), ["NA", "x"]);
    let frame = parse(",x,\n0,1.5,\n1,2.5,\n").unwrap();
    assert_eq!(frame.names().collect::<Vec<_>>(), ["column 1", "x"]);
    assert!(parse("run,x\n1,0.5\n2b,0.7\n\n3,0.9\n").is_err());
    let read = parse("run,x\n1,0.5\n2,0.7\n\n3,0.9\n").unwrap();
    let places: Vec<String> = (0..3).map(|row| read.origin().place(row)).collect();
    assert_eq!(places, ["line 2", "line 3", "line 5"]);
}

#[test]
fn csv_of_other_writers_is_understood() {
    let text =
        "\u{feff}time, x ,name,ok\r\n0, 1,left,True\r\n\r\n1,,\"right\",False\r\n2,2.5,,False";
    let folder = Folder::new("foreign-csv");
    fs::write(folder.file("a.csv"), text).unwrap();
    let table = Table::read(folder.file("a.csv")).unwrap();
    assert_eq!(*table.i64("time").unwrap(), [0, 1, 2]);
    let x = table.f64("x").unwrap();
    assert!(x[0] == 1.0 && x[1].is_nan() && x[2] == 2.5);
    assert_eq!(table.text("name").unwrap(), ["left", "right", ""]);
    assert_eq!(table.bool("ok").unwrap(), [true, false, false]);
    let message = table.finite_f64("x").unwrap_err().to_string();
    assert!(message.ends_with("a.csv: line 4, column 'x': NaN is no finite number"), "{message}");
}

#[test]
fn getters_convert_what_they_can_and_explain_what_not() {
    let table = sample();
    assert_eq!(table.f64("variant").unwrap()[1], 7.0);
    assert_eq!(table.i64("variant").unwrap()[3], i64::from(u32::MAX));
    let messages = [
        (
            table.f64("presure_a_pa").unwrap_err(),
            "there is no column 'presure_a_pa'; did you mean 'pressure_a_pa'? The table has time_s, \
             pressure_a_pa, offset, variant, healthy, fault",
        ),
        (
            table.f64("xyzzy_kg").unwrap_err(),
            "there is no column 'xyzzy_kg'; the table has time_s, pressure_a_pa, offset, variant, \
             healthy, fault",
        ),
        (table.f64("fault").unwrap_err(), "column 'fault' holds text, needed are numbers"),
        (
            table.text("healthy").unwrap_err(),
            "column 'healthy' holds true or false, needed are text",
        ),
        (
            table.u32("offset").unwrap_err(),
            "row 1, column 'offset': -9223372036854775808 is not in 0 … 4294967295",
        ),
    ];
    for (error, expected) in messages {
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn a_table_refuses_columns_that_do_not_fit() {
    let mut table = sample();
    let twice = table.push(Column::new("time_s", "s", vec![0.0; 4])).unwrap_err();
    assert_eq!(twice.to_string(), "there is already a column 'time_s'");
    let short = table.push(Column::new("x", "", vec![0.0])).unwrap_err();
    assert_eq!(short.to_string(), "column 'x' has 1 rows, the others have 4");
    let other = Table::from_columns(vec![Column::new("x", "", vec![1.0])]).unwrap();
    let message = table.append(other).unwrap_err().to_string();
    assert_eq!(message, "1 columns cannot be appended to 6");
}

#[test]
fn parquet_streams_without_changing_the_table() {
    let folder = Folder::new("stream");
    let path = folder.file("a.parquet");
    let mut writer = ParquetWriter::create(&path, &sample()).unwrap();
    for _ in 0..50_000 {
        writer.append(&sample()).unwrap();
    }
    assert!(!path.exists(), "nothing is there before the end");
    let wrong = Table::from_columns(vec![Column::new("x", "", vec![1.0])]).unwrap();
    assert!(writer.append(&wrong).is_err());
    writer.end_group().unwrap();
    writer.finish().unwrap();
    let reader = ParquetReader::open_columns(&path, &["variant", "time_s"]).unwrap();
    assert_eq!(reader.row_count(), 200_000);
    assert_eq!(reader.schema().names().collect::<Vec<_>>(), ["variant", "time_s"]);
    let mut rows = 0;
    for part in reader {
        let part = part.unwrap();
        assert_eq!(part.u32("variant").unwrap()[..4], [0, 7, 8, u32::MAX]);
        rows += part.row_count();
    }
    assert_eq!(rows, 200_000);
    let message = ParquetReader::open_columns(&path, &["varian"]).err().unwrap().to_string();
    assert!(message.contains("did you mean 'variant'? The table has"), "{message}");
}

#[test]
fn an_unfinished_stream_leaves_nothing() {
    let folder = Folder::new("unfinished");
    let mut writer = ParquetWriter::create(folder.file("a.parquet"), &sample()).unwrap();
    writer.append(&sample()).unwrap();
    drop(writer);
    assert_eq!(folder.names(), [""; 0]);
}

#[test]
fn damaged_parquet_is_refused_and_never_panics() {
    let folder = Folder::new("damaged");
    let path = folder.file("a.parquet");
    sample().write(&path).unwrap();
    let whole = fs::read(&path).unwrap();
    let refused = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        Table::read(&path).unwrap_err().to_string()
    };
    assert!(refused(b"").ends_with("a.parquet: the file is empty"));
    for length in [3, 11, 12, whole.len() / 2, whole.len() - 1] {
        let message = refused(&whole[..length]);
        assert!(message.ends_with("this is no Parquet file, or its end is missing"), "{message}");
    }
    assert!(refused(b"a,b\n1,2\nand so on\n").contains("this is no Parquet file"));
    let marks_only = [&b"PAR1"[..], &[0; 40], b"PAR1"].concat();
    assert!(refused(&marks_only).contains("damaged or unreadable: "));
    for place in 4..whole.len() - 4 {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x81;
        fs::write(&path, &bytes).unwrap();
        let _ = Table::read(&path);
    }
}

fn row_count(parts: ParquetReader) -> usize {
    parts.map(|part| part.unwrap().row_count()).sum()
}

fn foreign(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign").join(name)
}

#[test]
fn val_pyarrow_parquet_of_pandas_and_polars_is_read() {
    let table = Table::read(foreign("pandas.parquet")).unwrap();
    assert_eq!(*table.f64("x_m").unwrap(), [1.0, 2.5]);
    assert_eq!(*table.i64("n").unwrap(), [1, 2]);
    assert_eq!(*table.u32("u").unwrap(), [1, 2]);
    assert_eq!(table.bool("ok").unwrap(), [true, false]);
    assert_eq!(table.text("s").unwrap(), ["a", "b"]);
    assert_eq!(table.text("c").unwrap(), ["b", "a"]);
    for codec in ["snappy", "gzip", "lz4", "zstd"] {
        let table = Table::read(foreign(&format!("polars_{codec}.parquet"))).unwrap();
        assert_eq!(*table.f64("x_m").unwrap(), [1.0, 2.5], "{codec}");
        assert_eq!(table.text("c").unwrap(), ["b", "a"], "{codec}");
    }
}

/// The formulas of `tests/foreign/make.py`.
#[test]
fn val_pyarrow_parquet_of_every_type_and_encoding_is_read() {
    for name in ["every_plain.parquet", "every_version_2.parquet"] {
        let table = Table::read(foreign(name)).unwrap();
        let whole = |column: &str| table.i64(column).unwrap().into_owned();
        let rows = |formula: fn(i64) -> i64| (0..600).map(formula).collect::<Vec<_>>();
        assert_eq!(whole("i8"), rows(|n| n % 256 - 128), "{name}");
        assert_eq!(whole("i16"), rows(|n| n * 100 - 30_000), "{name}");
        assert_eq!(whole("i32"), rows(|n| n * 3_500_000 - 1_000_000_000), "{name}");
        assert_eq!(whole("i64"), rows(|n| n * 1_000_000_000_000_000), "{name}");
        assert_eq!(whole("u8"), rows(|n| n % 256), "{name}");
        assert_eq!(whole("u16"), rows(|n| n * 100), "{name}");
        assert_eq!(whole("u32"), rows(|n| n * 7_000_000), "{name}");
        assert_eq!(whole("u64"), rows(|n| n * 1_000_000_000_000_000), "{name}");
        assert_eq!(whole("level"), rows(|n| n % 5), "{name}");
        for n in 0..600 {
            let value = n as f64;
            assert_eq!(table.f64("f16").unwrap()[n], value / 8.0 - 10.0, "{name}");
            assert_eq!(table.f64("f32").unwrap()[n], value / 8.0, "{name}");
            assert_eq!(table.f64("f64").unwrap()[n], value / 3.0, "{name}");
            assert_eq!(table.bool("ok").unwrap()[n], n % 3 == 0, "{name}");
            assert_eq!(table.text("s").unwrap()[n], format!("row {n}"), "{name}");
            assert_eq!(table.text("large").unwrap()[n], format!("row {n}"), "{name}");
            assert_eq!(table.text("chosen").unwrap()[n], format!("{}", n % 7), "{name}");
        }
    }
}

/// Ten o'clock and hundredths of a second behind it, in every unit that there is.
#[test]
fn val_pyarrow_moments_are_seconds_since_1970() {
    let table = Table::read(foreign("when.parquet")).unwrap();
    for name in ["milli", "micro", "nano"] {
        assert_eq!(table.column(name).unwrap().unit, "s", "{name}");
        let seconds = table.f64(name).unwrap();
        for (row, second) in seconds.iter().enumerate() {
            assert_eq!(*second, 1_795_341_600.0 + row as f64 / 100.0, "{name}");
        }
    }
}

/// The same hundredths of a second as durations, times of day, days and in 96 bits.
#[test]
fn val_pyarrow_times_arrive_in_seconds_whatever_stores_them() {
    let table = Table::read(foreign("times.parquet")).unwrap();
    let column = |name: &str| {
        assert_eq!(table.column(name).unwrap().unit, "s", "{name}");
        table.f64(name).unwrap().into_owned()
    };
    assert_eq!(column("duration_ns"), [0.0, 0.01, 0.02]);
    assert_eq!(column("duration_s"), [0.0, 1.0, 2.0]);
    for name in ["of_day_ms", "of_day_us"] {
        assert_eq!(column(name), [28_800.0, 28_800.01, 28_800.02], "{name}");
    }
    assert_eq!(column("day"), [1_795_305_600.0, 1_795_392_000.0, -86_400.0]);
    let moments = [1_795_341_600.0, 1_795_341_600.01, 1_795_341_600.02];
    assert_eq!(column("nano"), moments, "the schema says ns, the values are ms");
    let older = Table::read(foreign("int96.parquet")).unwrap();
    assert_eq!(*older.f64("int96").unwrap(), moments);
    assert_eq!(older.column("int96").unwrap().unit, "s");
}

#[test]
fn val_pyarrow_the_unnamed_time_index_of_pandas_is_the_time() {
    let table = Table::read(foreign("index.parquet")).unwrap();
    assert_eq!(table.names().collect::<Vec<_>>(), ["x_m", "time"]);
    assert_eq!(table.f64("time").unwrap()[1], 1_795_341_600.01);
    let mut only = ParquetReader::open_columns(foreign("index.parquet"), &["time"]).unwrap();
    let only = only.next().unwrap().unwrap();
    assert_eq!(only.column("time").unwrap().unit, "s");
}

#[test]
fn a_missing_value_in_parquet_is_nan_or_an_empty_text() {
    let table = Table::read(foreign("gaps.parquet")).unwrap();
    for (name, first, last) in
        [("whole", 1.0, 3.0), ("small", 1.0, 3.0), ("real", 1.5, 3.5), ("ok", 1.0, 0.0)]
    {
        let values = table.f64(name).unwrap();
        assert!(values[0] == first && values[1].is_nan() && values[2] == last, "{name}");
    }
    assert_eq!(table.text("s").unwrap(), ["a", "", "c"]);
}

#[test]
fn foreign_parquet_that_has_no_place_in_a_table_is_refused() {
    let cases = [
        ("decimal.parquet", "column 'price' has the type Decimal; known are"),
        ("large.parquet", "row 2, column 'a': 9223372036854775808 does not fit in 63 bits"),
        ("polars_brotli.parquet", "column 'x_m' is compressed with BROTLI"),
    ];
    for (name, expected) in cases {
        let message = Table::read(foreign(name)).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    let parts = ParquetReader::open_columns(foreign("decimal.parquet"), &["a"]).unwrap();
    assert_eq!(row_count(parts), 2, "a column not asked for is no obstacle");
}

#[test]
fn a_column_that_has_no_place_is_left_out_and_refused_only_where_it_is_used() {
    let table = table::read_usable(foreign("decimal.parquet")).unwrap();
    assert_eq!(table.names().collect::<Vec<_>>(), ["a"]);
    let message = table.column("price").unwrap_err().to_string();
    assert!(message.contains("column 'price' has the type Decimal"), "{message}");
    assert_eq!(table.origin().left_out()[0].0, "price");
    let message = table::read_usable(foreign("polars_brotli.parquet")).unwrap_err().to_string();
    assert!(message.contains("compressed with BROTLI"), "nothing is left: {message}");
}

/// A file of 800 bytes that would be 5 GB of text, and one with 200 MB in an encoding without a dictionary.
#[test]
fn a_small_file_with_gigabytes_of_text_is_stopped_by_the_limit() {
    for (name, rows, gigabytes) in
        [("large_text.parquet", 5000, 1), ("shared_text.parquet", 20_000, 0)]
    {
        let limits = Limits::of_table(gigabytes * 1_000_000_000 + 100_000_000);
        let table = read_within(&foreign(name), &|_| true, limits).unwrap();
        assert_eq!(table.names().collect::<Vec<_>>(), ["a"], "{name}");
        assert_eq!(table.row_count(), rows, "the columns within the limit are there");
        let message = table.column("comment").unwrap_err().to_string();
        assert!(message.contains("column 'comment' takes more than"), "{message}");
        assert!(message.contains("SERVOTWIN_TABLE_GB"), "{message}");
        let unused = ParquetReader::open_columns(foreign(name), &["a"]).unwrap();
        assert_eq!(row_count(unused), rows);
    }
    let strict = Table::read(foreign("large_text.parquet")).unwrap_err().to_string();
    assert!(strict.contains("the limit of a column"), "{strict}");
    let mut parts = ParquetReader::open(foreign("large_text.parquet")).unwrap();
    let streamed = parts.next().unwrap().unwrap_err().to_string();
    assert!(streamed.contains("column 'comment' takes more than 2 GB"), "{streamed}");
}

#[test]
fn columns_together_stay_within_the_limit_of_a_table() {
    let folder = Folder::new("limit");
    let path = folder.file("a.parquet");
    let names = ["a", "b", "c", "d", "e", "f"];
    let columns = names.map(|name| Column::new(name, "", vec![0.5; 1000])).to_vec();
    Table::from_columns(columns).unwrap().write(&path).unwrap();
    let table = read_within(&path, &|_| true, Limits::of_table(40_000)).unwrap();
    assert_eq!(table.names().collect::<Vec<_>>(), &names[..5], "8000 bytes each");
    let message = table.column("f").unwrap_err().to_string();
    assert!(message.contains("with column 'f' the table takes more than"), "{message}");
    assert!(read_within(&path, &|_| true, Limits::of_table(20_000)).is_err(), "no column is left");
}

/// The time to find a column does not depend on the number of columns; otherwise this test would not end.
#[test]
fn a_table_of_many_columns_is_read_and_taken_apart_column_by_column() {
    let folder = Folder::new("wide");
    let count = 100_000;
    let columns: Vec<Column> = (0..count)
        .map(|place| Column::new(format!("a long name of column {place}"), "", vec![0.5, 1.5]))
        .collect();
    let table = Table::from_columns(columns).unwrap();
    let names: Vec<String> = table.names().map(str::to_owned).collect();
    for format in table::ALL {
        let path = folder.file(&format!("a.{}", format.extension));
        let (file, rows) = match format.extension {
            "csv" => (table.clone(), 2),
            _ => (Table::from_columns(table.columns()[..20_000].to_vec()).unwrap(), 2),
        };
        file.write(&path).unwrap();
        let read = Table::read(&path).unwrap();
        assert_eq!((read.columns().len(), read.row_count()), (file.columns().len(), rows));
        let found = names.iter().filter(|name| read.column(name).is_ok());
        assert_eq!(found.take(20_000).count(), 20_000);
    }
}

#[test]
fn a_missing_column_is_answered_with_those_there_are() {
    let told = |name: &str| sample().column(name).unwrap_err().to_string();
    let known = "time_s, pressure_a_pa, offset, variant, healthy, fault";
    assert_eq!(told("x"), format!("there is no column 'x'; the table has {known}"));
    let near = told("ofset");
    assert!(near.contains("did you mean 'offset'? The table has time_s"), "{near}");
    let wanted = |name: &str| name == "a";
    let table = table::read_wanted(foreign("decimal.parquet"), &wanted).unwrap();
    let message = table.column("price_eur").unwrap_err().to_string();
    assert!(message.contains("a, price"), "also those that were not read: {message}");
}
