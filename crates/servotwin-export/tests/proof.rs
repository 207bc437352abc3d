//! The export of a small trained diagnoser, compiled and compared.

mod folder;
mod mistakes;
#[path = "../../servotwin-model/tests/all/rig.rs"]
#[allow(dead_code)]
mod rig;
#[path = "../../servotwin-diagnosis/tests/toy/mod.rs"]
#[allow(dead_code)]
mod toy;

use servotwin_diagnosis::diagnoser::{Boundary, Diagnoser};
use servotwin_diagnosis::spread::Spread;
use servotwin_export::c;
use servotwin_export::prove::{Build, Plan, ProofEvidence, prove};
use servotwin_export::{ExportedTwin, SourceFile};
use servotwin_model::program::Program;
use servotwin_model::solver::{Between, Method, SolverSettings};
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::Arc;

/// Five minutes of samples.
const SAMPLES: u64 = 30_000;

/// Proves the export in every build.
fn assert_proven(diagnoser: &Arc<Diagnoser>) {
    let builds = Build::available();
    let files = c::files(diagnoser).unwrap();
    let plan = Plan { samples: SAMPLES, ..Plan::new(diagnoser, &files) };
    let proven = prove(&plan, &builds, &mut |_, _| ()).unwrap();
    assert!(proven.len() >= 3, "the tests need gcc: {builds:?}");
    for evidence in proven {
        assert!(evidence.holds(), "{evidence:#?}");
        assert!(evidence.thresholds > 20 && evidence.rows > 3 * evidence.thresholds);
        assert!(evidence.samples == SAMPLES && !evidence.raised.is_empty(), "{evidence:#?}");
    }
}

#[test]
fn the_export_of_a_trained_diagnoser_decides_the_same_in_every_build() {
    assert_proven(&toy::diagnoser());
}

/// The files with another text in one place.
fn with_mistake(whole: &[SourceFile], (name, old, new): (&str, &str, &str)) -> Vec<SourceFile> {
    let mut files = whole.to_vec();
    let text = &mut files.iter_mut().find(|file| file.name == name).unwrap().text;
    assert!(text.contains(old), "{name} has no {old}");
    *text = text.replacen(old, new, 1);
    files
}

#[test]
fn other_names_and_other_arithmetic_are_found() {
    let diagnoser = &toy::diagnoser();
    let whole = c::files(diagnoser).unwrap();
    let swapped = ("servotwin_tables.c", "\"actuator_1\"", "\"actuator_2\"");
    // A constant of the logarithm, of which features are made, in its fourteenth digit.
    let constant = ("servotwin_math.c", "4.3429448187816", "4.3429448187817");
    let files = with_mistake(&with_mistake(&whole, swapped), constant);
    let plan = Plan::new(diagnoser, &files);
    let evidence = prove(&plan, &[Build::new("gcc -O0")], &mut |_, _| ()).unwrap().remove(0);
    let is_found = |place: &str| evidence.differences.iter().any(|found| found.place == place);
    assert!(!evidence.is_exact && is_found("start test"), "{evidence:#?}");
    assert!(is_found("servotwin_actuator_names[0]"), "{evidence:#?}");

    for unsafe_flag in ["-Ofast", "-funsafe-math-optimizations", "-ffinite-math-only"] {
        let plan = Plan::new(diagnoser, &whole);
        let build = Build::new(&format!("gcc {unsafe_flag}"));
        let refused = prove(&plan, &[build], &mut |_, _| ()).unwrap_err().to_string();
        assert!(refused.contains("servotwin_exact.h"), "{unsafe_flag}: {refused}");
    }
}

/// Flags that change the arithmetic. What a compiler does not declare of them, the start finds.
const UNSAFE: [&str; 7] = [
    "-ffast-math",
    "-ffinite-math-only",
    "-fno-honor-infinities",
    "-fassociative-math",
    "-fno-honor-nans",
    "-freciprocal-math",
    "-funsafe-math-optimizations",
];

/// A compiler that compiles one file with a flag of its own. The objects of all others are kept from build to build.
fn with_flag_of(file: &str, compiler: &str, flag: &str, kept: &Path) -> Build {
    let script = kept.join(file);
    let text = format!(
        "#!/bin/sh
for last; do :; done
case \"$*\" in *' -c '*)
    if [ \"$last\" = {file} ]; then exec {compiler} \"$@\" {flag}; fi
    object={0}/$(cat \"$last\" servotwin_real.h | cksum | tr ' ' -).o
    [ -e $object ] || {compiler} \"$@\" -o $object || exit 1
    exec cp $object \"$last\".o
esac
exec {compiler} \"$@\"
",
        kept.display()
    );
    std::fs::write(&script, text).unwrap();
    std::fs::set_permissions(&script, Permissions::from_mode(0o755)).unwrap();
    Build::new(&format!("{} -O2", script.display()))
}

/// The evidence of a build with such a compiler; `None` if it refuses the text.
fn evidence_with(plan: &Plan, build: Build) -> Option<ProofEvidence> {
    match prove(plan, &[build], &mut |_, _| ()) {
        Ok(mut all) => Some(all.remove(0)),
        Err(refused) => {
            let refused = refused.to_string();
            let reasons = ["servotwin_exact.h", "unrecognized command", "-fassociative-math"];
            assert!(reasons.iter().any(|reason| refused.contains(reason)), "{refused}");
            None
        }
    }
}

/// Which of the flags of one file change an answer of an export that starts all the same.
fn not_refused(plan: &Plan, compilers: &[&str], files: &[&str], flags: &[&str]) -> Vec<String> {
    let mut wrong = Vec::new();
    for compiler in compilers {
        let temporary = tempfile::tempdir().unwrap();
        let kept = temporary.path();
        let harmless = with_flag_of(files[0], compiler, "-DHARMLESS", kept);
        assert!(evidence_with(plan, harmless).is_some_and(|evidence| evidence.holds()));
        for (file, flag) in files.iter().flat_map(|file| flags.iter().map(move |f| (file, f))) {
            let build = with_flag_of(file, compiler, flag, kept);
            let evidence = evidence_with(plan, build);
            if evidence.is_some_and(|evidence| evidence.is_exact && !evidence.holds()) {
                wrong.push(format!("{compiler} {flag} {file}"));
            }
        }
    }
    wrong
}

/// The C files of a diagnosis and of a twin that compute.
const OF_DIAGNOSIS: [&str; 9] = [
    "servotwin_session.c",
    "servotwin_boundary.c",
    "servotwin_decision.c",
    "servotwin_judge.c",
    "servotwin_windows.c",
    "servotwin_features.c",
    "servotwin_models.c",
    "servotwin_random.c",
    "servotwin_math.c",
];
const OF_TWIN: [&str; 3] = ["servotwin_hybrid.c", "servotwin_twin.c", "servotwin_equations.c"];

/// A file that forgets what a missing value is, in a build that starts, decides otherwise; the start refuses it.
#[test]
fn the_start_test_finds_a_file_without_missing_values() {
    let diagnoser = toy::diagnoser();
    let files = c::files(&diagnoser).unwrap();
    let asked = ("servotwin_session.c", " && servotwin_models_keeps_rules()", "");
    let unasked = with_mistake(&files, asked);
    let found = |files: &[SourceFile]| {
        let plan = Plan { samples: 3000, ..Plan::new(&diagnoser, files) };
        not_refused(&plan, &["clang"], &["servotwin_models.c"], &["-fno-honor-nans"])
    };
    assert_eq!(found(&unasked), ["clang -fno-honor-nans servotwin_models.c"]);
    assert_eq!(found(&files), [""; 0]);
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_flag_of_one_file_of_the_diagnosis_is_refused_or_changes_nothing() {
    let diagnoser = toy::diagnoser();
    let files = c::files(&diagnoser).unwrap();
    let plan = Plan { samples: 1000, ..Plan::new(&diagnoser, &files) };
    assert_eq!(not_refused(&plan, &["gcc", "clang"], &OF_DIAGNOSIS, &UNSAFE), [""; 0]);
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_flag_of_one_file_of_the_twin_is_refused_or_changes_nothing() {
    let (program, diagnoser) = (rig::actuator(), toy::diagnoser());
    let twin = twin(&program, SolverSettings::of_runs());
    let files = c::files_with_twin(&diagnoser, &twin).unwrap();
    let plan = Plan { variants: 1, twin: Some(&twin), ..Plan::new(&diagnoser, &files) };
    assert_eq!(not_refused(&plan, &["gcc", "clang"], &OF_TWIN, &UNSAFE), [""; 0]);
}

#[test]
fn every_header_refuses_unsafe_arithmetic_and_can_be_called_from_cpp() {
    for file in c::files(&toy::diagnoser()).unwrap() {
        let is_header = file.name.ends_with(".h") && file.name != "servotwin_exact.h";
        if is_header {
            assert!(file.text.contains("#include \"servotwin_exact.h\"\n"), "{}", file.name);
            let declares = file.text.contains(");\n");
            assert_eq!(declares, declares && file.text.contains("extern \"C\" {"), "{}", file.name);
        }
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn gcc_has_no_warning_for_one_actuator() {
    let diagnoser = toy::train::<{ toy::sensors_of(1) }>(1);
    let program = rig::actuator();
    let twin = twin(&program, SolverSettings::of_runs());
    let sensors = vec![0; diagnoser.sensors.len()];
    let twin = ExportedTwin { sensors, ..twin };
    let files = c::files_with_twin(&diagnoser, &twin).unwrap();
    let builds = ["gcc -O2", "gcc -O3"].map(Build::new);
    let plan = Plan { twin: Some(&twin), samples: 1000, ..Plan::new(&diagnoser, &files) };
    let proven = prove(&plan, &builds, &mut |_, _| ()).unwrap();
    assert!(proven.iter().all(ProofEvidence::holds), "{proven:#?}");
}

/// A diagnoser that uses everything: windows beyond a baseline, a boundary, scales, spreads, and a temperature.
fn demanding() -> Arc<Diagnoser> {
    let mut diagnoser = toy::with_baseline();
    for (place, sensor) in diagnoser.sensors.iter_mut().enumerate() {
        sensor.scale = 0.7 + 0.2 * place as f64;
        sensor.spread = sensor.spread.or(Some(Spread { spool: 1, growth: 0.5 }));
    }
    diagnoser.boundaries = vec![Boundary {
        input: 0,
        sensor: 2,
        is_return: true,
        effects: vec![(2, 1e-7), (3, 6e-8)],
    }];
    // Narrow, so that the sum of two inputs is not plausible in place of their difference.
    let difference = &mut diagnoser.environment.differences[0];
    (difference.least, difference.largest) = (1.9e7, 2.1e7);
    for length in &mut diagnoser.lengths {
        length.panel.committee.stages.iter_mut().for_each(|stage| stage.temperature = 1.3);
    }
    Arc::new(diagnoser)
}

#[test]
#[ignore = "slow: ./check --all"]
fn so_does_one_that_uses_everything() {
    assert_proven(&demanding());
}

/// An actuator whose controller has a clock, with inputs that are held, straight and curved.
fn twin(program: &Program, settings: SolverSettings) -> ExportedTwin<'_> {
    // The command is read on ticks only; the load acts all the time.
    let courses = [Between::Line, Between::Hold, Between::Cubic];
    let inputs = &program.network().inputs;
    let range = |default: f64| [default - 0.1 - default.abs(), default + 0.1 + default.abs()];
    ExportedTwin {
        program,
        settings,
        period_s: 0.01,
        between: (0..inputs.len()).map(|input| courses[input % 3]).collect(),
        ranges: inputs.iter().map(|input| range(input.default)).collect(),
        // Nothing compares them here; there are as many as the diagnosis has.
        sensors: vec![0; toy::diagnoser().sensors.len()],
        possible: vec![
            (f64::NEG_INFINITY, f64::INFINITY);
            inputs.len() + toy::diagnoser().sensors.len()
        ],
        reactions: vec![],
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_twin_with_a_clock_and_faults_is_the_same_with_any_control_of_its_steps() {
    let (program, diagnoser) = (rig::actuator(), toy::diagnoser());
    let reference = SolverSettings { method: Method::Rodas5P, ..SolverSettings::of_runs() };
    for settings in [SolverSettings::of_runs(), SolverSettings::real_time(), reference] {
        let twin = twin(&program, settings);
        let files = c::files_with_twin(&diagnoser, &twin).unwrap();
        let plan =
            Plan { twin: Some(&twin), samples: 10, variants: 4, ..Plan::new(&diagnoser, &files) };
        let evidence = &prove(&plan, &[Build::new("gcc -O2")], &mut |_, _| ()).unwrap()[0];
        assert!(evidence.holds() && evidence.variants == 4, "{evidence:#?}");
        assert!(evidence.twin_samples > 10_000 && evidence.points == 2000, "{evidence:#?}");
    }
}

#[test]
#[ignore = "slow: ./check --all"]
fn mistakes_in_a_twin_are_found() {
    let (program, diagnoser) = (rig::actuator(), toy::diagnoser());
    let twin = twin(&program, SolverSettings::of_runs());
    let files = c::files_with_twin(&diagnoser, &twin).unwrap();
    let (diagnoser, files) = (&diagnoser, files.as_slice());
    let plan = Plan { twin: Some(&twin), variants: 2, ..Plan::new(diagnoser, files) };
    assert_eq!(mistakes::not_found(&plan, (30, 3), Some("servotwin_equations.c")), []);
    // This system always finds a steady state, so nothing is known of what is done otherwise.
    let control = &files.iter().find(|file| file.name == "servotwin_twin.c").unwrap().text;
    let line_of = |text| control[..control.find(text).unwrap()].matches('\n').count();
    let otherwise = line_of("static void begin_following(")..line_of("static void look_for_rest(");
    let missed = mistakes::not_found(&plan, (60, 3), Some("servotwin_twin.c"));
    assert!(missed.iter().all(|mistake| otherwise.contains(&mistake.line)), "{missed:#?}");
}

#[test]
fn the_start_test_of_a_twin_knows_the_answer_of_a_run() {
    let (program, diagnoser) = (rig::actuator(), toy::diagnoser());
    let files = c::files_with_twin(&diagnoser, &twin(&program, SolverSettings::of_runs())).unwrap();
    let answers = files
        .iter()
        .flat_map(|file| file.text.lines())
        .filter(|line| line.contains("known_answer ="));
    let answers: Vec<&str> = answers.collect();
    // The mixture of nothing.
    assert!(!answers.iter().any(|answer| answer.contains("cbf29ce484222325")), "{answers:?}");
}

/// Makes mistakes of a seed, all of which a proof must find.
fn assert_finds_mistakes(count: usize, seed: u64) {
    let diagnoser = demanding();
    let files = c::files(&diagnoser).unwrap();
    let plan = Plan { samples: SAMPLES, ..Plan::new(&diagnoser, &files) };
    assert_eq!(mistakes::not_found(&plan, (count, seed), None), []);
}

#[test]
fn a_proof_finds_mistakes() {
    assert_finds_mistakes(3, 3);
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_proof_finds_every_mistake_of_a_hundred() {
    assert_finds_mistakes(110, 1);
}
