//! The ranges of what a host sets, and the imperfections of the sensors, as tables of the C code.

use crate::notation::{place, record, write_list, write_public};
use crate::twin::ExportedTwin;
use servotwin_model::c_source::hexadecimal;
use servotwin_model::program::Slot;

/// Ranges of parameters and inputs, and the sensors. A hybrid twin has no use for the last two: it judges its inputs itself.
pub(super) fn text(twin: &ExportedTwin, is_system: bool) -> String {
    let network = twin.program.network();
    let mut text = String::from("/* Written by servotwin. */\n#include \"servotwin_fmu.h\"\n");
    let mut write_ranges = |name: &str, ranges: Vec<String>| {
        write_list(&mut text, "servotwin_fmu_range", &format!("fmu_{name}_ranges"), &ranges, "");
    };
    let declared = network.components.iter().flat_map(|c| c.component.parameters);
    write_ranges("parameter", declared.map(|p| range((p.min, p.max))).collect());
    if is_system {
        let inputs = 0..network.inputs.len();
        write_ranges("input", inputs.map(|input| range(network.input_range(input))).collect());
        let sensors = twin.sensors.iter().filter_map(|&slot| sensor(twin, slot));
        let sensors: Vec<String> = sensors.collect();
        let none = "{ 0U, -1, -1, 0x0p+0, 0x0p+0 }";
        write_list(&mut text, "servotwin_fmu_sensor", "fmu_sensors", &sensors, none);
        write_public(&mut text, "int32_t", "fmu_sensor_count", &sensors.len().to_string());
    }
    text
}

fn range((least, largest): (f64, f64)) -> String {
    let literal = |limit: f64| hexadecimal(limit.clamp(-f64::MAX, f64::MAX));
    record(&[literal(least), literal(largest)])
}

/// The entry of a sensor; `None` for a quantity that no sensor measures.
fn sensor(twin: &ExportedTwin, slot: Slot) -> Option<String> {
    let program = twin.program;
    let components = &program.network().components;
    let observable = program.observables().iter().find(|observable| observable.slot == slot)?;
    let (id, _) = observable.name.rsplit_once('.')?;
    let component = components.iter().position(|instance| instance.id == id)?;
    let instance = &components[component];
    let span = (instance.component.span)(&instance.parameters)?;
    let first = twin.first_parameter(component);
    let parameter = |name| place(instance.component.parameter(name).map(|p| first + p));
    Some(record(&[
        format!("{slot}U"),
        parameter("noise_sigma"),
        parameter("bits"),
        hexadecimal(span.full_scale),
        hexadecimal(span.range),
    ]))
}
