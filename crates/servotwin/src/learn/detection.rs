//! Detection: which faults leave the band, and from which intensity on.

use super::data_set::{DataRow, DataSet};
use serde::{Deserialize, Serialize};
use servotwin_learning::metrics::Rate;

/// The detection results of a data set.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// For each kind, detection against intensity.
    pub curves: Vec<Curve>,
    /// For each fault in each case, the least detected intensity.
    pub least: Vec<Least>,
}

/// Detection of one kind of fault against intensity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// The fault, without the actuator.
    pub kind: String,
    /// The detail class that it belongs to.
    pub detail: String,
    /// Intensities with the share detected at each, over cases and actuators.
    pub points: Vec<(f64, Rate)>,
}

/// The least intensity at which a fault is detected in a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Least {
    /// The fault, with the actuator.
    pub fault: String,
    /// The name of the operating case.
    pub case: String,
    /// The least intensity that is detected together with all greater ones; `None` if the greatest is not detected.
    pub intensity: Option<f64>,
}

/// Evaluates detection over a data set.
pub(crate) fn evaluate(data: &DataSet) -> Detection {
    let faults = data.faults();
    Detection {
        curves: kinds(data, &faults).into_iter().map(|kind| curve(data, &faults, kind)).collect(),
        least: least(data, &faults),
    }
}

/// The kinds of the rows, ascending.
fn kinds(data: &DataSet, rows: &[usize]) -> Vec<u32> {
    let mut kinds: Vec<u32> = rows.iter().map(|&row| data.rows[row].kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    kinds
}

fn curve(data: &DataSet, faults: &[usize], kind: u32) -> Curve {
    let mut counts = vec![(0u64, 0u64); data.intensities.len()];
    let mut detail = String::new();
    for &place in faults {
        let (row, label) = (&data.rows[place], data.examples.labels()[place]);
        if row.kind == kind {
            let (detected, all) = &mut counts[row.intensity as usize];
            *all += 1;
            *detected += u64::from(row.is_detected());
            detail.clone_from(&data.examples.names().details[label.detail as usize]);
        }
    }
    let points = data.intensities.iter().zip(counts).filter(|(_, (_, all))| *all > 0);
    let point =
        |(intensity, (detected, all)): (&f64, (u64, u64))| (*intensity, Rate::new(detected, all));
    Curve { kind: data.kinds[kind as usize].clone(), detail, points: points.map(point).collect() }
}

fn least(data: &DataSet, faults: &[usize]) -> Vec<Least> {
    let mut order: Vec<&DataRow> = faults.iter().map(|&row| &data.rows[row]).collect();
    order.sort_by_key(|row| (row.fault, row.case, row.intensity));
    let of_run = |run: &[&DataRow]| {
        let detected = run.iter().rev().take_while(|row| row.is_detected()).last();
        Least {
            fault: data.faults[run[0].fault as usize].clone(),
            case: data.cases[run[0].case as usize].clone(),
            intensity: detected.map(|row| data.intensities[row.intensity as usize]),
        }
    };
    let runs = order.chunk_by(|a, b| (a.fault, a.case) == (b.fault, b.case));
    runs.map(of_run).collect()
}
