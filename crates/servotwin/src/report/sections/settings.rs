//! The subjects side by side: realistic against ideal, and the change by a third sensor.

use crate::evaluation::protocol::Protocol;
use crate::evaluation::score::Rate;
use crate::report::lines::{ACCURACY, SAFETY};
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{NONE, rate};
use crate::report::{Material, Section};

/// See the module.
pub struct Settings;

impl Section for Settings {
    fn id(&self) -> &'static str {
        "settings"
    }

    fn title(&self) -> &'static str {
        "Realistic against ideal, and a third sensor"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let subjects = &material.results.subjects;
        let [first, others @ ..] = &subjects[..] else {
            return;
        };
        if others.is_empty() {
            return;
        }
        let mut heads = vec![(String::new(), Side::Left), (first.title.clone(), Side::Right)];
        for other in others {
            heads.push((other.title.clone(), Side::Right));
            heads.push(("change, points".into(), Side::Right));
        }
        let mut grid = Grid::new(heads);
        for line in SAFETY.iter().chain(&ACCURACY) {
            let of = |result: &crate::job::results::SubjectResult| {
                line.of(&result.evaluation, Protocol::Grouped)
            };
            let mut row = vec![line.title.to_owned(), rate(of(first))];
            for other in others {
                row.push(rate(of(other)));
                row.push(change(of(first), of(other)));
            }
            grid.push(row);
        }
        page.table(
            &grid,
            "Grouped protocol. Intervals are 95 %; a change inside them may be chance.",
        );
        if subjects.iter().any(|result| result.subject.extra_sensor()) {
            page.text(
                "The additional sensor measures the stroke a third time, so that a majority vote \
                 can tell which stroke sensor errs: the change of design that the seed paper suggests.",
            );
        }
        if let Some(realism) = &material.study.realism {
            page.note(&format!(
                "Realistic: sensor noise and quantisation as the system declares them, and another \
                 specimen for every variant, whose parameters differ by the tolerances of the study \
                 file (seed {}); {} fault-free specimens in each operating case.",
                realism.seed, realism.healthy
            ));
        }
    }
}

fn change(before: Option<Rate>, after: Option<Rate>) -> String {
    let shares = before.and_then(|rate| rate.share).zip(after.and_then(|rate| rate.share));
    shares.map_or(NONE.into(), |(before, after)| format!("{:+.2}", 100.0 * (after - before)))
}
