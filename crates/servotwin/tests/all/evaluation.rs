//! The evaluation on a made-up campaign whose answers are known.

use servotwin::evaluation::parallel::Workers;
use servotwin::evaluation::protocol::{Holding, Protocol};
use servotwin::evaluation::{DataSet, Evaluation, EvaluationError, FeatureInfo, Settings};
use servotwin::evaluation::{evaluate, model_file, train};
use servotwin::table::{Column, Table};
use servotwin_diagnosis::classifiers::Kind;
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_diagnosis::random::Random;

/// Kind, detail, command, and the two own features that the fault moves.
const KINDS: [(&str, &str, &str, [f64; 2]); 5] = [
    ("leakage_a.leakage", "external_leakage", "shut_down", [-1.0, 0.0]),
    ("servo_valve.clogging", "control_valve", "shut_down", [0.0, -1.0]),
    ("sensor_ram.bias", "displacement_sensor", "change_mode", [1.0, 0.0]),
    ("sensor_a.bias", "pressure_sensor", "change_mode", [0.7, 0.7]),
    ("cylinder.leakage", "internal_leakage", "warning", [0.0, 1.0]),
];

fn infos() -> Vec<FeatureInfo> {
    let info = |name: &str, family: &str, units: &[usize]| FeatureInfo {
        name: name.into(),
        family: family.into(),
        units: units.into(),
        resolution: 0.0,
    };
    vec![
        info("x_1", "moments", &[0]),
        info("y_1", "moments", &[0]),
        info("x_2", "moments", &[1]),
        info("y_2", "moments", &[1]),
        info("size_1_2", "comparison", &[0, 1]),
        info("nothing", "comparison", &[0, 1]),
    ]
}

/// The features of a fault of actuator 1, in the order of [`infos`].
fn features(direction: [f64; 2], intensity: f64, random: &mut Random, noise: f64) -> [f64; 6] {
    let mut normal = || noise * (random.unit() + random.unit() - 1.0);
    let own = direction.map(|d| d * intensity + normal());
    // The other actuator feels a part of it.
    let other = direction.map(|d| 0.3 * d * intensity + normal());
    let size = |v: [f64; 2]| v[0].abs() + v[1].abs();
    [own[0], own[1], other[0], other[1], size(own) - size(other), 7.0]
}

fn mirrored(f: [f64; 6]) -> [f64; 6] {
    [f[2], f[3], f[0], f[1], -f[4], f[5]]
}

/// A campaign: kinds × two actuators × ten intensities × three cases, and ten healthy specimens.
fn campaign(noise: f64) -> Table {
    let mut random = Random::new(5);
    let mut texts: [Vec<String>; 6] = Default::default();
    let (mut intensities, mut detectable, mut values) = (vec![], vec![], vec![]);
    let mut add = |text: [&str; 6], intensity: f64, seen: [f64; 6]| {
        texts.iter_mut().zip(text).for_each(|(column, text)| column.push(text.into()));
        intensities.push(intensity);
        detectable.push(intensity > 0.15);
        values.push(seen);
    };
    for case in ["S1/50", "S1/100", "S2/50"] {
        for (kind, detail, command, direction) in KINDS {
            for actuator in ["actuator_1", "actuator_2"] {
                for step in 1..=10 {
                    let intensity = f64::from(step) / 10.0;
                    let seen = features(direction, intensity, &mut random, noise);
                    let seen = if actuator == "actuator_1" { seen } else { mirrored(seen) };
                    let fault = format!("{actuator}.{kind}");
                    add([case, &fault, kind, actuator, command, detail], intensity, seen);
                }
            }
        }
        for _ in 0..10 {
            let h = "healthy";
            add([case, h, h, h, h, h], 0.0, [0.0; 6]);
        }
    }
    let names = ["case", "fault", "kind", "actuator", "command", "detail"];
    let mut columns: Vec<Column> =
        names.into_iter().zip(texts).map(|(name, text)| Column::new(name, "", text)).collect();
    columns.push(Column::new("intensity", "", intensities));
    columns.push(Column::new("detectable", "", detectable));
    for (place, info) in infos().iter().enumerate() {
        let column = |f: &dyn Fn(&[f64; 6]) -> f64| values.iter().map(f).collect::<Vec<f64>>();
        columns.push(Column::new(format!("f:{}", info.name), "", column(&|v| v[place])));
        columns.push(Column::new(format!("m:{}", info.name), "", column(&|v| mirrored(*v)[place])));
    }
    Table::from_columns(columns).unwrap()
}

fn settings() -> Settings {
    let few = Holding { repeats: 2, folds: 3, deals: 1, seed: 3 };
    Settings {
        holding: few,
        short_holding: few,
        comparison_holding: few,
        classifiers: [Kind::Cart, Kind::NaiveBayes].map(Kind::default_settings).into(),
        ..Settings::default()
    }
}

fn evaluated(noise: f64, threads: usize) -> (Evaluation, Hierarchy, DataSet) {
    let data = DataSet::new(&campaign(noise), infos(), &[]).unwrap();
    let (evaluation, hierarchy) = evaluated_with(&data, threads);
    (evaluation, hierarchy, data)
}

fn evaluated_with(data: &DataSet, threads: usize) -> (Evaluation, Hierarchy) {
    let hierarchy = train(data, &settings().training).unwrap();
    let workers = Workers::new(threads);
    let evaluation = evaluate(data, &hierarchy, &settings(), workers, &|_, _| ()).unwrap();
    (evaluation, hierarchy)
}

fn share(rate: Option<servotwin::evaluation::score::Rate>) -> f64 {
    rate.and_then(|rate| rate.share).unwrap()
}

#[test]
fn an_easy_campaign_is_solved_under_every_protocol() {
    let (evaluation, hierarchy, _) = evaluated(0.01, 2);
    assert_eq!(evaluation.protocols.len(), 5);
    for protocol in [Protocol::RandomThird, Protocol::Grouped, Protocol::LeaveCaseOut] {
        let result = evaluation.protocol(protocol).unwrap();
        assert!(share(result.end_to_end) > 0.93, "{protocol:?} {:?}", result.end_to_end);
        let safety = result.safety.as_ref().unwrap();
        assert!(share(Some(safety.wrong_actuator)) < 0.01);
        assert!(share(Some(safety.missed_shutdown)) < 0.03);
    }
    let kinds = evaluation.protocol(Protocol::LeaveKindOut).unwrap();
    assert!(kinds.end_to_end.is_none() && kinds.stages.len() == 1);
    assert_eq!(kinds.splits, KINDS.len());
    // Pooled: A, B and one detail stage for each command.
    let ids: Vec<&str> = hierarchy.stages.iter().map(|stage| stage.id.as_str()).collect();
    assert_eq!(ids, ["A", "B", "C", "D", "E"]);
    let nine: Vec<&str> = evaluation.baseline[0].stages.iter().map(|s| s.id.as_str()).collect();
    assert_eq!(nine, ["A", "B", "C", "D", "E", "B1", "B2", "C1", "C2", "D1", "D2", "E1", "E2"]);
}

#[test]
fn detection_is_counted_against_the_known_threshold() {
    let (evaluation, ..) = evaluated(0.01, 1);
    let detection = &evaluation.detection;
    assert_eq!((detection.detected.count, detection.detected.of), (270, 300));
    assert_eq!(detection.least.len(), 5 * 2 * 3);
    assert!(detection.least.iter().all(|least| least.intensity == Some(0.2)));
    assert_eq!(evaluation.constant_features, ["nothing"]);
    assert_eq!(detection.false_alarms.unwrap().of, 30);
    assert_eq!(evaluation.false_alarms.as_ref().unwrap().shutdowns.count, 0);
}

#[test]
fn a_noisy_campaign_names_what_is_confused() {
    let (evaluation, ..) = evaluated(0.5, 2);
    let grouped = evaluation.protocol(Protocol::Grouped).unwrap();
    assert!(share(grouped.end_to_end) < 0.95);
    assert!(!evaluation.ambiguity.pairs.is_empty());
    assert!(!evaluation.worst_leaves.is_empty());
    let errors: u64 = evaluation.ambiguity.pairs.iter().map(|pair| pair.count).sum();
    let end_to_end = grouped.end_to_end.unwrap();
    assert_eq!(errors, end_to_end.of - end_to_end.count, "every error is confused with something");
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let json = |threads| serde_json::to_string(&evaluated(0.3, threads).0).unwrap();
    assert_eq!(json(1), json(3));
}

#[test]
fn the_model_is_the_same_after_reading() {
    let (_, hierarchy, _) = evaluated(0.3, 2);
    let folder = std::env::temp_dir().join(format!("servotwin-model-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("hierarchy.json");
    model_file::write(&path, &hierarchy).unwrap();
    assert_eq!(model_file::read_hierarchy(&path).unwrap(), hierarchy);
    let broken = std::fs::read_to_string(&path).unwrap().replace("hierarchy 1", "hierarchy 9");
    std::fs::write(&path, broken).unwrap();
    assert!(matches!(model_file::read_hierarchy(&path), Err(EvaluationError::CorruptModel { .. })));
    std::fs::write(&path, "{").unwrap();
    assert!(matches!(model_file::read_hierarchy(&path), Err(EvaluationError::Model { .. })));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn groups_never_stand_on_both_sides() {
    let data = DataSet::new(&campaign(0.1), infos(), &[]).unwrap();
    let key = |row: &usize| (data.rows[*row].kind, data.rows[*row].intensity);
    for split in Protocol::Grouped.splits(&data, Holding::default()).unwrap() {
        let train: std::collections::BTreeSet<_> = split.train.iter().map(key).collect();
        assert!(split.test.iter().all(|row| !train.contains(&key(row))));
    }
}

#[test]
fn a_single_actuator_needs_no_stage_for_it() {
    let table = campaign(0.05);
    let rows: Vec<usize> = (0..table.row_count())
        .filter(|&row| table.text("actuator").unwrap()[row] == "actuator_1")
        .collect();
    let one = |column: &Column| {
        let values: servotwin::table::Values = match &column.values {
            servotwin::table::Values::Float(v) => {
                rows.iter().map(|&r| v[r]).collect::<Vec<_>>().into()
            }
            servotwin::table::Values::Flag(v) => {
                rows.iter().map(|&r| v[r]).collect::<Vec<_>>().into()
            }
            servotwin::table::Values::Text(v) => {
                rows.iter().map(|&r| v[r].clone()).collect::<Vec<_>>().into()
            }
            other => other.clone(),
        };
        Column { values, ..column.clone() }
    };
    let table = Table::from_columns(table.columns().iter().map(one).collect()).unwrap();
    let data = DataSet::new(&table, infos(), &[]).unwrap();
    let (evaluation, hierarchy) = evaluated_with(&data, 1);
    let ids: Vec<&str> = hierarchy.stages.iter().map(|stage| stage.id.as_str()).collect();
    assert_eq!(ids, ["B", "C", "D", "E"]);
    assert!(evaluation.protocol(Protocol::LeaveKindOut).is_none());
    assert!(share(evaluation.protocol(Protocol::Grouped).unwrap().end_to_end) > 0.9);
}

#[test]
fn what_cannot_be_learnt_is_said() {
    let table = campaign(0.1);
    let without = |name: &str| {
        let columns = table.columns().iter().filter(|column| column.name != name).cloned();
        Table::from_columns(columns.collect()).unwrap()
    };
    let message = |table: &Table| DataSet::new(table, infos(), &[]).unwrap_err().to_string();
    assert!(message(&without("kind")).contains("'kind'"));
    assert!(message(&without("f:x_1")).contains("did you mean"), "{}", message(&without("f:x_1")));
    let replaced = |name: &str, values: servotwin::table::Values| {
        let swap = |column: &Column| match column.name == name {
            true => Column { values: values.clone(), ..column.clone() },
            false => column.clone(),
        };
        Table::from_columns(table.columns().iter().map(swap).collect()).unwrap()
    };
    let rows = table.row_count();
    let healthy = replaced("kind", vec!["healthy".to_owned(); rows].into());
    assert!(message(&healthy).contains("no faults"));
    let hidden = DataSet::new(&replaced("detectable", vec![false; rows].into()), infos(), &[]);
    assert!(matches!(
        train(&hidden.unwrap(), &settings().training),
        Err(EvaluationError::NothingDetectable { faults: 300 })
    ));
    let mut broken = table.f64("f:y_1").unwrap().into_owned();
    broken[17] = f64::NAN;
    let broken = message(&replaced("f:y_1", broken.into()));
    assert!(broken.contains("f:y_1") && broken.contains("18"), "{broken}");
    assert!(matches!(DataSet::new(&table, vec![], &[]), Err(EvaluationError::NoFeatures)));
}
