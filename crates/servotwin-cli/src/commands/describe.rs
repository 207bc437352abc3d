//! `servotwin describe`: the parts of a system and its behavior at rest.

use super::{SystemOption, note};
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use crate::{Global, Run};
use servotwin::rest;
use servotwin::system::System;
use servotwin_report::{behavior, schematic};
use servotwin_view::document::{Document, Table, Value};
use servotwin_view::row;
use std::path::PathBuf;

/// Describe a system: components, states, inputs, sensors, and eigenvalues at rest; or faults.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    system: SystemOption,
    /// Draw the components and their connections to a .svg file.
    #[arg(long, value_name = "FILE")]
    schematic: Option<PathBuf>,
    /// List the faults that its components can have, instead of describing the system.
    #[arg(long)]
    faults: bool,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        let read = Paths::default().read("SYSTEM", &self.system.path);
        read.write("--schematic", Format::SVG, &self.schematic)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        let system = self.system.read()?;
        if let Some(path) = &self.schematic {
            schematic::of(&system).draw().save(path)?;
        }
        if self.faults {
            return Ok(faults(&system));
        }
        let rest = rest::of(&system)?;
        if !rest.is_found {
            let why = if rest.limit_cycle { ", a limit cycle was measured" } else { "" };
            let text = format!(
                "no rest was found{why}: the states and eigenvalues are those where the search for it ended"
            );
            note(global, &text);
        }
        Ok(behavior::document(&system, &rest))
    }
}

/// Every fault that the components of a system can have.
fn faults(system: &System) -> Document {
    let mut table = Table::of(
        "id:fault | component: | kind: | category | parameter: | unit: | healthy | at_intensity_1 | summary:meaning",
    );
    let list = system.fault_list();
    for own in &list {
        table.push(row![
            own.id.as_str(),
            own.component.as_str(),
            own.kind,
            own.category,
            own.parameter,
            own.unit.symbol(),
            Value::mixed(own.healthy, own.unit),
            Value::mixed(own.full, own.unit),
            own.summary,
        ]);
    }
    let verdict = format!("{} faults; intensities go from 0 (healthy) to 1.", list.len());
    let mut document = Document::listing("faults", verdict);
    document.table("faults", table);
    document
}
