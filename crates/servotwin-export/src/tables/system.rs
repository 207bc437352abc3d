//! The tables of the diagnosed system: sensors, inputs, views, boundaries, and the constants of the decision.

use crate::notation::{
    place, quoted, record, write_array, write_list, write_numbers, write_public,
};
use servotwin_diagnosis::diagnoser::{DiagnosedSensor, Diagnoser, common_mode};
use servotwin_diagnosis::features::Sensor;
use servotwin_diagnosis::spread::DELAY_S;
use servotwin_model::c_source::hexadecimal;

/// Writes all tables of the system.
pub(super) fn write(text: &mut String, diagnoser: &Diagnoser) {
    sensors(text, diagnoser);
    inputs(text, diagnoser);
    views(text, diagnoser);
    common_pairs(text, diagnoser);
    boundaries(text, diagnoser);
    streams(text, diagnoser);
    constants(text, diagnoser);
    names(text, diagnoser);
}

fn sensors(text: &mut String, diagnoser: &Diagnoser) {
    let entry = |(sensor, seen): (&DiagnosedSensor, &Sensor)| {
        let growth = sensor.spread.map_or(0.0, |spread| spread.growth);
        let [scale, noise, stand_in_noise, growth] =
            [sensor.scale, sensor.noise, seen.noise_of_stand_in(), growth].map(hexadecimal);
        let actuator = place(sensor.actuator.map(|actuator| actuator as usize));
        let spool = place(sensor.spread.map(|spread| spread.spool as usize));
        record(&[scale, noise, stand_in_noise, growth, actuator, spool])
    };
    let seen = diagnoser.sensors_seen();
    let entries: Vec<String> = diagnoser.sensors.iter().zip(&seen.0).map(entry).collect();
    let empty = "{ 0x1p+0, 0x0p+0, 0x0p+0, 0x0p+0, -1, -1 }";
    write_list(text, "servotwin_sensor", "sensors", &entries, empty);
}

fn inputs(text: &mut String, diagnoser: &Diagnoser) {
    let environment = &diagnoser.environment;
    let range = |least, largest| [least, largest].map(hexadecimal);
    let entry = |input: &servotwin_diagnosis::diagnoser::environment::InputRange| {
        let frozen = input.frozen_after_samples(diagnoser.period_s).unwrap_or(0);
        let frozen_after = format!("{}U", frozen.min(u64::from(u32::MAX)));
        let [least, largest] = range(input.least, input.largest);
        record(&[least, largest, frozen_after])
    };
    let entries: Vec<String> = environment.inputs.iter().map(entry).collect();
    write_list(text, "servotwin_input", "inputs", &entries, "{ 0x0p+0, 0x0p+0, 0U }");
    let find = |name: &str| environment.inputs.iter().position(|input| input.name == name);
    let differences = environment.differences.iter().filter_map(|difference| {
        let (of, minus) = (find(&difference.of)?, find(&difference.minus)?);
        let [least, largest] = range(difference.least, difference.largest);
        Some(record(&[of.to_string(), minus.to_string(), least, largest]))
    });
    let entries: Vec<String> = differences.collect();
    let empty = "{ 0, 0, 0x0p+0, 0x0p+0 }";
    write_list(text, "servotwin_difference", "differences", &entries, empty);
}

/// The order of the sensors in each view; the first is the own one.
fn views(text: &mut String, diagnoser: &Diagnoser) {
    let sensors = diagnoser.sensors_seen();
    let orders = sensors.rotations(diagnoser.views()).unwrap_or_default();
    let own: Vec<usize> = (0..sensors.0.len()).collect();
    let rows = std::iter::once(own).chain(orders).map(|order| {
        let places: Vec<String> = order.iter().map(usize::to_string).collect();
        record(&places)
    });
    let rows: Vec<String> = rows.collect();
    *text += &format!(
        "\nconst uint8_t servotwin_orders[SERVOTWIN_VIEWS][SERVOTWIN_SENSORS] = {{\n    {}\n}};\n",
        rows.join(",\n    ")
    );
}

fn common_pairs(text: &mut String, diagnoser: &Diagnoser) {
    let pairs = common_mode::corresponding(&diagnoser.sensors_seen(), diagnoser.watched());
    let mut entries = Vec::new();
    for (number, ([first, second], sensors)) in pairs.iter().enumerate() {
        let mut values = vec![first.to_string(), second.to_string(), sensors.len().to_string()];
        for (side, what) in ["first", "second"].into_iter().enumerate() {
            let name = format!("pair_{number}_{what}");
            write_array(text, "uint8_t", &name, sensors.iter().map(|pair| pair[side]));
            values.push(name);
        }
        entries.push(record(&values));
    }
    let empty = "{ 0, 0, 0, 0, 0 }";
    write_list(text, "servotwin_common_pair", "common_pairs", &entries, empty);
}

fn boundaries(text: &mut String, diagnoser: &Diagnoser) {
    let mut entries = Vec::new();
    for (number, boundary) in diagnoser.boundaries.iter().enumerate() {
        let effects = || boundary.effects.iter();
        let [sensors, changes] =
            ["sensors", "changes"].map(|what| format!("boundary_{number}_{what}"));
        write_array(text, "uint8_t", &sensors, effects().map(|(sensor, _)| *sensor));
        write_numbers(text, &changes, effects().map(|(_, change)| *change));
        let [input, sensor] = [boundary.input, boundary.sensor].map(|place| place.to_string());
        let own_change = hexadecimal(boundary.effect().unwrap_or_default());
        let count = boundary.effects.len().to_string();
        let is_return = boundary.is_return.to_string();
        entries.push(record(&[input, sensor, is_return, own_change, count, sensors, changes]));
    }
    let empty = "{ 0, 0, false, 0x0p+0, 0, 0, 0 }";
    write_list(text, "servotwin_boundary", "boundaries", &entries, empty);
}

/// The window lengths of residuals as they are, and of those beyond the baseline.
fn streams(text: &mut String, diagnoser: &Diagnoser) {
    let mut entries = Vec::new();
    for (stream, is_corrected) in [false, true].into_iter().enumerate() {
        let lengths = diagnoser.lengths.iter().enumerate();
        let own: Vec<_> =
            lengths.filter(|(_, l)| l.baseline_corrected.is_some() == is_corrected).collect();
        let base = own.iter().map(|(_, length)| length.span.pane_samples).min().unwrap_or(1);
        let places = format!("stream_{stream}_places");
        write_array(text, "uint8_t", &places, own.iter().map(|(place, _)| place));
        entries.push(record(&[base.to_string(), own.len().to_string(), places]));
    }
    write_list(text, "servotwin_stream_plan", "stream_plans", &entries, "");
    let (settle, memory) = match diagnoser.baseline {
        Some(settings) => (settings.settle_samples, settings.memory_samples),
        None => (1, 1),
    };
    for (name, samples) in
        [("baseline_settle_samples", settle), ("baseline_memory_samples", memory)]
    {
        write_public(text, "int32_t", name, &samples.to_string());
    }
    let delay_samples = hexadecimal(DELAY_S / diagnoser.period_s);
    write_public(text, "servotwin_real", "delay_samples", &delay_samples);
}

fn constants(text: &mut String, diagnoser: &Diagnoser) {
    let (tuning, period_s) = (&diagnoser.tuning, diagnoser.period_s);
    let switches_off = tuning.switches_off(diagnoser.names());
    let off: Vec<String> = switches_off.iter().map(|&off| format!("{}U", u8::from(off))).collect();
    write_list(text, "uint8_t", "switches_off", &off, "0U");
    let deviation = tuning.line_slope_deviation;
    let samples = |time_s: f64, least: u64| format!("{}U", diagnoser.samples(time_s).max(least));
    let number = hexadecimal;
    let record = record(&[
        number(period_s),
        tuning.least_on.to_string(),
        number(tuning.clip_nats),
        number(tuning.evidence_cap),
        number(tuning.in_band_nats),
        number(tuning.in_band_share()),
        number(tuning.pending_share),
        number(tuning.least_detail_confidence),
        number(tuning.max_common_mode),
        number(tuning.most_lost),
        samples(tuning.recover_s, 0),
        samples(tuning.settle_s, 0),
        samples(tuning.input_held_s, 0),
        samples(tuning.input_recover_s, 0),
        samples(tuning.no_data_after_s, 1),
        samples(tuning.settle_s, 1),
        number(tuning.fault_needed_nats),
        number(tuning.boundary_memory_s),
        number(period_s / tuning.healthy_slope_memory_s),
        number(tuning.line_error * tuning.line_error),
        number(1.0 / (deviation * deviation)),
        number(tuning.least_boundary_move),
        number(tuning.largest_boundary_error),
    ]);
    text.push('\n');
    write_public(text, "servotwin_constants", "tuning", &record);
}

fn names(text: &mut String, diagnoser: &Diagnoser) {
    for (what, list) in super::names(diagnoser) {
        let literals: Vec<String> = list.iter().map(|name| quoted(name)).collect();
        let name = format!("{}_names", what.to_ascii_lowercase());
        write_list(text, "char *const", &name, &literals, "\"\"");
    }
}
