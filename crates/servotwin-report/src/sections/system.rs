//! The system: its schematic and its sensors.

use crate::words::three_digits;
use crate::{Material, schematic};
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let study = material.study;
    let system = &study.system;
    page.figure(
            "schematic",
            schematic::of(system).draw(),
            "The simulated system: what supplies at the left, what is moved at the right. A line joins ports, \
             and a dot marks where it branches.",
        );
    let mut grid = Table::headed(["sensor", "signal", "scale", "unit"]);
    for (place, &sensor) in study.measured.iter().enumerate() {
        let sensor = &system.sensors[sensor];
        let extra = if place >= study.base_sensors() { " (additional)" } else { "" };
        grid.push(vec![
            format!("{}{extra}", sensor.label),
            sensor.signal.clone(),
            three_digits(sensor.unit.difference_to_shown(sensor.scale)),
            sensor.unit.shown().into(),
        ]);
    }
    page.table("", grid.captioned("Sensors. A residual is the measured value less the twin's, divided by the scale; a \
             fault is detected if any residual ever leaves its band (±3 % of scale, or one learned for the \
             sensor)."));
}
