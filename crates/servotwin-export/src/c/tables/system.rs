//! The tables of the diagnosed system: sensors, inputs, views, boundaries, and the constants of the decision.

use super::super::literal::{array, numbers};
use servotwin_diagnosis::diagnoser::{Diagnoser, common_mode};
use servotwin_model::c_source::hexadecimal;
use std::fmt::Write;

/// Writes `const KIND NAME[] = { … };` for other files.
fn public(c: &mut String, kind: &str, name: &str, entries: &[String], empty: &str) {
    let all = if entries.is_empty() { empty.into() } else { entries.join(",\n    ") };
    let _ = writeln!(c, "\nconst {kind} {name}[{}] = {{\n    {all}\n}};", entries.len().max(1));
}

/// Writes all tables of the system.
pub(super) fn write(c: &mut String, diagnoser: &Diagnoser) {
    sensors(c, diagnoser);
    inputs(c, diagnoser);
    views(c, diagnoser);
    common_pairs(c, diagnoser);
    boundaries(c, diagnoser);
    streams(c, diagnoser);
    constants(c, diagnoser);
    names(c, diagnoser);
}

fn sensors(c: &mut String, diagnoser: &Diagnoser) {
    let entry = |sensor: &servotwin_diagnosis::diagnoser::Sensor| {
        let stand_in_noise = if sensor.is_noisy { sensor.noise } else { 0.0 };
        let [scale, noise, stand_in] =
            [sensor.scale, sensor.noise, stand_in_noise].map(hexadecimal);
        let actuator = sensor.actuator.map_or(-1, |actuator| actuator as i32);
        format!("{{ {scale}, {noise}, {stand_in}, {actuator} }}")
    };
    let entries: Vec<String> = diagnoser.sensors.iter().map(entry).collect();
    public(c, "servotwin_sensor", "servotwin_sensors", &entries, "{ 0x1p+0, 0x0p+0, 0x0p+0, -1 }");
}

fn inputs(c: &mut String, diagnoser: &Diagnoser) {
    let environment = &diagnoser.environment;
    let entry = |input: &servotwin_diagnosis::diagnoser::environment::Input| {
        let frozen = input.frozen_after_samples(diagnoser.period_s).unwrap_or(0);
        let [least, largest] = [input.least, input.largest].map(hexadecimal);
        format!("{{ {least}, {largest}, {}U }}", frozen.min(u64::from(u32::MAX)))
    };
    let entries: Vec<String> = environment.inputs.iter().map(entry).collect();
    public(c, "servotwin_input", "servotwin_inputs", &entries, "{ 0x0p+0, 0x0p+0, 0U }");
    let place = |name: &str| environment.inputs.iter().position(|input| input.name == name);
    let differences = environment.differences.iter().filter_map(|difference| {
        let (of, minus) = (place(&difference.of)?, place(&difference.minus)?);
        let [least, largest] = [difference.least, difference.largest].map(hexadecimal);
        Some(format!("{{ {of}, {minus}, {least}, {largest} }}"))
    });
    let entries: Vec<String> = differences.collect();
    public(
        c,
        "servotwin_difference",
        "servotwin_differences",
        &entries,
        "{ 0, 0, 0x0p+0, 0x0p+0 }",
    );
}

/// The order of the sensors in each view; the first is the own one.
fn views(c: &mut String, diagnoser: &Diagnoser) {
    let sensors = diagnoser.sensors_seen();
    let views = super::views(diagnoser);
    let orders = sensors.rotations(views).unwrap_or_default();
    let own: Vec<usize> = (0..sensors.0.len()).collect();
    let rows = std::iter::once(own).chain(orders).map(|order| {
        let places: Vec<String> = order.iter().map(usize::to_string).collect();
        format!("{{ {} }}", places.join(", "))
    });
    let rows: Vec<String> = rows.collect();
    let _ = writeln!(
        c,
        "\nconst uint8_t servotwin_orders[SERVOTWIN_VIEWS][SERVOTWIN_SENSORS] = {{\n    {}\n}};",
        rows.join(",\n    ")
    );
}

fn common_pairs(c: &mut String, diagnoser: &Diagnoser) {
    let pairs = common_mode::corresponding(&diagnoser.sensors_seen(), diagnoser.watched());
    let mut entries = Vec::new();
    for (place, ([first, second], sensors)) in pairs.iter().enumerate() {
        for (side, name) in ["first", "second"].into_iter().enumerate() {
            let own = sensors.iter().map(|pair| pair[side]);
            array(c, "uint8_t", &format!("pair_{place}_{name}"), own);
        }
        let count = sensors.len();
        entries.push(format!(
            "{{ {first}, {second}, {count}, pair_{place}_first, pair_{place}_second }}"
        ));
    }
    public(c, "servotwin_common_pair", "servotwin_common_pairs", &entries, "{ 0, 0, 0, 0, 0 }");
}

fn boundaries(c: &mut String, diagnoser: &Diagnoser) {
    let mut entries = Vec::new();
    for (place, boundary) in diagnoser.boundaries.iter().enumerate() {
        let effects = || boundary.effects.iter();
        array(c, "uint8_t", &format!("boundary_{place}_sensors"), effects().map(|(s, _)| *s));
        numbers(c, &format!("boundary_{place}_changes"), effects().map(|(_, change)| *change));
        entries.push(format!(
            "{{ {}, {}, {}, {}, boundary_{place}_sensors, boundary_{place}_changes }}",
            boundary.input,
            boundary.sensor,
            hexadecimal(boundary.effect().unwrap_or_default()),
            boundary.effects.len()
        ));
    }
    let empty = "{ 0, 0, 0x0p+0, 0, 0, 0 }";
    public(c, "servotwin_boundary", "servotwin_boundaries", &entries, empty);
}

/// The window lengths of residuals as they are, and of those beyond the baseline.
fn streams(c: &mut String, diagnoser: &Diagnoser) {
    let mut entries = Vec::new();
    for (stream, is_corrected) in [false, true].into_iter().enumerate() {
        let lengths = diagnoser.lengths.iter().enumerate();
        let own: Vec<_> =
            lengths.filter(|(_, l)| l.baseline_corrected.is_some() == is_corrected).collect();
        let base = own.iter().map(|(_, length)| length.span.pane_samples).min().unwrap_or(1);
        array(c, "uint8_t", &format!("stream_{stream}_places"), own.iter().map(|(place, _)| place));
        entries.push(format!("{{ {base}, {}, stream_{stream}_places }}", own.len()));
    }
    public(c, "servotwin_stream_plan", "servotwin_stream_plans", &entries, "");
    let (settle, memory) = match diagnoser.baseline {
        Some(settings) => (settings.settle_samples, settings.memory_samples),
        None => (1, 1),
    };
    let _ = writeln!(c, "const int32_t servotwin_baseline_settle_samples = {settle};");
    let _ = writeln!(c, "const int32_t servotwin_baseline_memory_samples = {memory};");
}

fn constants(c: &mut String, diagnoser: &Diagnoser) {
    let (tuning, period_s) = (&diagnoser.tuning, diagnoser.period_s);
    let switches_off = tuning.switches_off(diagnoser.names());
    let off: Vec<String> = switches_off.iter().map(|&off| format!("{}U", u8::from(off))).collect();
    public(c, "uint8_t", "servotwin_switches_off", &off, "0U");
    let deviation = tuning.line_slope_deviation;
    let samples = |time_s: f64| diagnoser.samples(time_s);
    let number = hexadecimal;
    let entries = [
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
        format!("{}U", samples(tuning.recover_s)),
        format!("{}U", samples(tuning.settle_s)),
        format!("{}U", samples(tuning.no_data_after_s).max(1)),
        format!("{}U", samples(tuning.settle_s).max(1)),
        number(tuning.fault_needed_nats),
        number(tuning.boundary_memory_s),
        number(period_s / tuning.healthy_slope_memory_s),
        number(1.0 / (deviation * deviation)),
        number(tuning.largest_boundary_error),
    ];
    let _ = writeln!(
        c,
        "\nconst servotwin_constants servotwin_tuning = {{\n    {}\n}};",
        entries.join(",\n    ")
    );
}

fn names(c: &mut String, diagnoser: &Diagnoser) {
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
        let name = format!("servotwin_{what}_names");
        public(c, "char *const", &name, &quoted, "\"\"");
    }
}

/// A name within a string literal. Names are short words; what C would read otherwise is replaced.
fn escaped(name: &str) -> String {
    let plain = |c: char| matches!(c, ' '..='~') && !matches!(c, '"' | '\\' | '?');
    name.chars().map(|c| if plain(c) { c } else { '_' }).collect()
}
