//! Chooses what a run records by names: a sensor, an input, a quantity such as `actuator_1.cylinder.position_m`, a
//! component for all of its quantities, or `all`.

use crate::ensemble::Ensemble;
use crate::nearest::UnknownName;
use crate::shown::Shown;
use crate::signal::random::NormalDeviates;
use crate::system::imperfection::Imperfection;
use crate::system::{Sensor, System};
use crate::table::{Column, Table, TableError};
use servotwin_model::program::Slot;
use servotwin_model::spec::Unit;
use servotwin_view::time_series::{Panel, Series, TimeSeries};
use std::collections::BTreeSet;

/// A recorded quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Name of the column, with the unit's suffix.
    pub name: String,
    /// Label in figures.
    pub label: String,
    /// SI unit of the values.
    pub unit: Unit,
    /// Slot in the variable array.
    pub slot: Slot,
}

/// Name of a column, with the unit's suffix added unless present.
pub fn with_suffix(name: &str, unit: Unit) -> String {
    match name.ends_with(unit.suffix()) {
        true => name.into(),
        false => format!("{name}{}", unit.suffix()),
    }
}

/// The column of a table that holds a sensor or an input: its id, with or without the unit's suffix.
pub(crate) fn column<'t>(table: &'t Table, id: &str, unit: Unit) -> Option<&'t str> {
    let full = with_suffix(id, unit);
    let named = |wanted: &str| table.names().find(|name| *name == wanted);
    named(&full).or_else(|| named(id))
}

/// The quantities for `names`. Without names it records the inputs `driven` and all sensors, or the states of a system
/// without sensors.
///
/// # Errors
/// The system has no quantity of this name.
pub fn choose(
    system: &System,
    names: &[String],
    driven: &[&str],
) -> Result<Vec<Recorded>, UnknownName> {
    let mut recorded = Vec::new();
    if names.is_empty() {
        recorded.extend(driven.iter().flat_map(|id| named(system, id)));
        recorded.extend(system.sensors.iter().flat_map(|sensor| named(system, &sensor.id)));
        if system.sensors.is_empty() {
            let states = system.program.states().iter();
            recorded.extend(states.flat_map(|state| named(system, &state.name)));
        }
    }
    for name in names {
        let found = named(system, name);
        if found.is_empty() {
            let known = all_names(system);
            return Err(UnknownName { what: "quantity", given: name.clone(), known });
        }
        recorded.extend(found);
    }
    let mut seen = BTreeSet::new();
    recorded.retain(|one| seen.insert(one.name.clone()));
    Ok(recorded)
}

/// The quantities that a name selects; empty if unknown.
fn named(system: &System, name: &str) -> Vec<Recorded> {
    let program = &system.program;
    let is_meant =
        |sensor: &&Sensor| name == sensor.label || name == with_suffix(&sensor.id, sensor.unit);
    if let Some(sensor) = system.sensor(name).or_else(|| system.sensors.iter().find(is_meant)) {
        let slot = program.observable(&sensor.signal).expect("a checked sensor").slot;
        let (name, label) = (with_suffix(&sensor.id, sensor.unit), sensor.label.clone());
        return vec![Recorded { name, label, unit: sensor.unit, slot }];
    }
    let inside = format!("{name}.");
    let observables = program.observables().iter();
    let found =
        observables.filter(|o| name == "all" || o.name == name || o.name.starts_with(&inside));
    let recorded = found.map(|o| Recorded {
        name: with_suffix(&o.name, o.unit),
        label: o.name.clone(),
        unit: o.unit,
        slot: o.slot,
    });
    recorded.collect()
}

fn all_names(system: &System) -> Vec<String> {
    let sensors = system.sensors.iter().map(|sensor| sensor.id.clone());
    // A component without a quantity would be refused, too.
    let components = system.network().components.iter().map(|c| c.id.clone());
    let components = components.filter(|id| !named(system, id).is_empty());
    let observables = system.program.observables().iter().map(|o| o.name.clone());
    sensors.chain(components).chain(observables).collect()
}

/// The times of a run's samples, s.
pub(crate) fn times_s(ensemble: &Ensemble) -> Vec<f64> {
    (0..ensemble.samples()).map(|k| k as f64 * ensemble.sample_period_s).collect()
}

/// The recorded values of a run as a table, with the time as the first column.
///
/// # Errors
/// Two quantities have the same name.
pub fn table(
    system: &System,
    recorded: &[Recorded],
    times_s: Vec<f64>,
    values: Vec<Vec<f64>>,
) -> Result<Table, TableError> {
    let mut table = Table::new()
        .with_metadata("servotwin", env!("CARGO_PKG_VERSION"))
        .with_metadata("system", &system.name);
    table.push(Column::new("time_s", Unit::Second.symbol(), times_s))?;
    for (one, values) in recorded.iter().zip(values) {
        table.push(Column::new(&one.name, one.unit.symbol(), values))?;
    }
    Ok(table)
}

/// Applies the declared noise and converter resolution of sensors to recorded values; other quantities stay unchanged.
/// The result depends only on seed and run, not on what else is recorded.
pub(crate) fn as_shown(
    system: &System,
    recorded: &[Recorded],
    values: &mut [Vec<f64>],
    seed: u64,
    run: usize,
) {
    for (one, values) in recorded.iter().zip(values) {
        let is_it = |sensor: &Sensor| with_suffix(&sensor.id, sensor.unit) == one.name;
        if let Some(sensor) = system.sensors.iter().position(is_it) {
            let number = run * system.sensors.len() + sensor;
            let mut noise = NormalDeviates::stream(seed, number as u64);
            let own = Imperfection::of(system, sensor);
            values.iter_mut().for_each(|value| *value = own.apply(*value, &mut noise));
        }
    }
}

/// Maximum size ratio of quantities with one unit in a common panel; a smaller one would look like a straight line.
const SIZES: f64 = 8.0;

/// A figure with a panel for each unit, in order of appearance, and for each size of values.
pub fn figure(
    title: &str,
    recorded: &[Recorded],
    times_s: &[f64],
    values: &[&[f64]],
) -> TimeSeries<'static> {
    let mut panels: Vec<(Unit, f64, Panel)> = Vec::new();
    for (one, values) in recorded.iter().zip(values) {
        let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let read = Shown::of(one.unit, largest);
        let shown: Vec<f64> = values.iter().map(|&si| read.value(si)).collect();
        let size = shown.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let is_alike =
            |other: f64| size.max(other) <= SIZES * size.min(other) || size * other == 0.0;
        let series = Series::new(one.label.clone(), times_s.to_vec(), shown);
        let own = panels.iter_mut().find(|(unit, other, panel)| {
            *unit == one.unit && panel.y_label == read.symbol() && is_alike(*other)
        });
        match own {
            Some((_, _, panel)) => panel.series.push(series),
            None => panels.push((one.unit, size, Panel::new("", read.symbol()).with(series))),
        }
    }
    let mut figure = TimeSeries::new(title.to_owned(), "time in s");
    figure.panels = panels.into_iter().map(|(_, _, panel)| panel).collect();
    figure
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suffixes_are_added_once() {
        assert_eq!(with_suffix("p_a_1", Unit::Pascal), "p_a_1_pa");
        assert_eq!(with_suffix("x.pressure_pa", Unit::Pascal), "x.pressure_pa");
        assert_eq!(with_suffix("mode", Unit::None), "mode");
    }

    #[test]
    fn what_is_small_has_an_axis_of_its_own() {
        let recorded = |name: &str| Recorded {
            name: name.into(),
            label: name.into(),
            unit: Unit::Metre,
            slot: 0,
        };
        let all = ["ram", "ram_2", "spool"].map(recorded);
        let values: [&[f64]; 3] = [&[0.0, 0.02], &[0.0, -0.018], &[0.0, 1e-3]];
        let panels = figure("", &all, &[0.0, 1.0], &values).panels;
        assert_eq!(panels.iter().map(|panel| panel.series.len()).collect::<Vec<_>>(), [2, 1]);
    }

    #[test]
    fn a_slip_in_a_name_is_told_with_the_nearest() {
        let system = System::default();
        let error = choose(&system, &["actuator_1.cylinder.positin_m".into()], &[]).unwrap_err();
        assert_eq!(error.nearest(), Some("actuator_1.cylinder.position_m"));
    }
}
