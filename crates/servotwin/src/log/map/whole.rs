//! A map over a whole table, as a fit reads it.

use super::{Map, MapError, Origin, Time, in_si};
use crate::evaluation::table_model::times;
use crate::log::source::SourceError;
use crate::table::{Column, Table, TableError, Values};

impl Map {
    /// That a table has the columns of the map.
    ///
    /// # Errors
    /// Those that it lacks, where the map names them.
    pub fn require(&self, log: &str, table: &Table) -> Result<(), MapError> {
        let known: Vec<String> = table.names().map(str::to_owned).collect();
        match SourceError::lacking(log, &self.wanted, &known).map(|error| self.explain(error)) {
            Some(Ok(mistakes)) => Err(mistakes),
            _ => Ok(()),
        }
    }

    /// A log that was read as a table, in SI units: `time_s`, and the inputs and sensors by their ids. What is the same
    /// always is a column that stands still; a value stands for missing ones behind it as long as the map says.
    ///
    /// # Errors
    /// A column is missing or not of numbers.
    pub fn applied(&self, log: &Table) -> Result<Table, TableError> {
        let time = self.time_of(log)?;
        let times_s = seconds(&time)?;
        let mut columns = vec![time];
        for channel in &self.channels {
            let mut values = match channel.from {
                Origin::Column { place, factor, offset } => {
                    let numbers = log.column(&self.wanted.names[place])?.numbers()?;
                    numbers.iter().map(|value| in_si(*value, factor, offset)).collect()
                }
                Origin::Value(value) => vec![value; times_s.len()],
                Origin::Default(_) | Origin::Nothing => continue,
            };
            hold(&mut values, &times_s, channel.hold_s);
            columns.push(Column::new(&channel.id, "", values));
        }
        Ok(Table::from_columns(columns)?.with_rows_of(log))
    }

    /// Dates stay as they are.
    fn time_of(&self, log: &Table) -> Result<Column, TableError> {
        let numbers = match self.time {
            Time::Rate { rate_hz } => {
                (0..log.row_count()).map(|row| row as f64 / rate_hz).collect()
            }
            Time::Column { place, unit_s } => {
                let column = log.column(&self.wanted.names[place])?;
                if self.wanted.dates {
                    return Ok(Column { name: TIME.into(), ..column.clone() });
                }
                column.numbers()?.iter().map(|value| value * unit_s).collect::<Vec<f64>>()
            }
        };
        Ok(Column::new(TIME, "s", numbers))
    }
}

const TIME: &str = "time_s";

/// What cannot be read is told by those who need it.
fn seconds(time: &Column) -> Result<Vec<f64>, TableError> {
    Ok(match &time.values {
        Values::Text(texts) => {
            texts.iter().map(|text| times::seconds(text).unwrap_or(f64::NAN)).collect()
        }
        _ => time.numbers()?.into_owned(),
    })
}

/// What times may differ by that are meant to be the same, as a part of what is between them.
const ROUNDING: f64 = 1e-4;

/// Puts the last value in the place of those that are missing behind it, for so long.
fn hold(values: &mut [f64], times_s: &[f64], hold_s: f64) {
    let mut last: Option<(f64, f64)> = None;
    for (value, &time_s) in values.iter_mut().zip(times_s) {
        if !value.is_nan() {
            last = Some((time_s, *value));
        } else if let Some((at_s, held)) = last
            && time_s - at_s <= hold_s * (1.0 + ROUNDING)
        {
            *value = held;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::log::map::Map;
    use crate::system::System;
    use crate::table::{Column, Table};

    const MAP: &str = r#"
format = 1
[time]
column = "ms"
unit = "ms"
[inputs]
command = { column = "cmd", unit = "deg", factor = -1 }
air_speed = { value = 100, unit = "m/s" }
[sensors]
p_a_1 = { column = "PA1", unit = "bar", hold_s = 0.015 }
"#;

    fn log(pressure: &'static str) -> Table {
        let column = |name, values: [f64; 4]| Column::new(name, "", values.to_vec());
        Table::from_columns(vec![
            column("ms", [0.0, 10.0, 20.0, 30.0]),
            column("cmd", [0.0, 180.0, -180.0, 0.0]),
            column(pressure, [1.0, f64::NAN, f64::NAN, 4.0]),
        ])
        .unwrap()
    }

    #[test]
    fn columns_become_signals_in_their_units() {
        let map = Map::parse(MAP, "map.toml", &System::default()).unwrap();
        let table = map.applied(&log("PA1")).unwrap();
        let names: Vec<&str> = table.names().collect();
        assert_eq!(names.len(), 4, "{names:?}");
        let of = |name: &str| table.f64(name).unwrap().into_owned();
        assert_eq!(of("time_s"), [0.0, 0.01, 0.02, 0.03]);
        assert_eq!(of("command")[1..3], [-std::f64::consts::PI, std::f64::consts::PI]);
        assert_eq!(of("air_speed"), [100.0; 4]);
        // Held for 15 ms, not for 20.
        let pressure = of("p_a_1");
        assert_eq!((pressure[0], pressure[1], pressure[3]), (1e5, 1e5, 4e5));
        assert!(pressure[2].is_nan());
    }

    #[test]
    fn a_value_stands_for_whole_periods_at_any_time() {
        let times_s: Vec<f64> = (0..1000).map(|sample| f64::from(sample) * 0.01).collect();
        let mut values: Vec<f64> =
            (0..1000).map(|sample| if sample % 2 == 0 { 7.0 } else { f64::NAN }).collect();
        super::hold(&mut values, &times_s, 0.01);
        assert!(values.iter().all(|value| *value == 7.0));
    }

    #[test]
    fn a_column_that_is_not_there_is_told_where_the_map_names_it() {
        let map = Map::parse(MAP, "map.toml", &System::default()).unwrap();
        assert!(map.require("log.csv", &log("PA1")).is_ok());
        let told = map.require("log.csv", &log("PA2")).unwrap_err().to_string();
        assert!(told.contains("map.toml:10") && told.contains("PA2"), "{told}");
    }
}
