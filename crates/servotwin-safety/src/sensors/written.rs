//! Tables and figure of a sensor trade.

use super::{FaultPair, SensorSet, SensorTrade, SetPairs};
use crate::error::SafetyError;
use crate::results::{FOLDER, StudyResultsFolder};
use servotwin::figure::Figure;
use servotwin::figure::lines::{Curve, Lines};
use servotwin::files::{create_folder, write_atomically};
use servotwin::table::{self, Column, Table, Values};
use servotwin_learning::metrics::Rate;
use std::path::PathBuf;

/// The rate that a column shows of a set; `None` if it is not known.
type RateOf = fn(&SensorSet) -> Option<Rate>;

/// The rates of a set, with the names of their columns.
const RATES: [(&str, RateOf); 10] = [
    ("detected", |set| Some(set.rates.detected)),
    ("healthy_alarms", |set| Some(set.rates.alarms)),
    ("isolated_to_1", |set| Some(set.rates.isolated[0])),
    ("isolated_to_2", |set| Some(set.rates.isolated[1])),
    ("isolated_to_3", |set| Some(set.rates.isolated[2])),
    ("isolable_to_1", |set| set.isolable.map(|of| of[0])),
    ("isolable_to_2", |set| set.isolable.map(|of| of[1])),
    ("isolable_to_3", |set| set.isolable.map(|of| of[2])),
    ("wrong_shutdown", |set| Some(set.rates.wrong_shutdown)),
    ("missed_shutdown", |set| Some(set.rates.missed_shutdown)),
];

impl SensorTrade {
    /// Writes all files and returns their paths.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, results: &StudyResultsFolder) -> Result<Vec<PathBuf>, SafetyError> {
        create_folder(results.folder.path().join(FOLDER))?;
        let [sets, pairs, figure] =
            ["sensors.csv", "pairs.csv", "pareto.svg"].map(|name| results.artefact(name));
        table::write(&sets, &self.set_table()?)?;
        table::write(&pairs, &self.pair_table()?)?;
        let svg = self.figure().svg;
        write_atomically(&figure, |out| out.write_all(svg.as_bytes()))?;
        Ok(vec![sets, pairs, figure])
    }

    fn upgrade_name(&self, set: &SensorSet) -> String {
        set.upgrade.map_or_else(String::new, |place| self.upgrades[place].name.clone())
    }

    /// One row for each judged set.
    fn set_table(&self) -> Result<Table, SafetyError> {
        let candidates = &self.candidates;
        fn of<T>(trade: &SensorTrade, value: impl Fn(&SensorSet) -> T) -> Vec<T> {
            trade.sets.iter().map(value).collect()
        }
        let column = |name: &str, unit: &str, values: Values| Column::new(name, unit, values);
        let left_out = |set: &SensorSet| candidates.names(candidates.all() & !set.set);
        let mut columns = vec![
            column("sensors", "", of(self, |set| candidates.names(set.set)).into()),
            column("upgrade", "", of(self, |set| self.upgrade_name(set)).into()),
            column("left_out", "", of(self, left_out).into()),
            column("count", "1", of(self, |set| set.set.count_ones()).into()),
            column("cost", "", of(self, |set| set.cost).into()),
            column("keeps_control", "", of(self, |set| set.keeps_control).into()),
            column("on_front", "", of(self, |set| set.is_on_front).into()),
        ];
        for (name, rate) in RATES {
            let share = |set: &SensorSet| rate(set).and_then(|rate| rate.share).unwrap_or(f64::NAN);
            let end = |of: fn(&Rate) -> f64| {
                move |set: &SensorSet| rate(set).as_ref().map_or(f64::NAN, of)
            };
            columns.push(column(name, "1", of(self, share).into()));
            columns.push(column(&format!("{name}_low"), "1", of(self, end(|r| r.low)).into()));
            columns.push(column(&format!("{name}_high"), "1", of(self, end(|r| r.high)).into()));
        }
        Ok(Table::from_columns(columns)?)
    }

    /// One row for each pair of faults that look alike or are confused.
    fn pair_table(&self) -> Result<Table, SafetyError> {
        let all =
            || self.pairs.iter().flat_map(|own| own.pairs.iter().map(move |pair| (own, pair)));
        let texts = |name: &str, texts: Vec<String>| Column::new(name, "", texts);
        let counts = |name: &str, of: fn(&FaultPair) -> u64| {
            Column::new(
                name,
                "1",
                all().map(|(_, (_, pair))| of(pair) as u32).collect::<Vec<u32>>(),
            )
        };
        let verdict = |own: &SetPairs, pair: &FaultPair| match own.is_structural {
            true => pair.verdict().to_owned(),
            false => "not known: too few healthy specimens".into(),
        };
        Ok(Table::from_columns(vec![
            texts("sensors", all().map(|(own, _)| self.candidates.names(own.set)).collect()),
            texts("fault", all().map(|(_, ((fault, _), _))| fault.clone()).collect()),
            texts("other", all().map(|(_, ((_, other), _))| other.clone()).collect()),
            counts("detected_runs", |pair| pair.detected),
            counts("alike", |pair| pair.alike),
            counts("confused", |pair| pair.confused),
            counts("confused_alike", |pair| pair.confused_alike),
            texts("verdict", all().map(|(own, (_, pair))| verdict(own, pair)).collect()),
        ])?)
    }

    /// The best value of each rate that sets of at most a cost reach.
    fn figure(&self) -> Figure {
        let curve = |name: &str, rate: RateOf, is_better: fn(f64, f64) -> bool| {
            let mut able: Vec<&SensorSet> =
                self.sets.iter().filter(|set| set.keeps_control).collect();
            able.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            let mut best: Vec<(f64, Rate)> = vec![];
            for set in able {
                let Some((rate, share)) = rate(set).and_then(|r| Some((r, r.share?))) else {
                    continue;
                };
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
            .with(curve("detected", |set| Some(set.rates.detected), more))
            .with(curve("isolable", |set| set.isolable.map(|of| of[0]), more))
            .with(curve("isolated", |set| Some(set.rates.isolated[0]), more))
            .with(curve("missed shutdown", |set| Some(set.rates.missed_shutdown), less))
            .with(curve("wrong shutdown", |set| Some(set.rates.wrong_shutdown), less));
        lines.curves.retain(|curve| !curve.points.is_empty());
        lines.y_range = Some((0.0, 100.0));
        lines.draw()
    }
}
