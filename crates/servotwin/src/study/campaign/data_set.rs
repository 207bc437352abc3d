//! The data set of a campaign: labels, detection and features, one row for each variant.

use super::{Images, Planned, Row, Study};
use crate::study::OperatingCase;
use crate::table::{Column, Table, Values};
use servotwin_diagnosis::features::{self, Feature};
use servotwin_diagnosis::residual::Window;
use std::collections::BTreeSet;

/// A feature of the data set.
#[derive(Clone, Debug, PartialEq)]
pub struct DataFeature {
    /// The feature.
    pub feature: Feature,
    /// The family that computes it.
    pub family: &'static str,
    /// Whether it needs the extra sensor.
    pub extra: bool,
}

/// All features of a study's data set, in the order of its columns.
pub fn data_features(study: &Study) -> Vec<DataFeature> {
    let base = features::Sensors(study.sensors.0[..study.base_sensors()].to_vec());
    let mut list = Vec::new();
    for family in features::ALL {
        let known = family.features(&base);
        for feature in family.features(&study.sensors) {
            let extra = !known.iter().any(|k| k.name == feature.name);
            list.push(DataFeature { feature, family: family.name(), extra });
        }
    }
    list
}

/// The column with the largest size that the residual of a sensor had.
pub fn largest_column(sensor: &str) -> String {
    format!("largest:{sensor}")
}

/// What a data set is made from.
pub(super) struct Maker<'m> {
    pub study: &'m Study,
    pub cases: &'m [OperatingCase],
    pub images: &'m Images,
}

impl Maker<'_> {
    /// The data set: labels, detection, features.
    pub fn table(&self, plan: &[Planned], rows: &[Row]) -> Table {
        let mut columns = self.label_columns(plan);
        let reflected = (0..plan.len()).map(|variant| self.images.is_mirrored(variant));
        let reflected = Values::Flag(reflected.collect());
        columns.push(Column::new("reflected", "", reflected));
        let float = |f: &dyn Fn(&Window) -> f64| {
            Values::Float(rows.iter().map(|row| f(&row.window)).collect())
        };
        let flag = |f: &dyn Fn(&Window) -> bool| {
            Values::Flag(rows.iter().map(|row| f(&row.window)).collect())
        };
        let period = self.study.sample_period_s;
        let first = |w: &Window| w.first_excursion().map_or(-1.0, |sample| sample as f64 * period);
        columns.push(Column::new("detectable", "", flag(&|w| w.first_excursion().is_some())));
        columns.push(Column::new("deviates", "", flag(&Window::deviates)));
        columns.push(Column::new("largest_residual", "", float(&Window::largest_of_all)));
        columns.push(Column::new("first_excursion_s", "s", float(&first)));
        let sensors = &self.study.sensors.0[..self.study.base_sensors()];
        for (sensor, known) in sensors.iter().enumerate() {
            let largest = float(&|w: &Window| w.largest(sensor));
            columns.push(Column::new(largest_column(&known.name), "", largest));
        }
        let failures = rows.iter().map(|row| row.failure.clone()).collect();
        columns.push(Column::new("failure", "", Values::Text(failures)));
        columns.extend(self.feature_columns(rows));
        Table::from_columns(columns).expect("columns of one length, named apart")
    }

    /// Each feature, and where the units correspond also its mirror image.
    fn feature_columns(&self, rows: &[Row]) -> Vec<Column> {
        let sensors = &self.study.sensors;
        let own: Vec<Vec<f64>> =
            rows.iter().map(|row| features::values(sensors, &row.window)).collect();
        let mirrored: Option<Vec<Vec<f64>>> = sensors.exchanged(0, 1).map(|order| {
            rows.iter()
                .map(|row| features::values(sensors, &row.window.reordered(&order)))
                .collect()
        });
        let mut columns = Vec::new();
        for (index, feature) in data_features(self.study).iter().enumerate() {
            let mut push = |view: &str, rows: &[Vec<f64>]| {
                let values = rows.iter().map(|row| row[index]).collect();
                let name = format!("{view}:{}", feature.feature.name);
                columns.push(Column::new(name, "", Values::Float(values)));
            };
            push("f", &own);
            if let Some(mirrored) = &mirrored {
                push("m", mirrored);
            }
        }
        columns
    }

    fn label_columns(&self, plan: &[Planned]) -> Vec<Column> {
        let study = self.study;
        let fault = |planned: &Planned| planned.fault.map(|f| &study.faults[f]);
        let class = |planned: &Planned| fault(planned).map(|f| &study.classes[f.class]);
        let intensity = |planned: &Planned| planned.intensity;
        let grade = |planned: &Planned| fault(planned).map_or(0.0, |f| f.at.intensity);
        let healthy = "healthy";
        let seed = study.realism.as_ref().map_or(0, |r| r.seed as u32);
        let variants = (0..plan.len() as u32).collect();
        let case = texts(plan, |p| &self.cases[p.case].name);
        let flown = texts(plan, |p| &self.cases[p.case].command);
        let id = texts(plan, |p| fault(p).map_or(healthy, |f| &f.id));
        let kind = texts(plan, |p| fault(p).map_or(healthy, |f| &f.kind));
        let actuator = texts(plan, |p| fault(p).map_or(healthy, |f| &study.units[f.unit]));
        let command = texts(plan, |p| class(p).map_or(healthy, |c| &c.command));
        let detail = texts(plan, |p| class(p).map_or(healthy, |c| &c.detail));
        let mut columns = vec![
            Column::new("variant", "", Values::Unsigned(variants)),
            Column::new("case", "", case),
            Column::new("flown", "", flown),
            Column::new("seed", "", Values::Unsigned(vec![seed; plan.len()])),
            Column::new("fault", "", id),
            Column::new("kind", "", kind),
            Column::new("intensity", "", Values::Float(plan.iter().map(intensity).collect())),
            Column::new("grade", "", Values::Float(plan.iter().map(grade).collect())),
            Column::new("actuator", "", actuator),
            Column::new("command", "", command),
            Column::new("detail", "", detail),
        ];
        // The form of the paper's figure 8: each fault's intensity in its own column.
        let ids: BTreeSet<&String> = study.faults.iter().map(|fault| &fault.id).collect();
        for id in ids {
            let of = |p: &Planned| {
                if fault(p).is_some_and(|f| &f.id == id) { intensity(p) } else { 0.0 }
            };
            let values = Values::Float(plan.iter().map(of).collect());
            columns.push(Column::new(format!("i:{id}"), "", values));
        }
        columns
    }
}

/// One text for each variant.
fn texts<'s>(plan: &[Planned], text: impl Fn(&Planned) -> &'s str) -> Values {
    Values::Text(plan.iter().map(|planned| text(planned).to_owned()).collect())
}
