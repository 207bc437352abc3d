//! Columns that all training tables share, whether their rows are records or windows of flights.
//!
//! Every column has a description. Every column of numbers has a unit, [`DIMENSIONLESS`] if it is a count, an index or a
//! ratio. Columns of text and of truth values have none.

use crate::study::Study;
use crate::table::{Column, Values};
use servotwin_diagnosis::features::{Feature, Sensor, Sensors, values};
use servotwin_diagnosis::residual::Window;

/// The unit of numbers without a dimension.
pub const DIMENSIONLESS: &str = "1";

/// The entry of healthy rows in the columns for faults.
pub(crate) const HEALTHY: &str = "healthy";

/// The fault of a row as an index in [`Study::faults`], and its intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shown {
    /// `None` for a healthy row.
    pub(crate) fault: Option<usize>,
    /// 0 for a healthy row.
    pub(crate) intensity: f64,
}

/// The columns for the faults of rows: name, kind, intensity, nominal intensity in the study, and the right answers.
pub(crate) fn fault_columns<'s>(study: &'s Study, rows: &[Shown]) -> Vec<Column> {
    let fault = |row: &Shown| row.fault.map(|fault| &study.faults[fault]);
    let class = |row: &Shown| fault(row).map(|fault| &study.classes[fault.class]);
    let text = |name: &str, of: &dyn Fn(&Shown) -> Option<&'s String>, what: &str| {
        let of = |row| of(row).map_or(HEALTHY, String::as_str).to_owned();
        Column::of(name, "", rows, of).described(what)
    };
    let number = |name: &str, of: &dyn Fn(&Shown) -> f64, what: &str| {
        Column::of(name, DIMENSIONLESS, rows, of).described(what)
    };
    let grade = |row: &Shown| fault(row).map_or(0.0, |fault| fault.at.intensity);
    let actuator = |row: &Shown| fault(row).map(|fault| &study.actuators[fault.actuator]);
    vec![
        text("fault", &|row| fault(row).map(|f| &f.id), "Full name of the fault, or healthy."),
        text("kind", &|row| fault(row).map(|f| &f.kind), "Fault without its actuator, or healthy."),
        number("intensity", &|row| row.intensity, "Intensity of the fault, 0 for healthy rows."),
        number("grade", &grade, "Intensity of the study that the row belongs to."),
        text("actuator", &actuator, "Label: the actuator with the fault, or healthy."),
        text("action", &|row| class(row).map(|c| &c.action), "Label: the required action."),
        text("detail", &|row| class(row).map(|c| &c.detail), "Label: the faulty component."),
    ]
}

/// The column with the largest absolute residual of a sensor.
pub fn largest_column(sensor: &str) -> String {
    format!("largest:{sensor}")
}

/// The largest absolute residual of every sensor.
pub(crate) fn largest_columns(sensors: &[Sensor], windows: &[&Window]) -> Vec<Column> {
    let column = |(place, sensor): (usize, &Sensor)| {
        let what = format!("Largest |r'| of the sensor {}, as a part of its scale.", sensor.name);
        let name = largest_column(&sensor.name);
        let largest = |window: &&Window| window.largest(place);
        Column::of(name, DIMENSIONLESS, windows, largest).described(what)
    };
    sensors.iter().enumerate().map(column).collect()
}

/// The column of a feature in a view: `f:` for the window as it is, `m:` seen from the second actuator, `m3:` from the
/// third.
pub fn view_column(view: usize, feature: &str) -> String {
    match view {
        0 => format!("f:{feature}"),
        1 => format!("m:{feature}"),
        _ => format!("m{}:{feature}", view + 1),
    }
}

/// Whether a column of a data set is a feature, in any view. All others describe the simulation or the detection.
pub(crate) fn is_feature_column(name: &str) -> bool {
    let Some((view, feature)) = name.split_once(':') else { return false };
    let is_view = match view.strip_prefix('m') {
        Some(place) => place.bytes().all(|byte| byte.is_ascii_digit()),
        None => view == "f",
    };
    is_view && !feature.is_empty()
}

/// The columns of a data set that a classifier may learn from, by name: its features in all views. None of them reveals
/// the fault.
pub fn feature_columns_of<'n>(names: impl IntoIterator<Item = &'n str>) -> Vec<&'n str> {
    names.into_iter().filter(|name| is_feature_column(name)).collect()
}

/// The features of a window in every view ([`servotwin_diagnosis::hierarchy`]); `orders` are the sensor orders of all
/// views but the first ([`Sensors::rotations`]).
pub(crate) fn seen(sensors: &Sensors, orders: &[Vec<usize>], window: &Window) -> Vec<Vec<f64>> {
    let others = orders.iter().map(|order| values(sensors, &window.reordered(order)));
    std::iter::once(values(sensors, window)).chain(others).collect()
}

/// The columns of all features in every view.
pub(crate) fn feature_columns<'f>(
    features: impl Iterator<Item = &'f Feature>,
    rows: &[Vec<Vec<f64>>],
) -> Vec<Column> {
    let views = rows.first().map_or(1, Vec::len);
    let mut columns = vec![];
    for (place, feature) in features.enumerate() {
        for view in 0..views {
            let values = rows.iter().map(|row| row[view][place]).collect();
            let name = view_column(view, &feature.name);
            let column = Column::new(name, si_unit(feature.unit), Values::Float(values));
            columns.push(column.described(description(feature, view)));
        }
    }
    columns
}

/// The SI unit of a feature. Parts of a scale, logarithms and indicators are dimensionless; their descriptions name
/// them.
fn si_unit(unit: &str) -> &str {
    let is_ratio = ["of scale", "log10"].iter().any(|ratio| unit.starts_with(ratio));
    if is_ratio || unit == "0 or 1" { DIMENSIONLESS } else { unit }
}

fn description(feature: &Feature, view: usize) -> String {
    let Feature { unit, meaning, .. } = feature;
    let unit = if *unit == DIMENSIONLESS { String::new() } else { format!(" ({unit})") };
    match view {
        0 => format!("Feature: {meaning}{unit}."),
        _ => format!("Feature with actuator {} in first place: {meaning}{unit}.", view + 1),
    }
}
