//! Columns common to all training tables, whether their rows are variants of a campaign or windows of flights.

use crate::study::Study;
use crate::table::{Column, Table, Values};
use servotwin_diagnosis::features::{Sensor, Sensors, values};
use servotwin_diagnosis::residual::Window;

/// Name of the class of rows without a fault.
pub(super) const HEALTHY: &str = "healthy";

/// The fault of a row, as an index into [`Study::faults`], and its intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Index of the fault; `None` without a fault.
    pub fault: Option<usize>,
    /// Intensity; 0 without a fault.
    pub intensity: f64,
}

/// The fault columns of rows: name, kind, intensity, nominal intensity of the study, and the right answers.
pub fn fault_columns<'s>(study: &'s Study, rows: &[Shown]) -> Vec<Column> {
    let fault = |row: &Shown| row.fault.map(|fault| &study.faults[fault]);
    let class = |row: &Shown| fault(row).map(|fault| &study.classes[fault.class]);
    let text = |name: &str, of: &dyn Fn(&Shown) -> Option<&'s String>| {
        let of = |row| of(row).map_or(HEALTHY, String::as_str).to_owned();
        Column::new(name, "", Values::Text(rows.iter().map(of).collect()))
    };
    let number = |name: &str, of: &dyn Fn(&Shown) -> f64| {
        Column::new(name, "", Values::Float(rows.iter().map(of).collect()))
    };
    vec![
        text("fault", &|row| fault(row).map(|fault| &fault.id)),
        text("kind", &|row| fault(row).map(|fault| &fault.kind)),
        number("intensity", &|row| row.intensity),
        number("grade", &|row| fault(row).map_or(0.0, |fault| fault.at.intensity)),
        text("actuator", &|row| fault(row).map(|fault| &study.units[fault.unit])),
        text("command", &|row| class(row).map(|class| &class.command)),
        text("detail", &|row| class(row).map(|class| &class.detail)),
    ]
}

/// Name of the column with the largest residual of a sensor.
pub fn largest_column(sensor: &str) -> String {
    format!("largest:{sensor}")
}

/// The largest residual of every sensor, one column each.
pub fn largest_columns(sensors: &[Sensor], windows: &[&Window]) -> Vec<Column> {
    let column = |(place, sensor): (usize, &Sensor)| {
        let largest = windows.iter().map(|window| window.largest(place)).collect();
        Column::new(largest_column(&sensor.name), "", Values::Float(largest))
    };
    sensors.iter().enumerate().map(column).collect()
}

/// Name of a feature's column in a view: `f:` for the window itself, `m:` viewed from the second actuator, `m3:` from
/// the third.
pub fn view_column(view: usize, feature: &str) -> String {
    match view {
        0 => format!("f:{feature}"),
        1 => format!("m:{feature}"),
        _ => format!("m{}:{feature}", view + 1),
    }
}

/// Whether a column of a data set is a feature, in any view. All others describe the simulation or the detection.
pub fn is_feature_column(name: &str) -> bool {
    let Some((view, feature)) = name.split_once(':') else { return false };
    let is_view = match view.strip_prefix('m') {
        Some(place) => place.bytes().all(|byte| byte.is_ascii_digit()),
        None => view == "f",
    };
    is_view && !feature.is_empty()
}

/// The columns of a data set that a classifier may learn from: its features in all views. None of them reveals the
/// fault.
pub fn feature_columns_of<'n>(names: impl IntoIterator<Item = &'n str>) -> Vec<&'n str> {
    names.into_iter().filter(|name| is_feature_column(name)).collect()
}

/// Whether a table is the data set of a campaign or of flights: it has features and fault columns.
pub fn is_data_set(table: &Table) -> bool {
    table.has("fault") && table.has("kind") && table.names().any(is_feature_column)
}

/// The features of a window in every view ([`servotwin_diagnosis::hierarchy`]). `orders` are the sensor orders of the
/// further views ([`Sensors::rotations`]).
pub fn seen(sensors: &Sensors, orders: &[Vec<usize>], window: &Window) -> Vec<Vec<f64>> {
    let others = orders.iter().map(|order| values(sensors, &window.reordered(order)));
    std::iter::once(values(sensors, window)).chain(others).collect()
}

/// The columns of all features in every view.
pub fn feature_columns<'n>(
    names: impl Iterator<Item = &'n str>,
    rows: &[Vec<Vec<f64>>],
) -> Vec<Column> {
    let views = rows.first().map_or(1, Vec::len);
    let mut columns = vec![];
    for (place, name) in names.enumerate() {
        for view in 0..views {
            let values = rows.iter().map(|row| row[view][place]).collect();
            columns.push(Column::new(view_column(view, name), "", Values::Float(values)));
        }
    }
    columns
}
