//! The faults that are detected, and the intensity from which each is detected.

use crate::lines;
use crate::words::{distinct, rate, spoken};
use crate::{Material, hardest_first};
use servotwin::job::results::SubjectResult;
use servotwin::learn::detection::Detection;
use servotwin::measure::VISIBLE;
use servotwin_view::Figure;
use servotwin_view::document::Document;
use servotwin_view::value_map::{ValueMap, digits};

/// The stand-in intensity of a fault that is never detected; real intensities are at most one.
const NEVER: f64 = 10.0;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let words = material.words();
    let show = |result: &SubjectResult, page: &mut Document| {
        let detection = &result.evaluation.detection;
        let detected = result.evaluation.in_band.of(&VISIBLE);
        let name = result.subject.name();
        page.heading(format!("Scenario: {}", result.title));
        page.text(format!(
            "{} of all faults leave {} at least once{}.",
            rate(Some(detected)),
            match lines::learned(result) {
                Some(_) => "the bands learned from healthy specimens",
                None => words.fixed_band(),
            },
            match detected.count < detected.of {
                true => {
                    "; the others are invisible to these sensors in these operating cases and are \
                         not diagnosed"
                }
                false => "",
            },
        ));
        page.figure(
            format!("least_intensity_{name}"),
            least(detection),
            format!(
                "Scenario: {}. The smallest intensity from which on a fault is detected in each \
                     operating case{}, the hardest to see first.",
                result.title,
                match words.has_several() {
                    true => format!(" (of all {} the worst)", words.actuators()),
                    false => String::new(),
                }
            ),
        );
    };
    hardest_first(&lines::scenarios(material.results), page, &show);
}

/// A map of the smallest detectable intensity: kinds of fault against operating cases.
fn least(detection: &Detection) -> Figure {
    let kinds: Vec<&str> = detection.curves.iter().map(|curve| curve.kind.as_str()).collect();
    let cases = distinct(detection.least.iter().map(|least| least.case.as_str()));
    let worst = |kind: &str, case: &str| {
        let own = detection.least.iter().filter(|least| {
            least.case == case
                && (least.fault == kind || least.fault.ends_with(&format!(".{kind}")))
        });
        // A fault that is never detected makes the cell `None`, which is worse than any intensity.
        own.map(|least| least.intensity).try_fold(0.0, |worst: f64, own| own.map(|i| worst.max(i)))
    };
    let of_kind = |kind: &&str| cases.iter().map(|case| worst(kind, case)).collect();
    let mut rows: Vec<(&str, Vec<Option<f64>>)> =
        kinds.iter().map(|kind| (*kind, of_kind(kind))).collect();
    // A fault that is never detected counts as worse than the greatest intensity.
    let hard = |row: &[Option<f64>]| row.iter().map(|cell| cell.unwrap_or(NEVER)).sum::<f64>();
    rows.sort_by(|a, b| hard(&b.1).total_cmp(&hard(&a.1)));
    let all: Vec<f64> = rows.iter().flat_map(|row| row.1.iter().flatten().copied()).collect();
    ValueMap {
        rows: rows.iter().map(|(kind, _)| spoken(kind)).collect(),
        columns: cases.iter().map(|case| (*case).to_owned()).collect(),
        digits: digits(all.iter().copied()),
        values: rows.into_iter().map(|row| row.1).collect(),
        range: (0.0, 1.0),
        meaning: "the smallest intensity from which on every one is detected".into(),
        worst: Some(("never".into(), "not detected even at the greatest intensity".into())),
    }
    .draw()
}
