//! The tables of the diagnosed system: sensors, inputs, views, boundaries, and the constants of the decision.

use crate::language::Language;
use crate::notation::{COUNT, Notation};
use servotwin_diagnosis::diagnoser::{Diagnoser, common_mode};

/// Writes all tables of the system.
pub(super) fn write(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    sensors(text, notation, diagnoser);
    inputs(text, notation, diagnoser);
    views(text, notation, diagnoser);
    common_pairs(text, notation, diagnoser);
    boundaries(text, notation, diagnoser);
    streams(text, notation, diagnoser);
    constants(text, notation, diagnoser);
    names(text, notation, diagnoser);
}

fn sensors(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    let entry = |sensor: &servotwin_diagnosis::diagnoser::DiagnosedSensor| {
        let stand_in_noise = if sensor.is_noisy { sensor.noise } else { 0.0 };
        let fields = [
            ("scale", notation.number(sensor.scale)),
            ("noise", notation.number(sensor.noise)),
            ("stand_in_noise", notation.number(stand_in_noise)),
            ("actuator", notation.place(sensor.actuator.map(|actuator| actuator as usize))),
        ];
        notation.record("Sensor", &fields)
    };
    let entries: Vec<String> = diagnoser.sensors.iter().map(entry).collect();
    notation.write_list(text, "Sensor", "sensors", &entries, "{ 0x1p+0, 0x0p+0, 0x0p+0, -1 }");
}

fn inputs(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    let environment = &diagnoser.environment;
    let range =
        |least, largest| [("least", notation.number(least)), ("largest", notation.number(largest))];
    let entry = |input: &servotwin_diagnosis::diagnoser::environment::InputRange| {
        let frozen = input.frozen_after_samples(diagnoser.period_s).unwrap_or(0);
        let frozen = notation.unsigned(frozen.min(u64::from(u32::MAX)));
        let [least, largest] = range(input.least, input.largest);
        notation.record("Input", &[least, largest, ("frozen_after", frozen)])
    };
    let entries: Vec<String> = environment.inputs.iter().map(entry).collect();
    notation.write_list(text, "Input", "inputs", &entries, "{ 0x0p+0, 0x0p+0, 0U }");
    let place = |name: &str| environment.inputs.iter().position(|input| input.name == name);
    let differences = environment.differences.iter().filter_map(|difference| {
        let (of, minus) = (place(&difference.of)?, place(&difference.minus)?);
        let [least, largest] = range(difference.least, difference.largest);
        let places = [("of", of.to_string()), ("minus", minus.to_string())];
        let [of, minus] = places;
        Some(notation.record("Difference", &[of, minus, least, largest]))
    });
    let entries: Vec<String> = differences.collect();
    let empty = "{ 0, 0, 0x0p+0, 0x0p+0 }";
    notation.write_list(text, "Difference", "differences", &entries, empty);
}

/// The order of the sensors in each view; the first is the own one.
fn views(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    let sensors = diagnoser.sensors_seen();
    let views = super::views(diagnoser);
    let orders = sensors.rotations(views).unwrap_or_default();
    let own: Vec<usize> = (0..sensors.0.len()).collect();
    let rows = std::iter::once(own).chain(orders).map(|order| {
        let places: Vec<String> = order.iter().map(usize::to_string).collect();
        places.join(", ")
    });
    let rows: Vec<String> = rows.collect();
    let (count, own) = (rows.len(), sensors.0.len());
    *text += &match notation.language {
        Language::C => format!(
            "\nconst uint8_t servotwin_orders[SERVOTWIN_VIEWS][SERVOTWIN_SENSORS] = {{\n    {{ {} }}\n}};\n",
            rows.join(" },\n    { ")
        ),
        Language::Rust => format!(
            "\npub static ORDERS: [[u8; {own}]; {count}] = [\n    [{}]\n];\n",
            rows.join("],\n    [")
        ),
    };
}

fn common_pairs(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    let pairs = common_mode::corresponding(&diagnoser.sensors_seen(), diagnoser.watched());
    let mut entries = Vec::new();
    for (place, ([first, second], sensors)) in pairs.iter().enumerate() {
        let mut fields = vec![
            ("first", first.to_string()),
            ("second", second.to_string()),
            (COUNT, sensors.len().to_string()),
        ];
        for (side, field) in ["of_first", "of_second"].into_iter().enumerate() {
            let name = format!("pair_{place}_{}", &field[3..]);
            notation.write_array(text, "u8", &name, sensors.iter().map(|pair| pair[side]));
            fields.push((field, notation.array(&name)));
        }
        entries.push(notation.record("CommonPair", &fields));
    }
    notation.write_list(text, "CommonPair", "common_pairs", &entries, "{ 0, 0, 0, 0, 0 }");
}

fn boundaries(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    let mut entries = Vec::new();
    for (place, boundary) in diagnoser.boundaries.iter().enumerate() {
        let effects = || boundary.effects.iter();
        let [sensors, changes] =
            ["sensors", "changes"].map(|what| format!("boundary_{place}_{what}"));
        notation.write_array(text, "u8", &sensors, effects().map(|(sensor, _)| *sensor));
        notation.write_numbers(text, &changes, effects().map(|(_, change)| *change));
        let fields = [
            ("input", boundary.input.to_string()),
            ("sensor", boundary.sensor.to_string()),
            ("own_change", notation.number(boundary.effect().unwrap_or_default())),
            (COUNT, boundary.effects.len().to_string()),
            ("sensors", notation.array(&sensors)),
            ("changes", notation.array(&changes)),
        ];
        entries.push(notation.record("Boundary", &fields));
    }
    notation.write_list(text, "Boundary", "boundaries", &entries, "{ 0, 0, 0x0p+0, 0, 0, 0 }");
}

/// The window lengths of residuals as they are, and of those beyond the baseline.
fn streams(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    let mut entries = Vec::new();
    for (stream, is_corrected) in [false, true].into_iter().enumerate() {
        let lengths = diagnoser.lengths.iter().enumerate();
        let own: Vec<_> =
            lengths.filter(|(_, l)| l.baseline_corrected.is_some() == is_corrected).collect();
        let base = own.iter().map(|(_, length)| length.span.pane_samples).min().unwrap_or(1);
        let places = format!("stream_{stream}_places");
        notation.write_array(text, "u8", &places, own.iter().map(|(place, _)| place));
        let fields = [
            ("base_samples", base.to_string()),
            (COUNT, own.len().to_string()),
            ("places", notation.array(&places)),
        ];
        entries.push(notation.record("StreamPlan", &fields));
    }
    notation.write_list(text, "StreamPlan", "stream_plans", &entries, "");
    let (settle, memory) = match diagnoser.baseline {
        Some(settings) => (settings.settle_samples, settings.memory_samples),
        None => (1, 1),
    };
    for (name, samples) in
        [("baseline_settle_samples", settle), ("baseline_memory_samples", memory)]
    {
        notation.write_public(text, "u32", name, &samples.to_string());
    }
}

fn constants(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    let (tuning, period_s) = (&diagnoser.tuning, diagnoser.period_s);
    let switches_off = tuning.switches_off(diagnoser.names());
    let is_off = |off: &bool| match notation.language {
        Language::C => notation.unsigned(u8::from(*off)),
        Language::Rust => notation.truth(*off),
    };
    let off: Vec<String> = switches_off.iter().map(is_off).collect();
    notation.write_list(text, "bool", "switches_off", &off, "0U");
    let deviation = tuning.line_slope_deviation;
    let samples = |time_s: f64, least: u64| notation.unsigned(diagnoser.samples(time_s).max(least));
    let number = |number| notation.number(number);
    let fields = [
        ("period_s", number(period_s)),
        ("least_on", tuning.least_on.to_string()),
        ("clip_nats", number(tuning.clip_nats)),
        ("evidence_cap", number(tuning.evidence_cap)),
        ("in_band_nats", number(tuning.in_band_nats)),
        ("in_band_share", number(tuning.in_band_share())),
        ("pending_share", number(tuning.pending_share)),
        ("least_detail_confidence", number(tuning.least_detail_confidence)),
        ("max_common_mode", number(tuning.max_common_mode)),
        ("most_lost", number(tuning.most_lost)),
        ("recover_samples", samples(tuning.recover_s, 0)),
        ("settle_samples", samples(tuning.settle_s, 0)),
        ("until_lost_samples", samples(tuning.no_data_after_s, 1)),
        ("until_back_samples", samples(tuning.settle_s, 1)),
        ("fault_needed_nats", number(tuning.fault_needed_nats)),
        ("boundary_memory_s", number(tuning.boundary_memory_s)),
        ("healthy_forgotten", number(period_s / tuning.healthy_slope_memory_s)),
        ("information_of_lines", number(1.0 / (deviation * deviation))),
        ("largest_boundary_error", number(tuning.largest_boundary_error)),
    ];
    text.push('\n');
    notation.write_public(text, "Constants", "tuning", &notation.record("Constants", &fields));
}

fn names(text: &mut String, notation: Notation, diagnoser: &Diagnoser) {
    let names = diagnoser.names();
    let sensors = diagnoser.sensors.iter().map(|sensor| sensor.name.clone()).collect();
    let inputs = diagnoser.environment.inputs.iter().map(|input| input.name.clone()).collect();
    let lists: [(&str, Vec<String>); 5] = [
        ("sensor", sensors),
        ("input", inputs),
        ("actuator", names.actuators.clone()),
        ("action", names.actions.clone()),
        ("detail", names.details.clone()),
    ];
    for (what, list) in lists {
        let quoted: Vec<String> =
            list.iter().map(|name| format!("\"{}\"", escaped(name))).collect();
        notation.write_list(text, "&str", &format!("{what}_names"), &quoted, "\"\"");
    }
}

/// A name within a string literal. Names are short words; what C would read otherwise is replaced.
fn escaped(name: &str) -> String {
    let plain = |c: char| matches!(c, ' '..='~') && !matches!(c, '"' | '\\' | '?');
    name.chars().map(|c| if plain(c) { c } else { '_' }).collect()
}
