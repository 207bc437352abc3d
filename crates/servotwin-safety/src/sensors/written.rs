//! Table and figure of a sensor trade.

use super::{SensorSet, SensorTrade};
use crate::error::SafetyError;
use crate::results::StudyResultsFolder;
use servotwin::measure::{
    END_TO_END_OF_ALL, Measure, RIGHT_ACTION_OF_ALL, SHUTDOWN_MISSED_OF_ALL, VISIBLE,
    VISIBLE_BY_CHANCE, WRONG_SHUTDOWN,
};
use servotwin::table::{Column, Table};
use servotwin::view::Figure;
use servotwin::view::lines::{Curve, Lines};
use servotwin_learning::metrics::Rate;
use std::path::PathBuf;

/// The measures of a set, whose names are those of columns.
const MEASURES: [&Measure; 6] = [
    &VISIBLE,
    &VISIBLE_BY_CHANCE,
    &RIGHT_ACTION_OF_ALL,
    &END_TO_END_OF_ALL,
    &WRONG_SHUTDOWN,
    &SHUTDOWN_MISSED_OF_ALL,
];

impl SensorTrade {
    /// Writes all files and returns their paths.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, results: &StudyResultsFolder) -> Result<Vec<PathBuf>, SafetyError> {
        Ok(vec![
            results.write_table("sensors.csv", &self.set_table()?)?,
            results.write("pareto.svg", &self.figure().svg)?,
        ])
    }

    /// One row for each judged set.
    fn set_table(&self) -> Result<Table, SafetyError> {
        let (candidates, sets) = (&self.candidates, &self.sets);
        let left_out = |set: &SensorSet| candidates.names(candidates.all() & !set.set);
        let mut columns = vec![
            Column::of("sensors", "", sets, |set| candidates.names(set.set)),
            Column::of("left_out", "", sets, left_out),
            Column::of("count", "1", sets, |set| set.set.count_ones()),
            Column::of("cost", "", sets, |set| set.cost),
            Column::of("keeps_control", "", sets, |set| set.keeps_control),
            Column::of("on_front", "", sets, |set| set.is_on_front),
        ];
        for measure in MEASURES {
            let mut push = |end: &str, value: fn(Rate) -> f64| {
                let name = format!("{}{end}", measure.name);
                columns.push(Column::of(name, "1", sets, |set| value(set.rates.of(measure))));
            };
            push("", |rate| rate.share.unwrap_or(f64::NAN));
            push("_low", |rate| rate.low);
            push("_high", |rate| rate.high);
        }
        Ok(Table::from_columns(columns)?)
    }

    /// The best value of each rate that sets of at most a cost reach.
    fn figure(&self) -> Figure {
        let curve = |name: &str, measure: &Measure, is_better: fn(f64, f64) -> bool| {
            let mut able: Vec<&SensorSet> =
                self.sets.iter().filter(|set| set.keeps_control).collect();
            able.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            let mut best: Vec<(f64, Rate)> = vec![];
            for set in able {
                let rate = set.rates.of(measure);
                let Some(share) = rate.share else { continue };
                let last = best.last().copied();
                if last.is_none_or(|(_, last)| is_better(share, last.share.unwrap_or(share))) {
                    best.retain(|(cost, _)| *cost < set.cost);
                    best.push((set.cost, rate));
                }
            }
            let percent = |value: f64| 100.0 * value;
            let points = best.iter().map(|(cost, r)| (*cost, percent(r.share.unwrap_or(0.0))));
            let ends = best.iter().map(|(_, r)| (percent(r.low), percent(r.high)));
            Curve::new(name, points.collect()).with_intervals(ends.collect())
        };
        let (more, less) = (|a: f64, b: f64| a > b, |a: f64, b: f64| a < b);
        let title = "Best value of each rate that sensors of at most a cost reach";
        let mut lines = Lines::new(title, "cost of the sensors", "share, %")
            .with(curve("detected", &VISIBLE, more))
            .with(curve("right action", &RIGHT_ACTION_OF_ALL, more))
            .with(curve("missed shutdown", &SHUTDOWN_MISSED_OF_ALL, less))
            .with(curve("wrong shutdown", &WRONG_SHUTDOWN, less));
        lines.curves.retain(|curve| !curve.points.is_empty());
        lines.y_range = Some((0.0, 100.0));
        lines.draw()
    }
}
