//! Dates and times of many writers.

use servotwin_io::moment::{Clock, DAY_S, Moment, refusal, seconds, shown, zone_in_words};

#[test]
fn times_of_many_writers() {
    // Seconds since 1970 as `date --utc +%s` prints them.
    let cases = [
        ("1970-01-01", 0.0),
        ("2026-11-21T08:15:02.5", 1_795_248_902.5),
        ("2026-11-21 08:15:02Z", 1_795_248_902.0),
        ("2026-11-21 09:15:02+01:00", 1_795_248_902.0),
        ("2026-11-21 02:45:02-0530", 1_795_248_902.0),
        ("21.11.2026 08:15", 1_795_248_900.0),
        ("2024/02/29", 1_709_164_800.0),
        ("1969-12-31 23:59:59", -1.0),
        ("08:15:02,25", 29_702.25),
        ("2026-11-21 08:15:02 UTC", 1_795_248_902.0),
        ("2026-11-21 08:15:02 GMT", 1_795_248_902.0),
        ("2026-11-21 10:15:02 UTC+02:00", 1_795_248_902.0),
        ("2026-11-21 08:15:02 AM", 1_795_248_902.0),
        ("2026-11-21 8:15:02.5 pm", 1_795_248_902.5 + 43_200.0),
        ("2026-11-21 12:00:00 AM", 1_795_219_200.0),
        ("21-Nov-2026 08:15:02", 1_795_248_902.0),
        ("Nov 21, 2026 8:15:02 a.m.", 1_795_248_902.0),
        ("12:00:01 PM", 43_201.0),
        ("20261121T081502.5", 1_795_248_902.5),
        ("20261121T081502Z", 1_795_248_902.0),
        ("08:15:02:250", 29_702.25),
        ("59:52.25", 3592.25),
        ("002:08:15:02.5", 86_400.0 + 29_702.5),
    ];
    for (text, expected) in cases {
        assert_eq!(seconds(text), Some(expected), "{text}");
    }
    for text in [
        "",
        "pump",
        "1.5",
        "12",
        "1-2-3",
        "25.13.2026",
        "12:75",
        "a:b",
        "11/21/2026",
        "2025-02-30",
        "13:00 PM",
        "0:15 AM",
        "21-11-2026",
        "20261321T081502",
        "20261121081502",
        "08:15:02:25",
        "59:72.25",
        "400:08:15:02.5",
    ] {
        assert_eq!(seconds(text), None, "{text}");
    }
}

#[test]
fn a_date_whose_order_is_not_known_is_refused_with_this_reason() {
    for text in ["11/21/2026 15:00:00", "01/02/26", "21-11-2026"] {
        assert!(refusal(text).unwrap().contains("order of day and month"), "{text}");
    }
    assert!(refusal("2026-11-21 15:00:00 CEST").unwrap().contains("offset"));
    for text in ["s", "pump", "2026-11-21", "15:00:00", "", "1.5", "2025-02-30"] {
        assert_eq!(refusal(text), None, "{text}");
    }
}

#[test]
fn the_first_time_of_a_log_decides_its_clock() {
    let mut clock = Clock::default();
    let first = clock.read("2026-03-29 01:59:59+01:00").unwrap();
    assert_eq!(shown(first), "2026-03-29 01:59:59.000");
    assert_eq!(clock.read("2026-03-29 03:00:00+02:00"), Some(first + 1.0));
    assert_eq!(clock.zone_s().map(zone_in_words).unwrap(), "UTC+01:00");
    assert_eq!(Moment::read("2026-03-29 01:00Z").unwrap().on_clock(3600.0), first + 1.0);
    assert_eq!(zone_in_words(-19_800.0), "UTC-05:30");
}

#[test]
fn a_time_of_day_goes_on_behind_midnight() {
    let mut clock = Clock::default();
    let texts = ["23:59:59.99", "00:00:00.00", "23:59:59.995", "00:00:00.01", "12:00:00"];
    let times: Vec<f64> = texts.iter().map(|text| clock.read(text).unwrap() - DAY_S).collect();
    let expected = [-0.01, 0.0, -0.005, 0.01, 43_200.0];
    for (time, expected) in times.iter().zip(expected) {
        assert!((time - expected).abs() < 1e-9, "{time} {expected}");
    }
    let mut clock = Clock::default();
    let numbers = [86_399.99, 0.0, 0.01].map(|value| clock.number(value, DAY_S));
    assert_eq!(numbers, [86_399.99, 86_400.0, 86_400.01]);
    // Minutes begin anew behind an hour.
    let mut clock = Clock::default();
    let times = ["59:59.990", "00:00.000", "00:00.010"].map(|text| clock.read(text).unwrap());
    assert_eq!(times, [3599.99, 3600.0, 3600.01]);
    // A clock that is set back stays set back.
    let mut clock = Clock::default();
    let numbers = [50_000.0, 0.0, 1.8e9, 0.0].map(|value| clock.number(value, DAY_S));
    assert_eq!(numbers, [50_000.0, 0.0, 1.8e9, 0.0]);
}

#[test]
fn a_date_is_shown_as_it_was_written() {
    for text in ["2025-10-26 02:59:54.010", "2026-02-28 23:59:59.999"] {
        assert_eq!(shown(seconds(text).unwrap()), text);
    }
    assert_eq!(shown(12.344), "12.34 s");
    assert_eq!(shown(f64::NAN), "NaN s");
    assert_eq!(shown(1e300), format!("{:.2} s", 1e300), "no calendar goes so far");
}
