//! Figures are well-formed, the same every time, and lose no peak.

use std::f64::consts::TAU;

use proptest::prelude::*;
use roxmltree::Document;
use servotwin_io::files::FileError;
use servotwin_view::decimate::decimate;
use servotwin_view::histogram::{HistogramGrid, HistogramPanel};
use servotwin_view::lines::{Curve, Lines};
use servotwin_view::schematic::{Net, NetEnd, Part, Schematic};
use servotwin_view::time_series::{Band, Panel, Series, TimeSeries};
use servotwin_view::tree::{Node, TreeFigure};
use servotwin_view::{Figure, Look};

use crate::folder::Folder;

/// Awkward names must not break the document.
const NAME: &str = "a <b> & \"c\" \u{1}";

fn time_series(y: &[f64]) -> Figure {
    let time: Vec<f64> = (0..y.len()).map(|step| step as f64 * 0.01).collect();
    let mut panel = Panel::new(NAME, "pressure (Pa)")
        .with(Series::new(NAME, &time, y))
        .with(Series::new("twin", &time, y));
    panel.band = Some(Band { name: "±3 %".into(), low: -0.03, high: 0.03 });
    TimeSeries::new(NAME, "time (s)").with(panel.clone()).with(panel).draw()
}

fn histogram(values: &[f64]) -> Figure {
    let mut grid = HistogramGrid::new("residual", &["healthy", "faulty"]);
    grid.band = Some(0.03);
    grid.panels.push(HistogramPanel::new(NAME, vec![values.into(), values.into()]));
    grid.panels.push(HistogramPanel::new("empty", vec![[].as_slice().into()]));
    grid.draw()
}

fn lines(value: f64) -> Figure {
    let points = vec![(1.0, value), (10.0, value * 2.0), (f64::NAN, 1.0), (100.0, -value)];
    let intervals = vec![(0.0, value); 4];
    Lines::new(NAME, "x", "y")
        .with(Curve::new(NAME, points.clone()).with_intervals(intervals))
        .with(Curve::new("plain", points).unmarked())
        .draw()
}

fn tree(depth: usize) -> Figure {
    fn grow(depth: usize) -> Node {
        let lines = vec![format!("x ≤ {depth}"), NAME.to_owned()];
        match depth {
            0 => Node::leaf(lines, vec![1.0, f64::NAN, 3.0]),
            _ => Node::split(lines, vec![0.0, 0.0], grow(depth - 1), grow(depth / 2)),
        }
    }
    let classes = vec!["healthy".to_owned(), NAME.to_owned(), "jam".to_owned()];
    TreeFigure { title: NAME.to_owned(), classes, looks: vec![], root: grow(depth) }.draw()
}

fn schematic(count: usize) -> Figure {
    let part = |number: usize| Part {
        id: format!("part_{number} {NAME}"),
        text: "title\nsecond line".to_owned(),
        kind: number % 2,
        group: number % 3,
        column: number * number % 7,
    };
    let end = |part: usize| NetEnd {
        part,
        port: format!("{NAME} {part}"),
        arrow: part.is_multiple_of(2),
    };
    let net = |number: usize| Net {
        kind: 1,
        ends: [number, number / 2, number * 7 % count].map(end).to_vec(),
    };
    let kinds = ["oil", NAME].iter().enumerate();
    Schematic {
        title: NAME.to_owned(),
        groups: ["", NAME, "third"].map(str::to_owned).to_vec(),
        kinds: kinds.map(|(place, kind)| ((*kind).to_owned(), Look::nth(place))).collect(),
        parts: (0..count).map(part).collect(),
        nets: (0..count).map(net).collect(),
    }
    .draw()
}

fn gallery() -> Vec<(&'static str, Figure)> {
    let wave: Vec<f64> = (0..9000).map(|step| (TAU * f64::from(step) * 1e-3).sin()).collect();
    vec![
        ("time series", time_series(&wave)),
        ("histogram", histogram(&wave)),
        ("lines", lines(3.0)),
        ("tree", tree(6)),
        ("schematic", schematic(60)),
    ]
}

fn assert_well_formed(name: &str, figure: &Figure) {
    let document = Document::parse(&figure.svg).unwrap_or_else(|error| panic!("{name}: {error}"));
    let view = document.root_element().attribute("viewBox").unwrap();
    assert_eq!(view, format!("0 0 {} {}", figure.width, figure.height), "{name}");
    assert!(!figure.svg.contains("NaN") && !figure.svg.contains("inf"), "{name}");
}

#[test]
fn every_kind_is_well_formed_and_deterministic() {
    for ((name, figure), (_, again)) in gallery().into_iter().zip(gallery()) {
        assert_well_formed(name, &figure);
        assert_eq!(figure, again, "{name}");
        let document = Document::parse(&figure.svg).unwrap();
        let mut titles = document.descendants().filter(|node| node.has_tag_name("title"));
        if let Some(title) = titles.next().and_then(|title| title.text()) {
            assert!(title.starts_with("a <b> & \"c\" "), "{name}: {title}");
        }
    }
}

#[test]
fn every_text_lies_inside_its_figure() {
    for (name, figure) in gallery() {
        let document = Document::parse(&figure.svg).unwrap();
        for text in document.descendants().filter(|node| node.has_tag_name("text")) {
            let place = |key| text.attribute(key).unwrap().parse::<f64>().unwrap();
            let inside = (0.0..=figure.width).contains(&place("x"))
                && (0.0..=figure.height).contains(&place("y"));
            assert!(inside, "{name}: {:?} at {} {}", text.text(), place("x"), place("y"));
        }
    }
}

#[test]
fn nothing_to_draw_is_drawn_as_nothing() {
    let empty = [
        time_series(&[]),
        time_series(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
        time_series(&[1.0]),
        TimeSeries::new("", "").draw(),
        histogram(&[]),
        histogram(&[f64::NAN]),
        histogram(&[0.5]),
        HistogramGrid::new("", &[]).draw(),
        lines(f64::NAN),
        lines(-1.0),
        lines(0.0),
        Lines::new("", "", "").draw(),
        tree(0),
        schematic(1),
        Schematic::default().draw(),
    ];
    for figure in empty {
        assert_well_formed("empty", &figure);
    }
}

#[test]
fn a_figure_is_saved_as_svg() {
    let folder = Folder::new("figures");
    let figure = lines(0.5);
    figure.save(folder.file("a.svg")).unwrap();
    assert_eq!(std::fs::read_to_string(folder.file("a.svg")).unwrap(), figure.svg);
    assert!(matches!(figure.save(folder.file("no/a.svg")), Err(FileError::MissingFolder { .. })));
}

#[test]
fn a_long_signal_makes_a_small_figure() {
    let wave: Vec<f64> = (0..9000).map(|step| (TAU * f64::from(step) * 1e-3).sin()).collect();
    let size = time_series(&wave).svg.len();
    assert!(size < 100_000, "two panels of two signals take {size} bytes");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn decimation_keeps_extremes_and_ends(
        y in prop::collection::vec(-1e3..1e3, 1..3000),
        buckets in 1..200_usize,
    ) {
        let x: Vec<f64> = (0..y.len()).map(|step| step as f64 * 0.01).collect();
        let kept = decimate(&x, &y, buckets);
        prop_assert!(kept.is_sorted_by(|one, other| one < other));
        prop_assert!(kept.len() <= (4 * (buckets + 1)).max(4));
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::MIN, f64::max);
        let kept_y = || kept.iter().map(|index| y[*index]);
        prop_assert_eq!(largest(&mut kept_y()), largest(&mut y.iter().copied()));
        prop_assert_eq!(largest(&mut kept_y().map(|v| -v)), largest(&mut y.iter().map(|v| -v)));
        prop_assert_eq!((kept[0], kept[kept.len() - 1]), (0, y.len() - 1));
    }
}

#[test]
fn decimation_keeps_gaps_and_unsorted_times() {
    let x: Vec<f64> = (0..1000).map(f64::from).collect();
    let mut y = vec![0.0; 1000];
    y[503] = f64::NAN;
    let kept = decimate(&x, &y, 10);
    assert!(kept.contains(&503) && kept.contains(&502) && kept.contains(&504));
    let turned: Vec<f64> = x.iter().rev().copied().collect();
    assert_eq!(decimate(&turned, &y, 10).len(), 1000);
}
