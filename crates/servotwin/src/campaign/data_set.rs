//! The data set of a campaign: labels, detection and features, one row for each variant.

use super::columns::{Shown, fault_columns, feature_columns, largest_columns, seen};
use super::effort::effort_columns;
use super::{Images, Planned, Row, Setting, Study};
use crate::study::OperatingCase;
use crate::table::{Column, Table, Values};
use servotwin_diagnosis::features::{self, Feature};
use servotwin_diagnosis::residual::Window;
use std::collections::BTreeSet;
use std::ops::Range;

/// A feature of the data set.
#[derive(Clone, Debug, PartialEq)]
pub struct DataFeature {
    /// Name, unit and actuators.
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

/// Builds the data set of some variants.
pub(super) struct Maker<'m> {
    pub study: &'m Study,
    pub cases: &'m [OperatingCase],
    pub plan: &'m [Planned],
    pub images: &'m Images,
    pub setting: Setting,
}

impl Maker<'_> {
    /// The data set of some variants and their rows: labels, detection, features.
    pub fn table(&self, variants: Range<usize>, rows: &[Row]) -> Table {
        let mut columns = self.label_columns(variants.clone());
        let reflected = variants.map(|variant| self.images.is_mirrored(variant));
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
        let windows: Vec<&Window> = rows.iter().map(|row| &row.window).collect();
        columns.extend(largest_columns(sensors, &windows));
        columns.extend(effort_columns(&rows.iter().map(|row| row.effort).collect::<Vec<_>>()));
        let failures = rows.iter().map(|row| row.failure.clone()).collect();
        columns.push(Column::new("failure", "", Values::Text(failures)));
        columns.extend(self.feature_columns(rows));
        Table::from_columns(columns).expect("columns of one length, named apart")
    }

    /// Each feature and, if the actuators correspond, its values in the other views.
    fn feature_columns(&self, rows: &[Row]) -> Vec<Column> {
        let sensors = &self.study.sensors_in(self.setting);
        let orders = sensors.rotations(self.study.units.len()).unwrap_or_default();
        let rows: Vec<_> = rows.iter().map(|row| seen(sensors, &orders, &row.window)).collect();
        let features = data_features(self.study);
        feature_columns(features.iter().map(|known| known.feature.name.as_str()), &rows)
    }

    fn label_columns(&self, variants: Range<usize>) -> Vec<Column> {
        let (study, plan) = (self.study, &self.plan[variants.clone()]);
        let seed = study.realism.as_ref().map_or(0, |r| r.seed as u32);
        let variants = variants.map(|variant| variant as u32).collect();
        let mut columns = vec![
            Column::new("variant", "", Values::Unsigned(variants)),
            Column::new("case", "", texts(plan, |p| &self.cases[p.case].name)),
            Column::new("flown", "", texts(plan, |p| &self.cases[p.case].command)),
            Column::new("seed", "", Values::Unsigned(vec![seed; plan.len()])),
        ];
        let shown = |p: &Planned| Shown { fault: p.fault, intensity: p.intensity };
        columns.extend(fault_columns(study, &plan.iter().map(shown).collect::<Vec<_>>()));
        // As in the paper's figure 8: each fault's intensity in its own column.
        let ids: BTreeSet<&String> = study.faults.iter().map(|fault| &fault.id).collect();
        for id in ids {
            let is_it = |p: &Planned| p.fault.is_some_and(|fault| &study.faults[fault].id == id);
            let of = |p: &Planned| if is_it(p) { p.intensity } else { 0.0 };
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
