//! The evaluation on made-up records whose answers are known.

use servotwin::learn::committee::evidence_quantile;
use servotwin::learn::data_set::DataRow;
use servotwin::learn::protocol::{Holding, Protocol, ProtocolResult};
use servotwin::learn::{Context, DataSet, Evaluation, EvaluationError, EvaluationSettings};
use servotwin::learn::{bands, evaluate, model_file, train};
use servotwin::measure::{self, Rates};
use servotwin::parallel::Workers;
use servotwin::records::DataFeature;
use servotwin::study::Purpose;
use servotwin::table::{Column, Table};
use servotwin_diagnosis::classifiers::ClassifierKind;
use servotwin_diagnosis::features::{Feature, Teaches};
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_diagnosis::panel::Panel;
use servotwin_diagnosis::random::Random;

/// Kind, detail, command, and the two own features that the fault moves.
const KINDS: [(&str, &str, &str, [f64; 2]); 5] = [
    ("leakage_a.leakage", "external_leakage", "shut_down", [-1.0, 0.0]),
    ("servo_valve.clogging", "control_valve", "shut_down", [0.0, -1.0]),
    ("sensor_ram.bias", "displacement_sensor", "change_mode", [1.0, 0.0]),
    ("sensor_a.bias", "pressure_sensor", "change_mode", [0.7, 0.7]),
    ("cylinder.leakage", "internal_leakage", "warning", [0.0, 1.0]),
];

/// The commands of the toy, the most urgent first.
fn urgency() -> Vec<String> {
    ["shut_down", "change_mode", "warning"].map(Into::into).into()
}

fn infos() -> Vec<DataFeature> {
    let info = |name: &str, family, actuators: &[usize]| DataFeature {
        feature: Feature {
            name: name.into(),
            unit: "1",
            meaning: String::new(),
            actuators: actuators.into(),
            teaches: Teaches::Everybody,
        },
        family,
        extra: false,
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

const JUDGED: &[&str] = &["S1/50", "S1/100", "S2/50"];
const TRAINING: &[&str] = &["T1/60", "T2/70", "T3/80", "T4/90"];

/// Records: kinds × two actuators × ten intensities × three cases, and ten healthy specimens.
fn records(noise: f64) -> Table {
    flown(noise, JUDGED, 5)
}

/// The same with other cases.
fn flown(noise: f64, cases: &[&str], seed: u64) -> Table {
    let mut random = Random::new(seed);
    let mut texts: [Vec<String>; 6] = Default::default();
    let (mut intensities, mut detectable, mut values) = (vec![], vec![], vec![]);
    let mut add = |text: [&str; 6], intensity: f64, seen: [f64; 6]| {
        texts.iter_mut().zip(text).for_each(|(column, text)| column.push(text.into()));
        intensities.push(intensity);
        detectable.push(intensity > 0.15);
        values.push(seen);
    };
    for &case in cases {
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
    let names = ["case", "fault", "kind", "actuator", "action", "detail"];
    let command = |case: &String| case.split('/').next().unwrap().to_owned();
    let flown: Vec<String> = texts[0].iter().map(command).collect();
    let mut columns: Vec<Column> =
        names.into_iter().zip(texts).map(|(name, text)| Column::new(name, "", text)).collect();
    columns.push(Column::new("flown", "", flown));
    // From an intensity of 0.2 on both sensors leave the band of 3 %.
    let largest: Vec<f64> = detectable.iter().map(|&d| if d { 0.05 } else { 0.01 }).collect();
    for name in ["x_1", "x_2"] {
        columns.push(Column::new(format!("largest:{name}"), "", largest.clone()));
    }
    columns.push(Column::new("failure", "", vec![String::new(); intensities.len()]));
    columns.push(Column::new("grade", "", intensities.clone()));
    columns.push(Column::new("intensity", "", intensities));
    columns.push(Column::new("detectable", "", detectable));
    for (place, info) in infos().iter().enumerate() {
        let column = |f: &dyn Fn(&[f64; 6]) -> f64| values.iter().map(f).collect::<Vec<f64>>();
        columns.push(Column::new(format!("f:{}", info.feature.name), "", column(&|v| v[place])));
        columns.push(Column::new(
            format!("m:{}", info.feature.name),
            "",
            column(&|v| mirrored(*v)[place]),
        ));
    }
    Table::from_columns(columns).unwrap()
}

fn settings() -> EvaluationSettings {
    let few = Holding { repeats: 2, folds: 3, seed: 3, ..Holding::default() };
    EvaluationSettings {
        holding: few,
        comparison_holding: few,
        classifiers: [ClassifierKind::Cart, ClassifierKind::NaiveBayes]
            .map(servotwin_learning::classifiers::Settings::default_of)
            .into(),
        shutdowns: vec!["shut_down".into()],
        ..EvaluationSettings::default()
    }
}

/// The judged cases alone.
fn judged(table: Table) -> DataSet {
    DataSet::new(&[(Purpose::Test, table)], infos(), &[], &urgency()).unwrap()
}

/// With four training commands.
fn with_training(noise: f64) -> DataSet {
    let tables = [(Purpose::Test, records(noise)), (Purpose::Train, flown(noise, TRAINING, 6))];
    DataSet::new(&tables, infos(), &[], &urgency()).unwrap()
}

fn evaluated(noise: f64, threads: usize) -> (Evaluation, Panel, DataSet) {
    let data = judged(records(noise));
    let (evaluation, trained) = evaluated_with(&data, &settings(), threads);
    (evaluation, trained, data)
}

fn evaluated_with(
    data: &DataSet,
    settings: &EvaluationSettings,
    threads: usize,
) -> (Evaluation, Panel) {
    let workers = Workers::new(threads);
    let pools = [0, 0];
    let trained = train(data, settings, &pools, workers).unwrap();
    let context = Context {
        trained: &trained,
        pools: &pools,
        all_features: data,
        workers,
        progress: &|_, _| (),
    };
    let evaluation = evaluate(data, settings, &context).unwrap();
    (evaluation, trained)
}

fn share(rate: Option<servotwin::learn::metrics::Rate>) -> f64 {
    rate.and_then(|rate| rate.share).unwrap()
}

/// What is for the trees alone keeps its column, so that trees and committee read the same rows.
#[test]
fn a_committee_reads_what_teaches_everybody() {
    let mut features = infos();
    for info in features.iter_mut().filter(|info| info.feature.name.starts_with('x')) {
        info.feature.teaches = Teaches::TreesOfRecords;
    }
    let tables = [(Purpose::Test, records(0.01)), (Purpose::Train, flown(0.01, TRAINING, 6))];
    let data = DataSet::new(&tables, features, &[], &urgency()).unwrap();
    let (evaluation, trained) = evaluated_with(&data, &settings(), 1);
    let (trees, committee) = (&trained.trees, &trained.committee);
    assert_eq!(trees.names, committee.names);
    let reads = |hierarchy: &Hierarchy, column: u32| {
        hierarchy.stages.iter().any(|stage| stage.columns.contains(&column))
    };
    assert!([0, 1, 2, 3].iter().all(|&column| reads(trees, column)));
    assert_eq!([0, 1, 2, 3].map(|column| reads(committee, column)), [false, true, false, true]);
    // Where it learns anew it does not read them either.
    let unseen = Protocol::UnseenIntensity;
    let of_trees = share(evaluation.protocol(unseen).unwrap().rates.counted(&measure::END_TO_END));
    let of_committee =
        share(evaluation.committee(unseen).unwrap().rates.counted(&measure::END_TO_END));
    assert!(of_committee < 0.8 && of_trees > 0.9, "{of_committee} {of_trees}");
}

/// What flights may take off the evidence of a fault is less than this.
#[test]
fn a_committee_is_as_sure_as_the_faults_that_taught_it() {
    let data = with_training(0.01);
    let trained = train(&data, &settings(), &[0, 0], Workers::new(1)).unwrap();
    let (committee, lessons) = (&trained.committee, settings().committee_lessons);
    let of_all = evidence_quantile(&data, committee, lessons).unwrap();
    let is_weak = |row: &DataRow| row.own_intensity < 0.25;
    let weak = data.without(|row| !row.is_healthy && !is_weak(row));
    let of_weak = evidence_quantile(&weak, committee, lessons).unwrap();
    assert!(of_weak < of_all && of_all > 3.0, "{of_weak} {of_all}");
    let healthy = data.without(|row| row.purpose == Purpose::Train && !row.is_healthy);
    let nothing = evidence_quantile(&healthy, committee, lessons);
    assert!(matches!(nothing, Err(EvaluationError::NothingDetectable { faults: 0 })));
}

#[test]
fn easy_records_are_solved_under_every_protocol() {
    let (evaluation, trained, _) = evaluated(0.01, 2);
    let hierarchy = trained.trees;
    assert_eq!(evaluation.protocols.len(), 3, "no training commands, no new command");
    assert!(evaluation.committee.is_empty());
    for protocol in [Protocol::RandomThird, Protocol::UnseenIntensity] {
        let result = evaluation.protocol(protocol).unwrap();
        let rate = |measure| share(result.rates.counted(measure));
        assert!(rate(&measure::END_TO_END) > 0.93, "{protocol:?} {:?}", result.rates);
        assert!(rate(&measure::WRONG_ACTUATOR) < 0.01);
        assert!(rate(&measure::SHUTDOWN_MISSED) < 0.03);
    }
    let kinds = evaluation.protocol(Protocol::KindLeftOut).unwrap();
    assert!(kinds.rates.counted(&measure::END_TO_END).is_none());
    // A and B, and B of each actuator.
    assert_eq!(kinds.stages.len(), 4);
    assert!(kinds.rates.counted(&measure::RIGHT_ACTION_OF_ALL).is_some());
    assert_eq!(kinds.splits, KINDS.len());
    // Pooled: A, B and one detail stage for each command.
    let ids: Vec<&str> = hierarchy.stages.iter().map(|stage| stage.id.as_str()).collect();
    assert_eq!(ids, ["A", "B", "C", "D", "E"]);
    assert!(evaluation.baseline.is_none(), "no training commands");
    let (evaluation, _) = evaluated_with(&with_training(0.01), &settings(), 2);
    let baseline = evaluation.baseline.unwrap();
    let nine: Vec<&str> = baseline.stages.iter().map(|s| s.id.as_str()).collect();
    assert_eq!(nine, ["A", "B", "C", "D", "E", "B1", "B2", "C1", "C2", "D1", "D2", "E1", "E2"]);
    let thirds = evaluation.random_thirds.iter();
    let thirds: Vec<_> = thirds.map(|own| (own.stage.as_str(), own.accuracies.len())).collect();
    assert_eq!(thirds, [("A", 30), ("B", 30)]);
}

#[test]
fn detection_is_counted_against_the_known_threshold() {
    let (evaluation, ..) = evaluated(0.01, 1);
    let detection = &evaluation.detection;
    let counted = |rates: &Rates, measure| (rates.of(measure).count, rates.of(measure).of);
    assert_eq!(counted(&evaluation.in_band, &measure::VISIBLE), (270, 300));
    assert_eq!(detection.least.len(), 5 * 2 * 3);
    assert!(detection.least.iter().all(|least| least.intensity == Some(0.2)));
    assert_eq!(evaluation.constant_features, ["nothing"]);
    assert_eq!(counted(&evaluation.in_band, &measure::VISIBLE_BY_CHANCE), (0, 30));
    assert_eq!(counted(&evaluation.healthy[0], &measure::FALSE_SHUTDOWN), (0, 30));
}

#[test]
fn noisy_records_name_what_is_confused() {
    let (evaluation, ..) = evaluated(0.5, 2);
    let grouped = evaluation.protocol(Protocol::UnseenIntensity).unwrap();
    let end_to_end = grouped.rates.of(&measure::END_TO_END);
    assert!(share(Some(end_to_end)) < 0.95);
    let errors: u64 = grouped.confused.iter().map(|confused| confused.count).sum();
    assert_eq!(errors, end_to_end.of - end_to_end.count, "every error is confused with something");
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let json = |threads| serde_json::to_string(&evaluated(0.3, threads).0).unwrap();
    assert_eq!(json(1), json(3));
}

#[test]
fn the_model_is_the_same_after_reading() {
    let diagnoser = &**crate::flights::diagnoser();
    let folder = std::env::temp_dir().join(format!("servotwin-model-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("diagnoser.json");
    model_file::write(&path, diagnoser).unwrap();
    assert_eq!(model_file::read_diagnoser(&path).unwrap(), *diagnoser);
    let broken = std::fs::read_to_string(&path).unwrap().replace("diagnoser 1", "diagnoser 9");
    std::fs::write(&path, broken).unwrap();
    assert!(matches!(model_file::read_diagnoser(&path), Err(EvaluationError::CorruptModel { .. })));
    std::fs::write(&path, "{").unwrap();
    assert!(matches!(model_file::read_diagnoser(&path), Err(EvaluationError::Model { .. })));
    // A copy far from its manifest is checked, too: no digit passes, of the checksum or of a number.
    model_file::write_model(&path, diagnoser).unwrap();
    assert_eq!(model_file::read_diagnoser(&path).unwrap(), *diagnoser);
    let whole = std::fs::read(&path).unwrap();
    let digits: Vec<usize> =
        (0..whole.len()).filter(|&place| whole[place].is_ascii_digit()).collect();
    for place in digits.iter().step_by(digits.len().div_ceil(60)) {
        let mut changed = whole.clone();
        changed[*place] = if whole[*place] == b'9' { b'8' } else { whole[*place] + 1 };
        std::fs::write(&path, changed).unwrap();
        assert!(model_file::read_diagnoser(&path).is_err(), "byte {place}");
    }
    let whole = String::from_utf8(whole).unwrap();
    let (_, unchecked) = whole.split_once("\",\n").unwrap();
    let plain = format!("{{\n{unchecked}");
    std::fs::write(&path, &plain).unwrap();
    assert_eq!(model_file::read_diagnoser(&path).unwrap(), *diagnoser, "unchecked on purpose");
    // Another program has sorted the keys.
    std::fs::write(&path, plain.replacen('{', "{\"a\": 1, \"sha256\": \"0\",", 1)).unwrap();
    let moved = model_file::read_diagnoser(&path).unwrap_err().to_string();
    assert!(
        moved.contains("is not its first one") && moved.contains("remove that line"),
        "{moved}"
    );
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn groups_never_stand_on_both_sides() {
    let data = judged(records(0.1));
    let key = |row: &usize| (data.rows[*row].kind, data.rows[*row].intensity);
    for split in Protocol::UnseenIntensity.splits(&data, Holding::default()).unwrap() {
        let train: std::collections::BTreeSet<_> = split.train.iter().map(key).collect();
        assert!(split.test.iter().all(|row| !train.contains(&key(row))));
    }
}

#[test]
fn a_single_actuator_needs_no_stage_for_it() {
    let table = records(0.05);
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
    let (evaluation, trained) = evaluated_with(&judged(table), &settings(), 1);
    let ids: Vec<&str> = trained.trees.stages.iter().map(|stage| stage.id.as_str()).collect();
    assert_eq!(ids, ["B", "C", "D", "E"]);
    let kinds = evaluation.protocol(Protocol::KindLeftOut).unwrap();
    let ids: Vec<&str> = kinds.stages.iter().map(|stage| stage.id.as_str()).collect();
    assert_eq!(ids, ["B"], "one actuator leaves the action to find");
    assert!(
        share(
            evaluation
                .protocol(Protocol::UnseenIntensity)
                .unwrap()
                .rates
                .counted(&measure::END_TO_END)
        ) > 0.9
    );
}

#[test]
fn what_cannot_be_learnt_is_said() {
    let table = records(0.1);
    let without = |name: &str| {
        let columns = table.columns().iter().filter(|column| column.name != name).cloned();
        Table::from_columns(columns.collect()).unwrap()
    };
    let read =
        |table: &Table| DataSet::new(&[(Purpose::Test, table.clone())], infos(), &[], &urgency());
    let message = |table: &Table| read(table).unwrap_err().to_string();
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
    let small = |column: &Column| match column.name.starts_with("largest:") {
        true => Column { values: vec![0.01; rows].into(), ..column.clone() },
        false => column.clone(),
    };
    let hidden = Table::from_columns(table.columns().iter().map(small).collect()).unwrap();
    let hidden = read(&hidden);
    assert!(matches!(
        train(&hidden.unwrap(), &settings(), &[0, 0], Workers::new(1)),
        Err(EvaluationError::NothingDetectable { faults: 300 })
    ));
    let mut broken = table.f64("f:y_1").unwrap().into_owned();
    broken[17] = f64::NAN;
    let broken = message(&replaced("f:y_1", broken.into()));
    assert!(broken.contains("f:y_1") && broken.contains("18"), "{broken}");
    let none = DataSet::new(&[(Purpose::Test, table)], vec![], &[], &[]);
    assert!(matches!(none, Err(EvaluationError::NoFeatures)));
}

#[test]
fn new_commands_are_judged_with_what_training_commands_teach() {
    let data = with_training(0.01);
    let (evaluation, trained) = evaluated_with(&data, &settings(), 2);
    assert_eq!(evaluation.protocols.len(), 4);
    let new = evaluation.protocol(Protocol::NewCommand).unwrap();
    assert!(share(new.rates.counted(&measure::END_TO_END)) > 0.95, "{:?}", new.rates);
    let all = new.rates.of(&measure::SHUTDOWN_MISSED_OF_ALL);
    // One intensity of ten is never detected: those shutdowns are missed.
    assert_eq!(all.of, 2 * 2 * 10 * 3);
    assert!(share(Some(all)) >= 0.1);
    assert!(trained.least_confidence.is_some());
}

#[test]
fn what_is_held_out_is_in_no_training_row() {
    let data = with_training(0.1);
    let rows = |protocol: Protocol| protocol.splits(&data, settings().holding).unwrap();
    let row = |place: &usize| &data.rows[*place];
    for protocol in [Protocol::NewCommand, Protocol::UnseenIntensity] {
        for split in rows(protocol) {
            assert!(split.train.iter().all(|r| row(r).purpose == Purpose::Train));
            assert!(split.test.iter().all(|r| row(r).purpose == Purpose::Test));
        }
    }
    for split in rows(Protocol::UnseenIntensity) {
        let key = |place: &usize| (row(place).kind, row(place).intensity);
        let known = split.train.iter().filter(|place| !row(place).is_healthy).map(key);
        let known: std::collections::BTreeSet<_> = known.collect();
        assert!(split.test.iter().all(|place| !known.contains(&key(place))));
    }
}

#[test]
fn bands_are_learned_from_healthy_training_specimens_alone() {
    let mut data = with_training(0.1);
    let mut random = Random::new(8);
    let healthy = data.rows_where(Purpose::Train, |row| row.is_healthy);
    for &row in &healthy {
        // Log-normal around 2 % and 1 %.
        let mut size = |middle: f64| {
            let normal: f64 = (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
            middle * (0.3 * normal).exp()
        };
        data.rows[row].largest = vec![size(0.02), size(0.01)];
    }
    let judged = data.rows_where(Purpose::Test, |row| row.is_healthy);
    data.rows[judged[0]].largest = vec![9.0, 9.0];
    let learned = bands::learn(&data, &[0, 1], bands::ALARMS).unwrap();
    for (band, middle) in learned.iter().zip([0.02, 0.01]) {
        // A few of its deviations (0.3) above the middle, and nothing of the judged specimen.
        assert!((1.5..4.0).contains(&(band.half_width / middle)), "{band:?}");
        // Of forty records none may leave a band.
        assert_eq!((band.records, band.exceeded), (40, 0));
    }
    let pooled = bands::learn(&data, &[0, 0], bands::ALARMS).unwrap();
    assert_eq!(pooled[0].half_width, pooled[1].half_width);
    let all: Vec<f64> = learned.iter().map(|band| band.half_width).collect();
    let touched = data.with_bands(&all);
    let largest = healthy.iter().map(|&row| touched.rows[row].excess).fold(0.0, f64::max);
    assert!((largest - 1.0).abs() < 1e-9, "no wider than it must be: {largest}");
    let banded = data.with_bands(&[0.1, 0.1]);
    assert!(banded.rows[judged[0]].is_detected() && !banded.rows[healthy[3]].is_detected());
}

#[test]
fn a_run_without_a_steady_start_teaches_no_band() {
    let mut data = with_training(0.1);
    let mut random = Random::new(8);
    let healthy = data.rows_where(Purpose::Train, |row| row.is_healthy);
    for &row in &healthy {
        let mut size = || 0.01 + 0.005 * random.unit();
        data.rows[row].largest = vec![size(), size()];
    }
    let learned = bands::learn(&data, &[0, 1], bands::ALARMS).unwrap();
    // Two records as those of a crane that falls for a second before its valve holds it.
    for &row in &healthy[..2] {
        data.rows[row].largest = vec![0.6, 0.5];
    }
    let widened = bands::learn(&data, &[0, 1], bands::ALARMS).unwrap();
    assert!(widened[0].half_width > 0.5, "{widened:?}");
    for &row in &healthy[..2] {
        data.rows[row].began_on_the_move = true;
    }
    for (band, before) in bands::learn(&data, &[0, 1], bands::ALARMS).unwrap().iter().zip(&learned)
    {
        assert_eq!(band.records, before.records - 2);
        assert!((band.half_width / before.half_width - 1.0).abs() < 0.1, "{band:?} {before:?}");
    }
}

#[test]
fn no_band_is_wider_than_twice_the_largest_residual_that_taught_it() {
    // The second sensor has one outlier, so that the common number of deviations is large; the first is scattered.
    let mut rows: Vec<Vec<f64>> = (0..20).map(|k| vec![[0.001, 0.03][k % 2], 0.01]).collect();
    rows[7][1] = 0.5;
    let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    let widths = bands::half_widths(&rows, &[0, 1], bands::ALARMS).unwrap();
    assert!((widths[0] - bands::MAX_OVER_LARGEST * 0.03).abs() < 1e-12, "{widths:?}");
    assert!((0.49..=1.0).contains(&widths[1]), "{widths:?}");
}

#[test]
fn a_kind_that_was_not_trained_may_stay_not_isolated() {
    let (evaluation, _) = evaluated_with(&with_training(0.01), &settings(), 2);
    let unknown = evaluation.isolation(Protocol::KindLeftOut).unwrap();
    let known = evaluation.isolation(Protocol::NewCommand).unwrap();
    for isolation in [unknown, known] {
        let [decided, right, either] =
            measure::OF_ISOLATED.map(|measure| isolation.rates.of(measure));
        let wrong = decided.count - right.count;
        assert_eq!(either.count + wrong, either.of);
        assert_eq!(right.of, decided.count);
        let of_kinds: u64 = isolation.wrong_kinds().iter().map(|(_, [wrong, _])| wrong).sum();
        assert_eq!(of_kinds, wrong);
    }
    // Every kind moves the residuals in a direction of its own, so a kind that is left out resembles no other.
    let decided = |of: &ProtocolResult| share(of.rates.counted(&measure::ISOLATED));
    assert!(decided(unknown) < 0.1, "{:?}", unknown.rates);
    assert_eq!(unknown.rates.of(&measure::WRONG_SHUTDOWN).count, 0);
    assert!(share(known.rates.counted(&measure::RIGHT_OR_NOT_ISOLATED)) > 0.99);
    assert!(decided(known) > 0.9);
}
