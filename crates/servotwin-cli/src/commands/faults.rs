//! `servotwin faults`: every fault that the components of a system can have.

use super::SystemOption;
use crate::Global;
use crate::failure::Failure;
use crate::render::{Grid, Side, json, number};
use serde_json::json;
use servotwin::system::System;
use servotwin::table::{Column, Table, csv};
use servotwin_model::program::FaultAt;
use servotwin_model::spec::Unit;

/// List every fault that the components of a system can have.
#[derive(clap::Args)]
pub struct Options {
    #[command(flatten)]
    system: SystemOption,
    /// Write the list as CSV (numbers in SI units).
    #[arg(long, conflicts_with = "json")]
    csv: bool,
}

/// One line of the list.
struct Line {
    id: String,
    component: String,
    kind: &'static str,
    category: &'static str,
    parameter: &'static str,
    unit: Unit,
    healthy: f64,
    full: f64,
    summary: &'static str,
}

/// The text for standard output.
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let lines = lines(&options.system.read()?);
    if global.json {
        return Ok(json(&lines.iter().map(Line::json).collect()));
    }
    if options.csv {
        return csv_text(&lines);
    }
    Ok(people(&lines))
}

fn lines(system: &System) -> Vec<Line> {
    let mut lines = Vec::new();
    let healthy = system.program.parameters(&[]);
    for (component, instance) in system.network().components.iter().enumerate() {
        let spec = instance.component.spec();
        for (fault, declared) in spec.faults.iter().enumerate() {
            let place = spec.parameter(declared.parameter).expect("checked by the contract");
            let full = system.program.parameters(&[FaultAt { component, fault, intensity: 1.0 }]);
            lines.push(Line {
                id: format!("{}.{}", instance.id, declared.name),
                component: instance.id.clone(),
                kind: spec.kind,
                category: declared.category.name(),
                parameter: declared.parameter,
                unit: spec.parameters[place].unit,
                healthy: healthy[component][place],
                full: full[component][place],
                summary: declared.summary,
            });
        }
    }
    lines
}

impl Line {
    fn json(&self) -> serde_json::Value {
        json!({
            "id": self.id,
            "component": self.component,
            "kind": self.kind,
            "category": self.category,
            "intensity": [0, 1],
            "parameter": self.parameter,
            "unit": self.unit.symbol(),
            "healthy": self.healthy,
            "at_intensity_1": self.full,
            "summary": self.summary,
        })
    }
}

fn csv_text(lines: &[Line]) -> Result<String, Failure> {
    let text = |name: &str, of: &dyn Fn(&Line) -> String| {
        Column::new(name, "", lines.iter().map(of).collect::<Vec<String>>())
    };
    let numbers = |name: &str, of: &dyn Fn(&Line) -> f64| {
        Column::new(name, "", lines.iter().map(of).collect::<Vec<f64>>())
    };
    let table = Table::from_columns(vec![
        text("id", &|line| line.id.clone()),
        text("component", &|line| line.component.clone()),
        text("kind", &|line| line.kind.into()),
        text("category", &|line| line.category.into()),
        text("parameter", &|line| line.parameter.into()),
        text("unit", &|line| line.unit.symbol().into()),
        numbers("healthy", &|line| line.healthy),
        numbers("at_intensity_1", &|line| line.full),
        text("summary", &|line| line.summary.into()),
    ])?;
    let mut text = Vec::new();
    csv::write_to(&mut text, &table).expect("writing to memory does not fail");
    Ok(String::from_utf8(text).expect("a CSV table is UTF-8"))
}

fn people(lines: &[Line]) -> String {
    let mut grid = Grid::new(&[
        ("fault", Side::Left),
        ("category", Side::Left),
        ("healthy", Side::Right),
        ("at intensity 1", Side::Right),
        ("unit", Side::Left),
        ("meaning", Side::Left),
    ]);
    for line in lines {
        grid.push(vec![
            line.id.clone(),
            line.category.into(),
            number(line.unit.to_shown(line.healthy), 5),
            number(line.unit.to_shown(line.full), 5),
            line.unit.shown().into(),
            line.summary.into(),
        ]);
    }
    format!("{}{} faults; intensities go from 0 (healthy) to 1.\n", grid.text(), lines.len())
}
