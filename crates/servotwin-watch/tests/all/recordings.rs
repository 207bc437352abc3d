//! Files of measurement systems, as asammdf wrote them (`tests/foreign/make_recordings.py`), and what is said of them where
//! the feature that reads them is off.

use servotwin_watch::source::{Address, Wanted};
use std::path::PathBuf;

fn foreign(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../servotwin-io/tests/foreign")).join(name)
}

fn wanted(names: &[&str], time: Option<usize>) -> Wanted {
    let names = names.iter().map(|name| name.to_string()).collect();
    Wanted { names, time, ..Wanted::default() }
}

#[cfg(not(feature = "mf4"))]
#[test]
fn a_file_of_a_feature_that_is_off_names_it_and_the_line_to_type() {
    let address = Address::File(foreign("recording_plain.mf4"));
    let columns = address.columns().map(|_| ()).map_err(|error| error.to_string());
    let opened = address.open(&wanted(&["p"], None)).map(|_| ()).map_err(|error| error.to_string());
    for told in [columns, opened] {
        let told = told.unwrap_err();
        assert!(
            told.contains("cargo install --path crates/servotwin-cli --features mf4"),
            "{told}"
        );
        assert!(told.contains("recording_plain.mf4"), "{told}");
    }
}

#[cfg(feature = "mf4")]
mod read {
    use super::*;
    use servotwin_watch::source::{LogRow, Read};

    /// All rows of a file, or why there are none.
    pub(super) fn rows(path: &std::path::Path, wanted: &Wanted) -> Result<Vec<Vec<f64>>, String> {
        let mut source =
            Address::File(path.into()).open(wanted).map_err(|error| error.to_string())?;
        let (mut row, mut found) = (LogRow::default(), vec![]);
        loop {
            match source.read(&mut row).map_err(|error| error.to_string())? {
                Read::End => return Ok(found),
                Read::Row => found.push(row.values.clone()),
                _ => {}
            }
        }
    }

    pub(super) fn columns(name: &str) -> Vec<(String, String)> {
        let columns = Address::File(foreign(name)).columns().unwrap();
        columns.into_iter().map(|column| (column.name, column.unit)).collect()
    }

    /// Files with flipped bits and without their ends are read or refused; nothing panics or takes more than it has.
    pub(super) fn mutate(name: &str, names: &[&str]) {
        let whole = std::fs::read(foreign(name)).unwrap();
        let ending = name.rsplit_once('.').unwrap().1;
        let folder =
            std::env::temp_dir().join(format!("servotwin-mutated-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join(format!("log.{ending}"));
        let mut state = 1_u64;
        let mut next = |below: usize| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let mut refused = 0;
        for k in 0..500 {
            let mut bytes = whole.clone();
            match k % 5 {
                0 => bytes.truncate(next(whole.len())),
                // A length or an address that is as large as it gets.
                1 => {
                    let at = next(whole.len() - 8) / 4 * 4;
                    bytes[at..at + 4 + 4 * (k / 5 % 2)].fill(0xFF);
                }
                _ => (0..=k % 3).for_each(|_| bytes[next(whole.len())] ^= 1 << next(8)),
            }
            std::fs::write(&path, bytes).unwrap();
            let address = Address::File(path.clone());
            refused += usize::from(address.columns().is_err());
            let read = rows(&path, &wanted(names, Some(0)));
            assert!(read.is_err() || read.unwrap().len() < 10_000);
        }
        assert!(refused > 20, "{refused} refused");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    pub(super) fn refusal(name: &str, change: impl Fn(&mut Vec<u8>)) -> String {
        let ending = name.rsplit_once('.').unwrap().1;
        let mut bytes = std::fs::read(foreign(name)).unwrap();
        change(&mut bytes);
        let path = std::env::temp_dir().join(format!(
            "servotwin-refused-{}-{:?}.{ending}",
            std::process::id(),
            std::thread::current().id()
        ));
        std::fs::write(&path, bytes).unwrap();
        let found = rows(&path, &wanted(&["time", "p_a"], Some(0)));
        std::fs::remove_file(&path).unwrap();
        found.unwrap_err()
    }
}

#[cfg(feature = "mf4")]
mod mf4 {
    use super::read::{columns, mutate, refusal, rows};
    use super::*;

    const FILES: [&str; 4] = [
        "recording_plain.mf4",
        "recording_deflate.mf4",
        "recording_transposed.mf4",
        "recording_parts.mf4",
    ];

    #[test]
    fn channels_are_columns_with_their_units() {
        let expected = [
            ("time", "s"),
            ("command", "deg"),
            ("p_a", "bar"),
            ("x_p", "mm"),
            ("state", ""),
            ("both#1", "bar"),
            ("temperature", "°C"),
            ("both#2", "bar"),
            ("note", ""),
            ("formula", ""),
        ];
        for name in FILES {
            let found = columns(name);
            let found: Vec<(&str, &str)> =
                found.iter().map(|(n, u)| (n.as_str(), u.as_str())).collect();
            assert_eq!(found, expected, "{name}");
        }
    }

    #[test]
    fn zipped_and_parted_groups_of_two_rates_become_rows_in_time() {
        let names = ["time", "command", "p_a", "x_p", "state", "both#1", "temperature", "both#2"];
        for name in FILES {
            let found = rows(&foreign(name), &wanted(&names, Some(0))).unwrap();
            assert_eq!(found.len(), 100, "{name}");
            for (k, row) in found.iter().enumerate() {
                let x = k as f64;
                let pressure = (1000 + 37 * k % 100) as f64 * 0.125 - 5.0;
                assert_eq!(row[..3], [x / 64.0, x / 8.0 - 3.0, pressure], "{name}");
                // Invalid values are missing, and a slow group has none in between.
                assert_eq!(row[3].is_nan(), (10..20).contains(&k), "{name}");
                assert!(row[3].is_nan() || row[3] == x / 16.0, "{name}");
                assert_eq!(row[4..6], [(k % 3) as f64 - 1.0, x], "{name}");
                match k % 8 == 0 && k < 80 {
                    true => assert_eq!(row[6..], [20.0 + x / 32.0, -x / 8.0], "{name}"),
                    false => assert!(row[6].is_nan() && row[7].is_nan(), "{name}"),
                }
            }
        }
    }

    #[test]
    fn what_is_not_read_is_refused_with_its_reason() {
        let path = foreign("recording_plain.mf4");
        let refused =
            |name: &str, time: &str| rows(&path, &wanted(&[time, name], Some(0))).unwrap_err();
        assert!(refused("note", "time").contains("column 'note': a channel of the MDF kind 1"));
        assert!(refused("formula", "time").contains("column 'formula': a formula"));
        assert!(refused("p_b", "time").contains("has no column 'p_b'; did you mean 'p_a'?"));
        assert!(refused("p_a", "command").contains("the times are the column 'time'"));
        let of = |change: &dyn Fn(&mut Vec<u8>)| refusal("recording_plain.mf4", change);
        assert!(of(&|bytes| bytes[..8].copy_from_slice(b"UnFinMF ")).contains("not finished"));
        assert!(
            of(&|bytes| bytes[28..30].copy_from_slice(&330_u16.to_le_bytes()))
                .contains("version 330")
        );
        assert!(of(&|bytes| bytes.truncate(6000)).contains("the file ends within a block"));
        assert!(of(&|bytes| bytes.clear()).contains("the file ends"));
        let in_columns = |bytes: &mut Vec<u8>| {
            let marks: Vec<usize> =
                (0..bytes.len() - 4).filter(|&at| &bytes[at..at + 4] == b"##DT").collect();
            marks.iter().for_each(|&at| bytes[at + 3] = b'V');
        };
        assert!(of(&in_columns).contains("data in columns"));
    }

    #[test]
    fn hand_mutated_files_neither_panic_nor_hang() {
        for name in FILES {
            mutate(name, &["time", "command", "p_a", "x_p", "temperature"]);
        }
    }
}
